//! Units and axes: an OBJ brought to metres, y up.

use glam::Vec3;

use super::sidecar::UpAxis;
use crate::scene::mesh::{Mesh, is_proper};

/// Scales a mesh and turns it y up; returns how many triangles were lost to rounding.
pub fn place(mesh: &mut Mesh, scale: f32, up: UpAxis) -> usize {
    if scale == 1.0 && up == UpAxis::Y {
        return 0;
    }
    let turned = |v: Vec3| match up {
        UpAxis::Y => v,
        UpAxis::Z => Vec3::new(v.x, v.z, -v.y),
    };
    mesh.positions.iter_mut().for_each(|p| *p = turned(*p) * scale);
    mesh.normals.iter_mut().for_each(|n| *n = turned(*n));
    let n = mesh.indices.len();
    let kept: Vec<usize> = (0..n).filter(|&t| is_proper(mesh.corners(t))).collect();
    if kept.len() < n {
        mesh.indices = kept.iter().map(|&t| mesh.indices[t]).collect();
        mesh.materials = kept.iter().map(|&t| mesh.materials[t]).collect();
        mesh.objects = kept.iter().map(|&t| mesh.objects[t]).collect();
    }
    n - kept.len()
}
