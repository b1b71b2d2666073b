//! glTF 2.0, `.gltf` and `.glb`, through `gltf-json`.
//!
//! What is read, and what of a material becomes what, is listed in `docs/formats.md`. All images of a
//! material lie as its first does (texture coordinates and `KHR_texture_transform`): a
//! [`Mesh`] has one set of texture coordinates.
//!
//! # References
//! Khronos, *glTF 2.0 Specification*, and its registry of extensions.

mod file;
mod geometry;
mod material;

use std::{collections::HashMap, path::Path, sync::Arc};

use glam::{Mat4, Quat, Vec3};
use gltf_json::{
    Accessor, Index, Node, Skin, camera::Type, extensions::scene::khr_lights_punctual::Type as LightKind,
    validation::Checked,
};

use self::{file::File, geometry::Pose, material::Materials};
use super::{
    error::ImportError,
    imported::{Imported, ImportedCamera, ImportedLight, Part, Punctual},
};
use crate::{
    math::Rgb,
    scene::{
        Mesh,
        texture::{self, Texture},
    },
};

/// Luminous efficacy by which exporters turn watts into lumens.
const LUMENS_PER_WATT: f32 = 683.0;
/// Longest name of a light.
const MAX_NAME: usize = 180;

/// Facts that a user should hear of, each once.
#[derive(Debug, Default)]
struct Notes(Vec<String>);

impl Notes {
    fn add(&mut self, note: String) {
        if !self.0.contains(&note) {
            self.0.push(note);
        }
    }
}

/// `name`, or with a number behind it when it is among `taken`.
fn unique(name: String, taken: &[String]) -> String {
    let is_free = |n: &String| !taken.contains(n);
    if is_free(&name) {
        return name;
    }
    (2..).map(|i| format!("{name}_{i}")).find(is_free).unwrap_or(name)
}

/// Reads a glTF with its buffers and images.
///
/// # Errors
/// With the file, the key and what is wrong with it.
pub fn load(path: &Path) -> Result<Imported, ImportError> {
    let file = File::read(path)?;
    let nodes = tree(&file)?;
    let mut reader = Reader {
        worlds: nodes.iter().map(|n| (n.index, n.world)).collect(),
        file: &file,
        nodes: &nodes,
        materials: Materials::new(&file),
        mesh: Mesh::default(),
        parts: Vec::new(),
        part_ids: HashMap::new(),
        camera: None,
        cameras: Vec::new(),
        lights: Vec::new(),
        notes: Notes::default(),
        n_degenerate: 0,
    };
    for (i, _) in nodes.iter().enumerate().filter(|(_, n)| n.is_visible) {
        reader.node(i)?;
    }
    reader.finish()
}

/// A node of the scene.
struct Placed {
    index: usize,
    /// Position in the list of the node above.
    parent: Option<usize>,
    /// From the node's coordinates to the world's.
    world: Mat4,
    is_visible: bool,
}

/// The nodes of the default scene, every parent before its children.
fn tree(file: &File) -> Result<Vec<Placed>, ImportError> {
    let root = &file.root;
    let roots: Vec<Index<Node>> = match root.scene {
        Some(scene) => file.get("scene", scene)?.nodes.clone(),
        None => root.scenes.first().map(|s| s.nodes.clone()).unwrap_or_default(),
    };
    let mut out: Vec<Placed> = Vec::new();
    let mut is_met = vec![false; root.nodes.len()];
    let mut next: Vec<(Index<Node>, Option<usize>)> = roots.iter().rev().map(|&n| (n, None)).collect();
    while let Some((node, parent)) = next.pop() {
        let index = node.value();
        let key =
            parent.map_or_else(|| "scenes.nodes".into(), |p| format!("nodes[{}].children", out[p].index));
        let json = file.get(&key, node)?;
        if std::mem::replace(&mut is_met[index], true) {
            return Err(file.error(key, format!("node {index} stands in the tree twice")));
        }
        let (above, was_visible) =
            parent.map_or((Mat4::IDENTITY, true), |p| (out[p].world, out[p].is_visible));
        let world = above * local(json);
        if !world.is_finite() {
            return Err(file.error(format!("nodes[{index}]"), "its transformation must be finite"));
        }
        let visibility = json.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
        let is_hidden = visibility.is_some_and(|v| v["visible"].as_bool() == Some(false));
        let id = out.len();
        out.push(Placed { index, parent, world, is_visible: was_visible && !is_hidden });
        next.extend(json.children.iter().flatten().rev().map(|&child| (child, Some(id))));
    }
    Ok(out)
}

