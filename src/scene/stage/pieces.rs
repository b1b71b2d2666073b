//! What of a scene is its subject, and whether it stands on a floor.

use std::collections::HashMap;

use glam::Vec3;

use super::super::mesh::{Mesh, face_normal};

/// Pieces above which nothing is grouped.
const MAX_PIECES: usize = 3000;
/// Largest thickness of a panel, in its extents.
const PANEL_THICKNESS: f32 = 0.02;
/// Least extents of a floor or a wall, in those of the scene.
const PANEL_SPAN: f32 = 0.6;
/// Largest distance of a floor or wall from the scene's boundary, in its extents.
const PANEL_GAP: f32 = 0.05;
/// Least share of a room's area that lies on the scene's boundary.
const ROOM_SHARE: f32 = 0.7;
/// Largest horizontal extents of what stands in a room or on a floor, in those of the scene.
const MAX_STANDING: f32 = 0.8;
/// Pieces whose boxes are no farther apart, in diagonals of the scene, belong together.
const TOUCHING: f32 = 0.01;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub lo: Vec3,
    /// Largest corner.
    pub hi: Vec3,
}

impl Bounds {
    /// Of points; of none it is inside out.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        let empty = Self { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };
        points.into_iter().fold(empty, |b, p| Self { lo: b.lo.min(p), hi: b.hi.max(p) })
    }

    fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Side lengths.
    pub fn extent(&self) -> Vec3 {
        self.hi - self.lo
    }

    /// Middle.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.lo + self.hi)
    }

    fn touches(&self, other: &Self, gap: f32) -> bool {
        (self.lo - gap).cmple(other.hi).all() && (other.lo - gap).cmple(self.hi).all()
    }
}

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
/// groups of touching pieces holds that is neither floor nor wall.
///
/// Pieces are objects or groups, or the connected parts of the mesh if there is only one.
pub fn find(mesh: &Mesh) -> Subject {
    let pieces = pieces(mesh);
    let all = || Subject { is_main: vec![true; mesh.indices.len()], has_floor: false };
    if pieces.len() < 2 || pieces.len() > MAX_PIECES {
        return all();
    }
    let scene = bounds_of(pieces.iter());
    let is_shell: Vec<bool> = pieces.iter().map(|p| is_shell(mesh, p, &scene)).collect();
    let floors = pieces.iter().zip(&is_shell).filter(|(p, is_shell)| **is_shell && is_floor(p, &scene));
    let rest: Vec<&Piece> = pieces.iter().zip(&is_shell).filter(|(_, s)| !**s).map(|(p, _)| p).collect();
    let floor = bounds_of(floors.map(|(p, _)| p));
    let subject = dominant(&rest, TOUCHING * scene.extent().length());
    let bounds = bounds_of(subject.iter().copied());
    let share = bounds.extent() / scene.extent();
    let stands = bounds.lo.y - floor_top(&floor, &scene) <= PANEL_GAP * scene.extent().y;
    if subject.is_empty() || !stands || share.x > MAX_STANDING || share.z > MAX_STANDING {
        return all();
    }
    let mut is_main = vec![false; mesh.indices.len()];
    subject.iter().flat_map(|p| &p.triangles).for_each(|&t| is_main[t] = true);
    Subject { is_main, has_floor: true }
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

fn bounds_of<'a>(pieces: impl Iterator<Item = &'a Piece>) -> Bounds {
    pieces.map(|p| p.bounds).reduce(Bounds::union).unwrap_or(Bounds::of([]))
}

/// Height of the floor; without one below all that there is.
fn floor_top(floor: &Bounds, scene: &Bounds) -> f32 {
    if floor.lo.y.is_finite() {
        floor.hi.y.min(scene.lo.y + PANEL_GAP * scene.extent().y)
    } else {
        f32::NEG_INFINITY
    }
}

/// A panel at the bottom, or a room.
fn is_floor(piece: &Piece, scene: &Bounds) -> bool {
    piece.bounds.lo.y <= scene.lo.y + PANEL_GAP * scene.extent().y
        && (0..3).step_by(2).all(|a| piece.bounds.extent()[a] >= PANEL_SPAN * scene.extent()[a])
}

/// Whether a piece is a floor, a wall, a ceiling or a whole room.
fn is_shell(mesh: &Mesh, piece: &Piece, scene: &Bounds) -> bool {
    let (extent, whole) = (piece.bounds.extent(), scene.extent());
    let thin = (0..3).find(|&a| extent[a] <= PANEL_THICKNESS * extent.max_element());
    if let Some(axis) = thin {
        let spans = (0..3).filter(|&a| a != axis).all(|a| extent[a] >= PANEL_SPAN * whole[a]);
        let gap = (piece.bounds.lo[axis] - scene.lo[axis]).min(scene.hi[axis] - piece.bounds.hi[axis]);
        // A floor is below, however large it is.
        return spans && gap <= PANEL_GAP * whole[axis];
    }
    if extent.x < 0.9 * whole.x || extent.z < 0.9 * whole.z {
        return false;
    }
    let tolerance = PANEL_THICKNESS * whole;
    let lies_on_boundary = |corners: &[Vec3; 3]| {
        (0..3).any(|a| {
            corners.iter().all(|c| c[a] - scene.lo[a] <= tolerance[a])
                || corners.iter().all(|c| scene.hi[a] - c[a] <= tolerance[a])
        })
    };
    let (mut on, mut total) = (0.0, 0.0);
    for &t in &piece.triangles {
        let corners = mesh.corners(t);
        let area = face_normal(corners).length();
        total += area;
        on += if lies_on_boundary(&corners) { area } else { 0.0 };
    }
    on >= ROOM_SHARE * total
}

/// The group of touching pieces with the largest box.
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
    let size = |r: usize| bounds_of(members(r).into_iter()).extent().length();
    let mut best: Option<(f32, usize)> = None;
    for r in (0..pieces.len()).filter(|&i| roots[i] == i) {
        let s = size(r);
        if best.is_none_or(|(largest, _)| s > largest) {
            best = Some((s, r));
        }
    }
    best.map_or_else(Vec::new, |(_, r)| members(r))
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

    /// Appends a box, or a panel if an extent is 0.
    fn add(mesh: &mut Mesh, object: u32, lo: [f32; 3], hi: [f32; 3]) {
        let first = mesh.positions.len() as u32;
        let pick = |i: usize, a: usize| if i >> a & 1 == 0 { lo[a] } else { hi[a] };
        mesh.positions.extend((0..8).map(|i| Vec3::new(pick(i, 0), pick(i, 1), pick(i, 2))));
        let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        for [a, b, c, d] in faces.map(|f| f.map(|i| first + i)) {
            for t in [[a, b, c], [a, c, d]] {
                mesh.indices.push(t);
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
        assert_eq!(main_boxes(&mesh), [1]);
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
