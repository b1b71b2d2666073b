//! Finds the subject of a scene, and whether it stands on a floor.
//!
//! The thresholds are dimensionless and chosen by hand. The interval that each names is the one over
//! which the subjects found in the test scenes stay the same: the 20 of the comparison with Mitsuba,
//! the rooms of boxes in this module's tests, and the fruit basket.

use std::collections::HashMap;

use glam::Vec3;

use super::setting::{PANEL_GAP, Piece, Setting, bounds_of};
use crate::{
    embree::EmbreeError,
    math::Bounds,
    scene::mesh::{Mesh, face_normal},
};

/// Pieces above which everything is the subject: all pairs are tested, which takes 40 ms for 3000.
const MAX_PIECES: usize = 3000;
/// Largest height of a subject's lowest point above or below a floor, over the scene's height: pictures
/// that hang in a room stand on its floor too. Interval 0.10 to 0.25.
const STANDING_GAP: f32 = 0.12;
/// Largest horizontal extents of a subject, over those of the scene: what fills the floor is the scene
/// itself. Interval 0.76 to 0.84.
const MAX_STANDING: f32 = 0.8;
/// Largest distance of pieces that belong together, over the diagonal of all but floor and walls: parts
/// of an object touch, objects beside each other do not. Interval 0.0015 to 0.28.
const TOUCHING: f32 = 0.01;
/// Least size of a group over that of the largest for it to be as much the subject: of a chess set more
/// than a king, of a table with a lamp the table alone. Interval 0.26 to 0.67.
const EQUAL_SIZE: f32 = 0.6;
/// Least vertical component of the normal of a triangle that carries a named subject: it slopes by 45°.
const MIN_FLOOR_NORMAL: f32 = 0.7;
/// Largest depth of a floor below a named subject, over the subject's diagonal: what lies deeper does not
/// show as the floor on which it stands.
const MAX_FLOOR_DEPTH: f32 = 0.5;

/// The main object that is found, or was named.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Whether each triangle belongs to the main object.
    pub is_main: Vec<bool>,
    /// Whether the scene has a floor, room or landscape under the main object.
    pub has_floor: bool,
}

/// Finds the subject: without a floor everything; otherwise what the largest of the
/// groups of touching pieces holds that is neither floor nor wall. What stands on a
/// table in a room is found by doing so again.
///
/// Pieces are objects or groups, or the connected parts of the mesh if there is only one. Which way
/// their faces look does not count. `is_clear` says of each material whether one sees through it.
///
/// # Errors
/// When a triangle's coordinates are not finite or too large for Embree.
pub fn find(mesh: &Mesh, is_clear: &[bool]) -> Result<Subject, EmbreeError> {
    let pieces = pieces(mesh, is_clear);
    let mut subject: Vec<&Piece> = pieces.iter().collect();
    let mut has_floor = false;
    while (2..=MAX_PIECES).contains(&subject.len()) {
        let Some(inner) = without_shells(mesh, &subject)? else { break };
        subject = inner;
        has_floor = true;
    }
    let mut is_main = vec![false; mesh.indices.len()];
    subject.iter().flat_map(|p| &p.triangles).for_each(|&t| is_main[t] = true);
    Ok(Subject { is_main, has_floor })
}

/// The largest group of pieces that stands on a floor or in a room of the others.
fn without_shells<'a>(mesh: &Mesh, pieces: &[&'a Piece]) -> Result<Option<Vec<&'a Piece>>, EmbreeError> {
    let setting = Setting::new(mesh, pieces)?;
    let scene = setting.scene;
    let gap = STANDING_GAP * scene.extent().y;
    let floors: Vec<f32> = setting.floors().collect();
    let main_of = |inner: &[&'a Piece]| dominant(inner, TOUCHING * bounds_of(inner).extent().length());
    // What may be a wall is one where the rest stands before it.
    let (walls, solids): (Vec<&Piece>, Vec<&Piece>) =
        setting.inner.iter().partition(|p| !floors.is_empty() && p.may_be_wall());
    let before = main_of(&solids);
    let mut rest = solids;
    for wall in walls {
        if before.is_empty() || !wall.backs(mesh, &before)? {
            rest.push(wall);
        }
    }
    let subject = main_of(&rest);
    let bounds = bounds_of(&subject);
    let stands = floors.iter().any(|top| (bounds.lo.y - top).abs() <= gap);
    let is_held = !setting.surroundings.is_empty() || stands && setting.is_within_rooms(&bounds);
    let share = bounds.extent() / scene.extent();
    let is_small = share.x <= MAX_STANDING && share.z <= MAX_STANDING;
    // What is painted on a floor does not stand on it.
    let rises = bounds.hi.y > scene.lo.y;
    Ok((!subject.is_empty() && is_held && is_small && rises).then_some(subject))
}

