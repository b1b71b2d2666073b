//! What of a scene is its subject, and whether it stands on a floor.

use std::collections::HashMap;

use glam::Vec3;

use crate::{
    math::Bounds,
    scene::mesh::{Mesh, face_normal},
};

/// Pieces above which nothing is grouped.
const MAX_PIECES: usize = 3000;
/// Largest thickness of a panel, in its extents.
const PANEL_THICKNESS: f32 = 0.04;
/// Least extents of a floor or a wall, in those of the scene.
const PANEL_SPAN: f32 = 0.6;
/// Largest distance of a floor or wall from the scene's boundary, in its extents.
const PANEL_GAP: f32 = 0.05;
/// Least horizontal extents of a room or a backdrop, in those of the scene.
const ROOM_SPAN: f32 = 0.9;
/// How far a room's walls are from the scene's boundary at most, in its extents.
const BOUNDARY: f32 = 0.02;
/// How high above a floor a subject is still taken to stand on it, in the scene's height.
const STANDING_GAP: f32 = 0.12;
/// Least share of a room's area that lies on the scene's boundary.
const ROOM_SHARE: f32 = 0.7;
/// Least share of that which faces inward: a closed box seen from outside is no room.
const INWARD_SHARE: f32 = 0.4;
/// Least horizontal extents of a backdrop or a landscape, in those of all else.
const ENCLOSING_SPAN: f32 = 1.5;
/// Least share of its area that faces the middle of all else.
const ENCLOSING_SHARE: f32 = 0.8;
/// Largest horizontal extents of what stands in a room or on a floor, in those of the scene.
const MAX_STANDING: f32 = 0.8;
/// Pieces whose boxes are no farther apart, in diagonals of all but floor and walls, belong together.
const TOUCHING: f32 = 0.01;

/// Groups of this size, in that of the largest, are as much the subject.
const EQUAL: f32 = 0.6;

/// What of a scene is its subject.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// By triangle.
    pub is_main: Vec<bool>,
    /// Whether something below carries it.
    pub has_floor: bool,
}

/// Triangles that belong together.
#[derive(Debug)]
struct Piece {
    triangles: Vec<usize>,
    bounds: Bounds,
}

/// Finds the subject: without a floor everything; otherwise what the largest of the
/// groups of touching pieces holds that is neither floor nor wall. What stands on a
/// table in a room is found by doing so again.
///
/// Pieces are objects or groups, or the connected parts of the mesh if there is only one.
pub fn find(mesh: &Mesh) -> Subject {
    let pieces = pieces(mesh);
    let mut subject: Vec<&Piece> = pieces.iter().collect();
    let mut has_floor = false;
    while (2..=MAX_PIECES).contains(&subject.len()) {
        let Some(inner) = without_shells(mesh, &subject) else { break };
        subject = inner;
        has_floor = true;
    }
    let mut is_main = vec![false; mesh.indices.len()];
    subject.iter().flat_map(|p| &p.triangles).for_each(|&t| is_main[t] = true);
    Subject { is_main, has_floor }
}

/// The largest group of pieces that stands on a floor or in a room of the others.
fn without_shells<'a>(mesh: &Mesh, pieces: &[&'a Piece]) -> Option<Vec<&'a Piece>> {
    let scene = bounds_of(pieces);
    let is_enclosing = |p: &Piece| encloses(mesh, p, pieces, &scene);
    let (shells, inner): (Vec<&Piece>, Vec<&Piece>) =
        pieces.iter().partition(|p| is_panel(p, &scene) || is_room(mesh, p, &scene) || is_enclosing(p));
    if shells.is_empty() {
        return None;
    }
    let subject = dominant(&inner, TOUCHING * bounds_of(&inner).extent().length());
    let bounds = bounds_of(&subject);
    let share = bounds.extent() / scene.extent();
    let gap = STANDING_GAP * scene.extent().y;
    let floors = shells.iter().filter(|p| is_floor(p, &scene));
    let top = |p: &Piece| if is_panel(p, &scene) { p.bounds.hi.y } else { p.bounds.lo.y };
    let stands = floors.map(|p| top(p)).any(|top| (bounds.lo.y - top).abs() <= gap);
    let is_held = stands || shells.iter().any(|p| is_enclosing(p));
    let is_small = share.x <= MAX_STANDING && share.z <= MAX_STANDING;
    // What is painted on a floor does not stand on it.
    let rises = bounds.hi.y > scene.lo.y;
    (!subject.is_empty() && is_held && is_small && rises).then_some(subject)
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
        normal.y.abs() > 0.7
            && b.hi.y <= subject.lo.y + PANEL_GAP * size
            && b.lo.y >= subject.lo.y - 0.5 * size
    });
    let floor = Bounds::of(below.flatten());
    floor.lo.x <= subject.lo.x
        && floor.lo.z <= subject.lo.z
        && floor.hi.x >= subject.hi.x
        && floor.hi.z >= subject.hi.z
}

fn bounds_of(pieces: &[&Piece]) -> Bounds {
    pieces.iter().map(|p| p.bounds).reduce(Bounds::union).unwrap_or(Bounds::of([]))
}

/// Whether a piece spans this share of the scene, seen from above.
fn spans(piece: &Piece, scene: &Bounds, share: f32) -> bool {
    let (extent, whole) = (piece.bounds.extent(), scene.extent());
    extent.x >= share * whole.x && extent.z >= share * whole.z
}

