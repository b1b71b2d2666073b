//! Parameters of a render: integrator, view, samples and values of the background.

use std::ops::Range;

use glam::UVec2;

use super::IntegratorKind;
use crate::{
    camera::Camera, film::tiling::Tiling, math::hash::hash_words, sampler::SamplerKind, scene::Scene,
};

/// Multiple importance sampling heuristic. \[Veach97\] 9.2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Heuristic {
    /// Weights proportional to the densities.
    Balance,
    /// Weights proportional to the squared densities.
    #[default]
    Power,
}

impl Heuristic {
    /// Value of the heuristic's function at a density, or at a ratio of densities.
    #[must_use]
    pub fn apply(self, x: f64) -> f64 {
        match self {
            Self::Balance => x,
            Self::Power => x * x,
        }
    }
}

/// An integrator with its options.
#[derive(Clone, Copy, Debug)]
pub struct Integrator {
    /// Kind of integrator.
    pub kind: IntegratorKind,
    /// Upper bound of the edges of a path after the camera, at least 1.
    pub max_depth: usize,
    /// Heuristic by which the strategies that find a path are weighted.
    pub heuristic: Heuristic,
}

impl Default for Integrator {
    fn default() -> Self {
        Self { kind: IntegratorKind::Bdpt, max_depth: 8, heuristic: Heuristic::Power }
    }
}

/// Samples that the pixels of a render take of a sequence.
pub trait Taken: Sync {
    /// Family and seed of the sequence.
    fn sequence(&self) -> (SamplerKind, u64);
    /// Indices of the samples of a pixel.
    fn indices(&self, pixel: UVec2) -> Range<u32>;
    /// Number of samples of all pixels of a picture of `size`.
    fn total(&self, size: UVec2) -> u64;
}

/// Samples of a render: a range of indices of a sequence, the same for every pixel.
#[derive(Clone, Copy, Debug)]
pub struct Samples {
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Seed of the scramble of the whole picture.
    pub seed: u64,
    /// Index of the first sample of every pixel.
    pub first: u32,
    /// Number of samples per pixel.
    pub count: u32,
}

impl Samples {
    /// The same range of an independently scrambled sequence, that of replicate `r`.
    #[must_use]
    pub fn replicate(self, r: u64) -> Self {
        Self { seed: seed_of_replicate(self.seed, r), ..self }
    }
}

/// Seed of the independently scrambled sequence of replicate `r` of a render.
#[must_use]
pub fn seed_of_replicate(seed: u64, r: u64) -> u64 {
    hash_words(&[seed, r])
}

impl Taken for Samples {
    fn sequence(&self) -> (SamplerKind, u64) {
        (self.sampler, self.seed)
    }
    fn indices(&self, _pixel: UVec2) -> Range<u32> {
        self.first..self.first + self.count
    }
    fn total(&self, size: UVec2) -> u64 {
        u64::from(size.x) * u64::from(size.y) * u64::from(self.count)
    }
}

/// Samples of a render whose tiles take ranges of their own of one sequence. Splats are then to be divided by
/// the mean number of samples of all pixels, what a pixel's own samples bring by their number.
#[derive(Clone, Debug)]
pub struct TileSamples {
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Seed of the scrambles of the whole picture.
    pub seed: u64,
    /// The tiles of the picture.
    pub tiling: Tiling,
    /// Indices of the samples of every pixel of a tile, by tile.
    pub indices: Vec<Range<u32>>,
}

impl Taken for TileSamples {
    fn sequence(&self) -> (SamplerKind, u64) {
        (self.sampler, self.seed)
    }
    fn indices(&self, pixel: UVec2) -> Range<u32> {
        self.indices[self.tiling.of(pixel)].clone()
    }
    fn total(&self, _size: UVec2) -> u64 {
        self.tiling.total(|t| self.indices[t].len() as u32)
    }
}

/// A scene with the camera that sees it.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera; its film has the size of the picture.
    pub camera: &'a Camera,
}

/// Values of the background at which light is carried along a path, the largest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values<const N: usize>(pub [f32; N]);
