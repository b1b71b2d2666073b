//! Visibility between the main object, its camera and its lights.

use glam::Vec3;

use super::frame::View;
use crate::{
    embree::{Accel, EmbreeError, Ray, TriangleMesh},
    scene::Mesh,
};

/// Rays from a camera to the main object, at most: the standard error of the visible share is then
/// √(0.9·0.1/256) = 0.02 at the share that is asked for.
const MAX_RAYS: usize = 256;
/// Share of a ray's length at its end that is not tested: the subject's own surroundings touch it there.
const END_MARGIN: f32 = 1e-3;

/// Columns and rows of the points of a picture at which it is tested what frames it, its edges included: gaps of a
/// tenth of its width show.
const GRID: [usize; 2] = [17, 13];
/// Distance up to which something frames a picture, over that of the camera from the subject.
const FAR: f32 = 1e3;

/// All triangles but those of the main object.
#[derive(Debug)]
pub struct Obstacles {
    accel: Option<Accel>,
}

impl Obstacles {
    /// The triangles of a mesh that are not `is_main`.
    ///
    /// # Errors
    /// When a triangle's coordinates are not finite or too large for Embree.
    pub fn new(mesh: &Mesh, is_main: &[bool]) -> Result<Self, EmbreeError> {
        let others = is_main.iter().zip(&mesh.indices).filter(|(is_main, _)| !**is_main);
        let indices: Vec<[u32; 3]> = others.map(|(_, t)| *t).collect();
        if indices.is_empty() {
            return Ok(Self { accel: None });
        }
        let accel = Accel::build(&[TriangleMesh { positions: &mesh.positions, indices: &indices }])?;
        Ok(Self { accel: Some(accel) })
    }

    /// Whether there is nothing but the main object.
    pub fn is_empty(&self) -> bool {
        self.accel.is_none()
    }

    /// Share in [0, 1] of the segment from `from` to `to` before the first obstacle; 1 without any.
    pub fn free_share(&self, from: Vec3, to: Vec3) -> f32 {
        let Some(accel) = &self.accel else { return 1.0 };
        let dir = to - from;
        accel.intersect(&Ray { org: from, dir, t_min: 0.0, t_max: 1.0 }).map_or(1.0, |hit| hit.t)
    }

    /// Share in [0, 1] of a picture in which an obstacle, such as a backdrop, is behind or before the main object:
    /// elsewhere one sees past it into the dark.
    pub fn framed_share(&self, view: &View) -> f32 {
        let (axes, tangents) = (view.axes(), view.tangents());
        let far = FAR * view.eye.distance(view.look_at);
        let at = |k: usize, n: usize| 2.0 * k as f32 / (n - 1) as f32 - 1.0;
        let [columns, rows] = GRID;
        let is_framed = |i: &usize| {
            let (x, y) = (at(i % columns, columns) * tangents.x, at(i / columns, rows) * tangents.y);
            let ahead = axes.forward + axes.right * x + axes.up * y;
            self.free_share(view.eye, view.eye + ahead * far) < 1.0
        };
        (0..columns * rows).filter(is_framed).count() as f32 / (columns * rows) as f32
    }

    /// Share in [0, 1] of the points that no obstacle hides from `eye`, by a sample of them.
    pub fn visible_share(&self, points: &[Vec3], eye: Vec3) -> f32 {
        let step = points.len().div_ceil(MAX_RAYS).max(1);
        let sample = points.iter().step_by(step);
        let n = sample.clone().count().max(1);
        sample.filter(|p| self.free_share(eye, eye + (**p - eye) * (1.0 - END_MARGIN)) >= 1.0).count() as f32
            / n as f32
    }
}
