//! glTF 2.0, `.gltf` and `.glb`, through `gltf-json`.
//!
//! What is read, and what of a material becomes what, is listed in `docs/formats.md`. All images of a
//! material lie as its first does (texture coordinates and `KHR_texture_transform`): a
//! [`Mesh`](crate::scene::Mesh) has one set of texture coordinates.
//!
//! # References
//! Khronos, *glTF 2.0 Specification*, and its registry of extensions.

mod animation;
mod camera;
mod empty;
mod file;
mod geometry;
mod light;
mod material;
mod nodes;
mod texture;

use std::{collections::HashMap, path::Path, sync::Arc};

use glam::{DVec3, Mat4};

use self::{
    camera::Cameras,
    file::File,
    geometry::{Geometry, Pose},
    nodes::SceneNode,
};
use super::{
    error::ImportError,
    imported::{Imported, ImportedLight, Part, UniqueNames},
    warnings::Warnings,
};
use crate::{
    files::reach::Reach,
    scene::texture::{self as scene_texture, Texture},
};

/// Reads a glTF with its buffers and images.
///
/// # Errors
/// When the file is not glTF 2.0, requires an extension that is not read, a buffer or image cannot be
/// read, a key is wrong, or there is no triangle. The error names the file, and the key where there is one.
pub fn load(path: &Path) -> Result<Imported, ImportError> {
    load_within(path, &Reach::anywhere())
}

/// As [`load`], reading no file out of `reach`.
///
/// # Errors
/// Every error of [`load`]; also when the glTF names a file out of reach.
pub fn load_within(path: &Path, reach: &Reach) -> Result<Imported, ImportError> {
    let mut file = File::read(path, reach)?;
    let mut warnings = Warnings::default();
    animation::pose(&mut file, &mut warnings);
    let mut nodes = nodes::scene_nodes(&file)?;
    let origin = nodes::center(&file, &mut nodes)?;
    let mut reader = Reader {
        worlds: nodes.iter().map(|n| (n.index, n.world)).collect(),
        file: &file,
        nodes: &nodes,
        geometry: Geometry::new(&file),
        parts: Vec::new(),
        part_ids: HashMap::new(),
        cameras: Cameras::default(),
        lights: Vec::new(),
        origin,
        light_names: UniqueNames::default(),
        warnings,
    };
    for (i, _) in nodes.iter().enumerate().filter(|(_, n)| n.is_visible) {
        reader.read_node(i)?;
    }
    reader.finish()
}

/// A scene while its nodes are read.
struct Reader<'a> {
    file: &'a File,
    nodes: &'a [SceneNode],
    /// World transformations of the scene's nodes by index in the file.
    worlds: HashMap<usize, Mat4>,
    geometry: Geometry<'a>,
    parts: Vec<Part>,
    part_ids: HashMap<Part, u32>,
    cameras: Cameras,
    lights: Vec<ImportedLight>,
    /// Place of the scene's origin in the file's coordinates.
    origin: DVec3,
    light_names: UniqueNames,
    warnings: Warnings,
}

impl Reader<'_> {
    /// Reads camera, light and mesh of the node at position `id` of the scene's nodes.
    fn read_node(&mut self, id: usize) -> Result<(), ImportError> {
        let file = self.file;
        let &SceneNode { index, world, .. } = &self.nodes[id];
        let node = &file.root.nodes[index];
        let key = format!("nodes[{index}]");
        self.cameras.read(file, &key, node, &world, &mut self.warnings)?;
        let light = light::read(file, &key, node, &world, &mut self.light_names, &mut self.warnings)?;
        self.lights.extend(light);
        let Some(mesh_index) = node.mesh else { return Ok(()) };
        let mesh = file.get(&format!("{key}.mesh"), mesh_index)?;
        let poses: Vec<Pose> = match node.skin {
            Some(skin) => vec![Pose::Skinned(nodes::joint_matrices(file, &key, skin, &self.worlds)?)],
            None => nodes::instances(file, &key, node)?.into_iter().map(|m| Pose::Rigid(world * m)).collect(),
        };
        let part = self.part_id(nodes::part(file, self.nodes, id, mesh.name.as_deref())?);
        let weights = node.weights.as_deref().or(mesh.weights.as_deref()).unwrap_or_default();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let key = format!("meshes[{}].primitives[{i}]", mesh_index.value());
            let primitive = self.geometry.read_primitive(&key, primitive, weights, &mut self.warnings)?;
            if let Some(primitive) = primitive {
                for pose in &poses {
                    self.geometry.place(&key, &primitive, pose, part)?;
                }
            }
        }
        Ok(())
    }

    fn part_id(&mut self, part: Part) -> u32 {
        if let Some(&id) = self.part_ids.get(&part) {
            return id;
        }
        let id = self.parts.len() as u32;
        self.parts.push(part.clone());
        self.part_ids.insert(part, id);
        id
    }

    fn finish(self) -> Result<Imported, ImportError> {
        let Geometry { mut materials, mut mesh, left_out, .. } = self.geometry;
        let mut warnings = self.warnings;
        let Cameras { list: cameras, unread: unread_cameras } = self.cameras;
        let path = &self.file.path;
        left_out.report(path, &mut warnings);
        let lost_lamps = empty::lost_lamps(self.file, self.nodes, self.origin);
        if mesh.indices.is_empty() {
            return Err(ImportError::NoTriangles { path: path.clone(), left_out });
        }
        materials.finish_glass(&mut mesh, &mut warnings);
        let in_use = materials.list.iter_mut().flat_map(|(_, p)| p.textures_mut());
        let mut textures: Vec<&mut Arc<Texture>> = in_use.collect();
        for warning in scene_texture::fit(&mut textures, scene_texture::TEXTURE_BUDGET) {
            warnings.add(warning);
        }
        Ok(Imported {
            mesh,
            origin: self.origin,
            parts: self.parts,
            materials: materials.list,
            lost_shaders: materials.lost,
            warnings: warnings.into_lines(),
            camera: cameras.first().map(|c| c.1),
            cameras,
            unread_cameras,
            lights: self.lights,
            lost_lamps,
            is_of_blender: self.file.is_of_blender(),
        })
    }
}
