//! Russian roulette.

use crate::math::Rgb;

/// Edges after which Russian roulette begins.
const ROULETTE_START: usize = 3;
/// A subpath survives at least this often, so that no light it could still
/// meet becomes a rare and bright event.
const MIN_SURVIVAL: f32 = 0.1;

/// Russian roulette after `n_edges`: the factor on the throughput of a
/// survivor, or `None`. \[Veach97\] 10.4.1.
pub(super) fn roulette(n_edges: usize, throughput: Rgb, u: f32) -> Option<f32> {
    if n_edges < ROULETTE_START {
        return Some(1.0);
    }
    let survival = throughput.max_element().clamp(MIN_SURVIVAL, 1.0);
    (u < survival).then_some(1.0 / survival)
}
