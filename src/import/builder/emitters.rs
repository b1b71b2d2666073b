//! Surfaces that emit, as mesh lights.

use std::{cell::OnceCell, collections::BTreeSet, sync::Arc};

use glam::Vec2;

use crate::{
    light::{EmissionProfile, EmissiveTriangle, MeshLight},
    math::Rgb,
    scene::{Material, Mesh, interaction},
};

impl EmissionProfile for Material {
    fn emission(&self, uv: Vec2) -> Rgb {
        self.emission_texture().map_or(Rgb::ONE, |t| t.sample(uv))
    }

    fn opacity(&self, uv: Vec2) -> f32 {
        Self::opacity(self, uv)
    }
}

/// The scene's surfaces, and which of their materials no light of the sidecar stands for.
pub struct Emitters<'a> {
    mesh: &'a Mesh,
    materials: &'a [Material],
    unclaimed: BTreeSet<usize>,
    /// Triangles of each material, listed when they are first asked for.
    triangles: OnceCell<Vec<Vec<usize>>>,
}

impl<'a> Emitters<'a> {
    /// The surfaces of a scene, all materials unclaimed.
    pub fn new(mesh: &'a Mesh, materials: &'a [Material]) -> Self {
        Self { mesh, materials, unclaimed: (0..materials.len()).collect(), triangles: OnceCell::new() }
    }

    /// The scene's materials.
    pub fn materials(&self) -> &'a [Material] {
        self.materials
    }

    /// Claims a material for a light of the sidecar; `false` if another light has it already.
    pub fn claim(&mut self, material: usize) -> bool {
        self.unclaimed.remove(&material)
    }

    /// Materials that emit and that no light has claimed, in their order.
    pub fn unclaimed(&self) -> impl Iterator<Item = usize> {
        self.unclaimed.iter().copied().filter(|&m| self.materials[m].is_emissive())
    }

    /// The light of all triangles of a material; `None` without any that can emit.
    pub fn mesh_light(&self, material: usize) -> Option<MeshLight> {
        let surface = &self.materials[material];
        let varies = surface.emission_texture().is_some() || surface.is_translucent();
        let profile = varies.then(|| Arc::new(surface.clone()) as Arc<dyn EmissionProfile>);
        MeshLight::new(self.triangles_of(material), profile, surface.emits_from_both_sides())
    }

    fn triangles_of(&self, material: usize) -> Vec<EmissiveTriangle> {
        let mesh = self.mesh;
        let lists = self.triangles.get_or_init(|| {
            let mut lists = vec![Vec::new(); self.materials.len()];
            for (prim, &m) in mesh.materials.iter().enumerate() {
                lists[m as usize].push(prim);
            }
            lists
        });
        let emissive = |prim: usize| EmissiveTriangle {
            prim: prim as u32,
            corners: mesh.corners(prim),
            uvs: mesh.indices[prim].map(|i| mesh.uvs[i as usize]),
            clearance: interaction::clearance_of(mesh.corners(prim)),
        };
        lists[material].iter().copied().map(emissive).collect()
    }
}
