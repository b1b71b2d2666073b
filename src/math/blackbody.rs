//! Colours of glowing bodies: from a temperature to linear Rec.709 of luminance 1, and back.
//!
//! The chromaticity is that of Planck's law, by a fit. A tint is the distance Duv from the Planckian locus in the
//! CIE 1960 diagram: above it, green, for positive values.
//!
//! # References
//! \[Krystek85\] (the fit); \[BT709\]; \[Ohno14\] (Duv).

use glam::{DMat3, DVec2, DVec3};

use super::{
    display::LUMINANCE_WEIGHTS,
    primaries::{REC709, xyz_to_rec709},
};

/// Least and largest temperature that a light may have, kelvin: those of the fit. Below, Rec.709 holds nothing near
/// the locus; above, the locus hardly moves.
pub const TEMPERATURES: [f64; 2] = [1000.0, 15_000.0];
/// Largest distance of a tint from the locus to either side: beyond, no temperature describes a colour.
pub const MAX_TINT: f64 = 0.05;

/// Halvings of the range of reciprocal temperatures when one is sought: 1e-9 of it.
const BISECTIONS: u32 = 30;

/// A colour with its derivative by the temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glow {
    /// Linear Rec.709 of luminance 1.
    pub rgb: [f64; 3],
    /// Derivative of each channel of the colour by the temperature, 1/K.
    pub by_kelvin: [f64; 3],
}

/// Colour of a body of this temperature, `tint` above the locus. What lies outside Rec.709, as below 1900 K, is
/// cut off at 0.
#[must_use]
pub fn glow(kelvin: f64, tint: f64) -> Glow {
    let [at, slope, bend] = locus(kelvin);
    // The unit normal on the side of green, and its derivative along the locus.
    let normal = DVec2::new(slope.y, -slope.x);
    let length = normal.length();
    let turn = DVec2::new(bend.y, -bend.x);
    let by_kelvin = slope + tint * (turn - normal * (normal.dot(turn) / (length * length))) / length;
    let uv = at + tint * normal / length;
    // X and Z where Y = 1.
    let xyz = DVec3::new(1.5 * uv.x / uv.y, 1.0, (2.0 - 0.5 * uv.x) / uv.y - 5.0);
    let dx = 1.5 * (by_kelvin.x - uv.x / uv.y * by_kelvin.y) / uv.y;
    let dz = (-0.5 * by_kelvin.x - (2.0 - 0.5 * uv.x) / uv.y * by_kelvin.y) / uv.y;
    let to_rgb = xyz_to_rec709().unwrap_or(DMat3::IDENTITY);
    let (rgb, by_kelvin) = (to_rgb * xyz, to_rgb * DVec3::new(dx, 0.0, dz));
    let inside = DVec3::from_array(rgb.to_array().map(|v| f64::from(u8::from(v > 0.0))));
    let (rgb, by_kelvin) = (rgb * inside, by_kelvin * inside);
    let weights = DVec3::from_array(LUMINANCE_WEIGHTS);
    let (y, dy) = (weights.dot(rgb), weights.dot(by_kelvin));
    Glow { rgb: (rgb / y).to_array(), by_kelvin: ((by_kelvin - rgb * (dy / y)) / y).to_array() }
}

/// Temperature, within [`TEMPERATURES`], of the point of the locus that is nearest to a linear Rec.709 colour, and the
/// colour's distance from it, Duv.
#[must_use]
pub fn temperature_of(rgb: [f64; 3]) -> (f64, f64) {
    let xyz = REC709.to_xyz().unwrap_or(DMat3::IDENTITY) * DVec3::from_array(rgb);
    let uv = to_uv(xyz);
    let [mut high, mut low] = TEMPERATURES.map(|t| 1.0 / t);
    for _ in 0..BISECTIONS {
        let mid = 0.5 * (low + high);
        let [at, slope, _] = locus(1.0 / mid);
        // Along the locus, towards higher temperatures.
        if (uv - at).dot(slope) > 0.0 { high = mid } else { low = mid }
    }
    let kelvin = 1.0 / (0.5 * (low + high));
    let [at, slope, _] = locus(kelvin);
    (kelvin, (uv - at).dot(DVec2::new(slope.y, -slope.x).normalize()))
}

/// u and v of the CIE 1960 diagram.
fn to_uv(xyz: DVec3) -> DVec2 {
    DVec2::new(4.0 * xyz.x, 6.0 * xyz.y) / (xyz.x + 15.0 * xyz.y + 3.0 * xyz.z)
}

