//! The scene's triangles in one indexed mesh.

use std::collections::{BTreeMap, HashMap};

use glam::{Vec2, Vec3, Vec4};

use crate::{embree::MAX_COORDINATE, light::Surroundings, math::Bounds};

/// Least radius of a scene's bounding sphere, metres, so that a density over it is finite.
const MIN_RADIUS: f32 = 1e-3;
/// Factor on the radius of a scene's bounding sphere: a thousand roundings of an f32.
const RADIUS_MARGIN: f32 = 1.0001;

/// Faces that meet at a position, above which those that look alike are taken together. The poles of
/// spheres have some hundred.
const MAX_FACES: usize = 1024;
/// Width of the cells of normals that are taken together, 1.8 degrees: there are at most 13,000.
const CELL: f32 = 1.0 / 32.0;

/// An indexed triangle mesh with per-triangle material and object.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v up.
    pub uvs: Vec<Vec2>,
    /// Unit tangents along which the x of a normal map runs, and the sign of the other axis,
    /// normal × tangent · sign. Zero, and beyond the end of the list, where the texture coordinates decide.
    pub tangents: Vec<Vec4>,
    /// Vertex indices of each triangle, counter-clockwise seen from the front.
    pub indices: Vec<[u32; 3]>,
    /// Index of the material of each triangle.
    pub materials: Vec<u32>,
    /// Index of the object, or group, of each triangle.
    pub objects: Vec<u32>,
}

impl Mesh {
    /// Corner positions of a triangle, metres.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.indices[triangle].map(|i| self.positions[i as usize])
    }

    /// Bounding box of all vertices, those that no triangle uses included.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        Bounds::of(self.positions.iter().copied())
    }

    /// Bounding sphere of all triangles, and a distance that leads out of it from anywhere inside and
    /// from `camera`.
    #[must_use]
    pub fn surroundings(&self, camera: Vec3) -> Surroundings {
        let used = || self.indices.iter().flatten().map(|&i| self.positions[i as usize]);
        let center = Bounds::of(used()).center();
        let radius = used().map(|p| p.distance(center)).fold(0.0, f32::max).max(MIN_RADIUS) * RADIUS_MARGIN;
        Surroundings { center, radius, far: 3.0 * radius + camera.distance(center) }
    }
}

/// Unnormalised normal of a triangle, twice its area long.
#[must_use]
pub fn face_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a)
}

