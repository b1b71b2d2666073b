//! Nodes that hold nothing, which betray lamps that an exporter dropped.

use std::collections::HashSet;

use glam::{DVec3, Vec3};

use super::{file::File, nodes::SceneNode};
use crate::import::{imported::printable_name, warnings::Warnings};

/// Parts of the names of lamps, in lower case. Where nodes without content are common, only these count.
const LAMPS: [&str; 5] = ["light", "lamp", "softbox", "spot", "sun"];
/// Names listed, at most.
const MAX_LISTED: usize = 3;

/// Says which nodes of the scene hold nothing and may have been lamps, and how to add these.
///
/// A glTF has no area lights. Blender's exporter leaves their nodes, without content: there every such
/// node is named, unless it is part of a skeleton; in other files those that are called like a lamp.
/// `origin` is the place of the nodes' origin in the file's coordinates.
pub fn report(file: &File, nodes: &[SceneNode], origin: DVec3, warnings: &mut Warnings) {
    let joints: HashSet<usize> =
        file.root.skins.iter().flat_map(|s| s.joints.iter().map(|j| j.value())).collect();
    let mut in_skeleton = vec![false; nodes.len()];
    let mut empty: Vec<&SceneNode> = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        in_skeleton[i] = joints.contains(&node.index) || node.parent.is_some_and(|p| in_skeleton[p]);
        if node.is_visible && !in_skeleton[i] && is_lost_lamp(file, node.index) {
            empty.push(node);
        }
    }
    let Some(first) = empty.first() else { return };
    let name = |n: &SceneNode| file.root.nodes[n.index].name.clone().unwrap_or_default();
    let mut names =
        empty.iter().take(MAX_LISTED).map(|n| format!("`{}`", name(n))).collect::<Vec<_>>().join(", ");
    if empty.len() > MAX_LISTED {
        names += &format!(" and {} more", empty.len() - MAX_LISTED);
    }
    let (nodes, hold, they) = if empty.len() == 1 {
        ("node", "holds", "it was a lamp")
    } else {
        ("nodes", "hold", "they were lamps")
    };
    let exporter =
        if file.is_of_blender() { "Blender exports no area lights" } else { "glTF has no area lights" };
    let position = first.world.transform_point3(Vec3::ZERO);
    let ahead = first.world.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z);
    let [position, look_at] = [position, position + ahead].map(|p| {
        let DVec3 { x, y, z } = p.as_dvec3() + origin;
        format!("[{x:.3}, {y:.3}, {z:.3}]")
    });
    warnings.add(format!(
        "{}: {nodes} {names} {hold} nothing, and {exporter}: if {they}, add [[lights]] to the sidecar, name = {:?}, type = \
         \"rectangle\", position = {position}, look_at = {look_at}, half_extents = [0.5, 0.5], radiance = 10.0 (USD would keep \
         lamps, but is not read yet)",
        file.path.display(),
        printable_name(&name(first)),
    ));
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
