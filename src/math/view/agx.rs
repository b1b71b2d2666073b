//! AgX, the default view of Blender since version 4.0, by its published construction.
//!
//! In Rec.2020: a guard rail for colours outside it, primaries that are rotated and drawn in (the inset), a
//! sigmoid of the logarithm of each channel, two fifths of the hue that the channels took on by that, the
//! outset; then, in Rec.709, the guard rail again. Blender displays a lattice of 57³ points of it over the
//! logarithms in E-Gamut, interpolated tetrahedrally, and so does this: where the rail has its edges, the
//! two differ by up to 22/255. Measured against Blender 5.0.1 on 11,904 colours: at most .02/255.
//!
//! # References
//! \[Sobotka23\] (inset, outset, sigmoid); \[Zhou23\] (guard rails, hue, lattice); \[EGamut\].

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

use super::{MIDDLE_GREY, lattice::Lattice};
use crate::math::primaries::{Chromaticities, D65, REC709, REC2020};

/// Points of the lattice along each edge.
const SIDE: usize = 57;
/// Exponent of the display's curve in which the lattice is stored.
const GAMMA: f64 = 2.4;
/// Stops from black to white of the sigmoid.
const STOPS: f64 = 16.5;
/// Stops from black to middle grey of the sigmoid.
const STOPS_BELOW: f64 = 10.0;
/// Slope of the sigmoid at middle grey.
const SLOPE: f64 = 2.4;
/// Exponent of the toe and of the shoulder of the sigmoid.
const POWER: f64 = 1.5;
/// Share of the change of hue by the sigmoid that stays.
const HUE_SHARE: f64 = 0.4;
/// Degrees by which red, green and blue are rotated about white, and shares by which they are drawn in,
/// before the sigmoid; shares by which they are drawn in for the matrix whose inverse is the outset.
const ROTATIONS: [f64; 3] = [2.139_761_49, -1.228_273_35, -3.051_742_46];
const INSETS: [f64; 3] = [0.329_652_05, 0.280_513_36, 0.124_753_68];
const OUTSETS: [f64; 3] = [0.323_174_38, 0.283_256_05, 0.037_432_6];
/// Shares of Rec.2020's channels in luminance by the CIE's functions of 2015, as the rails weigh them.
const RAIL_WEIGHTS: DVec3 =
    DVec3::new(0.265_818_037_025_044_9, 0.598_469_860_453_65, 0.135_712_102_521_305_2);
/// Power of the luminance with which the rail in Rec.709 goes over to the luminance itself.
const RAIL_POWER: f64 = 0.08;
/// FilmLight's E-Gamut.
const E_GAMUT: Chromaticities =
    Chromaticities { red: [0.8, 0.3177], green: [0.18, 0.9], blue: [0.065, -0.0805], white: D65 };

/// The transform, ready to be used.
struct Agx {
    /// From Rec.709 to E-Gamut.
    to_lattice: DMat3,
    lattice: Lattice,
}

/// Sampled once: 57³ colours take some tenths of a second.
static AGX: LazyLock<Agx> = LazyLock::new(|| {
    let formation = Formation::new();
    let to_lattice = between(REC709, E_GAMUT);
    let to_rec2020 = between(E_GAMUT, REC2020);
    let stored = |e: DVec3| formation.display(to_rec2020 * e).powf(1.0 / GAMMA);
    Agx { to_lattice, lattice: Lattice::sample(SIDE, stored) }
});

/// Display-linear Rec.709 in [0, 1] of a linear colour, with its derivatives by the channels, by column.
pub(super) fn display(rgb: DVec3) -> (DVec3, DMat3) {
    let Agx { to_lattice, lattice } = &*AGX;
    let (stored, slopes) = lattice.at(*to_lattice * rgb);
    let shown = stored.powf(GAMMA);
    let by_stored = GAMMA * stored.powf(GAMMA - 1.0);
    (shown, DMat3::from_diagonal(by_stored) * slopes * *to_lattice)
}

/// From Rec.709 to the space of the lattice.
pub(super) fn to_lattice() -> DMat3 {
    AGX.to_lattice
}

