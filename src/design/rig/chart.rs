//! Maps of where a lamp would help, as files: a drawing, a table, and numbers.

use std::cmp::Ordering;

use glam::Vec3;
use image::{Rgb, RgbImage};
use rayon::prelude::*;

use super::{
    map::{Map, Spot},
    set::{self, Place},
};
use crate::{
    canvas::{Anchor, Canvas, FigureError, INK, text},
    files::csv_file,
    film::exr::{ExrImage, ExrPart},
};

/// Columns and rows of the unrolled map in numbers: two degrees a pixel, from the zenith to the nadir.
const GRID: (usize, usize) = (180, 90);
/// Angle from a place within which it counts in a direction, degrees: a little more than that between neighbouring
/// places.
const NEAR: f32 = 14.0;
/// Angle at which a place counts a third of one at the direction itself, degrees: about half of that between
/// neighbouring places, so that the map is smooth and their differences stay.
const BLUR: f32 = 7.0;
/// Cosine of the angle within which places stand in the same direction: half a degree.
const SAME: f32 = 0.99996;
/// Width and height of the drawing, pixels: both maps with their margins and titles.
const DRAWING: (u32, u32) = (920, 380);
/// Side of the map from above, pixels.
const ABOVE: u32 = 300;
/// Width and height of the unrolled map, pixels: 1.6 to a degree.
const UNROLLED: (u32, u32) = (560, 280);

/// The map as a table, CSV: a header, then a line for each place.
///
/// # Errors
/// When it cannot be encoded.
pub fn table(map: &Map) -> Result<Vec<u8>, csv::Error> {
    let header = ["azimuth", "elevation", "distance", "beam", "radiance", "f_q", "change"].map(String::from);
    let line = |s: &Spot| {
        let beam = s.lamp.beam.map_or_else(String::new, |beam| (2.0 * beam.angle).to_string());
        let place = [s.place.azimuth, s.place.elevation, s.place.distance].map(|v| v.to_string());
        let [azimuth, elevation, distance] = place;
        let [radiance, f_q, change] = [s.radiance, s.f_q, s.change].map(|v| v.to_string());
        [azimuth, elevation, distance, beam, radiance, f_q, change]
    };
    csv_file::encode(std::iter::once(header).chain(map.spots.iter().map(line)))
}

/// Unit vector at two angles, degrees: +z toward the camera, +x to the right in the picture, +y up.
fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    set::direction([azimuth, elevation], Vec3::X, Vec3::Z)
}

/// Lamps of one kind by the direction in which they stand: all that face one point, with or without a beam.
type Family = Vec<(Vec3, [f64; 2])>;

/// What lamps of each kind would do: at every place f_q with the best of those at several distances, and its change by
/// a little light.
fn families(map: &Map) -> Vec<Family> {
    let mut families: Vec<((bool, Vec3), Family)> = Vec::new();
    for spot in &map.spots {
        let kind = (spot.lamp.beam.is_some(), spot.lamp.look_at);
        let dir = direction(spot.place.azimuth, spot.place.elevation);
        let value = [spot.f_q, spot.change];
        let k = families.iter().position(|(other, _)| *other == kind).unwrap_or_else(|| {
            families.push((kind, Vec::new()));
            families.len() - 1
        });
        let family = &mut families[k].1;
        match family.iter_mut().find(|(other, _)| other.dot(dir) > SAME) {
            None => family.push((dir, value)),
            Some((_, best)) if spot.f_q < best[0] => *best = value,
            Some(_) => {}
        }
    }
    families.into_iter().map(|(_, family)| family).collect()
}

/// f_q with the best lamp, and its change by a little light, in directions of [`GRID`]; `None` where no lamp may stand.
struct Field {
    values: Vec<Option<[f64; 2]>>,
}

impl Field {
    /// Means of the lamps of each kind near a direction, the nearer the more; the kind that does best counts.
    fn of(map: &Map) -> Self {
        let (width, height) = GRID;
        let families = families(map);
        let least = NEAR.to_radians().cos();
        let mean = |dir: Vec3, family: &Family| {
            let (mut sum, mut weights) = ([0.0; 2], 0.0);
            for (other, value) in family {
                let cos = other.dot(dir);
                if cos > least {
                    let angle = f64::from(cos.min(1.0).acos().to_degrees() / BLUR);
                    let weight = (-angle * angle).exp();
                    weights += weight;
                    sum.iter_mut().zip(value).for_each(|(s, v)| *s += weight * v);
                }
            }
            (weights > 0.0).then(|| sum.map(|s| s / weights))
        };
        let at = |i: usize| {
            let azimuth = ((i % width) as f32 + 0.5) / width as f32 * 360.0 - 180.0;
            let elevation = 90.0 - ((i / width) as f32 + 0.5) / height as f32 * 180.0;
            let dir = direction(azimuth, elevation);
            let means = families.iter().filter_map(|family| mean(dir, family));
            // Where none helps, f_q is that without a lamp but for rounding, and the lamp that harms least counts.
            let rank = |v: &[f64; 2]| ((1e6 * v[0]).round(), v[1]);
            means.min_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(Ordering::Equal))
        };
        Self { values: (0..width * height).into_par_iter().map(at).collect() }
    }

    /// The values around a direction, bilinear; `None` where the nearest has none.
    fn at(&self, azimuth: f32, elevation: f32) -> Option<[f64; 2]> {
        let (width, height) = GRID;
        let x = (azimuth + 180.0) / 360.0 * width as f32 - 0.5;
        let y = ((90.0 - elevation) / 180.0 * height as f32 - 0.5).clamp(0.0, (height - 1) as f32);
        let get = |dx: i32, dy: usize| {
            let column = (x.floor() as i32 + dx).rem_euclid(width as i32) as usize;
            self.values[(y as usize + dy).min(height - 1) * width + column]
        };
        let (fx, fy) = (x - x.floor(), y.fract());
        get(fx.round() as i32, fy.round() as usize)?;
        let corners = [
            (0, 0, (1.0 - fx) * (1.0 - fy)),
            (1, 0, fx * (1.0 - fy)),
            (0, 1, (1.0 - fx) * fy),
            (1, 1, fx * fy),
        ];
        let (mut sum, mut weights) = ([0.0; 2], 0.0);
        for (dx, dy, weight) in corners {
            if let Some(value) = get(dx, dy) {
                weights += f64::from(weight);
                sum.iter_mut().zip(value).for_each(|(s, v)| *s += f64::from(weight) * v);
            }
        }
        Some(sum.map(|s| s / weights))
    }
}