/// Whether triangles of other pieces lie below a subject that was named.
pub fn has_floor(mesh: &Mesh, is_main: &[bool]) -> bool {
    let corners = |t: usize| mesh.corners(t);
    let subject = Bounds::of((0..is_main.len()).filter(|&t| is_main[t]).flat_map(corners));
    let size = subject.extent().length();
    let others = (0..is_main.len()).filter(|&t| !is_main[t]).map(corners);
    let below = others.filter(|c| {
        let normal = face_normal(*c).normalize_or_zero();
        let b = Bounds::of(*c);
        normal.y.abs() > MIN_FLOOR_NORMAL
            && b.hi.y <= subject.lo.y + PANEL_GAP * size
            && b.lo.y >= subject.lo.y - MAX_FLOOR_DEPTH * size
    });
    let floor = Bounds::of(below.flatten());
    floor.lo.x <= subject.lo.x
        && floor.lo.z <= subject.lo.z
        && floor.hi.x >= subject.hi.x
        && floor.hi.z >= subject.hi.z
}

/// The pieces of the largest group of touching pieces, and of the groups about as large.
fn dominant<'a>(pieces: &[&'a Piece], gap: f32) -> Vec<&'a Piece> {
    let mut group: Vec<usize> = (0..pieces.len()).collect();
    for i in 0..pieces.len() {
        for j in 0..i {
            if pieces[i].bounds.touches(&pieces[j].bounds, gap) {
                let (a, b) = (root(&mut group, i), root(&mut group, j));
                group[a.max(b)] = a.min(b);
            }
        }
    }
    let roots: Vec<usize> = (0..pieces.len()).map(|i| root(&mut group, i)).collect();
    let members =
        |r: usize| (0..pieces.len()).filter(|&i| roots[i] == r).map(|i| pieces[i]).collect::<Vec<_>>();
    let size = |r: usize| bounds_of(&members(r)).extent().length();
    let groups: Vec<(usize, f32)> =
        (0..pieces.len()).filter(|&i| roots[i] == i).map(|r| (r, size(r))).collect();
    let largest = groups.iter().map(|(_, s)| *s).fold(0.0, f32::max);
    groups.iter().filter(|(_, s)| *s >= EQUAL_SIZE * largest).flat_map(|(r, _)| members(*r)).collect()
}

/// Representative of a set of a disjoint-set forest; halves the path to it.
fn root(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}

/// The pieces of a mesh in the order of their first triangles.
fn pieces(mesh: &Mesh, is_clear: &[bool]) -> Vec<Piece> {
    let one_object = mesh.objects.windows(2).all(|w| w[0] == w[1]);
    let label =
        if one_object { components(mesh) } else { mesh.objects.iter().map(|&o| o as usize).collect() };
    let mut index: HashMap<usize, usize> = HashMap::new();
    let mut triangles: Vec<Vec<usize>> = Vec::new();
    for (t, l) in label.into_iter().enumerate() {
        let i = *index.entry(l).or_insert(triangles.len());
        if i == triangles.len() {
            triangles.push(Vec::new());
        }
        triangles[i].push(t);
    }
    triangles.into_iter().map(|triangles| Piece::new(mesh, triangles, is_clear)).collect()
}