/// Whether the coordinates of a point are such as Embree accepts.
#[must_use]
pub fn is_in_range(p: Vec3) -> bool {
    // Written so that NaN fails.
    p.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

/// Whether a triangle has a positive, finite area and coordinates that Embree accepts.
#[must_use]
pub fn is_proper(corners: [Vec3; 3]) -> bool {
    let n = face_normal(corners);
    corners.into_iter().all(is_in_range) && n.is_finite() && n.length_squared() > 0.0
}

/// Unit vertex normals of triangles that come without, three a triangle.
///
/// Each is the angle-weighted mean \[Thurmer98\] of the normals of the faces that meet at the same
/// position and bend from the triangle's own by at most `crease`, radians.
#[must_use]
pub fn smooth_normals(positions: &[Vec3], indices: &[[u32; 3]], crease: f32) -> Vec<[Vec3; 3]> {
    let corners = |t: &[u32; 3]| t.map(|i| positions[i as usize]);
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let faces: Vec<Vec3> = indices.iter().map(|t| face_normal(corners(t)).normalize_or_zero()).collect();
    let mut around: HashMap<[u32; 3], Vec<(u32, f32)>> = HashMap::new();
    for (f, t) in indices.iter().enumerate() {
        let c = corners(t);
        for k in 0..3 {
            let (e1, e2) = (c[(k + 1) % 3] - c[k], c[(k + 2) % 3] - c[k]);
            let angle = if faces[f] == Vec3::ZERO { 0.0 } else { e1.angle_between(e2) };
            around.entry(key(c[k])).or_default().push((f as u32, angle));
        }
    }
    let min_cos = crease.cos();
    let is_crowd = |(_, about): &(&[u32; 3], &Vec<(u32, f32)>)| about.len() > MAX_FACES;
    let crowds: HashMap<[u32; 3], Crowd> =
        around.iter().filter(is_crowd).map(|(p, about)| (*p, Crowd::new(about, &faces, min_cos))).collect();
    indices
        .iter()
        .enumerate()
        .map(|(f, t)| {
            corners(t).map(|p| {
                let p = key(p);
                let sum = match crowds.get(&p) {
                    Some(crowd) => crowd.sum(faces[f]),
                    None => around[&p]
                        .iter()
                        .filter(|(g, _)| faces[*g as usize].dot(faces[f]) >= min_cos)
                        .map(|(g, angle)| faces[*g as usize] * *angle)
                        .sum(),
                };
                sum.try_normalize().unwrap_or(faces[f])
            })
        })
        .collect()
}

/// The faces at a position where very many meet: each pair would be compared, of a disk of 300,000
/// triangles about its hub 10¹¹. Faces whose normals lie in one cell are taken together.
struct Crowd {
    /// For each cell the weighted sum of the normals that bend little enough from its own.
    sums: HashMap<[i32; 3], Vec3>,
}

impl Crowd {
    /// `about` are faces with their weights, `faces` the normals of all.
    fn new(about: &[(u32, f32)], faces: &[Vec3], min_cos: f32) -> Self {
        // In the order of the cells, so that sums do not depend on chance.
        let mut cells: BTreeMap<[i32; 3], (Vec3, Vec3)> = BTreeMap::new();
        for &(f, angle) in about {
            let n = faces[f as usize];
            let (mean, weighted) = cells.entry(Self::cell(n)).or_default();
            *mean += n;
            *weighted += n * angle;
        }
        let cells: Vec<([i32; 3], Vec3, Vec3)> =
            cells.into_iter().map(|(cell, (mean, sum))| (cell, mean.normalize_or_zero(), sum)).collect();
        let near = |n: Vec3| {
            let like = cells.iter().filter(|(_, other, _)| other.dot(n) >= min_cos);
            like.map(|(_, _, sum)| *sum).sum::<Vec3>()
        };
        // Of faces that may bend less than a cell is wide each keeps its own normal.
        let is_flat = min_cos > 1.0 - CELL * CELL;
        let sums = cells.iter().filter(|_| !is_flat).map(|(cell, mean, _)| (*cell, near(*mean))).collect();
        Self { sums }
    }

    fn cell(n: Vec3) -> [i32; 3] {
        (n / CELL).to_array().map(|v| v.round() as i32)
    }

    /// The sum for a face of normal `n`; zero where it keeps its own.
    fn sum(&self, n: Vec3) -> Vec3 {
        self.sums.get(&Self::cell(n)).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_are_smooth_below_the_crease_and_sharp_above() {
        // Two faces that meet at a right angle along the x axis.
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let t = [[0, 1, 2], [1, 0, 3]];
        let sharp = smooth_normals(&p, &t, 1.0);
        assert_eq!(sharp[0], [Vec3::Z; 3]);
        assert_eq!(sharp[1], [Vec3::Y; 3]);
        let smooth = smooth_normals(&p, &t, 2.0);
        assert!((smooth[0][0] - (Vec3::Y + Vec3::Z).normalize()).length() < 1e-6);
        assert_eq!(smooth[0][2], Vec3::Z);
    }

    /// A cone of `n` faces about the y axis, its apex first.
    fn cone(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let rim = |i: u32| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / n as f32).sin_cos();
            Vec3::new(cos, 0.0, sin)
        };
        let positions = std::iter::once(Vec3::Y).chain((0..n).map(rim)).collect();
        (positions, (0..n).map(|i| [0, 1 + (i + 1) % n, 1 + i]).collect())
    }

    #[test]
    fn where_very_many_faces_meet_normals_are_what_they_are_where_few_do() {
        for crease in [0.02, 0.4, 0.8, 3.0] {
            let [few, many] = [1000, 30_000].map(|n| {
                let (positions, indices) = cone(n);
                smooth_normals(&positions, &indices, crease)[0]
            });
            // Within the width of a cell: the crease falls there, and on one side alone at worst.
            assert!((few[0] - many[0]).length() < 2.0 * CELL, "{crease}: {} {}", few[0], many[0]);
            assert!((few[1] - many[1]).length() < 1e-2, "{crease}: {} {}", few[1], many[1]);
        }
    }
}