/// A map in every direction, as it is shown.
pub struct Chart<'a> {
    map: &'a Map,
    field: Field,
    /// How much f_q falls by a lamp, at most.
    gain: f64,
    /// How much f_q rises by a little light of a lamp, at most.
    harm: f64,
}

impl<'a> Chart<'a> {
    /// The chart of a map.
    #[must_use]
    pub fn of(map: &'a Map) -> Self {
        let field = Field::of(map);
        let most = |f: &dyn Fn(&[f64; 2]) -> f64| field.values.iter().flatten().map(f).fold(1e-9, f64::max);
        let (gain, harm) = (most(&|v| map.f_q - v[0]), most(&|v| v[1]));
        Self { map, field, gain, harm }
    }

    /// The unrolled map in numbers: f_q with the best lamp in each direction, from the zenith down and from behind
    /// over the left, the camera and the right; not a number where none may stand.
    #[must_use]
    pub fn numbers(&self) -> ExrImage {
        let (width, height) = GRID;
        let values = self.field.values.iter().map(|v| v.map_or(f32::NAN, |[f_q, _]| f_q as f32)).collect();
        ExrImage { width, height, parts: vec![ExrPart::single("f_q", "Y", values)], lightopt: None }
    }

    /// The map as a drawing, a PNG: from above, and unrolled.
    ///
    /// # Errors
    /// When the font or the canvas fails.
    pub fn drawing(&self, target: &str) -> Result<Vec<u8>, FigureError> {
        let title = format!("f_q of {target}: {:.3} now; blue where a lamp would lower it", self.map.f_q);
        let mut canvas = Canvas::drawn(DRAWING, |area| {
            text(area, &title, (16, 18), 15, INK, Anchor::Left)?;
            text(area, "from above; the camera is below", (16, 44), 12, INK, Anchor::Left)?;
            let words = "unrolled: behind, left, camera, right, behind; zenith above";
            text(area, words, (340, 44), 12, INK, Anchor::Left)
        })?;
        let above = RgbImage::from_fn(ABOVE, ABOVE, |x, y| {
            let [right, down] = [x, y].map(|v| 2.0 * (v as f32 + 0.5) / ABOVE as f32 - 1.0);
            let r = (right * right + down * down).sqrt();
            if r > 1.0 { Rgb([255; 3]) } else { self.color(right.atan2(down).to_degrees(), 90.0 - 100.0 * r) }
        });
        let unrolled = RgbImage::from_fn(UNROLLED.0, UNROLLED.1, |x, y| {
            let azimuth = (x as f32 + 0.5) / UNROLLED.0 as f32 * 360.0 - 180.0;
            self.color(azimuth, 90.0 - (y as f32 + 0.5) / UNROLLED.1 as f32 * 180.0)
        });
        canvas.paste(&above, 16, 60);
        canvas.paste(&unrolled, 340, 60);
        canvas.png()
    }

    /// Colour of a direction: black where a light stands.
    fn color(&self, azimuth: f32, elevation: f32) -> Rgb<u8> {
        let dir = direction(azimuth, elevation);
        let stands =
            |(_, place): &(String, Place)| direction(place.azimuth, place.elevation).dot(dir) > 0.9985;
        if self.map.lights.iter().any(stands) {
            return Rgb([0; 3]);
        }
        let Some([f_q, change]) = self.field.at(azimuth, elevation) else { return Rgb([225; 3]) };
        let fade = |amount: f64| (255.0 * (1.0 - amount.clamp(0.0, 1.0))) as u8;
        let gain = (self.map.f_q - f_q) / self.gain;
        if gain > 0.01 {
            return Rgb([fade(gain), fade(0.7 * gain), 255]);
        }
        let harm = change / self.harm;
        Rgb([255, fade(harm), fade(harm)])
    }
}
