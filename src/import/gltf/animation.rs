//! Animations, of which a still picture needs the first frame.
//!
//! Exporters write the joints of a skeleton at rest, and the pose in which it was seen into an animation
//! alone: so does Blender by default. Nodes that carry nothing themselves, joints and the like, are
//! therefore put where the first animation that moves them begins. A node with a mesh, a camera or a light
//! stays: it is written where it was when the file was made.

use std::collections::{BTreeMap, HashSet};

use glam::{DMat4, DQuat, DVec3, Mat4, Quat, Vec3};
use gltf_json::{Accessor, Index, Node};
use serde::Deserialize;

use super::file::{self, File};
use crate::import::{error::ImportError, warnings::Warnings};

/// How much a place of a node may differ from the first frame without a word, in its own units: a few
/// roundings of f32 numbers of the order of 1.
const TOLERANCE: f32 = 1e-5;

/// An animation as it is written; what `gltf-json` reads of it is less than what there is.
#[derive(Debug, Deserialize)]
pub struct Animation {
    name: Option<String>,
    #[serde(default)]
    channels: Vec<Channel>,
    #[serde(default)]
    samplers: Vec<Sampler>,
}

#[derive(Debug, Deserialize)]
struct Channel {
    sampler: usize,
    target: Target,
}

#[derive(Debug, Deserialize)]
struct Target {
    node: Option<usize>,
    #[serde(default)]
    path: String,
}

#[derive(Debug, Deserialize)]
struct Sampler {
    output: u32,
    interpolation: Option<String>,
}

/// The first keys of an animation for a node; `None` for what stays as it is.
#[derive(Default)]
struct Keys {
    scale: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    translation: Option<[f64; 3]>,
}

impl Keys {
    /// The place of a node with these keys, of which nothing is rounded.
    fn exact(&self, at_rest: &file::Place) -> file::Place {
        let parts = at_rest.matrix.map(|m| DMat4::from_cols_array(&m).to_scale_rotation_translation());
        file::Place {
            matrix: None,
            scale: self.scale.or(parts.map(|p| p.0.to_array())).or(at_rest.scale),
            rotation: self.rotation.or(parts.map(|p| p.1.to_array())).or(at_rest.rotation),
            translation: self.translation.or(parts.map(|p| p.2.to_array())).or(at_rest.translation),
        }
    }
}

/// Place of a node in its parent.
#[derive(Clone, Copy)]
struct Place {
    scale: Vec3,
    rotation: Quat,
    translation: Vec3,
}

impl Place {
    fn of(node: &Node) -> Self {
        if let Some(matrix) = &node.matrix {
            let (scale, rotation, translation) =
                Mat4::from_cols_array(matrix).to_scale_rotation_translation();
            return Self { scale, rotation, translation };
        }
        Self {
            scale: node.scale.map_or(Vec3::ONE, Vec3::from_array),
            rotation: node.rotation.map_or(Quat::IDENTITY, |q| Quat::from_array(q.0)),
            translation: node.translation.map_or(Vec3::ZERO, Vec3::from_array),
        }
    }

    /// The place with the first keys of an animation.
    fn with(self, keys: &Keys) -> Self {
        let vector = |v| DVec3::from_array(v).as_vec3();
        Self {
            scale: keys.scale.map_or(self.scale, vector),
            rotation: keys.rotation.map_or(self.rotation, |q| quat(q).normalize()),
            translation: keys.translation.map_or(self.translation, vector),
        }
    }

    fn differs(&self, other: &Self) -> bool {
        let far = |a: Vec3, b: Vec3| (a - b).length() > TOLERANCE * (1.0 + a.length());
        // A rotation is the same as its negative.
        let turned = (self.rotation - other.rotation).length().min((self.rotation + other.rotation).length());
        far(self.translation, other.translation) || far(self.scale, other.scale) || turned > TOLERANCE
    }
}

