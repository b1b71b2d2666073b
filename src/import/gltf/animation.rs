//! Animations, of which a still picture needs the first frame.
//!
//! Exporters write the joints of a skeleton at rest, and the pose in which it was seen into an animation
//! alone: so does Blender by default. Nodes that carry nothing themselves, joints and the like, are
//! therefore put where the first animation that moves them begins. A node with a mesh, a camera or a light
//! stays: it is written where it was when the file was made.

use std::collections::{BTreeMap, HashSet};

use glam::{Mat4, Quat, Vec3};
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
    let mut posed: BTreeMap<usize, Place> = BTreeMap::new();
    for (i, animation) in file.animations.iter().enumerate() {
        let name = animation.name.clone().unwrap_or_else(|| i.to_string());
        match first_frame(file, i, animation) {
            Err(e) => warnings.about("animation", &name, format!("is left out: {e}")),
            Ok(places) => {
                if places.keys().any(|node| moved.contains(node)) {
                    continue;
                }
                moved.extend(places.keys().copied());
                let n = posed.len();
                posed.extend(
                    places.into_iter().filter(|(node, p)| Place::of(&file.root.nodes[*node]).differs(p)),
                );
                if posed.len() > n {
                    let message = "the pose is that of its first frame, from which the file's own differs";
                    warnings.about("animation", &name, message.into());
                }
            }
        }
    }
    for (index, place) in posed {
        if let Some(exact) = file.places.get_mut(index) {
            *exact = file::Place {
                matrix: None,
                translation: Some(place.translation.as_dvec3().to_array()),
                rotation: Some(place.rotation.as_dquat().to_array()),
                scale: Some(place.scale.as_dvec3().to_array()),
            };
        }
        let node = &mut file.root.nodes[index];
        node.matrix = None;
        node.scale = Some(place.scale.to_array());
        node.rotation = Some(gltf_json::scene::UnitQuaternion(place.rotation.to_array()));
        node.translation = Some(place.translation.to_array());
    }
}

/// Places at the first key of an animation of the nodes that carry nothing themselves.
fn first_frame(
    file: &File,
    index: usize,
    animation: &Animation,
) -> Result<BTreeMap<usize, Place>, ImportError> {
    let mut places = BTreeMap::new();
    for (i, channel) in animation.channels.iter().enumerate() {
        let Some(id) = channel.target.node else { continue };
        let Some(node) = file.root.nodes.get(id).filter(|n| carries_nothing(n)) else { continue };
        let key = format!("animations[{index}].channels[{i}].sampler");
        let sampler = animation.samplers.get(channel.sampler).ok_or_else(|| {
            file.error(&key, format!("points to number {}, which does not exist", channel.sampler))
        })?;
        let place = places.entry(id).or_insert_with(|| Place::of(node));
        match channel.target.path.as_str() {
            "translation" => {
                place.translation = first(file, &key, sampler)?.map_or(place.translation, Vec3::from)
            }
            "scale" => place.scale = first(file, &key, sampler)?.map_or(place.scale, Vec3::from),
            "rotation" => {
                let rotation = first(file, &key, sampler)?.map(Quat::from_array);
                let proper = rotation.filter(|q| q.length_squared() > 0.0 && q.is_finite());
                place.rotation = proper.map_or(place.rotation, Quat::normalize);
            }
            _ => {}
        }
    }
    Ok(places)
}

/// The first value of a sampler; `None` where it has none.
fn first<const N: usize>(file: &File, key: &str, sampler: &Sampler) -> Result<Option<[f32; N]>, ImportError> {
    let values = file.elements::<N>(key, Index::<Accessor>::new(sampler.output))?;
    // Of a cubic spline a tangent stands before each value.
    let place = usize::from(sampler.interpolation.as_deref() == Some("CUBICSPLINE"));
    Ok(values.get(place).map(|v| v.map(|v| v as f32)))
}

fn carries_nothing(node: &Node) -> bool {
    let lights = |n: &Node| n.extensions.as_ref().is_some_and(|e| e.khr_lights_punctual.is_some());
    node.mesh.is_none() && node.camera.is_none() && !lights(node)
}