/// The lattice of what is stored.
pub(super) fn stored() -> &'static Lattice {
    &AGX.lattice
}

/// Display-linear light of what is stored.
pub(super) fn light(stored: f64) -> f64 {
    stored.powf(GAMMA)
}

/// From one space to another of the same white; the identity where one spans no space, which those of
/// this module do.
fn between(from: Chromaticities, to: Chromaticities) -> DMat3 {
    let matrix = |space: Chromaticities| space.to_xyz().unwrap_or(DMat3::IDENTITY);
    matrix(to).inverse() * matrix(from)
}

/// Rec.2020 with its primaries rotated about white by some degrees, brought back to the triangle, and
/// drawn in by some shares.
fn drawn_in(rotations: [f64; 3], shares: [f64; 3]) -> Chromaticities {
    let white = glam::DVec2::from_array(REC2020.white);
    let corners = [REC2020.red, REC2020.green, REC2020.blue].map(|c| glam::DVec2::from_array(c) - white);
    let moved: [[f64; 2]; 3] = std::array::from_fn(|i| {
        let direction = glam::DVec2::from_angle(rotations[i].to_radians()).rotate(corners[i]);
        // Where the ray from white leaves the triangle: the nearest of the lines that it meets ahead.
        let leaves = (0..3).filter_map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let along = a.perp_dot(b - a) / direction.perp_dot(b - a);
            (along > 0.0).then_some(along)
        });
        let edge = leaves.fold(f64::INFINITY, f64::min) * direction;
        (white + (1.0 - shares[i]) * edge).to_array()
    });
    Chromaticities { red: moved[0], green: moved[1], blue: moved[2], white: REC2020.white }
}

/// The formation of the picture before it is sampled.
struct Formation {
    inset: DMat3,
    outset: DMat3,
    to_rec709: DMat3,
    /// Weights of the rail for Rec.709's channels.
    rail_weights: DVec3,
}

impl Formation {
    fn new() -> Self {
        let to_rec2020 = between(REC709, REC2020);
        Self {
            inset: between(drawn_in(ROTATIONS, INSETS), REC2020),
            outset: between(REC2020, drawn_in([0.0; 3], OUTSETS)),
            to_rec709: to_rec2020.inverse(),
            rail_weights: to_rec2020.transpose() * RAIL_WEIGHTS,
        }
    }

    /// Display-linear Rec.709 in [0, 1] of a linear colour in Rec.2020.
    fn display(&self, rgb: DVec3) -> DVec3 {
        let inset = self.inset * guard(rgb, RAIL_WEIGHTS, |_, opponent| opponent);
        let formed = DVec3::from_array(inset.to_array().map(|v| sigmoid(stops(v)).max(0.0).powf(GAMMA)));
        let mixed = mix_hue(inset, formed);
        let shown = guard(self.to_rec709 * (self.outset * mixed), self.rail_weights, |y, opponent| {
            let share = y.max(0.0).powf(RAIL_POWER).min(1.0);
            opponent + share * (y - opponent)
        });
        shown.clamp(DVec3::ZERO, DVec3::ONE)
    }
}

/// Logarithm of a linear value as the sigmoid takes it: 0 for black, 1 for white, and beyond.
fn stops(linear: f64) -> f64 {
    // What has no logarithm is black, as is all that lies far below it.
    ((linear.max(1e-30) / MIDDLE_GREY).log2() + STOPS_BELOW) / STOPS
}

/// \[Sobotka23\]: through middle grey with a slope, and through black and white; not limited there.
fn sigmoid(x: f64) -> f64 {
    let (pivot, grey) = (STOPS_BELOW / STOPS, MIDDLE_GREY.powf(1.0 / GAMMA));
    let scale = |x: f64, y: f64| {
        let rise = SLOPE * x;
        (rise.powf(-POWER) * ((rise / y).powf(POWER) - 1.0)).powf(-1.0 / POWER)
    };
    let scale = if x < pivot { -scale(pivot, grey) } else { scale(1.0 - pivot, 1.0 - grey) };
    let t = SLOPE * (x - pivot) / scale;
    grey + scale * t / (1.0 + t.powf(POWER)).powf(1.0 / POWER)
}