/// Point of the Planckian locus, u and v, with its first and second derivative by the temperature: \[Krystek85\],
/// within 9e-5 of Planck's law with the CIE 1931 observer from 1000 to 15000 K.
fn locus(kelvin: f64) -> [DVec2; 3] {
    let [u, du, ddu] = ratio(
        [0.860_117_757, 1.541_182_54e-4, 1.286_412_12e-7],
        [1.0, 8.424_202_35e-4, 7.081_451_63e-7],
        kelvin,
    );
    let [v, dv, ddv] = ratio(
        [0.317_398_726, 4.228_062_45e-5, 4.204_816_91e-8],
        [1.0, -2.897_418_16e-5, 1.614_560_53e-7],
        kelvin,
    );
    [DVec2::new(u, v), DVec2::new(du, dv), DVec2::new(ddu, ddv)]
}

/// Ratio of two polynomials of the second degree, with its first and second derivative.
fn ratio(above: [f64; 3], below: [f64; 3], t: f64) -> [f64; 3] {
    let value = |[a, b, c]: [f64; 3]| a + t * (b + t * c);
    let slope = |[_, b, c]: [f64; 3]| b + 2.0 * c * t;
    let below_value = value(below);
    let ratio = value(above) / below_value;
    let first = (slope(above) - ratio * slope(below)) / below_value;
    let second = (2.0 * above[2] - 2.0 * first * slope(below) - 2.0 * ratio * below[2]) / below_value;
    [ratio, first, second]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chromaticity(kelvin: f64) -> [f64; 2] {
        let xyz = REC709.to_xyz().unwrap() * DVec3::from_array(glow(kelvin, 0.0).rgb);
        [xyz.x, xyz.y].map(|v| v / (xyz.x + xyz.y + xyz.z))
    }

    /// Chromaticities of the Planckian locus as the tables of the CIE 1931 observer give them, to four digits.
    #[test]
    fn chromaticities_are_those_of_the_tabulated_observer() {
        for (kelvin, x, y) in [
            (2000.0, 0.5267, 0.4133),
            (2856.0, 0.4476, 0.4074),
            (4000.0, 0.3805, 0.3768),
            (5000.0, 0.3451, 0.3516),
            (6500.0, 0.3135, 0.3237),
            (10000.0, 0.2807, 0.2884),
        ] {
            let [got_x, got_y] = chromaticity(kelvin);
            assert!((got_x - x).abs() < 5e-4 && (got_y - y).abs() < 5e-4, "{kelvin}: {got_x} {got_y}");
        }
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        for (kelvin, tint) in [(1500.0, 0.0), (2700.0, 0.0), (3200.0, 0.02), (5600.0, -0.01), (12000.0, 0.03)]
        {
            let found = glow(kelvin, tint);
            assert!((DVec3::from_array(LUMINANCE_WEIGHTS).dot(found.rgb.into()) - 1.0).abs() < 1e-12);
            let h = 1e-3 * kelvin;
            let at = |k: f64| glow(kelvin + k * h, tint).rgb;
            for c in 0..3 {
                // Of the fourth order.
                let (near, far) = (at(1.0)[c] - at(-1.0)[c], at(2.0)[c] - at(-2.0)[c]);
                let difference = (8.0 * near - far) / (12.0 * h);
                assert!(
                    (found.by_kelvin[c] - difference).abs() < 1e-6 * difference.abs().max(1e-4),
                    "{kelvin} {tint} {c}: {} {difference}",
                    found.by_kelvin[c]
                );
            }
        }
    }

    #[test]
    fn a_temperature_comes_back_from_its_colour() {
        for (kelvin, tint) in [(2200.0, 0.0), (3200.0, 0.0), (5600.0, 0.01), (7500.0, -0.02)] {
            let (found, duv) = temperature_of(glow(kelvin, tint).rgb);
            assert!((found / kelvin - 1.0).abs() < 1e-6, "{kelvin} {tint}: {found}");
            assert!((duv - tint).abs() < 1e-8, "{kelvin} {tint}: {duv}");
        }
        // White of Rec.709 is D65, of 6504 K and Duv .0032 [Ohno14].
        let (kelvin, duv) = temperature_of([1.0; 3]);
        assert!((kelvin - 6504.0).abs() < 20.0 && (duv - 0.0032).abs() < 1e-4, "{kelvin} {duv}");
    }
}
