//! The scene: geometry, materials, lights and camera, with the ray queries of integrators.
//!
//! A [`Scene`] does not change once it is loaded. What a picture varies, radiances, sizes and the
//! background's value, is a [`Lighting`](crate::lighting::Lighting) beside it.

pub mod interaction;
mod lean;
pub mod material;
pub mod mesh;
pub mod relief;
pub mod texture;
mod visibility;

use glam::{DVec3, Vec2, Vec3};

use crate::{
    camera::Camera,
    embree::{Accel, EmbreeError, Hit, Ray, TriangleMesh},
    light::{Crossing, Light, LightId, Shape, SizeDensity},
    math::{
        Frame, Rgb,
        hash::{hash_bytes, hash_words},
    },
};

pub use interaction::{ScatterSample, SurfaceInteraction};
pub use material::Material;
pub use mesh::Mesh;

/// Partly transparent surfaces that a ray passes, at most. It only ends rays that a stack of cut-outs
/// traps: after 1024 layers of opacity 0.05 a share of 10⁻²³ of the light is left.
const MAX_LAYERS: u32 = 1024;

/// A uniform variate in (0, 1] that is a hash of the ray and the triangle: the same ray always
/// passes the same triangles.
fn uniform(org: Vec3, dir: Vec3, prim: u32) -> f32 {
    let word = |a: f32, b: f32| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
    let h = hash_words(&[word(org.x, org.y), word(org.z, dir.x), word(dir.y, dir.z), u64::from(prim)]);
    ((h >> 40) as f32 + 1.0) / (1 << 24) as f32
}

/// Gives lights at infinity their surroundings; returns the mesh light that the triangles of each material
/// belong to.
fn furnish(lights: &mut [Light], mesh: &Mesh, n_materials: usize, camera: Vec3) -> Vec<Option<LightId>> {
    let surroundings = mesh.surroundings(camera);
    let mut emitters = vec![None; n_materials];
    for (i, light) in lights.iter_mut().enumerate() {
        light.surround(surroundings);
        if let Shape::Mesh(shape) = &light.shape {
            for prim in shape.prims() {
                emitters[mesh.materials[prim as usize] as usize] = Some(i as LightId);
            }
        }
    }
    emitters
}

/// A scene ready to render.
#[derive(Debug)]
pub struct Scene {
    /// Name of the scene file without ending, which names run directories.
    pub name: String,
    accel: Accel,
    /// Triangles, in world space.
    pub mesh: Mesh,
    /// Materials, indexed by [`Mesh::materials`].
    pub materials: Vec<Material>,
    /// Lights, indexed by [`LightId`].
    pub lights: Vec<Light>,
    /// Camera that the scene's author gave.
    pub camera: Camera,
    /// Factor on luminance before display encoding that the scene's author gave.
    pub exposure: f32,
    /// Place of the scene's origin in the coordinates of its file, metres: not zero where these are too far
    /// from theirs for `f32`.
    pub origin: DVec3,
    /// Whether each triangle belongs to the main object.
    pub is_main: Vec<bool>,
    /// Indices of the materials whose base colour the background's value scales.
    background: Vec<usize>,
    /// Mesh light that the triangles of each material belong to.
    emitters: Vec<Option<LightId>>,
    /// Whether the background's value scales the base colour of each material.
    is_background: Vec<bool>,
    /// Whether a ray may pass straight through some material.
    is_translucent: bool,
    /// Number of lights whose bodies block rays.
    n_occluders: usize,
    /// Height above each light at which a ray starts clear of the surfaces that the light lies on, metres.
    light_clearances: Vec<f32>,
    /// Middle of each light and radius of a ball about it that no triangle enters, metres, for a panel of a
    /// half-ball before it; `None` where there is no such middle.
    light_rooms: Vec<Option<(Vec3, f32)>>,
}

