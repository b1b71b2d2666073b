//! From linear luminance to the display-referred `l` in [0, 1] that the terms measure.
//!
//! `l = oetf_srgb(clamp(e·Y, 0, 1))`, `Y` from linear Rec.709 RGB, `e` the exposure.
//!
//! # References
//! \[IEC61966\] (sRGB transfer function), \[BT709\] (luminance weights).

use multiversion::multiversion;
use serde::{Deserialize, Serialize};

/// Rec.709 luminance weights of linear R, G, B.
pub const LUMINANCE_WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Linear luminance `Y` of a linear Rec.709 colour.
#[must_use]
pub fn luminance(rgb: [f32; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    LUMINANCE_WEIGHTS[0] * r + LUMINANCE_WEIGHTS[1] * g + LUMINANCE_WEIGHTS[2] * b
}

/// Measure of luminance: how linear luminance becomes the `l` that the terms of f_q measure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LuminanceMode {
    /// sRGB-encoded, as a display shows it; the published values are of this kind.
    #[default]
    Srgb,
    /// Linear, clamped to [0, 1].
    Linear,
}

impl LuminanceMode {
    /// Display luminance `l` of linear luminance `y` at exposure `exposure`; NaN stays NaN.
    #[must_use]
    pub fn encode(self, y: f64, exposure: f64) -> f64 {
        let v = (exposure * y).clamp(0.0, 1.0);
        match self {
            Self::Srgb => oetf_srgb(v),
            Self::Linear => v,
        }
    }

    /// `(l, dl/dY)`. The derivative is 0 outside the clamp and the inner one on its ends,
    /// so that a black pixel can brighten and a just-white one can darken.
    #[must_use]
    pub fn encode_with_derivative(self, y: f64, exposure: f64) -> (f64, f64) {
        let v = exposure * y;
        let l = self.encode(y, exposure);
        let inside = (0.0..=1.0).contains(&v);
        let slope = match self {
            _ if !inside => 0.0,
            Self::Linear => exposure,
            Self::Srgb if v <= 0.003_130_8 => exposure * 12.92,
            // Of a power c·v^p − d: p (l + d)/v.
            Self::Srgb => exposure * (l + 0.055) / (2.4 * v),
        };
        (l, slope)
    }

    /// [`Self::encode_with_derivative`] of every pixel.
    ///
    /// # Panics
    /// When the slices differ in length.
    pub fn encode_all(self, y: &[f64], exposure: f64, l: &mut [f64], slopes: &mut [f64]) {
        assert!(y.len() == l.len() && y.len() == slopes.len(), "pictures of one size");
        match self {
            Self::Srgb => encode_srgb(y, exposure, l, slopes),
            Self::Linear => {
                for ((&y, l), slope) in y.iter().zip(l).zip(slopes) {
                    (*l, *slope) = self.encode_with_derivative(y, exposure);
                }
            }
        }
    }

    /// Display luminance of every pixel of a linear picture.
    ///
    /// Every reported value comes through here, so a stored picture gives it again bit for bit.
    #[must_use]
    pub fn encode_image(self, rgb: &[[f32; 3]], exposure: f64) -> Vec<f64> {
        rgb.iter().map(|&c| self.encode(luminance(c), exposure)).collect()
    }
}

/// sRGB encoding of `v` in [0, 1]; NaN stays NaN.
#[must_use]
#[inline(always)]
pub fn oetf_srgb(v: f64) -> f64 {
    let curved = 1.055 * power_5_12(v) - 0.055;
    if v <= 0.003_130_8 { 12.92 * v } else { curved }
}

/// v^(5/12) = ⁴√v · ∛√v of a normal number, to a few units in the last place: roots
/// only, so that a loop over pixels becomes vector instructions.
#[inline(always)]
fn power_5_12(v: f64) -> f64 {
    let root = v.sqrt();
    // A third of the exponent; the constant centres the error, at most 3.4 %.
    let high = (root.to_bits() >> 32) as u32;
    let third = (u64::from(high) * 0x5555_5556) >> 32;
    let mut cube_root = f64::from_bits((third + 0x2a9f_7893) << 32);
    for _ in 0..3 {
        // Halley's iteration: the error's third power.
        let cube = cube_root * cube_root * cube_root;
        cube_root *= (cube + 2.0 * root) / (2.0 * cube + root);
    }
    root.sqrt() * cube_root
}

