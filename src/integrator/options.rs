//! Parameters of a render: integrator, view, samples and values of the background.

use super::IntegratorKind;
use crate::{camera::Camera, math::hash::hash_words, sampler::SamplerKind, scene::Scene};

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

/// Samples of a render: a range of indices of a sequence, for every pixel.
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
        Self { seed: hash_words(&[self.seed, r]), ..self }
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