/// Puts the nodes that carry nothing themselves where the first animation that moves them begins. Of
/// animations that move the same node the first alone counts.
pub fn pose(file: &mut File, warnings: &mut Warnings) {
    let mut moved = HashSet::new();
    let mut posed: BTreeMap<usize, Keys> = BTreeMap::new();
    let differs = |(index, keys): &(usize, Keys)| {
        let at_rest = Place::of(&file.root.nodes[*index]);
        at_rest.differs(&at_rest.with(keys))
    };
    for (i, animation) in file.animations.iter().enumerate() {
        let name = animation.name.clone().unwrap_or_else(|| i.to_string());
        match first_frame(file, i, animation) {
            Err(e) => warnings.about("animation", &name, format!("is left out: {e}")),
            Ok(frame) => {
                if frame.keys().any(|node| moved.contains(node)) {
                    continue;
                }
                moved.extend(frame.keys().copied());
                let n = posed.len();
                posed.extend(frame.into_iter().filter(differs));
                if posed.len() > n {
                    let message = "the pose is that of its first frame, from which the file's own differs";
                    warnings.about("animation", &name, message.into());
                }
            }
        }
    }
    for (i, animation) in file.animations.iter().enumerate() {
        if moves_shapes(file, i, animation) {
            let name = animation.name.clone().unwrap_or_else(|| i.to_string());
            let message =
                "the weights of its shape keys are the file's own, from which its first frame differs";
            warnings.about("animation", &name, message.into());
        }
    }
    for (index, keys) in posed {
        file.places[index] = keys.exact(&file.places[index]);
        let node = &mut file.root.nodes[index];
        let place = Place::of(node).with(&keys);
        node.matrix = None;
        node.scale = Some(place.scale.to_array());
        node.rotation = Some(gltf_json::scene::UnitQuaternion(place.rotation.to_array()));
        node.translation = Some(place.translation.to_array());
    }
}

/// First keys of an animation for the nodes that carry nothing themselves.
fn first_frame(
    file: &File,
    index: usize,
    animation: &Animation,
) -> Result<BTreeMap<usize, Keys>, ImportError> {
    let mut frame: BTreeMap<usize, Keys> = BTreeMap::new();
    for (i, channel) in animation.channels.iter().enumerate() {
        let Some(id) = channel.target.node else { continue };
        if !file.root.nodes.get(id).is_some_and(carries_nothing) {
            continue;
        }
        let key = format!("animations[{index}].channels[{i}].sampler");
        let sampler = animation.samplers.get(channel.sampler).ok_or_else(|| {
            file.error(&key, format!("points to number {}, which does not exist", channel.sampler))
        })?;
        let keys = frame.entry(id).or_default();
        match channel.target.path.as_str() {
            "translation" => keys.translation = first(file, &key, sampler)?.or(keys.translation),
            "scale" => keys.scale = first(file, &key, sampler)?.or(keys.scale),
            "rotation" => {
                let is_proper = |q: &[f64; 4]| quat(*q).length_squared() > 0.0 && quat(*q).is_finite();
                keys.rotation = first(file, &key, sampler)?.filter(is_proper).or(keys.rotation);
            }
            _ => {}
        }
    }
    Ok(frame)
}

/// Whether the first keys of an animation give a mesh other weights of its morph targets than it has.
fn moves_shapes(file: &File, index: usize, animation: &Animation) -> bool {
    animation.channels.iter().enumerate().any(|(i, channel)| {
        let node = channel.target.node.and_then(|id| file.root.nodes.get(id));
        let Some(mesh) = node.and_then(|node| node.mesh) else { return false };
        if channel.target.path != "weights" {
            return false;
        }
        let key = format!("animations[{index}].channels[{i}].sampler");
        let Some(sampler) = animation.samplers.get(channel.sampler) else { return false };
        let Ok(values) = file.elements::<1>(&key, Index::<Accessor>::new(sampler.output)) else {
            return false;
        };
        let mesh = file.root.meshes.get(mesh.value());
        let n = mesh.and_then(|m| m.primitives.first()?.targets.as_ref()).map_or(0, Vec::len);
        let own = node.and_then(|node| node.weights.as_ref()).or_else(|| mesh?.weights.as_ref());
        let place = if sampler.interpolation.as_deref() == Some("CUBICSPLINE") { n } else { 0 };
        let first = values.iter().skip(place).take(n);
        first.enumerate().any(|(k, [weight])| {
            let own = own.and_then(|own| own.get(k)).copied().unwrap_or(0.0);
            (own - *weight as f32).abs() > TOLERANCE
        })
    })
}

/// The first value of a sampler; `None` where it has none.
fn first<const N: usize>(file: &File, key: &str, sampler: &Sampler) -> Result<Option<[f64; N]>, ImportError> {
    let values = file.elements::<N>(key, Index::<Accessor>::new(sampler.output))?;
    // Of a cubic spline a tangent stands before each value.
    let place = usize::from(sampler.interpolation.as_deref() == Some("CUBICSPLINE"));
    Ok(values.get(place).copied())
}

fn quat(q: [f64; 4]) -> Quat {
    DQuat::from_array(q).as_quat()
}

fn carries_nothing(node: &Node) -> bool {
    let lights = |n: &Node| n.extensions.as_ref().is_some_and(|e| e.khr_lights_punctual.is_some());
    node.mesh.is_none() && node.camera.is_none() && !lights(node)
}
