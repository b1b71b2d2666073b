//! Scene, camera and sampling plan as all paths of a render see them.

use glam::{UVec2, Vec2, Vec3};

use super::{Integrator, Values, View, roulette::roulette};
use crate::{
    bsdf::Affine,
    camera::Camera,
    light::{Crossing, Light, LightId, LightLeSample, LightLiSample, LightPoint, SizeDensity},
    lighting::{SampleCounts, SamplingPlan},
    math::{AreaPdf, NodeRgb, Pmf, Rgb, SolidAnglePdf},
    sampler::Sampler,
    scene::{Edge, Scene, SurfaceInteraction},
};

/// Everything that the samples of a render have in common: scene, camera, sampling plan and the options
/// of the integrator.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a, const N: usize = 1> {
    /// Integrator with its options.
    pub integrator: Integrator,
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: &'a Camera,
    /// Values of the background at which light is carried.
    pub values: Values<N>,
    /// Sampling plan.
    pub plan: &'a SamplingPlan,
    /// Numbers of samples of the plan, without those that would only repeat others.
    counts: SampleCounts,
}

impl<'a, const N: usize> Context<'a, N> {
    /// Context of a render of `view` at some values of the background, sampled by `plan`.
    #[must_use]
    pub fn new(integrator: Integrator, view: View<'a>, values: Values<N>, plan: &'a SamplingPlan) -> Self {
        let View { scene, camera } = view;
        Self { integrator, scene, camera, values, plan, counts: without_repeats(plan.counts, scene) }
    }

    /// Origin and unit direction of a camera ray through a random point of `pixel` and of the lens.
    #[inline]
    pub(super) fn camera_ray(&self, sampler: &mut Sampler, pixel: UVec2) -> (Vec3, Vec3) {
        let raster = film_position(pixel, sampler.next_2d());
        self.camera.ray(raster, sampler.next_2d())
    }

    /// The light `id` with its place in the sampling plan.
    #[inline]
    #[must_use]
    pub fn light(&self, id: LightId) -> SampledLight<'a> {
        SampledLight {
            light: &self.scene.lights[id as usize],
            q: &self.plan.sizes[id as usize],
            pmf: self.plan.lights.pmf(id),
        }
    }

    /// Follows a ray to the surface or light that ends it; see [`Scene::trace`].
    #[inline]
    pub(super) fn trace(&self, org: Vec3, dir: Vec3, origin: Option<LightId>) -> Edge<'a> {
        self.scene.trace(org, dir, origin, self.plan.largest_value)
    }

    /// Calls `f` for every light that an edge meets, the one at its end included.
    pub(super) fn for_each_crossing(&self, edge: &Edge, f: impl FnMut(LightId, &Light, &Crossing)) {
        self.scene.for_each_crossing(edge, &self.plan.sizes, f);
    }

    /// Throughput after scattering at `si` with the scattering function `f`, cosine included.
    #[inline]
    pub(super) fn scatter(&self, beta: &NodeRgb<N>, f: Affine, si: &SurfaceInteraction) -> NodeRgb<N> {
        if si.is_background {
            beta.times_affine(f.coat, f.body, &self.values.0)
        } else {
            beta.times(f.at(1.0))
        }
    }

    /// Number of light samples at the end of a camera subpath of `n_edges` edges, at least 1.
    pub(super) fn light_samples_at(&self, n_edges: usize) -> u32 {
        if n_edges == 1 { self.counts.first_light_samples } else { self.counts.light_samples }
    }

    /// Expected number of light samples at the end of a camera subpath of `n_edges` edges; at 0 edges,
    /// on the lens, there is one for each light subpath.
    #[must_use]
    pub fn samples_at(&self, n_edges: usize) -> f32 {
        match n_edges {
            0 => self.light_subpaths(),
            _ => self.light_samples_at(n_edges) as f32,
        }
    }

    /// Russian roulette after `n_edges` edges of a subpath, where it has begun: the factor on the throughput of a
    /// subpath that survives, or `None`.
    #[inline]
    pub(super) fn roulette(&self, n_edges: usize, throughput: Rgb, u: f32) -> Option<f32> {
        if n_edges < self.counts.first_roulette as usize { Some(1.0) } else { roulette(throughput, u) }
    }

    /// Number of camera subpaths for each light subpath.
    pub(super) fn camera_subpaths(&self) -> u32 {
        self.counts.camera_subpaths
    }

    /// Expected number of light subpaths for each camera subpath.
    #[must_use]
    pub fn light_subpaths(&self) -> f32 {
        1.0 / self.counts.camera_subpaths as f32
    }
}

/// Raster position of a sample of `pixel`, uniform over it.
fn film_position(pixel: UVec2, u: Vec2) -> Vec2 {
    // Rounding must not push a sample of one pixel into the next.
    (pixel.as_vec2() + u).min((pixel + UVec2::ONE).as_vec2() * crate::math::ONE_MINUS_EPSILON)
}

/// Numbers of samples without those that would only repeat others: all samples of a point light are
/// the same.
fn without_repeats(counts: SampleCounts, scene: &Scene) -> SampleCounts {
    let is_points = scene.lights.iter().all(Light::is_delta);
    let most = if is_points { scene.lights.len().max(1) as u32 } else { u32::MAX };
    SampleCounts {
        first_light_samples: counts.first_light_samples.min(most),
        light_samples: counts.light_samples.min(most),
        ..counts
    }
}

/// A light with its density and probability in a sampling plan.
#[derive(Clone, Copy, Debug)]
pub struct SampledLight<'a> {
    /// The light.
    pub light: &'a Light,
    /// Density of the light's size coordinate.
    q: &'a SizeDensity,
    /// Probability with which the light is chosen.
    pub pmf: Pmf,
}

impl SampledLight<'_> {
    /// [`Light::sample_li`] with the plan's density.
    #[inline]
    #[must_use]
    pub fn sample_li(&self, reference: Vec3, u: Vec2) -> Option<LightLiSample> {
        self.light.sample_li(self.q, reference, u)
    }

    /// [`Light::pdf_li`] with the plan's density.
    #[inline]
    #[must_use]
    pub fn pdf_li(&self, reference: Vec3, at: &LightPoint) -> SolidAnglePdf {
        self.light.pdf_li(self.q, reference, at)
    }

    /// [`Light::sample_le`] with the plan's density.
    #[inline]
    #[must_use]
    pub fn sample_le(&self, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        self.light.sample_le(self.q, u_pos, u_dir)
    }

    /// [`Light::pdf_le`] with the plan's density.
    #[inline]
    #[must_use]
    pub fn pdf_le(&self, at: &LightPoint, dir: Vec3) -> (AreaPdf, SolidAnglePdf) {
        self.light.pdf_le(self.q, at, dir)
    }
}
