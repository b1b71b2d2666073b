//! The scene: geometry, materials, lights, camera, and the questions an
//! integrator asks of them.

pub mod builder;
mod find;
pub mod gltf;
pub mod imported;
pub mod interaction;
pub mod material;
pub mod mesh;
pub mod obj;
pub mod sidecar;
pub mod texture;
pub mod wavefront;

use glam::{Vec2, Vec3};

use crate::{
    camera::Camera,
    embree::{Accel, EmbreeError, Ray, TriangleMesh},
    light::{Crossing, Light, LightId, LightSampler},
    math::Frame,
};

pub use builder::{SceneError, load};
pub use interaction::{ScatterSample, SurfaceInteraction, offset_origin};
pub use material::Material;
pub use mesh::Mesh;

/// Fraction of a connection's length that its shadow ray covers: the rest is
/// where the far surface begins.
const SHADOW_LENGTH: f32 = 1.0 - 1e-4;

/// A scene ready to render.
#[derive(Debug)]
pub struct Scene {
    /// Name, for run directories.
    pub name: String,
    accel: Accel,
    /// Triangles.
    pub mesh: Mesh,
    /// Names of what triangles belong to, by [`Mesh::objects`].
    pub parts: Vec<wavefront::Part>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Bounds that the sidecar sets on the lights' variables.
    pub light_bounds: Vec<builder::LightBounds>,
    /// Chooses lights.
    pub light_sampler: LightSampler,
    /// Camera.
    pub camera: Camera,
    /// Factor on luminance before display encoding.
    pub exposure: f32,
    /// Whether a triangle belongs to the main object.
    pub is_main: Vec<bool>,
    /// Materials whose base colour the background value scales.
    pub background: Vec<usize>,
    /// Bounds that the sidecar sets on the background's value.
    pub value_range: Option<[f32; 2]>,
    /// What is free, from the sidecar.
    pub free: sidecar::FreeVariables,
    /// Facts found while loading that a user should hear of.
    pub warnings: Vec<String>,
}

/// A ray's first surface and how far it is.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit<'a> {
    /// Ray parameter.
    pub t: f32,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Index of the material.
    pub material: u32,
    /// The surface.
    pub si: SurfaceInteraction<'a>,
}

impl Scene {
    /// A scene of triangles, materials and lights; everything is the main
    /// object, nothing the background, exposure 1, all lights alike likely.
    ///
    /// # Errors
    /// When the triangles are broken.
    pub fn new(
        name: &str,
        mesh: Mesh,
        materials: Vec<Material>,
        lights: Vec<Light>,
        camera: Camera,
    ) -> Result<Self, EmbreeError> {
        let accel = Accel::build(&[TriangleMesh { positions: &mesh.positions, indices: &mesh.indices }])?;
        Ok(Self {
            name: name.to_owned(),
            accel,
            is_main: vec![true; mesh.indices.len()],
            mesh,
            parts: Vec::new(),
            materials,
            light_bounds: vec![builder::LightBounds::default(); lights.len()],
            light_sampler: LightSampler::new(&vec![1.0; lights.len()]),
            lights,
            camera,
            exposure: 1.0,
            background: Vec::new(),
            value_range: None,
            free: sidecar::FreeVariables::default(),
            warnings: Vec::new(),
        })
    }

    /// First surface along a ray with unit direction.
    #[must_use]
    pub fn intersect(&self, org: Vec3, dir: Vec3) -> Option<SurfaceHit<'_>> {
        let hit = self.accel.intersect(&Ray { org, dir, t_min: 0.0, t_max: f32::INFINITY })?;
        let triangle = hit.prim as usize;
        let [i, j, k] = self.mesh.indices[triangle].map(|i| i as usize);
        let [a, b, c] = [self.mesh.positions[i], self.mesh.positions[j], self.mesh.positions[k]];
        let (u, v) = (hit.u, hit.v);
        let w = 1.0 - u - v;
        let p = a * w + b * u + c * v;
        let ng = mesh::face_normal([a, b, c]).normalize_or(-dir);
        let ns = (self.mesh.normals[i] * w + self.mesh.normals[j] * u + self.mesh.normals[k] * v)
            .try_normalize()
            .unwrap_or(ng);
        let ng = if ng.dot(ns) < 0.0 { -ng } else { ng };
        let uv: Vec2 = self.mesh.uvs[i] * w + self.mesh.uvs[j] * u + self.mesh.uvs[k] * v;
        let material = self.mesh.materials[triangle];
        let bsdf = self.materials[material as usize].bsdf(uv);
        let si = SurfaceInteraction {
            p,
            p_error: interaction::rounding_of([a, b, c]),
            ng,
            frame: Frame::from_normal(ns),
            bsdf,
            triangle: hit.prim,
        };
        Some(SurfaceHit { t: hit.t, uv, material, si })
    }

    /// Base colour of the surface hit, background value included.
    #[must_use]
    pub fn base_color(&self, hit: &SurfaceHit) -> crate::math::Rgb {
        self.materials[hit.material as usize].color(hit.uv)
    }

    /// Whether the open segment from `from` to `to` meets no surface. Both
    /// ends must already be clear of their own surfaces.
    #[must_use]
    pub fn unoccluded(&self, from: Vec3, to: Vec3) -> bool {
        !self.accel.occluded(&Ray { org: from, dir: to - from, t_min: 0.0, t_max: SHADOW_LENGTH })
    }

    /// Calls `f` for every light that the ray crosses before `t_max`.
    pub fn for_each_crossing(
        &self,
        org: Vec3,
        dir: Vec3,
        t_max: f32,
        mut f: impl FnMut(LightId, &Light, &Crossing),
    ) {
        for (i, light) in self.lights.iter().enumerate() {
            if let Some(c) = light.crossing(org, dir, t_max) {
                f(i as LightId, light, &c);
            }
        }
    }

    /// Sets the background's value factor; `largest` is the most it will be.
    pub fn set_background_value(&mut self, value: f32, largest: f32) {
        for &m in &self.background {
            self.materials[m].set_value(value, largest);
        }
    }

    /// Sets a light's radiance and present size, sampled at that size.
    pub fn set_light(&mut self, light: usize, radiance: f32, size: f32) {
        let l = &mut self.lights[light];
        l.radiance = radiance;
        l.size = size;
        l.size_density = crate::light::SizeDensity::UniformArea { extent: size };
    }
}