/// An edge of a path: a ray up to the surface or light that blocks it, or to infinity.
#[derive(Clone, Copy, Debug)]
pub struct Edge<'a> {
    /// Origin, metres.
    pub org: Vec3,
    /// Unit direction.
    pub dir: Vec3,
    /// Surface at the end; `None` if a light blocks the ray, or nothing does, or if rounding has put the
    /// point behind another surface.
    pub hit: Option<SurfaceHit<'a>>,
    /// Length, metres; infinite when nothing blocks the ray.
    pub t_max: f32,
    /// Light whose body blocks the ray.
    blocked_by: Option<LightId>,
}

/// Intersection of a ray with a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit<'a> {
    /// Distance from the ray's origin, metres.
    pub t: f32,
    /// Texture coordinates, v up.
    pub uv: Vec2,
    /// Index of the material.
    pub material: u32,
    /// Point, normals and BSDF.
    pub si: SurfaceInteraction<'a>,
}

impl Scene {
    /// A scene of triangles, materials and lights; everything is the main
    /// object, nothing the background, the exposure is 1.
    ///
    /// # Errors
    /// When an index of a triangle is out of range, or a coordinate not finite or too large for Embree.
    pub fn new(
        name: &str,
        mesh: Mesh,
        materials: Vec<Material>,
        lights: Vec<Light>,
        camera: Camera,
    ) -> Result<Self, EmbreeError> {
        let accel = Accel::build(&[TriangleMesh { positions: &mesh.positions, indices: &mesh.indices }])?;
        let scene = Self {
            emitters: Vec::new(),
            is_background: vec![false; materials.len()],
            is_translucent: materials.iter().any(Material::is_translucent),
            n_occluders: 0,
            light_clearances: Vec::new(),
            light_rooms: Vec::new(),
            name: name.to_owned(),
            accel,
            is_main: vec![true; mesh.indices.len()],
            mesh,
            materials,
            lights: Vec::new(),
            camera,
            exposure: 1.0,
            origin: DVec3::ZERO,
            background: Vec::new(),
        };
        Ok(scene.with_lights(lights))
    }

    /// The scene with other lights in the place of its own. Lights that are meshes are parts of its triangles.
    #[must_use]
    pub fn with_lights(mut self, mut lights: Vec<Light>) -> Self {
        self.emitters = furnish(&mut lights, &self.mesh, self.materials.len(), self.camera.position);
        self.n_occluders = lights.iter().filter(|l| l.occludes).count();
        self.light_clearances = lights.iter().map(|l| visibility::clearance_over(l, &self.mesh)).collect();
        let room = |(l, &clearance)| visibility::room_about(l, clearance, &self.mesh);
        self.light_rooms = lights.iter().zip(&self.light_clearances).map(room).collect();
        self.lights = lights;
        self
    }

    /// The scene with many lights more, behind its own, that do not block rays, are no meshes, and are known to
    /// be clear of every surface: no time is spent on finding how clear, and rays to them are traced from both
    /// ends.
    #[must_use]
    pub fn with_clear_lights(mut self, lights: Vec<Light>) -> Self {
        self.light_clearances.resize(self.lights.len() + lights.len(), 0.0);
        self.light_rooms.resize(self.lights.len() + lights.len(), None);
        self.lights.extend(lights);
        self
    }

    /// The scene with the materials of these indices as its background: the background's value scales
    /// their base colours.
    #[must_use]
    pub fn with_background(mut self, materials: Vec<usize>) -> Self {
        self.is_background.fill(false);
        materials.iter().for_each(|&m| self.is_background[m] = true);
        self.background = materials;
        self
    }

