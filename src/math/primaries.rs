//! From the primaries and the white of a file to linear Rec.709.
//!
//! # References
//! \[BT709\] (primaries, white D65); \[Lindbloom\] (RGB to XYZ, Bradford adaptation).

use glam::{DMat3, DVec3};

/// Chromaticities x, y of primaries and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chromaticities {
    /// Chromaticity of red.
    pub red: [f64; 2],
    /// Chromaticity of green.
    pub green: [f64; 2],
    /// Chromaticity of blue.
    pub blue: [f64; 2],
    /// Chromaticity of white, R = G = B.
    pub white: [f64; 2],
}

/// White of Rec.709, Display P3 and Rec.2020.
pub const D65: [f64; 2] = [0.3127, 0.3290];

/// Rec.709, the primaries of sRGB and of the renderer.
pub const REC709: Chromaticities =
    Chromaticities { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: D65 };
/// Display P3 and P3-D65.
pub const P3_D65: Chromaticities =
    Chromaticities { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], white: D65 };
/// DCI-P3 with the white of the theatre.
pub const P3_DCI: Chromaticities = Chromaticities { white: [0.314, 0.351], ..P3_D65 };
/// Rec.2020.
pub const REC2020: Chromaticities =
    Chromaticities { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: D65 };
/// Adobe RGB (1998).
pub const ADOBE_RGB: Chromaticities =
    Chromaticities { red: [0.64, 0.33], green: [0.21, 0.71], blue: [0.15, 0.06], white: D65 };
/// ACES AP0.
pub const AP0: Chromaticities = Chromaticities {
    red: [0.7347, 0.2653],
    green: [0.0, 1.0],
    blue: [0.0001, -0.0770],
    white: [0.32168, 0.33767],
};
/// ACES AP1, of ACEScg.
pub const AP1: Chromaticities =
    Chromaticities { red: [0.713, 0.293], green: [0.165, 0.830], blue: [0.128, 0.044], white: AP0.white };
/// Rec.601 of 625 lines, PAL.
pub const REC601_625: Chromaticities =
    Chromaticities { red: [0.64, 0.33], green: [0.29, 0.60], blue: [0.15, 0.06], white: D65 };
/// Rec.601 of 525 lines, and SMPTE 240M.
pub const REC601_525: Chromaticities =
    Chromaticities { red: [0.630, 0.340], green: [0.310, 0.595], blue: [0.155, 0.070], white: D65 };

/// From X, Y, Z of a picture whose white is D65 to linear Rec.709.
#[must_use]
pub fn xyz_to_rec709() -> Option<DMat3> {
    Some(REC709.to_xyz()?.inverse())
}

/// White of the connection space of ICC profiles, X, Y and Z.
const D50: DVec3 = DVec3::new(0.9642, 1.0, 0.8249);

/// From X, Y, Z with the white D50, as ICC profiles have them, to linear Rec.709.
#[must_use]
pub fn d50_to_rec709() -> Option<DMat3> {
    let to = REC709.to_xyz()?;
    Some(to.inverse() * adaptation(D50, to * DVec3::ONE))
}

/// \[Lindbloom\]: takes colours from one white to another, both as X, Y and Z.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let gain = (BRADFORD * to) / (BRADFORD * from);
    BRADFORD.inverse() * DMat3::from_diagonal(gain) * BRADFORD
}

/// Cone responses of the Bradford adaptation, by columns.
const BRADFORD: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

/// Chromaticities within this distance are the same: files keep three to five digits.
const SAME: f64 = 1e-3;

impl Chromaticities {
    /// From x and y of red, green, blue and white, as EXR, PNG and Radiance list them.
    #[must_use]
    pub fn from_list([rx, ry, gx, gy, bx, by, wx, wy]: [f64; 8]) -> Self {
        Self { red: [rx, ry], green: [gx, gy], blue: [bx, by], white: [wx, wy] }
    }

    fn list(&self) -> [f64; 8] {
        let [a, b, c, d] = [self.red, self.green, self.blue, self.white];
        [a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]]
    }

    /// Whether they are those of Rec.709, to the digits that files keep.
    #[must_use]
    pub fn is_rec709(&self) -> bool {
        self.list().iter().zip(REC709.list()).all(|(a, b)| (a - b).abs() <= SAME)
    }

    /// From R, G, B to X, Y, Z with Y = 1 of white; `None` where they span no space.
    #[must_use]
    pub fn to_xyz(self) -> Option<DMat3> {
        let xyz = |[x, y]: [f64; 2]| DVec3::new(x, y, 1.0 - x - y);
        let primaries = DMat3::from_cols(xyz(self.red), xyz(self.green), xyz(self.blue));
        let is_sound = self.list().iter().all(|v| v.is_finite())
            && self.white[1] > SAME
            && primaries.determinant().abs() > SAME;
        let scale = primaries.inverse() * (xyz(self.white) / self.white[1]);
        let matrix = primaries * DMat3::from_diagonal(scale);
        (is_sound && matrix.is_finite() && scale.min_element() > 0.0).then_some(matrix)
    }

    /// The matrix to linear Rec.709: white becomes white by Bradford adaptation. `None` where
    /// the chromaticities are those of no device.
    #[must_use]
    pub fn to_rec709(self) -> Option<DMat3> {
        let (from, to) = (self.to_xyz()?, REC709.to_xyz()?);
        let matrix = to.inverse() * adaptation(from * DVec3::ONE, to * DVec3::ONE) * from;
        matrix.is_finite().then_some(matrix)
    }

    /// Shares of red, green and blue in the luminance Y; those of Rec.709 where the
    /// chromaticities are those of no device.
    #[must_use]
    pub fn luminance_weights(self) -> [f64; 3] {
        self.to_xyz().map_or(crate::math::display::LUMINANCE_WEIGHTS, |m| m.row(1).to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_stays_white_and_rec709_stays_itself() {
        for space in [REC709, P3_D65, P3_DCI, REC2020, ADOBE_RGB, AP0, AP1, REC601_525, REC601_625] {
            let white = space.to_rec709().unwrap() * DVec3::ONE;
            assert!((white - DVec3::ONE).abs().max_element() < 1e-12, "{space:?} {white}");
            assert_eq!(space.is_rec709(), space == REC709);
        }
        assert!((REC709.to_rec709().unwrap() - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, 1e-12));
    }

    #[test]
    fn the_matrices_are_the_published_ones() {
        // Blue of ACEScg as S-2014-004 has it with Bradford adaptation, and Y of P3's red.
        let blue = AP1.to_rec709().unwrap() * DVec3::Z;
        assert!((blue - DVec3::new(-0.08326, -0.01055, 1.15297)).abs().max_element() < 1e-4, "{blue}");
        assert!((P3_D65.luminance_weights()[0] - 0.2290).abs() < 1e-4);
        let weights = REC709.luminance_weights();
        for (got, want) in weights.iter().zip(crate::math::display::LUMINANCE_WEIGHTS) {
            assert!((got - want).abs() < 1e-4, "{weights:?}");
        }
    }

    #[test]
    fn what_spans_no_space_has_no_matrix() {
        let line = Chromaticities { blue: REC709.red, ..REC709 };
        let black = Chromaticities { white: [0.3, 0.0], ..REC709 };
        for bad in
            [line, black, Chromaticities::from_list([0.0; 8]), Chromaticities::from_list([f64::NAN; 8])]
        {
            assert!(bad.to_rec709().is_none(), "{bad:?}");
        }
    }
}
