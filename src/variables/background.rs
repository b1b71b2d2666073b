//! Value of the background's materials.

use super::{BasisRanges, Fitted, Kind, MatchedStart, Owner, Range, Scale, Survey, Variable, Wishes};
use crate::{lighting::Lighting, transport::LightingGradient};

/// A picture is a polynomial in it: the value nodes of a transport basis hold all values.
#[derive(Debug)]
pub(super) struct Background;

impl Background {
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

    fn range(&self, survey: &Survey, _light: usize) -> Option<Range> {
        let [lower, upper] = survey.fitted.value_range.filter(|_| survey.free.contains(Self::KEYWORD))?;
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

    fn derivative(&self, gradient: &LightingGradient, _light: usize) -> f64 {
        gradient.value
    }

    fn open(&self, fitted: &Fitted, _wishes: &Wishes, ranges: &mut BasisRanges) {
        let varies = fitted.value_range.filter(|[least, largest]| least < largest);
        ranges.largest_value = varies.map(|[_, largest]| largest);
    }

    fn matched_start(&self, v: &Variable, start: &MatchedStart) -> f64 {
        start.value * v.initial
    }

    fn advice_for_darkness(&self, v: &Variable, value: f64) -> Option<String> {
        (value <= v.lower * 1.01).then(|| {
            format!(
                "the background is as dark as it may be ({} = {value:.3}): allow less, or keep a light off it by \
                 moving or narrowing it",
                v.name
            )
        })
    }
}
