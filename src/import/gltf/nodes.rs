//! The node hierarchy: transformations, instances, joints and names.

use std::collections::HashMap;

use glam::{BVec3, DMat4, DQuat, DVec3, Mat4, Quat, Vec3};
use gltf_json::{Accessor, Index, Node, Skin, mesh::Semantic, validation::Checked};

use super::file::{File, Place};
use crate::import::{budget::MAX_DEPTH, error::ImportError, imported::Part, origin::Spread};

/// Boxes of meshes by which the place of a scene is found, at most: so many take some milliseconds, and tell
/// as much as all.
const MAX_BOXES: usize = 1 << 18;

/// A node of the default scene.
pub struct SceneNode {
    /// Index in the file's list of nodes.
    pub index: usize,
    /// Position of the parent in the list of scene nodes; `None` for a root.
    pub parent: Option<usize>,
    /// Number of nodes from the root to this one, both counted.
    depth: usize,
    /// Transformation from the node's coordinates to world space.
    pub world: Mat4,
    /// The same in `f64`, where the file has more digits than `f32` keeps.
    exact: DMat4,
    /// Whether neither the node nor an ancestor is hidden by `KHR_node_visibility`.
    pub is_visible: bool,
}

/// The nodes of the default scene, else of the first, every parent before its children.
///
/// # Errors
/// When a node does not exist, is met twice, or its transformation is not finite.
pub fn scene_nodes(file: &File) -> Result<Vec<SceneNode>, ImportError> {
    let root = &file.root;
    let roots: Vec<Index<Node>> = match root.scene {
        Some(scene) => file.get("scene", scene)?.nodes.clone(),
        None => root.scenes.first().map(|s| s.nodes.clone()).unwrap_or_default(),
    };
    let mut out: Vec<SceneNode> = Vec::new();
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
        let (above, exact_above, was_visible) = parent.map_or((Mat4::IDENTITY, DMat4::IDENTITY, true), |p| {
            (out[p].world, out[p].exact, out[p].is_visible)
        });
        let world = above * local(json);
        let exact = exact_above * exact_local(&file.places[index]);
        if !world.is_finite() || !exact.is_finite() {
            return Err(file.error(format!("nodes[{index}]"), "its transformation must be finite"));
        }
        let visibility = json.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
        let is_hidden = visibility.is_some_and(|v| v["visible"].as_bool() == Some(false));
        let depth = parent.map_or(1, |p| out[p].depth + 1);
        if depth > MAX_DEPTH {
            return Err(file.error(key, format!("the tree of nodes is more than {MAX_DEPTH} deep")));
        }
        let id = out.len();
        out.push(SceneNode { index, parent, depth, world, exact, is_visible: was_visible && !is_hidden });
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

fn exact_local(place: &Place) -> DMat4 {
    if let Some(m) = &place.matrix {
        return DMat4::from_cols_array(m);
    }
    let rotation = place.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    DMat4::from_scale_rotation_translation(
        place.scale.map_or(DVec3::ONE, DVec3::from_array),
        if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY },
        place.translation.map_or(DVec3::ZERO, DVec3::from_array),
    )
}

/// Moves the nodes to the origin that is right for the scene, see
/// [`origin`](crate::import::origin), and returns it. Those of a scene that is near it stay as they are.
///
/// # Errors
/// When an accessor of positions or an attribute of instances cannot be read.
pub fn center(file: &File, nodes: &mut [SceneNode]) -> Result<DVec3, ImportError> {
    let mut spread = spread(file, nodes, stated_bounds)?;
    if spread.origin() != DVec3::ZERO {
        // What accessors state of themselves may be wrong.
        spread = self::spread(file, nodes, found_bounds)?;
    }
    let origin = spread.origin();
    let is_far = |n: &SceneNode| spread.is_far(n.exact.w_axis.truncate());
    let has_far_parent = |n: &SceneNode| n.parent.is_some_and(|p| is_far(&nodes[p]));
    if origin != DVec3::ZERO || nodes.iter().any(has_far_parent) {
        let moved = DMat4::from_translation(-origin);
        nodes.iter_mut().for_each(|n| n.world = (moved * n.exact).as_mat4());
    }
    Ok(origin)
}

/// Least and largest coordinates of an accessor's positions; `None` where there are none.
type Bounds = fn(&File, &str, Index<Accessor>) -> Result<Option<[DVec3; 2]>, ImportError>;

/// Where the corners of the boxes around the visible meshes lie. Skins, which nodes do not place, are
/// left out.
fn spread(file: &File, nodes: &[SceneNode], bounds: Bounds) -> Result<Spread, ImportError> {
    let mut spread = Spread::default();
    let mut n_boxes = 0;
    for node in nodes.iter().filter(|n| n.is_visible) {
        let json = &file.root.nodes[node.index];
        let (Some(mesh), None) = (json.mesh, json.skin) else { continue };
        let key = format!("nodes[{}]", node.index);
        let mesh = file.get(&format!("{key}.mesh"), mesh)?;
        let instances = instances(file, &key, json)?;
        let position = Checked::Valid(Semantic::Positions);
        for &accessor in mesh.primitives.iter().filter_map(|p| p.attributes.get(&position)) {
            if n_boxes >= MAX_BOXES {
                return Ok(spread);
            }
            let Some([lo, hi]) = bounds(file, &key, accessor)? else { continue };
            for instance in instances.iter().take(MAX_BOXES.saturating_sub(n_boxes)) {
                n_boxes += 1;
                let world = node.exact * instance.as_dmat4();
                let corner = |i: u8| DVec3::select(BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), hi, lo);
                spread.extend((0..8).map(|i| world.transform_point3(corner(i))));
            }
        }
    }
    Ok(spread)
}