fn local(node: &Node) -> Mat4 {
    if let Some(m) = &node.matrix {
        return Mat4::from_cols_array(m);
    }
    Mat4::from_scale_rotation_translation(
        node.scale.map_or(Vec3::ONE, Vec3::from_array),
        node.rotation.map_or(Quat::IDENTITY, |q| rotation(q.0)),
        node.translation.map_or(Vec3::ZERO, Vec3::from_array),
    )
}

fn rotation(q: [f32; 4]) -> Quat {
    let q = Quat::from_array(q);
    if q.length_squared() > 0.0 { q.normalize() } else { Quat::IDENTITY }
}

/// A scene while it is read.
struct Reader<'a> {
    file: &'a File,
    nodes: &'a [Placed],
    /// To the world's coordinates, by number of the node.
    worlds: HashMap<usize, Mat4>,
    materials: Materials<'a>,
    mesh: Mesh,
    parts: Vec<Part>,
    part_ids: HashMap<Part, u32>,
    camera: Option<ImportedCamera>,
    /// Names of perspective cameras.
    cameras: Vec<String>,
    lights: Vec<ImportedLight>,
    notes: Notes,
    n_degenerate: usize,
}

impl Reader<'_> {
    fn node(&mut self, placed: usize) -> Result<(), ImportError> {
        let file = self.file;
        let &Placed { index, world, .. } = &self.nodes[placed];
        let node = &file.root.nodes[index];
        let key = format!("nodes[{index}]");
        if let Some(camera) = node.camera {
            self.read_camera(&key, node, camera, &world)?;
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            self.read_light(&key, node, light.light, &world)?;
        }
        let Some(mesh_index) = node.mesh else { return Ok(()) };
        let mesh = file.get(&format!("{key}.mesh"), mesh_index)?;
        let poses: Vec<Pose> = match node.skin {
            Some(skin) => vec![Pose::Skinned(self.joints(&key, skin)?)],
            None => self.instances(&key, node)?.into_iter().map(|m| Pose::Rigid(world * m)).collect(),
        };
        let part = self.part(placed, mesh.name.as_deref());
        let weights = node.weights.as_deref().or(mesh.weights.as_deref()).unwrap_or_default();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let key = format!("meshes[{}].primitives[{i}]", mesh_index.value());
            if let Some((shape, material)) = self.read_primitive(&key, primitive, weights)? {
                for pose in &poses {
                    self.place(&key, &shape, pose, material, part)?;
                }
            }
        }
        Ok(())
    }

    /// Number of the part that a node's triangles belong to.
    fn part(&mut self, placed: usize, mesh: Option<&str>) -> u32 {
        let mut names: Vec<String> = Vec::new();
        let mut at = Some(placed);
        while let Some(node) = at.map(|i| &self.nodes[i]) {
            names.extend(self.file.root.nodes[node.index].name.clone());
            at = node.parent;
        }
        names.extend(mesh.map(str::to_owned));
        names.retain(|n| !n.is_empty());
        let mut names = names.into_iter();
        let part = Part { object: names.next(), groups: names.collect() };
        if let Some(&id) = self.part_ids.get(&part) {
            return id;
        }
        let id = self.parts.len() as u32;
        self.parts.push(part.clone());
        self.part_ids.insert(part, id);
        id
    }

    /// Transformations of a skin's joints in the default pose; glTF 2.0 section 3.7.3.
    fn joints(&self, key: &str, skin: Index<Skin>) -> Result<Vec<Mat4>, ImportError> {
        let json = self.file.get(&format!("{key}.skin"), skin)?;
        let key = format!("skins[{}]", skin.value());
        let inverse = match json.inverse_bind_matrices {
            Some(accessor) => self.file.elements::<16>(&key, accessor)?,
            None => Vec::new(),
        };
        let joint = |(i, joint): (usize, &Index<Node>)| {
            let world = self.worlds.get(&joint.value()).copied().ok_or_else(|| {
                self.file.error(&key, format!("its joint, node {}, is not in the scene", joint.value()))
            })?;
            let bind = inverse.get(i).map_or(Mat4::IDENTITY, |m| Mat4::from_cols_array(&m.map(|v| v as f32)));
            Ok(world * bind)
        };
        json.joints.iter().enumerate().map(joint).collect()
    }

    /// Transformations of a node's instances, `EXT_mesh_gpu_instancing`; one when it has no such.
    fn instances(&self, key: &str, node: &Node) -> Result<Vec<Mat4>, ImportError> {
        let extension = node.extensions.as_ref().and_then(|e| e.others.get("EXT_mesh_gpu_instancing"));
        let Some(attributes) = extension.map(|e| &e["attributes"]) else { return Ok(vec![Mat4::IDENTITY]) };
        let accessor = |name: &str| -> Option<Index<Accessor>> {
            Some(Index::new(u32::try_from(attributes[name].as_u64()?).ok()?))
        };
        let vectors = |name: &str| accessor(name).map(|a| self.file.elements::<3>(key, a)).transpose();
        let turns = accessor("ROTATION").map(|a| self.file.elements::<4>(key, a)).transpose()?;
        let (moves, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let counts =
            [moves.as_ref().map(Vec::len), scales.as_ref().map(Vec::len), turns.as_ref().map(Vec::len)];
        let n = counts.into_iter().flatten().min().unwrap_or(1);
        let vector = |list: &Option<Vec<[f64; 3]>>, i: usize, otherwise| {
            list.as_ref().map_or(otherwise, |l| Vec3::from_array(l[i].map(|v| v as f32)))
        };
        let instance = |i| {
            Mat4::from_scale_rotation_translation(
                vector(&scales, i, Vec3::ONE),
                turns.as_ref().map_or(Quat::IDENTITY, |l| rotation(l[i].map(|v| v as f32))),
                vector(&moves, i, Vec3::ZERO),
            )
        };
        Ok((0..n).map(instance).collect())
    }

    fn read_camera(
        &mut self,
        key: &str,
        node: &Node,
        camera: Index<gltf_json::Camera>,
        world: &Mat4,
    ) -> Result<(), ImportError> {
        let json = self.file.get(&format!("{key}.camera"), camera)?;
        let name = node.name.as_ref().or(json.name.as_ref());
        let name = name.cloned().unwrap_or_else(|| format!("camera {}", camera.value()));
        let perspective = match (&json.type_, &json.perspective) {
            (Checked::Valid(Type::Perspective), Some(p)) => p,
            _ => {
                self.notes.add(format!("camera `{name}` is left out: it must be a perspective camera"));
                return Ok(());
            }
        };
        if self.camera.is_none() {
            let vfov = perspective.yfov.to_degrees();
            if !(vfov > 0.0 && vfov < 180.0) {
                let key = format!("cameras[{}].perspective.yfov", camera.value());
                let message = format!("must be in (0, π) radians, got {}", perspective.yfov);
                return Err(self.file.error(key, message));
            }
            let position = world.transform_point3(Vec3::ZERO);
            let (forward, up) = (world.transform_vector3(Vec3::NEG_Z), world.transform_vector3(Vec3::Y));
            let (Some(forward), Some(up)) = (forward.try_normalize(), up.try_normalize()) else {
                return Err(self.file.error(key, "its camera looks nowhere: the scale must not be 0"));
            };
            let aspect = perspective.aspect_ratio.filter(|a| a.is_finite() && *a > 0.0);
            self.camera = Some(ImportedCamera { position, look_at: position + forward, up, vfov, aspect });
        }
        self.cameras.push(name);
        Ok(())
    }

    fn read_light(
        &mut self,
        key: &str,
        node: &Node,
        light: Index<gltf_json::extensions::scene::khr_lights_punctual::Light>,
        world: &Mat4,
    ) -> Result<(), ImportError> {
        let json = self.file.get(&format!("{key}.extensions.KHR_lights_punctual.light"), light)?;
        let given = json.name.as_ref().or(node.name.as_ref());
        // Names become those of EXR parts.
        let plain = |c: char| if c == ' ' || c.is_ascii_graphic() { c } else { '_' };
        let name: String =
            given.map_or_else(String::new, |n| n.trim().chars().take(MAX_NAME).map(plain).collect());
        let name = if name.is_empty() { format!("light_{}", light.value()) } else { name };
        let taken: Vec<String> = self.lights.iter().map(|l| l.name.clone()).collect();
        let name = unique(name, &taken);
        let kind = match (&json.type_, &json.spot) {
            (Checked::Valid(LightKind::Point), _) => Punctual::Point,
            (Checked::Valid(LightKind::Directional), _) => Punctual::Directional,
            (Checked::Valid(LightKind::Spot), spot) => {
                let spot = spot.clone().unwrap_or_default();
                let outer = spot.outer_cone_angle.clamp(1e-3, std::f32::consts::FRAC_PI_2);
                Punctual::Spot { inner: spot.inner_cone_angle.clamp(0.0, outer), outer }
            }
            (Checked::Invalid, _) => {
                let key = format!("extensions.KHR_lights_punctual.lights[{}].type", light.value());
                return Err(self.file.error(key, "must be point, spot or directional"));
            }
        };
        let color = Rgb::from_array(json.color).max(Rgb::ZERO);
        let intensity = json.intensity / LUMENS_PER_WATT;
        if !(color.max_element() > 0.0 && color.is_finite() && intensity > 0.0 && intensity.is_finite()) {
            self.notes.add(format!("light `{name}` is left out: it is dark"));
            return Ok(());
        }
        self.lights.push(ImportedLight {
            name,
            kind,
            position: world.transform_point3(Vec3::ZERO),
            direction: world.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z),
            color,
            intensity,
        });
        Ok(())
    }

    fn finish(mut self) -> Result<Imported, ImportError> {
        if let [first, _, ..] = &self.cameras[..] {
            self.notes.add(format!("of {} cameras `{first}` is taken, the first", self.cameras.len()));
        }
        let path = &self.file.path;
        match self.n_degenerate {
            0 => {}
            1 => self.notes.add(format!("{}: left out 1 degenerate triangle", path.display())),
            n => self.notes.add(format!("{}: left out {n} degenerate triangles", path.display())),
        }
        self.materials.report(&mut self.notes);
        if self.mesh.indices.is_empty() {
            return Err(ImportError::NoTriangles { path: path.clone(), n_degenerate: self.n_degenerate });
        }
        let in_use = self.materials.list.iter_mut().flat_map(|(_, p)| p.textures_mut());
        let mut textures: Vec<&mut Arc<Texture>> = in_use.collect();
        for warning in texture::fit(&mut textures, texture::TEXTURE_BUDGET) {
            self.notes.add(warning);
        }
        Ok(Imported {
            mesh: self.mesh,
            parts: self.parts,
            materials: self.materials.list,
            warnings: self.notes.0,
            camera: self.camera,
            lights: self.lights,
        })
    }
}
