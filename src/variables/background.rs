//! The value of the background's materials as a variable.

use super::{BasisRanges, Kind, Limits, MatchedStart, Owner, Range, Scale, SurveyedScene};
use crate::{lighting::Lighting, transport::LightingGradient};

/// Value of the background, in which pictures are polynomials: the nodes of a transport basis hold all
/// values.
#[derive(Debug)]
pub(super) struct Background;

impl Background {
    /// Word for the kind in `free` of a sidecar and after `--free`.
    pub const KEYWORD: &str = "background";
}

impl Kind for Background {
    fn keyword(&self) -> &'static str {
        Self::KEYWORD
    }

    fn help(&self) -> &'static str {
        "Value of the background materials"
    }

    fn owner(&self) -> Owner {
        Owner::Scene("background")
    }

    fn suffix(&self) -> &'static str {
        "value"
    }

    fn range(&self, scene: &SurveyedScene, _light: usize) -> Option<Range> {
        let [lower, upper] = scene.limits.value?;
        Some(Range {
            unit: "1",
            lower: f64::from(lower),
            upper: f64::from(upper),
            initial: f64::from(1.0_f32.clamp(lower, upper)),
            scale: Scale::Perceptual,
        })
    }

    fn value<'x>(&self, x: &'x mut Lighting, _light: usize) -> &'x mut f64 {
        &mut x.value
    }

    fn derivative(&self, gradient: &LightingGradient, _x: &Lighting, _light: usize) -> f64 {
        gradient.value
    }

    fn open(&self, limits: Limits, _light: usize, ranges: &mut BasisRanges) {
        let varies = limits.value.filter(|[least, largest]| least < largest);
        ranges.largest_value = varies.map(|[_, largest]| largest);
    }

    fn matched_start(&self, range: &Range, _light: usize, start: &MatchedStart) -> f64 {
        start.value * range.initial
    }

    fn advice_for_darkness(&self, name: &str, range: &Range, value: f64) -> Option<String> {
        (value <= range.lower * 1.01).then(|| {
            format!(
                "the background is as dark as it may be ({name} = {value:.3}): allow less, or keep a light off it by \
                 moving or narrowing it"
            )
        })
    }
}
