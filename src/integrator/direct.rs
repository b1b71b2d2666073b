//! Next-event estimation: which lights are sampled, and where on them.
//!
//! Every vertex gets several samples, stratified over the lights and over the first
//! coordinate of each, its size: what differs most between them. The multi-sample model
//! \[Veach97\] 9.2.1 then counts a density as often as it is expected to be sampled.

use glam::Vec2;

use super::Integrator;
use crate::{
    light::{Light, LightId},
    sampler::Sampler,
    scene::Scene,
};

/// A light to be sampled.
pub(super) struct LightChoice {
    pub id: LightId,
    /// Expected number of samples of this light at this vertex.
    pub expected: f32,
    /// Where on it.
    pub u: Vec2,
}

impl Integrator {
    /// Without samples that would only repeat others: all samples of a point are one.
    pub(super) fn useful(&self, scene: &Scene) -> Self {
        let is_points = scene.lights.iter().all(Light::is_delta);
        let most = if is_points { scene.lights.len().max(1) as u32 } else { u32::MAX };
        Self {
            first_light_samples: self.first_light_samples.min(most),
            light_samples: self.light_samples.min(most),
            ..*self
        }
    }

    /// Light samples at the end of a camera subpath of `n_edges` edges, at least one.
    fn light_samples_at(&self, n_edges: usize) -> u32 {
        if n_edges == 1 { self.first_light_samples } else { self.light_samples }
    }

    /// As many light samples a camera subpath there are at the end of one of `n_edges` edges: the
    /// lens gets one with each light subpath.
    pub(super) fn samples_at(&self, n_edges: usize) -> f32 {
        match n_edges {
            0 => self.light_subpaths(),
            _ => self.light_samples_at(n_edges) as f32,
        }
    }

    /// Light subpaths for each camera subpath.
    pub(super) fn light_subpaths(&self) -> f32 {
        1.0 / self.camera_subpaths as f32
    }

    /// The lights sampled at the end of a camera subpath, from four dimensions of the sequence.
    pub(super) fn choose_lights<'a>(
        &self,
        scene: &'a Scene,
        sampler: &mut Sampler,
        n_edges: usize,
    ) -> impl Iterator<Item = LightChoice> + use<'a> {
        /// The plastic number's inverse: its multiples spread evenly.
        const STEP: f32 = 0.754_877_7;
        let (shift, along) = (sampler.next_1d(), sampler.next_1d());
        let _spare = sampler.next_2d();
        let n = self.light_samples_at(n_edges);
        (0..n).filter_map(move |i| {
            let (id, pmf, rest) = scene.light_sampler.sample((i as f32 + shift) / n as f32)?;
            let u = Vec2::new(rest, (along + i as f32 * STEP).fract());
            Some(LightChoice { id, expected: pmf.0 * n as f32, u })
        })
    }
}
