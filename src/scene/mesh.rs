//! The scene's triangles in one indexed mesh.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use crate::{embree::MAX_COORDINATE, light::Surroundings, math::Bounds};

/// Least radius of a scene's bounding sphere, metres, so that a density over it is finite.
const MIN_RADIUS: f32 = 1e-3;
/// Factor on the radius of a scene's bounding sphere: a thousand roundings of an f32.
const RADIUS_MARGIN: f32 = 1.0001;

/// An indexed triangle mesh with per-triangle material and object.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v up.
    pub uvs: Vec<Vec2>,
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

/// Whether a triangle has a positive, finite area and coordinates that Embree accepts.
#[must_use]
pub fn is_proper(corners: [Vec3; 3]) -> bool {
    let n = face_normal(corners);
    corners.iter().all(|c| c.abs().cmple(Vec3::splat(MAX_COORDINATE)).all())
        && n.is_finite()
        && n.length_squared() > 0.0
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
    indices
        .iter()
        .enumerate()
        .map(|(f, t)| {
            corners(t).map(|p| {
                let sum: Vec3 = around[&key(p)]
                    .iter()
                    .filter(|(g, _)| faces[*g as usize].dot(faces[f]) >= min_cos)
                    .map(|(g, angle)| faces[*g as usize] * *angle)
                    .sum();
                sum.try_normalize().unwrap_or(faces[f])
            })
        })
        .collect()
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
}