/// Label of the connected part of each triangle: triangles that share a position are connected.
fn components(mesh: &Mesh) -> Vec<usize> {
    let mut at: HashMap<[u32; 3], usize> = HashMap::new();
    let mut parent: Vec<usize> = (0..mesh.indices.len()).collect();
    for t in 0..mesh.indices.len() {
        for p in mesh.corners(t) {
            let first = *at.entry((p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(t);
            let (a, b) = (root(&mut parent, first), root(&mut parent, t));
            parent[a.max(b)] = a.min(b);
        }
    }
    (0..mesh.indices.len()).map(|t| root(&mut parent, t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::backdrop::Sweep;

    /// Appends a box, or a panel if an extent is 0.
    fn add(mesh: &mut Mesh, object: u32, lo: [f32; 3], hi: [f32; 3]) {
        let first = mesh.positions.len() as u32;
        let pick = |i: usize, a: usize| if i >> a & 1 == 0 { lo[a] } else { hi[a] };
        mesh.positions.extend((0..8).map(|i| Vec3::new(pick(i, 0), pick(i, 1), pick(i, 2))));
        // They face outward.
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        for face in faces {
            let corners = face.map(|i: u32| mesh.positions[(first + i) as usize]);
            let normal = face_normal([corners[0], corners[1], corners[2]]).normalize_or_zero();
            let start = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.normals.resize(mesh.positions.len(), normal);
            for t in [[0, 1, 2], [0, 2, 3]] {
                mesh.indices.push(t.map(|i| start + i));
                mesh.objects.push(object);
                mesh.materials.push(0);
            }
        }
    }

    fn main_boxes(mesh: &Mesh) -> Vec<usize> {
        let s = find(mesh, &[false]).unwrap();
        (0..mesh.indices.len() / 12).filter(|i| s.is_main[12 * i]).collect()
    }

    #[test]
    fn on_a_floor_the_largest_group_is_the_subject() {
        for names in [[0, 1, 2, 3], [0; 4]] {
            let mut mesh = Mesh::default();
            add(&mut mesh, names[0], [-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]);
            add(&mut mesh, names[1], [-1.0, 0.01, -1.0], [1.0, 1.0, 1.0]);
            add(&mut mesh, names[2], [-0.5, 1.01, -0.5], [0.5, 2.0, 0.5]);
            add(&mut mesh, names[3], [3.0, 0.01, 3.0], [3.5, 0.5, 3.5]);
            assert_eq!(main_boxes(&mesh), [1, 2], "{names:?}");
            assert!(find(&mesh, &[false]).unwrap().has_floor);
        }
    }

    #[test]
    fn what_stands_on_a_table_before_a_backdrop_is_the_subject() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [-0.8, -0.04, -0.5], [0.8, 0.0, 0.5]);
        add(&mut mesh, 1, [-0.2, 0.001, -0.2], [0.2, 0.2, 0.2]);
        let position = Vec3::new(0.0, -0.8, 0.0);
        let sweep =
            Sweep { position, turn: 0.0, front: 2.0, back: 2.0, width: 5.0, height: 3.0, radius: 1.0 };
        sweep.append(&mut mesh, 0, 2);
        assert_eq!(main_boxes(&mesh), [1]);
    }

    #[test]
    fn a_backdrop_may_face_either_way() {
        for is_turned in [false, true] {
            let mut mesh = Mesh::default();
            add(&mut mesh, 0, [-0.3, 0.0, -0.3], [0.3, 0.6, 0.3]);
            let sweep = Sweep {
                position: Vec3::ZERO,
                turn: 0.0,
                front: 2.0,
                back: 2.0,
                width: 4.0,
                height: 2.5,
                radius: 0.8,
            };
            sweep.append(&mut mesh, 0, 1);
            if is_turned {
                mesh.indices[12..].iter_mut().for_each(|t| t.swap(1, 2));
                mesh.normals.iter_mut().for_each(|n| *n = -*n);
            }
            let subject = find(&mesh, &[false]).unwrap();
            assert!(subject.has_floor && subject.is_main[..12].iter().all(|m| *m), "{is_turned}");
            assert!(!subject.is_main[12..].contains(&true), "{is_turned}");
        }
    }

    #[test]
    fn walls_need_not_end_where_the_floor_does() {
        // At its edge, at three quarters of it, and a metre below it.
        for (z, bottom) in [(-2.0, 0.0), (-1.0, 0.0), (-2.0, -1.0)] {
            let mut mesh = Mesh::default();
            add(&mut mesh, 0, [-2.0, 0.0, -2.0], [2.0, 0.0, 2.0]);
            add(&mut mesh, 1, [-0.3, 0.0, -0.3], [0.3, 0.6, 0.3]);
            add(&mut mesh, 2, [-2.0, bottom, z], [2.0, 3.0, z]);
            assert_eq!(main_boxes(&mesh), [1], "{z} {bottom}");
        }
    }

    #[test]
    fn without_a_floor_everything_is_the_subject() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [0.0; 3], [1.0; 3]);
        add(&mut mesh, 1, [3.0, 0.0, 0.0], [3.5; 3]);
        assert_eq!(find(&mesh, &[false]).unwrap(), Subject { is_main: vec![true; 24], has_floor: false });
    }

    #[test]
    fn the_panels_of_a_cupboard_are_no_room() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [0.0, 0.0, 0.0], [1.0, 0.02, 0.5]);
        add(&mut mesh, 1, [0.0, 0.0, 0.0], [0.02, 2.0, 0.5]);
        add(&mut mesh, 2, [0.98, 0.0, 0.0], [1.0, 2.0, 0.5]);
        add(&mut mesh, 3, [0.03, 0.03, 0.1], [0.97, 1.9, 0.48]);
        assert_eq!(main_boxes(&mesh), [0, 1, 2, 3]);
    }

    #[test]
    fn a_room_is_not_the_subject_whichever_way_it_faces() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [0.0; 3], [4.0, 3.0, 5.0]);
        add(&mut mesh, 1, [1.0, 0.0, 1.0], [2.0, 1.0, 2.0]);
        assert_eq!(main_boxes(&mesh), [1]);
        mesh.indices[..12].iter_mut().for_each(|t| t.swap(1, 2));
        mesh.normals[..32].iter_mut().for_each(|n| *n = -*n);
        assert_eq!(main_boxes(&mesh), [1]);
        let glass = find(&mesh, &[true]).unwrap();
        assert!(!glass.has_floor && glass.is_main.iter().all(|m| *m), "a glass case and what it shows");
    }

    #[test]
    fn the_thick_walls_of_a_room_are_not_the_subject() {
        // Both sides of the walls as one object or, in a mesh of one object, as two connected parts.
        for names in [[0, 0, 1], [0; 3]] {
            for thickness in [0.1, 0.2, 0.3, 0.4] {
                let mut mesh = Mesh::default();
                add(&mut mesh, names[0], [-thickness; 3], [4.0, 3.0, 5.0].map(|l| l + thickness));
                add(&mut mesh, names[1], [0.0; 3], [4.0, 3.0, 5.0]);
                add(&mut mesh, names[2], [1.0, 0.0, 1.0], [2.0, 1.0, 2.0]);
                let subject = find(&mesh, &[false]).unwrap();
                assert!(subject.has_floor, "{names:?} {thickness}");
                let of_thing = |t: usize| t >= 24;
                let is_right = subject.is_main.iter().enumerate().all(|(t, m)| *m == of_thing(t));
                assert!(is_right, "{names:?} {thickness}");
            }
        }
    }

    #[test]
    fn a_crate_with_what_it_holds_is_the_subject() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [-0.1; 3], [1.1; 3]);
        add(&mut mesh, 0, [0.0; 3], [1.0; 3]);
        add(&mut mesh, 1, [0.2, 0.0, 0.2], [0.8; 3]);
        // Open at the top.
        for face in [9, 3] {
            mesh.indices.drain(2 * face..2 * face + 2);
            mesh.objects.drain(2 * face..2 * face + 2);
            mesh.materials.drain(2 * face..2 * face + 2);
        }
        let subject = find(&mesh, &[false]).unwrap();
        assert!(subject.is_main.iter().all(|m| *m) && !subject.has_floor);
    }

    #[test]
    fn a_room_with_thick_walls_may_be_open() {
        // Towards +z, and at the top: outer and inner faces of what is left.
        for open in [vec![5], vec![3], vec![3, 5]] {
            let mut mesh = Mesh::default();
            add(&mut mesh, 1, [1.5, 0.0, 1.5], [2.5, 1.0, 2.5]);
            add(&mut mesh, 0, [-0.3; 3], [4.3, 3.3, 5.3]);
            add(&mut mesh, 0, [0.0; 3], [4.0, 3.0, 5.0]);
            for face in [6, 12].into_iter().rev().flat_map(|first| open.iter().rev().map(move |f| first + f))
            {
                mesh.indices.drain(2 * face..2 * face + 2);
                mesh.objects.drain(2 * face..2 * face + 2);
                mesh.materials.drain(2 * face..2 * face + 2);
            }
            let is_alone = |s: &Subject| s.is_main.iter().enumerate().all(|(t, m)| *m == (t < 12));
            // Open at the top alone it is a crate.
            assert_eq!(is_alone(&find(&mesh, &[false]).unwrap()), open != [3], "{open:?}");
        }
    }

    #[test]
    fn a_cove_of_its_own_is_a_part_of_the_backdrop() {
        let position = Vec3::ZERO;
        let sweep =
            Sweep { position, turn: 0.0, front: 2.0, back: 2.0, width: 4.0, height: 2.5, radius: 0.8 };
        for joined in ["nothing", "floor", "wall"] {
            let mut mesh = Mesh::default();
            add(&mut mesh, 0, [-0.3, 0.0, -0.3], [0.3, 0.6, 0.3]);
            sweep.append(&mut mesh, 0, 1);
            for t in 12..mesh.indices.len() {
                let middle = mesh.corners(t).into_iter().sum::<Vec3>() / 3.0;
                // The floor ends, and the wall begins, 0.8 m from the corner.
                let (floor, wall) = (middle.z > -1.2 + 1e-3, middle.y > 0.8 - 1e-3);
                mesh.objects[t] = match (floor, wall) {
                    (true, _) if joined == "floor" => 2,
                    (_, true) if joined == "wall" => 2,
                    (true, _) => 1,
                    (_, true) => 3,
                    _ => 2,
                };
            }
            let subject = find(&mesh, &[false]).unwrap();
            assert!(subject.has_floor, "{joined}");
            let is_right = mesh.objects.iter().zip(&subject.is_main).all(|(o, m)| (*o == 0) == *m);
            assert!(is_right, "{joined}");
        }
    }

    #[test]
    fn the_door_of_a_house_is_not_the_subject() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [0.0; 3], [8.0, 6.0, 10.0]);
        add(&mut mesh, 1, [3.0, 0.0, 9.95], [4.0, 2.0, 10.05]);
        assert_eq!(main_boxes(&mesh), [0, 1]);
    }

    #[test]
    fn a_panel_behind_or_beside_the_subject_is_a_wall_at_any_angle() {
        for (angle, panel) in [(0.0, 0.0), (0.6, 0.0), (0.6, 0.05), (-1.2, 0.01)] {
            let mut mesh = Mesh::default();
            add(&mut mesh, 0, [-0.3, 0.0, -0.3], [0.3, 0.6, 0.3]);
            add(&mut mesh, 1, [-1.5, 0.0, -0.6], [1.5, 2.0, -0.6 + panel]);
            let turn = glam::Quat::from_rotation_y(angle);
            mesh.positions.iter_mut().for_each(|p| *p = turn * *p);
            add(&mut mesh, 2, [-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]);
            assert_eq!(main_boxes(&mesh), [0], "{angle} {panel}");
        }
    }

    #[test]
    fn a_folded_screen_around_the_subject_is_a_wall() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [-0.3, 0.0, -0.3], [0.3, 0.6, 0.3]);
        add(&mut mesh, 1, [-1.5, 0.2, -1.0], [0.0, 2.0, -1.0]);
        // Its left wing comes forward.
        mesh.positions[32..].iter_mut().filter(|p| p.x < 0.0).for_each(|p| p.z = 0.5);
        add(&mut mesh, 1, [0.0, 0.2, -1.0], [1.5, 2.0, -1.0]);
        add(&mut mesh, 2, [-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]);
        let subject = find(&mesh, &[false]).unwrap();
        assert!(mesh.objects.iter().zip(&subject.is_main).all(|(o, m)| (*o == 0) == *m));
    }

    #[test]
    fn a_panel_that_is_no_wall_remains() {
        // A screen on its foot, and one beside a smaller thing.
        for solid in [[[-0.3, 0.0, -0.2], [0.3, 0.05, 0.2]], [[2.0, 0.0, -0.2], [2.2, 0.2, 0.0]]] {
            let mut mesh = Mesh::default();
            add(&mut mesh, 0, solid[0], solid[1]);
            add(&mut mesh, 1, [-0.8, 0.05, -0.02], [0.8, 1.0, 0.02]);
            add(&mut mesh, 2, [-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]);
            assert!(main_boxes(&mesh).contains(&1), "{solid:?}");
        }
    }

    #[test]
    fn the_shade_of_a_lamp_is_no_backdrop() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [-0.1, 0.0, -0.1], [0.1, 0.5, 0.1]);
        add(&mut mesh, 1, [-0.3, 0.4, -0.3], [0.3, 0.8, 0.3]);
        // Without its bottom and its top.
        for face in [3, 2] {
            let from = 12 + 2 * face;
            mesh.indices.drain(from..from + 2);
            mesh.objects.drain(from..from + 2);
            mesh.materials.drain(from..from + 2);
        }
        assert!(find(&mesh, &[false]).unwrap().is_main.iter().all(|m| *m));
    }

    #[test]
    fn what_lies_below_is_a_floor() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]);
        add(&mut mesh, 1, [-1.0, 0.01, -1.0], [1.0, 1.0, 1.0]);
        let box_only: Vec<bool> = mesh.objects.iter().map(|&o| o == 1).collect();
        assert!(has_floor(&mesh, &box_only));
        let floor_only: Vec<bool> = box_only.iter().map(|m| !m).collect();
        assert!(!has_floor(&mesh, &floor_only));
    }
}
