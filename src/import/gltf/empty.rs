//! Nodes that hold nothing, which betray lamps that an exporter dropped.

use std::collections::HashSet;

use glam::{DVec3, Vec3};

use super::{file::File, nodes::SceneNode};
use crate::import::imported::LostLamp;

/// Parts of the names of lamps, in lower case. Where nodes without content are common, only these count.
const LAMPS: [&str; 5] = ["light", "lamp", "softbox", "spot", "sun"];

/// The nodes of the scene that hold nothing and may have been lamps.
///
/// A glTF has no area lights. Blender's exporter leaves their nodes, without content: there every such
/// node counts, unless it is part of a skeleton; in other files those that are called like a lamp.
/// `origin` is the place of the nodes' origin in the file's coordinates.
pub fn lost_lamps(file: &File, nodes: &[SceneNode], origin: DVec3) -> Vec<LostLamp> {
    let joints: HashSet<usize> =
        file.root.skins.iter().flat_map(|s| s.joints.iter().map(|j| j.value())).collect();
    let mut in_skeleton = vec![false; nodes.len()];
    let mut lamps = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        in_skeleton[i] = joints.contains(&node.index) || node.parent.is_some_and(|p| in_skeleton[p]);
        if node.is_visible && !in_skeleton[i] && is_lost_lamp(file, node.index) {
            let position = node.world.transform_point3(Vec3::ZERO);
            let ahead = node.world.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z);
            let [position, look_at] = [position, position + ahead].map(|p| p.as_dvec3() + origin);
            let name = file.root.nodes[node.index].name.clone().unwrap_or_default();
            lamps.push(LostLamp { name, position, look_at });
        }
    }
    lamps
}

/// Whether a node has neither content nor children, and could have been a lamp.
fn is_lost_lamp(file: &File, index: usize) -> bool {
    let node = &file.root.nodes[index];
    let is_empty = node.mesh.is_none()
        && node.camera.is_none()
        && node.skin.is_none()
        && node.children.as_ref().is_none_or(Vec::is_empty)
        && node.extensions.as_ref().is_none_or(|e| e.khr_lights_punctual.is_none() && e.others.is_empty());
    let Some(name) = node.name.as_deref().filter(|_| is_empty) else { return false };
    let name = name.to_lowercase();
    file.is_of_blender() || LAMPS.iter().any(|lamp| name.contains(lamp))
}