fn stated_bounds(
    file: &File,
    key: &str,
    accessor: Index<Accessor>,
) -> Result<Option<[DVec3; 2]>, ImportError> {
    let json = file.get(key, accessor)?;
    if json.normalized {
        // They are stated as integers, which stand for fractions.
        return found_bounds(file, key, accessor);
    }
    let corner = |bound: &serde_json::Value| {
        let at = |i: usize| bound.get(i)?.as_f64();
        Some(DVec3::new(at(0)?, at(1)?, at(2)?))
    };
    let [lo, hi] = [&json.min, &json.max].map(|bound| bound.as_ref().and_then(corner));
    Ok(lo.zip(hi).map(|(lo, hi)| [lo, hi]))
}

fn found_bounds(
    file: &File,
    key: &str,
    accessor: Index<Accessor>,
) -> Result<Option<[DVec3; 2]>, ImportError> {
    if file.get(key, accessor)?.buffer_view.is_none() {
        return Ok(None);
    }
    let positions = file.elements::<3>(key, accessor)?.into_iter().map(DVec3::from_array);
    let bounds = positions.map(|p| [p, p]).reduce(|[lo, hi], [p, _]| [lo.min(p), hi.max(p)]);
    Ok(bounds)
}

fn rotation(q: [f32; 4]) -> Quat {
    let q = Quat::from_array(q);
    if q.length_squared() > 0.0 { q.normalize() } else { Quat::IDENTITY }
}

/// Names that select the triangles of the node at position `id` of `nodes`: the node's own as the
/// object, those of its ancestors and of its mesh as groups.
///
/// # Errors
/// When the names of all nodes so far are too many.
pub fn part(file: &File, nodes: &[SceneNode], id: usize, mesh: Option<&str>) -> Result<Part, ImportError> {
    let mut names: Vec<&str> = Vec::new();
    let mut at = Some(id);
    while let Some(node) = at.map(|i| &nodes[i]) {
        names.extend(file.root.nodes[node.index].name.as_deref());
        at = node.parent;
    }
    names.extend(mesh);
    names.retain(|n| !n.is_empty());
    let bytes = names.iter().map(|n| n.len() + size_of::<String>()).sum();
    file.budget.name(bytes).map_err(|e| file.error(format!("nodes[{}]", nodes[id].index), e))?;
    let mut names = names.into_iter().map(str::to_owned);
    Ok(Part { object: names.next(), groups: names.collect() })
}

/// Transformations of a skin's joints in the default pose, from the mesh's bind pose to world space;
/// glTF 2.0 section 3.7.3. `worlds` are those of the scene's nodes by index in the file.
///
/// # Errors
/// When the skin or its matrices do not exist, or a joint is not in the scene.
pub fn joint_matrices(
    file: &File,
    key: &str,
    skin: Index<Skin>,
    worlds: &HashMap<usize, Mat4>,
) -> Result<Vec<Mat4>, ImportError> {
    let json = file.get(&format!("{key}.skin"), skin)?;
    let key = format!("skins[{}]", skin.value());
    file.budget.decode(json.joints.len()).map_err(|e| file.error(&key, e))?;
    let inverse = match json.inverse_bind_matrices {
        Some(accessor) => file.elements::<16>(&key, accessor)?,
        None => Vec::new(),
    };
    let joint = |(i, joint): (usize, &Index<Node>)| {
        let world = worlds.get(&joint.value()).copied().ok_or_else(|| {
            file.error(&key, format!("its joint, node {}, is not in the scene", joint.value()))
        })?;
        let bind = inverse.get(i).map_or(Mat4::IDENTITY, |m| Mat4::from_cols_array(&m.map(|v| v as f32)));
        Ok(world * bind)
    };
    json.joints.iter().enumerate().map(joint).collect()
}

/// Transformations of a node's instances (`EXT_mesh_gpu_instancing`) in the node's coordinates; the
/// identity alone without the extension.
///
/// # Errors
/// When an attribute of the extension cannot be read.
pub fn instances(file: &File, key: &str, node: &Node) -> Result<Vec<Mat4>, ImportError> {
    let extension = node.extensions.as_ref().and_then(|e| e.others.get("EXT_mesh_gpu_instancing"));
    let Some(attributes) = extension.map(|e| &e["attributes"]) else { return Ok(vec![Mat4::IDENTITY]) };
    let accessor = |name: &str| -> Option<Index<Accessor>> {
        Some(Index::new(u32::try_from(attributes[name].as_u64()?).ok()?))
    };
    let vectors = |name: &str| accessor(name).map(|a| file.elements::<3>(key, a)).transpose();
    let rotations = accessor("ROTATION").map(|a| file.elements::<4>(key, a)).transpose()?;
    let (translations, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
    let counts = [
        translations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
    ];
    let n = counts.into_iter().flatten().min().unwrap_or(1);
    let vector = |list: &Option<Vec<[f64; 3]>>, i: usize, default| {
        list.as_ref().map_or(default, |l| Vec3::from_array(l[i].map(|v| v as f32)))
    };
    let instance = |i| {
        Mat4::from_scale_rotation_translation(
            vector(&scales, i, Vec3::ONE),
            rotations.as_ref().map_or(Quat::IDENTITY, |l| rotation(l[i].map(|v| v as f32))),
            vector(&translations, i, Vec3::ZERO),
        )
    };
    Ok((0..n).map(instance).collect())
}
