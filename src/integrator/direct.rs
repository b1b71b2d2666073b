//! Next-event estimation: choice of the lights that a vertex samples, and of the points on them.
//!
//! Every vertex takes several samples, stratified over the lights and over the first coordinate of a
//! point, its size coordinate: on the fruit basket one sample in the place of four left six times the
//! noise correction of f_q for about a quarter less time. The multi-sample model \[Veach97\] 9.2.1 counts a density as
//! often as it is expected to be sampled.

use glam::Vec2;

use super::Context;
use crate::{light::LightId, math::sequence::PLASTIC, sampler::Sampler};

/// A light that a vertex samples.
pub(super) struct LightChoice {
    /// Index of the light.
    pub id: LightId,
    /// Expected number of samples of the light at the vertex.
    pub expected: f32,
    /// Uniform variates for the point on the light.
    pub u: Vec2,
}

impl<'a, const N: usize> Context<'a, N> {
    /// The lights sampled at the end of a camera subpath of `n_edges` edges. Takes four dimensions of the
    /// sequence.
    pub(super) fn choose_lights(
        &self,
        sampler: &mut Sampler,
        n_edges: usize,
    ) -> impl Iterator<Item = LightChoice> + use<'a, N> {
        let (shift, along) = (sampler.next_1d(), sampler.next_1d());
        let _spare = sampler.next_2d();
        let n = self.light_samples_at(n_edges);
        let lights = &self.plan.lights;
        (0..n).filter_map(move |i| {
            let (id, pmf, rest) = lights.sample((i as f32 + shift) / n as f32)?;
            let u = Vec2::new(rest, (along + i as f32 * PLASTIC as f32).fract());
            Some(LightChoice { id, expected: pmf.0 * n as f32, u })
        })
    }
}