/// \[Zhou23\]: lifts a colour with negative channels until there are none, and dims it to the intensity that
/// it had. Intensity is `measure` of the luminance and of the luminance that counts the opponent colour.
fn guard(rgb: DVec3, weights: DVec3, measure: impl Fn(f64, f64) -> f64) -> DVec3 {
    let intensity = |c: DVec3| {
        let (opponent, y) = (DVec3::splat(c.max_element()) - c, weights.dot(c));
        measure(y, opponent.max_element() - weights.dot(opponent) + y)
    };
    let lifted = rgb + DVec3::splat((-rgb.min_element()).max(0.0));
    let (before, after) = (intensity(rgb), intensity(lifted));
    if after > before { lifted * (before / after) } else { lifted }
}

/// The colour `formed` with the hue of `original`, but for [`HUE_SHARE`] of the way to its own.
fn mix_hue(original: DVec3, formed: DVec3) -> DVec3 {
    let (from, to) = (hue(original), hue(formed));
    // The shorter way around.
    let way = (to - from + 9.0).rem_euclid(6.0) - 3.0;
    let hue = (from + HUE_SHARE * way).rem_euclid(6.0);
    let (most, least) = (formed.max_element(), formed.min_element());
    let channel = |turn: f64| {
        let k = (turn + hue).rem_euclid(6.0);
        most - (most - least) * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    DVec3::new(channel(5.0), channel(3.0), channel(1.0))
}

/// Hue of the hexagon, in sixths of a turn: 0 is red, 2 green, 4 blue; 0 for a grey.
fn hue(c: DVec3) -> f64 {
    let (most, chroma) = (c.max_element(), c.max_element() - c.min_element());
    match () {
        () if chroma == 0.0 => 0.0,
        () if most == c.x => ((c.y - c.z) / chroma).rem_euclid(6.0),
        () if most == c.y => (c.z - c.x) / chroma + 2.0,
        () => (c.x - c.y) / chroma + 4.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inset_and_outset_are_the_published_matrices() {
        let formation = Formation::new();
        // By rows, as Blender's configuration has the inset.
        let inset = [
            [0.856_627_153_315_983, 0.095_121_240_538_158_8, 0.048_251_606_145_858_3],
            [0.137_318_972_929_847, 0.761_241_990_602_591, 0.101_439_036_467_562],
            [0.111_898_212_999_95, 0.076_799_418_603_190_3, 0.811_302_368_396_859],
        ];
        for (i, row) in inset.iter().enumerate() {
            for (j, want) in row.iter().enumerate() {
                assert!((formation.inset.col(j)[i] - want).abs() < 1e-6, "{i} {j} {}", formation.inset);
            }
        }
        let white = formation.outset * DVec3::ONE;
        assert!((white - DVec3::ONE).abs().max_element() < 1e-12);
    }

    #[test]
    fn the_sigmoid_goes_through_black_grey_and_white() {
        assert!(sigmoid(0.0).abs() < 1e-12 && (sigmoid(1.0) - 1.0).abs() < 1e-12);
        let pivot = STOPS_BELOW / STOPS;
        assert!((sigmoid(pivot).powf(GAMMA) - MIDDLE_GREY).abs() < 1e-12);
        let slope = (sigmoid(pivot + 1e-6) - sigmoid(pivot - 1e-6)) / 2e-6;
        assert!((slope - SLOPE).abs() < 1e-2, "{slope}");
    }

    #[test]
    fn hues_go_the_shorter_way() {
        let red = DVec3::new(1.0, 0.0, 0.1);
        let orange = DVec3::new(1.0, 0.1, 0.0);
        // From −.1 to .1 of a sixth: past 0, not through green and blue.
        assert!((hue(mix_hue(red, orange)) - 5.98).abs() < 1e-12);
        for c in [DVec3::new(0.2, 0.9, 0.4), DVec3::new(0.7, 0.1, 0.8), DVec3::splat(0.3)] {
            assert!((mix_hue(c, c) - c).abs().max_element() < 1e-12);
        }
    }
}
