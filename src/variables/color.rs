//! The colour of a light as a variable: its temperature, or its channels.

use super::{BasisRanges, Kind, Limits, Owner, Range, Scale, SurveyedScene};
use crate::{light::LightColor, lighting::Lighting, transport::LightingGradient};

/// Bounds of a free temperature, kelvin: from a halogen lamp dimmed to the sky's shade, which is what lamps of
/// photographers can be set to.
const KELVIN: [f64; 2] = [2700.0, 7500.0];
/// Least channel of a free colour relative to the largest possible: deep gels pass a hundredth of a channel, and
/// at 0 of all channels there would be no colour.
const LEAST_CHANNEL: f64 = 0.01;

/// Temperature of the colour of a light. Its transport is linear in each channel of the colour, which a basis
/// with the colour of its replicates holds.
#[derive(Debug)]
pub(super) struct Temperature;

/// A channel of the colour of a light, which is scaled to luminance 1, so that only ratios of channels matter.
#[derive(Debug)]
pub(super) struct Channel(pub usize);

impl Temperature {
    /// Word for the kind in `free` of a sidecar and after `--free`.
    pub const KEYWORD: &str = "color";
}

impl Channel {
    /// Word for all three kinds in `free` of a sidecar and after `--free`.
    pub const KEYWORD: &str = "color_rgb";
}

impl Kind for Temperature {
    fn keyword(&self) -> &'static str {
        Self::KEYWORD
    }

    fn help(&self) -> &'static str {
        "Colour temperature of lights, from 2700 to 7500 K; not free unless it is named"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn suffix(&self) -> &'static str {
        "color_temperature"
    }

    fn is_usual(&self) -> bool {
        false
    }

    fn range(&self, scene: &SurveyedScene, light: usize) -> Option<Range> {
        let LightColor::Temperature { kelvin, .. } = scene.colors[light].as_temperature() else {
            return None;
        };
        let [lower, upper] = scene.temperature_range[light].map_or(KELVIN, |range| range.map(f64::from));
        Some(Range { unit: "K", lower, upper, initial: kelvin.clamp(lower, upper), scale: Scale::Reciprocal })
    }

    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64 {
        let color = x.color_mut(light);
        if !matches!(color, LightColor::Temperature { .. }) {
            *color = color.as_temperature();
        }
        let LightColor::Temperature { kelvin, .. } = color else { unreachable!("made one above") };
        kelvin
    }

    fn derivative(&self, gradient: &LightingGradient, x: &Lighting, light: usize) -> f64 {
        x.color_of(light).by_kelvin(gradient.color[light])
    }

    fn open(&self, _limits: Limits, _light: usize, ranges: &mut BasisRanges) {
        ranges.colors = true;
    }
}

impl Kind for Channel {
    fn keyword(&self) -> &'static str {
        Self::KEYWORD
    }

    fn help(&self) -> &'static str {
        "Colour of lights by red, green and blue, for gels and neon; not free unless it is named"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn suffix(&self) -> &'static str {
        ["red", "green", "blue"][self.0]
    }

    fn is_usual(&self) -> bool {
        false
    }

    fn range(&self, scene: &SurveyedScene, light: usize) -> Option<Range> {
        let factor = scene.colors[light].factor();
        let largest = factor.iter().copied().fold(0.0, f64::max);
        let initial = (factor[self.0] / largest).clamp(LEAST_CHANNEL, 1.0);
        Some(Range { unit: "1", lower: LEAST_CHANNEL, upper: 1.0, initial, scale: Scale::Perceptual })
    }

    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64 {
        let color = x.color_mut(light);
        if !matches!(color, LightColor::Rgb(_)) {
            *color = LightColor::Rgb(color.factor());
        }
        let LightColor::Rgb(rgb) = color else { unreachable!("made one above") };
        &mut rgb[self.0]
    }

    fn derivative(&self, gradient: &LightingGradient, x: &Lighting, light: usize) -> f64 {
        x.color_of(light).by_channel(self.0, gradient.color[light])
    }

    fn open(&self, _limits: Limits, _light: usize, ranges: &mut BasisRanges) {
        ranges.colors = true;
    }
}
