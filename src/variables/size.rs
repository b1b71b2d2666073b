//! The size of a light as a variable.

use super::{BasisRanges, Kind, Limits, Owner, Range, Scale, SurveyedScene};
use crate::{lighting::Lighting, transport::LightingGradient};

/// Size of a light, in which the light's contributions are indicators: the knots of a transport basis
/// hold all sizes.
#[derive(Debug)]
pub(super) struct Size;

impl Size {
    /// Word for the kind in `free` of a sidecar and after `--free`.
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

    fn range(&self, scene: &SurveyedScene, light: usize) -> Option<Range> {
        let [lower, upper] = scene.limits.sizes[light]?;
        Some(Range {
            unit: "1",
            lower: f64::from(lower),
            upper: f64::from(upper),
            initial: scene.sizes[light],
            scale: Scale::Logarithmic,
        })
    }

    fn value<'x>(&self, x: &'x mut Lighting, light: usize) -> &'x mut f64 {
        &mut x.size[light]
    }

    fn derivative(&self, gradient: &LightingGradient, _x: &Lighting, light: usize) -> f64 {
        gradient.size[light]
    }

    fn open(&self, limits: Limits, light: usize, ranges: &mut BasisRanges) {
        ranges.sizes[light] = limits.sizes[light].filter(|[least, most]| least < most);
    }

    fn flux_power(&self) -> Option<i32> {
        Some(2)
    }

    fn is_tried(&self) -> bool {
        true
    }

    fn least_sampled(&self, range: &Range, light: usize, least_sizes: &[f64]) -> f64 {
        least_sizes.get(light).map_or(range.lower, |&size| size)
    }
}
