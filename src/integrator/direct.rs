//! Next-event estimation: which lights are sampled, and where on them.
//!
//! Every vertex gets several samples, stratified over the lights and over the first
//! coordinate of each, its size: what differs most between them. The multi-sample model
//! \[Veach97\] 9.2.1 then counts a density as often as it is expected to be sampled.

use glam::Vec2;

use super::Context;
use crate::{light::LightId, math::sequence::PLASTIC, sampler::Sampler};

/// A light to be sampled.
pub(super) struct LightChoice {
    pub id: LightId,
    /// Expected number of samples of this light at this vertex.
    pub expected: f32,
    /// Where on it.
    pub u: Vec2,
}

impl<'a, const N: usize> Context<'a, N> {
    /// The lights sampled at the end of a camera subpath, from four dimensions of the sequence.
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
