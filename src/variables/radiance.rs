//! The radiance of a light as a variable.

use super::{Kind, MatchedStart, Owner, Range, Scale, SurveyedScene};
use crate::{lighting::Lighting, transport::LightingGradient};

/// Upper bound of the radiance over that at which the light alone shows what it lights at
/// [`BRIGHT`](super::survey::BRIGHT). More headroom lets a light be brighter than a picture of it alone
/// needs, as where it shines into shadows only, and makes steps of the scale coarser.
const HEADROOM: f64 = 4.0;

/// Radiance of a light, in which pictures are linear.
#[derive(Debug)]
pub(super) struct Radiance;

impl Radiance {
    /// Word for the kind in `free` of a sidecar and after `--free`.
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

    fn range(&self, scene: &SurveyedScene, light: usize) -> Option<Range> {
        let upper = scene.radiance_max[light].map_or(HEADROOM * scene.bright[light], f64::from);
        Some(Range {
            unit: scene.units[light],
            lower: 0.0,
            upper,
            initial: scene.neutral[light].min(upper),
            scale: Scale::Perceptual,
        })
    }

    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64 {
        &mut x.radiance[light]
    }

    fn derivative(&self, gradient: &LightingGradient, _x: &Lighting, light: usize) -> f64 {
        gradient.radiance[light]
    }

    fn matched_start(&self, _range: &Range, light: usize, start: &MatchedStart) -> f64 {
        if start.lit.contains(&light) { start.radiance[light] } else { 0.0 }
    }

    fn flux_power(&self) -> Option<i32> {
        Some(1)
    }
}
