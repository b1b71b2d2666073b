//! Films, which collect the light-carrying contributions of an integrator.
//!
//! An integrator hands every contribution, for unit radiance and with its
//! light and size coordinate, to a [`Recorder`]. The [`RgbFilm`] sums them
//! into a picture of each light; other films may keep them apart.
//!
//! Sums are independent of the number of threads: a pixel's own contributions
//! are added in sample order (f64), splats in fixed point (u64), whose sum
//! does not depend on the order.

pub mod exr;
pub mod image_file;
mod rgb;
mod splat;
pub mod tiling;

use glam::{UVec2, Vec2};

use crate::{
    light::{LightId, LightPoint},
    math::NodeRgb,
};

pub use rgb::{Picture, RgbFilm, RgbRow};
pub use splat::SplatBuffer;

/// A sampling strategy: `s` vertices from the light, `t` from the camera,
/// endpoints included. A light that a camera subpath crosses is its last
/// vertex: `s = 0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Strategy {
    /// Number of vertices of the light subpath.
    pub s: u8,
    /// Number of vertices of the camera subpath.
    pub t: u8,
}

impl Strategy {
    /// The strategy (s, t).
    #[must_use]
    pub fn new(s: usize, t: usize) -> Self {
        Self { s: s as u8, t: t as u8 }
    }

    /// Number of edges of the paths that the strategy samples.
    #[must_use]
    pub fn n_edges(&self) -> usize {
        usize::from(self.s) + usize::from(self.t) - 1
    }
}

/// Light carried along one sampled path, at `N` nodes of the background's value.
#[derive(Clone, Copy, Debug)]
pub struct Contribution<const N: usize = 1> {
    /// Light that the path ends on.
    pub light: LightId,
    /// Point of the light that the path ends on; its ρ is the size coordinate.
    pub at: LightPoint,
    /// Estimate of the pixel's radiance for unit radiance of the light, per node of the
    /// background's value; the weight of the strategy is included.
    pub value: NodeRgb<N>,
    /// Strategy that sampled the path.
    pub strategy: Strategy,
    /// Multiple importance sampling weight of the strategy for the path, in [0, 1].
    pub mis_weight: f32,
}

/// A receiver of the contributions of the samples of one pixel.
pub trait Recorder<const N: usize = 1> {
    /// Records a contribution to the pixel being sampled (t ≥ 2).
    fn add(&mut self, c: &Contribution<N>);
    /// Records a contribution at the point `raster` (pixels) where the path meets the film
    /// (t = 1).
    fn splat(&mut self, raster: Vec2, c: &Contribution<N>);
}

/// A film that can be filled row by row in parallel.
pub trait Film<const N: usize = 1>: Send + Sync {
    /// Recorder of one row of the film.
    type Row<'a>: RowRecorder<N> + Send
    where
        Self: 'a;
    /// Number of columns and rows, pixels.
    fn size(&self) -> UVec2;
    /// Recorders of the rows, first row first.
    fn rows(&mut self) -> Vec<Self::Row<'_>>;
    /// Number of contributions dropped because they were not finite, and number of splats
    /// that overflowed, since the film was made.
    fn defects(&self) -> (u64, u64);
}

/// A [`Recorder`] that moves from pixel to pixel of its row, once for each replicate.
pub trait RowRecorder<const N: usize = 1>: Recorder<N> {
    /// Begins the row; called before the first pixel.
    fn open(&mut self) {}
    /// Makes the `i`-th pixel of the row current.
    fn set_pixel(&mut self, i: usize);
    /// Ends a replicate; called when all its samples have been taken.
    fn end_replicate(&mut self) {}
    /// Ends the row; called when all samples have been taken.
    fn close(&mut self) {}
}
