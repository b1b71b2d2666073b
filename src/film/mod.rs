//! Films: what becomes of the light-carrying contributions of an integrator.
//!
//! An integrator hands every contribution, for unit radiance and with its
//! light and size coordinate, to a [`Recorder`]. The [`RgbFilm`] sums them
//! into a picture per light; other films may keep them apart.
//!
//! Sums are independent of the number of threads: a pixel's own contributions
//! are added in sample order (f64), splats in fixed point (u64), whose sum
//! does not depend on the order.

pub mod exr;
pub mod image_file;
mod rgb;
mod splat;

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
    /// Vertices of the light subpath.
    pub s: u8,
    /// Vertices of the camera subpath.
    pub t: u8,
}

impl Strategy {
    /// The strategy (s, t).
    #[must_use]
    pub fn new(s: usize, t: usize) -> Self {
        Self { s: s as u8, t: t as u8 }
    }

    /// Edges of the paths it samples.
    #[must_use]
    pub fn n_edges(&self) -> usize {
        usize::from(self.s) + usize::from(self.t) - 1
    }
}

/// Light carried along one sampled path, at `N` nodes of the background's value.
#[derive(Clone, Copy, Debug)]
pub struct Contribution<const N: usize = 1> {
    /// The light the path ends on.
    pub light: LightId,
    /// The path's end on the light; its ρ is the size coordinate.
    pub at: LightPoint,
    /// Pixel radiance for unit radiance of the light, already weighted.
    pub value: NodeRgb<N>,
    /// The strategy that sampled the path.
    pub strategy: Strategy,
    /// The weight of that strategy, within [0, 1].
    pub mis_weight: f32,
}

/// Receives the contributions of the samples of one pixel.
pub trait Recorder<const N: usize = 1> {
    /// A contribution to the pixel being sampled (t ≥ 2).
    fn add(&mut self, c: &Contribution<N>);
    /// A contribution to wherever the path meets the film (t = 1).
    fn splat(&mut self, raster: Vec2, c: &Contribution<N>);
}

/// A film that can be filled row by row in parallel.
pub trait Film<const N: usize = 1>: Send + Sync {
    /// Recorder of one row.
    type Row<'a>: RowRecorder<N> + Send
    where
        Self: 'a;
    /// Number of columns and rows, pixels.
    fn size(&self) -> UVec2;
    /// Recorders of the rows, first row first.
    fn rows(&mut self) -> Vec<Self::Row<'_>>;
    /// Contributions dropped because they were not finite, and splats that
    /// would have overflowed, since the film was made.
    fn defects(&self) -> (u64, u64);
}

/// A [`Recorder`] that moves from pixel to pixel of its row, once for each replicate.
pub trait RowRecorder<const N: usize = 1>: Recorder<N> {
    /// Called before the first pixel.
    fn open(&mut self) {}
    /// Makes the `i`-th pixel of the row current.
    fn set_pixel(&mut self, i: usize);
    /// Called when all samples of a replicate have been taken.
    fn end_replicate(&mut self) {}
    /// Called when all samples have been taken.
    fn close(&mut self) {}
}
