//! Russian roulette.

use crate::math::Rgb;

/// Least probability with which a subpath survives: the light that it could still meet is brightened
/// tenfold at most, at the price of longer subpaths in dark scenes. Less took 10 % less time on the
/// fruit basket and left more noise.
const MIN_SURVIVAL: f32 = 0.1;

/// Russian roulette by a uniform variate `u`: the factor on the throughput of a subpath that survives, or `None`.
/// \[Veach97\] 10.4.1.
pub(super) fn roulette(throughput: Rgb, u: f32) -> Option<f32> {
    let survival = throughput.max_element().clamp(MIN_SURVIVAL, 1.0);
    (u < survival).then_some(1.0 / survival)
}
