//! Length unit and up axis of an OBJ, which the format leaves open: conversion to metres, y up.

use glam::{DVec3, Vec3};
use serde::Deserialize;

use crate::scene::mesh::{Mesh, is_proper};

/// Coordinate axis of a file that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +y, as OBJ has it.
    #[default]
    Y,
    /// +z, as CAD programs have it; +y is then to the back.
    Z,
}

/// A point of the file in metres, y up.
#[must_use]
pub fn point_to_metres_y_up(p: DVec3, scale: f64, up: UpAxis) -> DVec3 {
    let rotated = match up {
        UpAxis::Y => p,
        UpAxis::Z => DVec3::new(p.x, p.z, -p.y),
    };
    rotated * scale
}

/// Scales a mesh by `scale`, metres per unit of the file, and rotates it such that `up` becomes +y.
///
/// Triangles that are then without area or out of range are removed; returns how many there were.
pub fn to_metres_y_up(mesh: &mut Mesh, scale: f64, up: UpAxis) -> usize {
    if scale == 1.0 && up == UpAxis::Y {
        return 0;
    }
    let rotated = |v: Vec3| match up {
        UpAxis::Y => v,
        UpAxis::Z => Vec3::new(v.x, v.z, -v.y),
    };
    mesh.positions.iter_mut().for_each(|p| *p = rotated(*p) * scale as f32);
    mesh.normals.iter_mut().for_each(|n| *n = rotated(*n));
    let n = mesh.indices.len();
    let kept: Vec<usize> = (0..n).filter(|&t| is_proper(mesh.corners(t))).collect();
    if kept.len() < n {
        mesh.indices = kept.iter().map(|&t| mesh.indices[t]).collect();
        mesh.materials = kept.iter().map(|&t| mesh.materials[t]).collect();
        mesh.objects = kept.iter().map(|&t| mesh.objects[t]).collect();
    }
    n - kept.len()
}
