//! Mean and variance of display luminance over the object and over the background.
//!
//! Both regions are measured in one pass for the means and one for the variances, whichever
//! terms ask for them.

use multiversion::multiversion;

use super::region::{Region, Regions};

/// Partial sums of a region. An addition need not wait for those to other sums, and rounding errors
/// grow with the addends of one of them: 384 at 128 × 96 pixels. Twice as many are no faster. The last
/// digits of f_q depend on it.
const LANES: usize = 32;

/// Mean and population variance σ² of display luminance over a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moments {
    /// Mean, in [0, 1].
    pub(super) mean: f64,
    /// Population variance, in [0, 1/4].
    pub(super) variance: f64,
}

/// Moments of both regions of `l`, in the order of [`Region`]. A picture that is all object has no
/// background to measure: its moments then stand for both.
pub(super) fn measure(l: &[f64], regions: &Regions) -> [Moments; 2] {
    let counts = [Region::Object, Region::Background].map(|region| regions.count(region));
    if let Some(weights) = regions.weights() {
        return weighted(l, weights, counts);
    }
    let by_count = |sums: [f64; 2]| -> [f64; 2] { std::array::from_fn(|r| sums[r] / counts[r]) };
    let means = by_count(sums(l, regions.mask()));
    let variances = by_count(squares(l, regions.mask(), means));
    let [object, background] = std::array::from_fn(|r| Moments { mean: means[r], variance: variances[r] });
    [object, if regions.count(Region::Background) == 0.0 { object } else { background }]
}

/// Moments of both regions where every pixel belongs to the object with a share.
fn weighted(l: &[f64], weights: &[f64], counts: [f64; 2]) -> [Moments; 2] {
    let sum = |region: usize, of: &dyn Fn(f64) -> f64| {
        let share = |w: f64| if region == 0 { w } else { 1.0 - w };
        l.iter().zip(weights).map(|(&l, &w)| share(w) * of(l)).sum::<f64>() / counts[region]
    };
    [0, 1].map(|region| {
        let mean = sum(region, &|l| l);
        Moments { mean, variance: sum(region, &|l| (l - mean) * (l - mean)) }
    })
}

/// Sums of `l` over the object and over the background.
#[multiversion(targets = "simd")]
fn sums(l: &[f64], mask: &[bool]) -> [f64; 2] {
    let mut sums = [[0.0; LANES]; 2];
    for (l, mask) in l.chunks(LANES).zip(mask.chunks(LANES)) {
        for (lane, (&l, &on_object)) in l.iter().zip(mask).enumerate() {
            // By selection, not by index: the sums stay in registers.
            sums[0][lane] += if on_object { l } else { 0.0 };
            sums[1][lane] += if on_object { 0.0 } else { l };
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

/// Sums of the squared distances of `l` from the means of object and background.
#[multiversion(targets = "simd")]
fn squares(l: &[f64], mask: &[bool], means: [f64; 2]) -> [f64; 2] {
    let mut sums = [[0.0; LANES]; 2];
    for (l, mask) in l.chunks(LANES).zip(mask.chunks(LANES)) {
        for (lane, (&l, &on_object)) in l.iter().zip(mask).enumerate() {
            let d = l - if on_object { means[0] } else { means[1] };
            sums[0][lane] += if on_object { d * d } else { 0.0 };
            sums[1][lane] += if on_object { 0.0 } else { d * d };
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}
