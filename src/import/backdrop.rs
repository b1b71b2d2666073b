//! A photographer's seamless sweep: a floor that bends up into a wall.

use std::f32::consts::FRAC_PI_2;

use glam::{Vec2, Vec3};

use crate::scene::Mesh;

/// Name of the sweep's object and of its material.
pub const NAME: &str = "backdrop";
/// Facets of the cove; its normals are exact.
const N_FACETS: u32 = 24;

/// Where a sweep stands and how large it is, metres.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    /// A point of the floor.
    pub position: Vec3,
    /// Radians about +y; at 0 the wall faces +z.
    pub turn: f32,
    /// From the position to the floor's front edge.
    pub front: f32,
    /// From the position to the wall.
    pub back: f32,
    /// Across.
    pub width: f32,
    /// Of the wall, at least the radius.
    pub height: f32,
    /// Of the cove, above 0, at most `back` and `height`.
    pub radius: f32,
}

impl Sweep {
    /// Appends the sweep's triangles to `mesh`. Their normals point to the
    /// subject; texture coordinates are metres across and along.
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

    /// Points (toward the front, up) from the floor's front edge to the wall's
    /// top, and the normals there.
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
