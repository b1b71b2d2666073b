//! The exposure of the picture as a variable.

use super::{Kind, Owner, Range, Scale, SurveyedScene};
use crate::{
    lighting::{Lighting, MAX_EXPOSURE},
    transport::LightingGradient,
};

/// Stops below and above the scene's exposure between which a free one lies: what a photograph may be
/// wrong by, with room on either side.
const STOPS: f64 = 6.0;

/// Exposure, a factor on all light: for scenes whose lights are given, and whose camera is not. Free only
/// where it is asked for, since it does what all radiances together do.
#[derive(Debug)]
pub(super) struct Exposure;

impl Exposure {
    /// Word for the kind in `free` of a sidecar and after `--free`.
    pub const KEYWORD: &str = "exposure";
}

impl Kind for Exposure {
    fn keyword(&self) -> &'static str {
        Self::KEYWORD
    }

    fn help(&self) -> &'static str {
        "Exposure, from 6 stops below to 6 above the scene's; not free unless it is named"
    }

    fn owner(&self) -> Owner {
        Owner::Scene("camera")
    }

    fn suffix(&self) -> &'static str {
        "exposure"
    }

    fn is_usual(&self) -> bool {
        false
    }

    fn range(&self, scene: &SurveyedScene, _light: usize) -> Option<Range> {
        let most = f64::from(MAX_EXPOSURE);
        Some(Range {
            unit: "1",
            lower: (scene.exposure * (-STOPS).exp2()).max(1.0 / most),
            upper: (scene.exposure * STOPS.exp2()).min(most),
            initial: scene.exposure,
            scale: Scale::Logarithmic,
        })
    }

    fn value<'x>(&self, x: &'x mut Lighting, _light: usize) -> &'x mut f64 {
        &mut x.exposure
    }

    fn derivative(&self, gradient: &LightingGradient, _x: &Lighting, _light: usize) -> f64 {
        gradient.exposure
    }
}