    /// Hash of what decides how light is transported: geometry, materials, and the lights' shapes and
    /// places. What a lighting, a camera or a sampling plan says is left out.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let m = &self.mesh;
        let vectors = m.positions.iter().chain(&m.normals).flat_map(|v| v.to_array());
        let uvs = m.uvs.iter().flat_map(|v| v.to_array());
        let tangents = m.tangents.iter().flat_map(|v| v.to_array());
        let floats = vectors.chain(uvs).chain(tangents).flat_map(f32::to_le_bytes);
        let indices = m.indices.iter().flatten().chain(&m.materials).flat_map(|i| i.to_le_bytes());
        let lights: Vec<Light> = self.lights.iter().map(|l| Light { radiance: 1.0, ..l.clone() }).collect();
        let words = format!("{:?} {lights:?} {:?}", self.materials, self.background);
        hash_words(&[hash_bytes(floats), hash_bytes(indices), hash_bytes(words.into_bytes().into_iter())])
    }

    /// First surface along a ray with unit direction that is at least half opaque.
    #[must_use]
    pub fn intersect(&self, org: Vec3, dir: Vec3) -> Option<SurfaceHit<'_>> {
        self.first_surface(org, dir, 1.0, |opacity, _| opacity >= 0.5)
    }

    /// Traces a ray with unit direction to the first surface or light that blocks it. A partly
    /// transparent surface does so with its opacity as probability; the light that the ray starts on
    /// (`origin`) never does. `sampling_value` is the background's value for which the surface's lobes
    /// are chosen.
    #[must_use]
    pub fn trace(&self, org: Vec3, dir: Vec3, origin: Option<LightId>, sampling_value: f32) -> Edge<'_> {
        let hit =
            self.first_surface(org, dir, sampling_value, |opacity, prim| opacity >= uniform(org, dir, prim));
        let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
        if let Some((light, t)) = self.first_occluder(org, dir, t_max, origin) {
            return Edge { org, dir, hit: None, t_max: t, blocked_by: Some(light) };
        }
        Edge { org, dir, hit: hit.and_then(|hit| self.settle(org, dir, hit)), t_max, blocked_by: None }
    }

    /// The first surface that is opaque, or that `accept` takes by its opacity and its triangle.
    fn first_surface(
        &self,
        org: Vec3,
        dir: Vec3,
        sampling_value: f32,
        accept: impl Fn(f32, u32) -> bool,
    ) -> Option<SurfaceHit<'_>> {
        let (mut from, mut passed) = (org, 0.0);
        for _ in 0..MAX_LAYERS {
            let hit = self.accel.intersect(&Ray { org: from, dir, t_min: 0.0, t_max: f32::INFINITY })?;
            let hit = SurfaceHit { t: passed + hit.t, ..self.surface(&hit, dir, sampling_value) };
            let material = &self.materials[hit.material as usize];
            if !self.may_pass(hit.si.triangle) || accept(material.opacity(hit.uv), hit.si.triangle) {
                return Some(hit);
            }
            from = hit.si.spawn_origin(dir);
            passed = (from - org).dot(dir);
        }
        None
    }

    /// Whether a ray may pass straight through a triangle.
    fn may_pass(&self, triangle: u32) -> bool {
        let material = self.mesh.materials[triangle as usize] as usize;
        self.is_translucent && self.materials[material].is_translucent()
    }

    /// The first light but `except` whose body blocks a ray before `t_max`, and the distance, metres.
    fn first_occluder(
        &self,
        org: Vec3,
        dir: Vec3,
        t_max: f32,
        except: Option<LightId>,
    ) -> Option<(LightId, f32)> {
        if self.n_occluders == 0 {
            return None;
        }
        let mut first = None;
        let mut t_max = t_max;
        for (i, light) in self.lights.iter().enumerate() {
            if let Some(t) = light.stop(org, dir, t_max).filter(|_| except != Some(i as LightId)) {
                t_max = t;
                first = Some((i as LightId, t));
            }
        }
        first
    }

    fn surface(&self, hit: &Hit, dir: Vec3, sampling_value: f32) -> SurfaceHit<'_> {
        let triangle = hit.prim as usize;
        let [i, j, k] = self.mesh.indices[triangle].map(|i| i as usize);
        let (u, v) = (hit.u, hit.v);
        let w = 1.0 - u - v;
        let (p, ng, clearance) = interaction::point_of(self.mesh.corners(triangle), u, v);
        let ng = ng.unwrap_or(-dir);
        let ns = (self.mesh.normals[i] * w + self.mesh.normals[j] * u + self.mesh.normals[k] * v)
            .try_normalize()
            .unwrap_or(ng);
        let ng = if ng.dot(ns) < 0.0 { -ng } else { ng };
        let uv: Vec2 = self.mesh.uvs[i] * w + self.mesh.uvs[j] * u + self.mesh.uvs[k] * v;
        let material = self.mesh.materials[triangle];
        let surface = &self.materials[material as usize];
        let is_background = self.is_background[material as usize];
        let bsdf = surface.bsdf(uv, if is_background { sampling_value } else { 1.0 });
        let tilted = surface.relief().map(|r| {
            let at = relief::Place { triangle, weights: Vec3::new(w, u, v), uv };
            relief::tilt(r, &self.mesh, &at, ns)
        });
        let si = SurfaceInteraction {
            p,
            clearance,
            ng,
            frame: Frame::from_normal(tilted.unwrap_or(ns)),
            untilted: tilted.map(|_| ns),
            bsdf,
            triangle: hit.prim,
            is_background,
        };
        SurfaceHit { t: hit.t, uv, material, si }
    }

    /// The triangles as rays meet them.
    #[must_use]
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// The triangles as rays meet them, to have the rays recorded.
    pub fn accel_mut(&mut self) -> &mut Accel {
        &mut self.accel
    }

    /// Base colour of a surface, linear Rec.709, at a value of the background.
    #[must_use]
    pub fn base_color(&self, hit: &SurfaceHit, value: f32) -> Rgb {
        let material = hit.material as usize;
        self.materials[material].color(hit.uv) * self.value_of(material, value)
    }

    /// Factor on a material's base colour at a value of the background.
    #[must_use]
    pub fn value_of(&self, material: usize, value: f32) -> f32 {
        if self.is_background[material] { value } else { 1.0 }
    }

    /// Calls `f` for every light that an edge crosses, the one at its end included; `sizes` gives the
    /// extent of each light.
    pub fn for_each_crossing(
        &self,
        edge: &Edge,
        sizes: &[SizeDensity],
        mut f: impl FnMut(LightId, &Light, &Crossing),
    ) {
        for ((i, light), q) in self.lights.iter().enumerate().zip(sizes) {
            let i = i as LightId;
            // Few edges meet a panel, whose limit takes some work.
            let is_panel = matches!(light.shape, Shape::Planar(_));
            let t_max = if is_panel { f32::INFINITY } else { self.crossing_limit(edge, i) };
            let Some(c) = light.crossing(edge.org, edge.dir, t_max, q.extent()) else { continue };
            if !is_panel || c.t < self.crossing_limit(edge, i) {
                f(i, light, &c);
            }
        }
        let Some(hit) = edge.hit else { return };
        if let Some(i) = self.emitters[hit.material as usize] {
            let light = &self.lights[i as usize];
            let SurfaceInteraction { triangle, p, .. } = hit.si;
            if let Some(c) = light.surface_crossing(triangle, p, hit.uv, edge.dir, hit.t) {
                f(i, light, &c);
            }
        }
    }

    /// Names of the lights, in their order.
    #[must_use]
    pub fn light_names(&self) -> Vec<&str> {
        self.lights.iter().map(|l| l.name.as_str()).collect()
    }

    /// Materials whose base colour the background's value scales.
    #[must_use]
    pub fn background(&self) -> &[usize] {
        &self.background
    }

    /// Largest channel that the base colour of a background material takes at value 1.
    #[must_use]
    pub fn background_albedo(&self) -> f32 {
        self.background.iter().map(|&m| self.materials[m].max_albedo()).fold(0.0, f32::max)
    }
}
