//! What stands between a subject, its camera and its lights.

use glam::Vec3;

use crate::{
    embree::{Accel, EmbreeError, Ray, TriangleMesh},
    scene::Mesh,
};

/// Rays to the subject, at most.
const MAX_RAYS: usize = 256;

/// All triangles but those of the subject.
#[derive(Debug)]
pub struct Obstacles {
    accel: Option<Accel>,
}

impl Obstacles {
    /// Of a mesh whose subject is `is_main`.
    ///
    /// # Errors
    /// When the triangles are broken.
    pub fn new(mesh: &Mesh, is_main: &[bool]) -> Result<Self, EmbreeError> {
        let others = is_main.iter().zip(&mesh.indices).filter(|(is_main, _)| !**is_main);
        let indices: Vec<[u32; 3]> = others.map(|(_, t)| *t).collect();
        if indices.is_empty() {
            return Ok(Self { accel: None });
        }
        let accel = Accel::build(&[TriangleMesh { positions: &mesh.positions, indices: &indices }])?;
        Ok(Self { accel: Some(accel) })
    }

    /// How much of the way from `from` to `to` is free, in [0, 1].
    pub fn free_share(&self, from: Vec3, to: Vec3) -> f32 {
        let Some(accel) = &self.accel else { return 1.0 };
        let dir = to - from;
        accel.intersect(&Ray { org: from, dir, t_min: 0.0, t_max: 1.0 }).map_or(1.0, |hit| hit.t)
    }

    /// Share of points that are not hidden from `eye`.
    pub fn visible_share(&self, points: &[Vec3], eye: Vec3) -> f32 {
        const MARGIN: f32 = 1e-3;
        let step = points.len().div_ceil(MAX_RAYS).max(1);
        let sample = points.iter().step_by(step);
        let n = sample.clone().count().max(1);
        sample.filter(|p| self.free_share(eye, eye + (**p - eye) * (1.0 - MARGIN)) >= 1.0).count() as f32
            / n as f32
    }
}
