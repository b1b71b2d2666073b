//! What all paths of a render share.

use glam::{UVec2, Vec2, Vec3};

use super::{Integrator, Values, View};
use crate::{
    bsdf::Affine,
    camera::Camera,
    light::{Crossing, Light, LightId, LightLeSample, LightLiSample, LightPoint, SizeDensity},
    lighting::{SampleCounts, SamplingPlan},
    math::{AreaPdf, NodeRgb, Pmf, SolidAnglePdf},
    sampler::Sampler,
    scene::{Edge, Scene, SurfaceInteraction},
};

/// A scene, a camera and a sampling plan with the options of the integrator that walks through
/// them: everything that the samples of a render have in common.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a, const N: usize = 1> {
    /// Options.
    pub integrator: Integrator,
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: &'a Camera,
    /// Background values at which light is carried.
    pub values: Values<N>,
    /// Where samples go.
    pub plan: &'a SamplingPlan,
    /// Numbers of samples, without those that would only repeat others.
    counts: SampleCounts,
}

impl<'a, const N: usize> Context<'a, N> {
    /// A render of `view` at some values of the background, sampled by `plan`.
    #[must_use]
    pub fn new(integrator: Integrator, view: View<'a>, values: Values<N>, plan: &'a SamplingPlan) -> Self {
        let View { scene, camera } = view;
        Self { integrator, scene, camera, values, plan, counts: without_repeats(plan.counts, scene) }
    }

    /// Origin and direction of the ray of a sample of `pixel`: a point of the lens, and toward what
    /// it sees at a point of the pixel.
    #[inline]
    pub(super) fn camera_ray(&self, sampler: &mut Sampler, pixel: UVec2) -> (Vec3, Vec3) {
        let raster = film_position(pixel, sampler.next_2d());
        self.camera.ray(raster, sampler.next_2d())
    }

    /// The light of an index.
    #[inline]
    pub fn light(&self, id: LightId) -> SampledLight<'a> {
        SampledLight {
            light: &self.scene.lights[id as usize],
            q: &self.plan.sizes[id as usize],
            pmf: self.plan.lights.pmf(id),
        }
    }

    /// Follows a ray to what ends it; see [`Scene::trace`].
    #[inline]
    pub(super) fn trace(&self, org: Vec3, dir: Vec3, origin: Option<LightId>) -> Edge<'a> {
        self.scene.trace(org, dir, origin, self.plan.largest_value)
    }

    /// Calls `f` for every light that an edge meets, the one at its end included.
    pub(super) fn for_each_crossing(&self, edge: &Edge, f: impl FnMut(LightId, &Light, &Crossing)) {
        self.scene.for_each_crossing(edge, &self.plan.sizes, f);
    }

    /// Throughput after a scattering at `si`.
    #[inline]
    pub(super) fn scatter(&self, beta: &NodeRgb<N>, f: Affine, si: &SurfaceInteraction) -> NodeRgb<N> {
        if si.is_background {
            beta.times_affine(f.coat, f.body, &self.values.0)
        } else {
            beta.times(f.at(1.0))
        }
    }

    /// Light samples at the end of a camera subpath of `n_edges` edges, at least one.
    pub(super) fn light_samples_at(&self, n_edges: usize) -> u32 {
        if n_edges == 1 { self.counts.first_light_samples } else { self.counts.light_samples }
    }

    /// Expected number of light samples per camera subpath at the end of one of `n_edges` edges;
    /// the lens, at 0 edges, gets one with each light subpath.
    pub fn samples_at(&self, n_edges: usize) -> f32 {
        match n_edges {
            0 => self.light_subpaths(),
            _ => self.light_samples_at(n_edges) as f32,
        }
    }

    /// Camera subpaths for each light subpath.
    pub(super) fn camera_subpaths(&self) -> u32 {
        self.counts.camera_subpaths
    }

    /// Light subpaths for each camera subpath.
    pub fn light_subpaths(&self) -> f32 {
        1.0 / self.counts.camera_subpaths as f32
    }
}

/// Raster position of a sample: uniform over the pixel.
fn film_position(pixel: UVec2, u: Vec2) -> Vec2 {
    // Rounding must not push a sample of one pixel into the next.
    (pixel.as_vec2() + u).min((pixel + UVec2::ONE).as_vec2() * crate::math::ONE_MINUS_EPSILON)
}

/// The counts without samples that would only repeat others: all samples of a point are one.
fn without_repeats(counts: SampleCounts, scene: &Scene) -> SampleCounts {
    let is_points = scene.lights.iter().all(Light::is_delta);
    let most = if is_points { scene.lights.len().max(1) as u32 } else { u32::MAX };
    SampleCounts {
        first_light_samples: counts.first_light_samples.min(most),
        light_samples: counts.light_samples.min(most),
        ..counts
    }
}

/// A light with its place in the sampling plan.
#[derive(Clone, Copy, Debug)]
pub struct SampledLight<'a> {
    /// The light.
    pub light: &'a Light,
    /// Distribution of its size coordinate.
    q: &'a SizeDensity,
    /// Probability of choosing it.
    pub pmf: Pmf,
}

impl SampledLight<'_> {
    /// See [`Light::sample_li`].
    #[inline]
    pub fn sample_li(&self, reference: Vec3, u: Vec2) -> Option<LightLiSample> {
        self.light.sample_li(self.q, reference, u)
    }

    /// See [`Light::pdf_li`].
    #[inline]
    pub fn pdf_li(&self, reference: Vec3, at: &LightPoint) -> SolidAnglePdf {
        self.light.pdf_li(self.q, reference, at)
    }

    /// See [`Light::sample_le`].
    #[inline]
    pub fn sample_le(&self, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        self.light.sample_le(self.q, u_pos, u_dir)
    }

    /// See [`Light::pdf_le`].
    #[inline]
    pub fn pdf_le(&self, at: &LightPoint, dir: Vec3) -> (AreaPdf, SolidAnglePdf) {
        self.light.pdf_le(self.q, at, dir)
    }
}