/// A panel at the bottom, or a room.
fn is_floor(piece: &Piece, scene: &Bounds) -> bool {
    piece.bounds.lo.y <= scene.lo.y + PANEL_GAP * scene.extent().y && spans(piece, scene, PANEL_SPAN)
}

/// Whether a piece is a floor, a wall or a ceiling.
fn is_panel(piece: &Piece, scene: &Bounds) -> bool {
    let (extent, whole) = (piece.bounds.extent(), scene.extent());
    let Some(axis) = (0..3).find(|&a| extent[a] <= PANEL_THICKNESS * extent.max_element()) else {
        return false;
    };
    let gap = (piece.bounds.lo[axis] - scene.lo[axis]).min(scene.hi[axis] - piece.bounds.hi[axis]);
    (0..3).filter(|&a| a != axis).all(|a| extent[a] >= PANEL_SPAN * whole[a])
        && gap <= PANEL_GAP * whole[axis]
}

/// Whether a piece is a room: most of it lies on the scene's boundary and is seen from inside.
fn is_room(mesh: &Mesh, piece: &Piece, scene: &Bounds) -> bool {
    let tolerance = BOUNDARY * scene.extent();
    let lies_on_boundary = |corners: &[Vec3; 3]| {
        (0..3).any(|a| {
            corners.iter().all(|c| c[a] - scene.lo[a] <= tolerance[a])
                || corners.iter().all(|c| scene.hi[a] - c[a] <= tolerance[a])
        })
    };
    if !spans(piece, scene, ROOM_SPAN) {
        return false;
    }
    let (on, inward) = areas(mesh, piece, scene.center(), lies_on_boundary);
    let (total, _) = areas(mesh, piece, scene.center(), |_| true);
    on >= ROOM_SHARE * total && inward >= INWARD_SHARE * on
}

/// Whether a piece surrounds the others at a distance, as a backdrop or a landscape does.
fn encloses(mesh: &Mesh, piece: &Piece, pieces: &[&Piece], scene: &Bounds) -> bool {
    if !spans(piece, scene, ROOM_SPAN) {
        return false;
    }
    let others: Vec<&Piece> = pieces.iter().filter(|p| !std::ptr::eq(**p, piece)).copied().collect();
    let inner = bounds_of(&others);
    let room = piece.bounds.extent() / inner.extent();
    if room.x < ENCLOSING_SPAN || room.z < ENCLOSING_SPAN {
        return false;
    }
    let (total, inward) = areas(mesh, piece, inner.center(), |_| true);
    inward >= ENCLOSING_SHARE * total
}

/// Area of the triangles of a piece that `counts`, and that of those whose shading normals
/// face a point.
fn areas(mesh: &Mesh, piece: &Piece, point: Vec3, counts: impl Fn(&[Vec3; 3]) -> bool) -> (f32, f32) {
    let triangles = piece.triangles.iter().map(|&t| (t, mesh.corners(t))).filter(|(_, c)| counts(c));
    triangles.fold((0.0, 0.0), |(total, facing), (t, c)| {
        let area = 0.5 * face_normal(c).length();
        let normal: Vec3 = mesh.indices[t].iter().map(|&i| mesh.normals[i as usize]).sum();
        (total + area, facing + if normal.dot(point - c[0]) > 0.0 { area } else { 0.0 })
    })
}

/// The group of touching pieces with the largest box, and those about as large: of a chess
/// set more than a king.
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
    groups.iter().filter(|(_, s)| *s >= EQUAL * largest).flat_map(|(r, _)| members(*r)).collect()
}

/// The representative of a set, whose paths are halved on the way.
fn root(parent: &mut [usize], mut i: usize) -> usize {
    while parent[i] != i {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    i
}

fn pieces(mesh: &Mesh) -> Vec<Piece> {
    let one_object = mesh.objects.windows(2).all(|w| w[0] == w[1]);
    let label =
        if one_object { components(mesh) } else { mesh.objects.iter().map(|&o| o as usize).collect() };
    let mut index: HashMap<usize, usize> = HashMap::new();
    let mut out: Vec<Piece> = Vec::new();
    for (t, l) in label.into_iter().enumerate() {
        let bounds = Bounds::of(mesh.corners(t));
        let i = *index.entry(l).or_insert(out.len());
        match out.get_mut(i) {
            None => out.push(Piece { triangles: vec![t], bounds }),
            Some(piece) => {
                piece.triangles.push(t);
                piece.bounds = piece.bounds.union(bounds);
            }
        }
    }
    out
}

/// Connected part of each triangle: those that share a position are connected.
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
        let s = find(mesh);
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
            assert!(find(&mesh).has_floor);
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
    fn without_a_floor_everything_is_the_subject() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [0.0; 3], [1.0; 3]);
        add(&mut mesh, 1, [3.0, 0.0, 0.0], [3.5; 3]);
        assert_eq!(find(&mesh), Subject { is_main: vec![true; 24], has_floor: false });
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
    fn a_room_is_not_the_subject() {
        let mut mesh = Mesh::default();
        add(&mut mesh, 0, [0.0; 3], [4.0, 3.0, 5.0]);
        add(&mut mesh, 1, [1.0, 0.0, 1.0], [2.0, 1.0, 2.0]);
        assert_eq!(main_boxes(&mesh), [0, 1], "a box with something in it");
        mesh.normals[..32].iter_mut().for_each(|n| *n = -*n);
        assert_eq!(main_boxes(&mesh), [1], "a room");
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
