//! Lamps in a photographer's words.

use glam::{DVec3, Vec3};

use super::{PlacedLamp, lamp::Lamp, set::Set};
use crate::{
    audit::placed::{Description, Placed, Role},
    import::sidecar::LightType,
    light::{LUMENS_PER_WATT, Outline},
    math::Rgb,
};

/// Share of the light that a background lamp sends to the object, over that to the background, at most.
const SPARED: f64 = 0.35;
/// Azimuth from which on a lamp stands behind the subject, degrees.
const BEHIND: f32 = 100.0;
/// Elevation from which on a lamp behind the subject lights its top, degrees.
const ABOVE: f32 = 55.0;

/// Roles of some lamps, in their order: by where they stand and by the mean luminance that each brings to object and
/// background, in `means`.
pub(super) fn roles(lamps: &[Lamp], means: &[[f64; 2]], set: &Set) -> Vec<Role> {
    let role = |(lamp, &[object, background]): (&Lamp, &[f64; 2])| match set.place(lamp.position) {
        _ if object < SPARED * background => Role::Background,
        p if p.azimuth.abs() < BEHIND => Role::Fill,
        p if p.elevation > ABOVE => Role::Hair,
        _ => Role::Rim,
    };
    let mut roles: Vec<Role> = lamps.iter().zip(means).map(role).collect();
    let before = (0..roles.len()).filter(|&k| roles[k] == Role::Fill);
    if let Some(k) = before.max_by(|&a, &b| means[a][0].total_cmp(&means[b][0])) {
        roles[k] = Role::Key;
    }
    roles
}

impl PlacedLamp {
    /// The lamp as it is written, in the coordinates of the scene's file, whose origin is at `origin` there.
    #[must_use]
    pub fn placed(&self, origin: DVec3) -> Placed {
        let point = |p: Vec3| {
            let p = [p.x, p.y, p.z].map(decimal);
            [p[0] + origin.x, p[1] + origin.y, p[2] + origin.z]
        };
        let (half_extents, radius) = match self.lamp.outline {
            Outline::Rectangle { a, b } => (Some([a, b].map(decimal)), None),
            Outline::Disk { r } => (None, Some(decimal(r))),
        };
        let kind = match (self.lamp.beam, radius) {
            (Some(_), _) => LightType::Spot,
            (None, Some(_)) => LightType::Disk,
            (None, None) => LightType::Rectangle,
        };
        Placed {
            kind,
            position: Some(point(self.lamp.position)),
            look_at: Some(point(self.lamp.look_at)),
            half_extents,
            radius,
            angle: self.lamp.beam.map(|beam| decimal(beam.angle)),
            softness: self.lamp.beam.map(|beam| decimal(beam.softness)),
            color: (self.lamp.color != Rgb::ONE).then(|| self.lamp.color.to_array().map(decimal)),
            image: None,
            rotation: None,
        }
    }

    /// What a photographer sets up for the lamp at a radiance and a size.
    #[must_use]
    pub fn description(&self, radiance: f64, size: f64) -> Description {
        let light = self.lamp.light(String::new());
        let watts = radiance * f64::from(light.unit_power(size as f32));
        let extent = match self.lamp.outline {
            Outline::Rectangle { a, b } => [a, b],
            Outline::Disk { r } => [r, r],
        };
        Description {
            role: self.role,
            azimuth: rounded(f64::from(self.place.azimuth), 1),
            elevation: rounded(f64::from(self.place.elevation), 1),
            distance: rounded(f64::from(self.place.distance), 3),
            height: rounded(f64::from(self.height), 3),
            extent: extent.map(|half| rounded(2.0 * f64::from(half) * size, 3)),
            beam: self.lamp.beam.map(|beam| rounded(2.0 * f64::from(beam.angle), 1)),
            watts: rounded(watts, 3),
            lumens: rounded(watts * f64::from(LUMENS_PER_WATT), 0),
        }
    }
}

/// A lamp in one line: where it stands, how large it is and how bright.
#[must_use]
pub fn in_words(d: &Description) -> String {
    let side = match d.azimuth {
        a if a.abs() < 0.5 => "from the front".to_owned(),
        a => format!("{:.0}\u{b0} {}", a.abs(), if a < 0.0 { "left" } else { "right" }),
    };
    let height = format!("{:.0}\u{b0} {}", d.elevation.abs(), if d.elevation < 0.0 { "down" } else { "up" });
    let [width, tall] = d.extent;
    let beam = d.beam.map_or_else(String::new, |beam| format!(", beam {beam:.0}\u{b0}"));
    format!(
        "{side}, {height}, {:.2} m away, {:.2} m high; {width:.2} x {tall:.2} m{beam}; {:.3} W, {:.0} lm",
        d.distance, d.height, d.watts, d.lumens
    )
}

/// The shortest decimal number that is read as the same `f32`.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// A number rounded to some decimals.
fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10.0_f64.powi(decimals);
    (value * scale).round() / scale
}
