//! Radiance of a light.

use super::{Kind, MatchedStart, Owner, Range, Scale, Survey, Variable, survey::HEADROOM};
use crate::{lighting::Lighting, transport::LightingGradient};

/// A picture is linear in it.
#[derive(Debug)]
pub(super) struct Radiance;

impl Radiance {
    pub const KEYWORD: &str = "radiance";
}

impl Kind for Radiance {
    fn keyword(&self) -> &'static str {
        Self::KEYWORD
    }

    fn help(&self) -> &'static str {
        "Radiance of lights"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn suffix(&self) -> &'static str {
        "radiance"
    }

    fn range(&self, survey: &Survey, light: usize) -> Option<Range> {
        if !survey.is_free(self, light) {
            return None;
        }
        let wanted = survey.wishes.lights[light].radiance_max;
        let upper = wanted.map_or(HEADROOM * survey.bright[light], f64::from);
        Some(Range {
            unit: survey.scene.lights[light].unit(),
            lower: 0.0,
            upper,
            initial: survey.neutral_radiance(light).min(upper),
            scale: Scale::Perceptual,
        })
    }

    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64 {
        &mut x.radiance[light]
    }

    fn derivative(&self, gradient: &LightingGradient, light: usize) -> f64 {
        gradient.radiance[light]
    }

    fn matched_start(&self, v: &Variable, start: &MatchedStart) -> f64 {
        if start.lit.contains(&v.light) { start.radiance[v.light] } else { 0.0 }
    }

    fn flux_power(&self) -> Option<i32> {
        Some(1)
    }
}
