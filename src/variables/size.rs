//! Size of a light.

use super::{BasisRanges, Fitted, Kind, Owner, Range, Scale, Survey, Variable, Wishes};
use crate::{lighting::Lighting, transport::LightingGradient};

/// A picture is an indicator in it: the knots of a transport basis hold all sizes.
#[derive(Debug)]
pub(super) struct Size;

impl Size {
    pub const KEYWORD: &str = "size";
}

impl Kind for Size {
    fn keyword(&self) -> &'static str {
        Self::KEYWORD
    }

    fn help(&self) -> &'static str {
        "Size of lights"
    }

    fn owner(&self) -> Owner {
        Owner::Light
    }

    fn suffix(&self) -> &'static str {
        "size"
    }

    fn range(&self, survey: &Survey, light: usize) -> Option<Range> {
        let [lower, upper] = survey.fitted.sizes[light].filter(|_| survey.is_free(self, light))?;
        Some(Range {
            unit: "1",
            lower: f64::from(lower),
            upper: f64::from(upper),
            initial: survey.fitted.lighting.size[light],
            scale: Scale::Logarithmic,
        })
    }

    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64 {
        &mut x.size[light]
    }

    fn derivative(&self, gradient: &LightingGradient, light: usize) -> f64 {
        gradient.size[light]
    }

    fn open(&self, fitted: &Fitted, wishes: &Wishes, ranges: &mut BasisRanges) {
        for ((range, &fitted), light) in ranges.sizes.iter_mut().zip(&fitted.sizes).zip(&wishes.lights) {
            *range = fitted.filter(|[least, most]| least < most && light.free.contains(Self::KEYWORD));
        }
    }

    fn flux_power(&self) -> Option<i32> {
        Some(2)
    }

    fn is_tried(&self) -> bool {
        true
    }

    fn least_sampled(&self, v: &Variable, least_sizes: &[f64]) -> f64 {
        least_sizes.get(v.light).map_or(v.lower, |&size| size)
    }
}
