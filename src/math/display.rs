//! From linear luminance to the display-referred `l` in [0, 1] that the terms measure.
//!
//! `l = oetf_srgb(clamp(e·Y, 0, 1))`, `Y` from linear Rec.709 RGB, `e` the exposure.
//!
//! # References
//! \[IEC61966\] (sRGB transfer function), \[BT709\] (luminance weights).

use serde::{Deserialize, Serialize};

/// Rec.709 luminance weights of linear R, G, B.
pub const LUMINANCE_WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Linear luminance `Y` of a linear Rec.709 colour.
#[must_use]
pub fn luminance(rgb: [f32; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    LUMINANCE_WEIGHTS[0] * r + LUMINANCE_WEIGHTS[1] * g + LUMINANCE_WEIGHTS[2] * b
}

/// How linear luminance becomes the `l` of the terms.
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

    /// Display luminance of every pixel of a linear picture.
    ///
    /// Every reported value comes through here, so a stored picture gives it again bit for bit.
    #[must_use]
    pub fn encode_image(self, rgb: &[[f32; 3]], exposure: f64) -> Vec<f64> {
        rgb.iter().map(|&c| self.encode(luminance(c), exposure)).collect()
    }
}

/// sRGB encoding of `v` in [0, 1].
#[must_use]
pub fn oetf_srgb(v: f64) -> f64 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
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
    fn luminance_uses_rec709_weights() {
        assert_eq!(luminance([1.0, 0.0, 0.0]), 0.2126);
        assert_eq!(luminance([0.0, 1.0, 0.0]), 0.7152);
        assert_eq!(luminance([0.0, 0.0, 1.0]), 0.0722);
    }
}