/// [`LuminanceMode::encode_with_derivative`] without branches.
#[multiversion(targets = "simd")]
fn encode_srgb(y: &[f64], exposure: f64, l: &mut [f64], slopes: &mut [f64]) {
    for ((&y, l), slope) in y.iter().zip(l).zip(slopes) {
        let v = exposure * y;
        *l = oetf_srgb(v.clamp(0.0, 1.0));
        let curved = exposure * (*l + 0.055) / (2.4 * v);
        let inner = if v <= 0.003_130_8 { exposure * 12.92 } else { curved };
        *slope = if (0.0..=1.0).contains(&v) { inner } else { 0.0 };
    }
}

/// sRGB decoding: inverse of [`oetf_srgb`].
#[must_use]
pub fn eotf_srgb(l: f64) -> f64 {
    if l <= 0.040_45 { l / 12.92 } else { ((l + 0.055) / 1.055).powf(2.4) }
}

/// Derivative of [`eotf_srgb`].
#[must_use]
pub fn eotf_srgb_derivative(l: f64) -> f64 {
    if l <= 0.040_45 { 1.0 / 12.92 } else { 2.4 / 1.055 * ((l + 0.055) / 1.055).powf(1.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivative_agrees_with_central_differences() {
        let h = 1e-7;
        for mode in [LuminanceMode::Srgb, LuminanceMode::Linear] {
            for (y, e) in [(0.001, 1.0), (0.2, 1.5), (0.49, 2.0), (0.7, 0.3), (3.0, 1.0)] {
                let fd = (mode.encode(y + h, e) - mode.encode(y - h, e)) / (2.0 * h);
                let (l, slope) = mode.encode_with_derivative(y, e);
                assert_eq!(l, mode.encode(y, e));
                let mut all = ([0.0], [0.0]);
                mode.encode_all(&[y], e, &mut all.0, &mut all.1);
                assert_eq!(all, ([l], [slope]));
                assert!((fd - slope).abs() <= 1e-6 * slope.abs().max(1e-3), "{mode:?} {y} {e}");
            }
        }
    }

    #[test]
    fn the_clamp_has_inner_slopes_on_its_ends_and_none_beyond() {
        let mode = LuminanceMode::Srgb;
        assert_eq!(mode.encode_with_derivative(0.0, 2.0), (0.0, 2.0 * 12.92));
        let (white, slope) = mode.encode_with_derivative(0.5, 2.0);
        assert!((white - 1.0).abs() < 1e-15 && slope > 0.8);
        assert_eq!(mode.encode_with_derivative(0.6, 2.0).1, 0.0);
        assert_eq!(mode.encode_with_derivative(-0.1, 2.0), (0.0, 0.0));
    }

    #[test]
    fn srgb_middle_grey_and_the_round_trip() {
        assert!((oetf_srgb(0.214_041_140_482_232_55) - 0.5).abs() < 1e-12);
        for code in 0..=255 {
            let l = f64::from(code) / 255.0;
            assert!((oetf_srgb(eotf_srgb(l)) - l).abs() < 1e-7);
        }
    }

    #[test]
    fn the_power_is_exact_to_rounding() {
        for i in 0..200_000 {
            let v = 1.0025_f64.powi(-i / 10) * (1.0 - f64::from(i % 10) * 1e-4);
            if v < 1e-200 {
                break;
            }
            let error = (power_5_12(v) / v.powf(5.0 / 12.0) - 1.0).abs();
            assert!(error < 2e-15, "{v}: {error}");
        }
        assert!(
            oetf_srgb(f64::NAN).is_nan() && oetf_srgb(0.0) == 0.0 && (oetf_srgb(1.0) - 1.0).abs() < 1e-15
        );
    }

    #[test]
    fn luminance_uses_rec709_weights() {
        assert_eq!(luminance([1.0, 0.0, 0.0]), 0.2126);
        assert_eq!(luminance([0.0, 1.0, 0.0]), 0.7152);
        assert_eq!(luminance([0.0, 0.0, 1.0]), 0.0722);
    }
}
