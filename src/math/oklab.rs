//! Chroma of what a display shows: a and b of Oklab, with a toe.
//!
//! The cube root of Oklab has an infinite slope at black, where noise would become colour. Below the bound of
//! CIELAB it is continued along its tangent, as there, which moves a and b of dark pixels towards 0.
//!
//! # References
//! \[Ottosson20\] (Oklab); \[CIE15\] eq. 8.5 (the toe).

use glam::{DMat3, DVec3};

/// Cube root of the bound below which the root is continued along its tangent, \[CIE15\].
const TOE: f64 = 6.0 / 29.0;

/// From linear Rec.709 to responses of cones, \[Ottosson20\], by columns.
const CONES: DMat3 = DMat3::from_cols(
    DVec3::new(0.412_221_470_8, 0.211_903_498_2, 0.088_302_461_9),
    DVec3::new(0.536_332_536_3, 0.680_699_545_1, 0.281_718_837_6),
    DVec3::new(0.051_445_992_9, 0.107_396_956_6, 0.629_978_700_5),
);
/// Rows of a and b, \[Ottosson20\].
const CHROMA: [DVec3; 2] = [
    DVec3::new(1.977_998_495_1, -2.428_592_205_0, 0.450_593_709_9),
    DVec3::new(0.025_904_037_1, 0.782_771_766_2, -0.808_675_766_0),
];

/// a (red against green) and b (yellow against blue) of a display-linear Rec.709 colour in [0, 1], each with its
/// derivatives by red, green and blue.
#[must_use]
pub fn chroma(rgb: DVec3) -> [(f64, DVec3); 2] {
    let (mut roots, mut slopes) = (DVec3::ZERO, DVec3::ZERO);
    for (c, cone) in (CONES * rgb).to_array().into_iter().enumerate() {
        if cone > TOE * TOE * TOE {
            roots[c] = cone.cbrt();
            slopes[c] = 1.0 / (3.0 * roots[c] * roots[c]);
        } else {
            slopes[c] = 1.0 / (3.0 * TOE * TOE);
            roots[c] = cone * slopes[c] + TOE * 2.0 / 3.0;
        }
    }
    CHROMA.map(|row| (row.dot(roots), CONES.transpose() * (row * slopes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that the author of Oklab lists for colours of sRGB, and greys.
    #[test]
    fn primaries_have_the_published_chroma_and_greys_none() {
        for (rgb, a, b) in [
            (DVec3::X, 0.224_863, 0.125_846),
            (DVec3::Y, -0.233_888, 0.179_498),
            (DVec3::Z, -0.032_457, -0.311_528),
        ] {
            let found = chroma(rgb).map(|(v, _)| v);
            assert!((found[0] - a).abs() < 1e-5 && (found[1] - b).abs() < 1e-5, "{rgb} {found:?}");
        }
        for grey in [0.0, 1e-4, 0.01, 0.2, 1.0] {
            assert!(chroma(DVec3::splat(grey)).iter().all(|(v, _)| v.abs() < 1e-7), "{grey}");
        }
    }

    #[test]
    fn derivatives_agree_with_central_differences_on_both_sides_of_the_toe() {
        for rgb in
            [DVec3::new(0.6, 0.2, 0.05), DVec3::new(0.001, 0.004, 0.0005), DVec3::new(0.02, 0.001, 0.9)]
        {
            let found = chroma(rgb);
            for c in 0..3 {
                let h = 1e-7;
                let at = |d: f64| {
                    let mut moved = rgb;
                    moved[c] += d;
                    chroma(moved).map(|(v, _)| v)
                };
                let (more, less) = (at(h), at(-h));
                for k in 0..2 {
                    let difference = (more[k] - less[k]) / (2.0 * h);
                    assert!(
                        (found[k].1[c] - difference).abs() < 1e-6 * difference.abs().max(1.0),
                        "{rgb} {c} {k}"
                    );
                }
            }
        }
    }
}
