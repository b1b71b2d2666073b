//! Colours that a picture gives to lights.

use serde::{Deserialize, Serialize};

use crate::math::{
    blackbody::{self, glow},
    display::LUMINANCE_WEIGHTS,
};

/// Colour that a picture gives to a light, a factor on each channel of its contributions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightColor {
    /// That with which the light's contributions are recorded, [`Light::color`](super::Light::color).
    #[default]
    Recorded,
    /// Linear Rec.709 up to a factor, not all 0, for a light that is recorded white.
    Rgb([f64; 3]),
    /// A body of this temperature, kelvin, `tint` above the Planckian locus, for a light that is recorded white.
    Temperature {
        /// Temperature, kelvin.
        kelvin: f64,
        /// Distance Duv from the locus.
        tint: f64,
    },
}

impl LightColor {
    /// Factor on each channel, of luminance 1 or 1 itself.
    #[must_use]
    pub fn factor(self) -> [f64; 3] {
        match self {
            Self::Recorded => [1.0; 3],
            Self::Rgb(rgb) => {
                let y = luminance(rgb);
                rgb.map(|v| v / y)
            }
            Self::Temperature { kelvin, tint } => glow(kelvin, tint).rgb,
        }
    }

    /// The factor as pictures are rendered with it; `None` where there is none.
    #[must_use]
    pub fn gain(self) -> Option<[f32; 3]> {
        (self != Self::Recorded).then(|| self.factor().map(|v| v as f32))
    }

    /// Derivative by the temperature of a number, from that by each channel of the factor; 0 where the colour has
    /// no temperature.
    #[must_use]
    pub fn by_kelvin(self, by_factor: [f64; 3]) -> f64 {
        match self {
            Self::Temperature { kelvin, tint } => dot(glow(kelvin, tint).by_kelvin, by_factor),
            Self::Recorded | Self::Rgb(_) => 0.0,
        }
    }

    /// Derivative by a channel of [`Self::Rgb`] of a number, from that by each channel of the factor; 0 where the
    /// colour is not given so.
    #[must_use]
    pub fn by_channel(self, channel: usize, by_factor: [f64; 3]) -> f64 {
        let Self::Rgb(rgb) = self else { return 0.0 };
        let y = luminance(rgb);
        (by_factor[channel] - LUMINANCE_WEIGHTS[channel] * dot(rgb, by_factor) / y) / y
    }

    /// The nearest colour on the Planckian locus, or `self` where it has a temperature.
    #[must_use]
    pub fn as_temperature(self) -> Self {
        match self {
            Self::Temperature { .. } => self,
            _ => Self::Temperature { kelvin: blackbody::temperature_of(self.factor()).0, tint: 0.0 },
        }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn luminance(rgb: [f64; 3]) -> f64 {
    dot(rgb, LUMINANCE_WEIGHTS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The derivative of Σ w·factor by each parameter, by central differences.
    #[test]
    fn derivatives_agree_with_central_differences() {
        let weights = [0.7, -1.3, 2.1];
        let value = |color: LightColor| dot(color.factor(), weights);
        let rgb = [0.9, 0.4, 0.15];
        for channel in 0..3 {
            let at = |h: f64| {
                let mut moved = rgb;
                moved[channel] += h;
                value(LightColor::Rgb(moved))
            };
            let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
            let found = LightColor::Rgb(rgb).by_channel(channel, weights);
            assert!((found - difference).abs() < 1e-6 * found.abs(), "{channel}: {found} {difference}");
        }
        let at = |kelvin: f64| LightColor::Temperature { kelvin, tint: 0.01 };
        let difference = (value(at(4000.1)) - value(at(3999.9))) / 0.2;
        let found = at(4000.0).by_kelvin(weights);
        assert!((found - difference).abs() < 1e-6 * found.abs(), "{found} {difference}");
    }

    #[test]
    fn colours_have_luminance_one_and_a_temperature_comes_back() {
        assert!((luminance(LightColor::Rgb([3.0, 0.0, 1.0]).factor()) - 1.0).abs() < 1e-12);
        let warm = LightColor::Temperature { kelvin: 3200.0, tint: 0.0 };
        assert_eq!(warm.as_temperature(), warm);
        let LightColor::Temperature { kelvin, .. } = LightColor::Rgb(warm.factor()).as_temperature() else {
            panic!("a temperature")
        };
        assert!((kelvin - 3200.0).abs() < 0.01, "{kelvin}");
    }
}
