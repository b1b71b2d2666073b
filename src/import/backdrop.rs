//! A photographer's seamless sweep: a floor that bends up into a wall.

use std::f32::consts::FRAC_PI_2;

use glam::{Vec2, Vec3};

use crate::scene::Mesh;

/// Name of the sweep's object and of its material.
pub const NAME: &str = "backdrop";
/// Base colour where the sidecar does not say: light grey paper.
pub const BASE_COLOR: [f32; 3] = [0.6; 3];
/// Facets of the quarter cylinder between floor and wall. Vertex normals are exact, so that only
/// the outline shows them: 24 keep it within r·(1 − cos 1.875°) = 5·10⁻⁴ r of the cylinder.
const N_FACETS: u32 = 24;

/// Position and dimensions of a sweep: a floor, a quarter cylinder (the cove) and a wall.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    /// Reference point on the floor, below the subject, metres.
    pub position: Vec3,
    /// Rotation about +y, radians; at 0 the wall faces +z.
    pub turn: f32,
    /// Horizontal distance from `position` to the front edge of the floor, metres.
    pub front: f32,
    /// Horizontal distance from `position` to the wall, metres.
    pub back: f32,
    /// Horizontal extent of floor, cove and wall across the viewing direction, metres.
    pub width: f32,
    /// Height of the wall above the floor, metres; at least `radius`.
    pub height: f32,
    /// Radius of the cove, metres; positive and at most `back` and `height`.
    pub radius: f32,
}

impl Sweep {
    /// Appends the sweep's triangles to `mesh` as those of material `material` and object `object`.
    ///
    /// Normals point toward the subject. Texture coordinates are metres: u across, v along the
    /// profile from the front edge.
    pub fn append(&self, mesh: &mut Mesh, material: u32, object: u32) {
        let (sin, cos) = self.turn.sin_cos();
        let (right, front) = (Vec3::new(cos, 0.0, -sin), Vec3::new(sin, 0.0, cos));
        let first = mesh.positions.len() as u32;
        let profile = self.profile();
        let mut along = 0.0;
        let mut last = profile[0].0;
        for (p, normal) in &profile {
            along += p.distance(last);
            last = *p;
            for side in [-0.5, 0.5] {
                mesh.positions
                    .push(self.position + right * (side * self.width) + front * p.x + Vec3::Y * p.y);
                mesh.normals.push(front * normal.x + Vec3::Y * normal.y);
                mesh.uvs.push(Vec2::new((side + 0.5) * self.width, along));
            }
        }
        for row in 0..profile.len() as u32 - 1 {
            let i = first + 2 * row;
            for triangle in [[i, i + 1, i + 3], [i, i + 3, i + 2]] {
                mesh.indices.push(triangle);
                mesh.materials.push(material);
                mesh.objects.push(object);
            }
        }
    }

    /// Profile from the front edge of the floor to the top of the wall: points and unit normals,
    /// both as (toward the front, up).
    fn profile(&self) -> Vec<(Vec2, Vec2)> {
        let r = self.radius;
        let center = Vec2::new(r - self.back, r);
        let mut out = vec![(Vec2::new(self.front, 0.0), Vec2::Y)];
        out.extend((0..=N_FACETS).map(|i| {
            let (sin, cos) = (FRAC_PI_2 * i as f32 / N_FACETS as f32).sin_cos();
            let normal = Vec2::new(sin, cos);
            (center - r * normal, normal)
        }));
        if self.height > r {
            out.push((Vec2::new(-self.back, self.height), Vec2::X));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{math::Bounds, scene::mesh::face_normal};

    #[test]
    fn the_sweep_is_as_large_as_it_should_and_faces_the_subject() {
        let sweep = Sweep {
            position: Vec3::new(1.0, 2.0, 3.0),
            turn: FRAC_PI_2,
            front: 4.0,
            back: 2.0,
            width: 6.0,
            height: 5.0,
            radius: 1.0,
        };
        let mut mesh = Mesh::default();
        sweep.append(&mut mesh, 0, 0);
        let Bounds { lo, hi } = mesh.bounds();
        assert!((lo - Vec3::new(-1.0, 2.0, 0.0)).length() < 1e-5, "{lo}");
        assert!((hi - Vec3::new(5.0, 7.0, 6.0)).length() < 1e-5, "{hi}");
        for (t, corners) in mesh.indices.iter().enumerate() {
            let n = face_normal(mesh.corners(t)).normalize();
            assert!(corners.iter().all(|&i| n.dot(mesh.normals[i as usize]) > 0.99), "{t}");
            assert!(n.x > -1e-5 && n.y > -1e-5, "{n}");
        }
    }
}
