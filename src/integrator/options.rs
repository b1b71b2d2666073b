//! What a render is asked: integrator, view, samples and values of the background.

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
    /// The heuristic's function of a density or ratio of densities.
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
    /// Which.
    pub kind: IntegratorKind,
    /// Edges after the camera, at least 1.
    pub max_depth: usize,
    /// Weights of the bidirectional strategies.
    pub heuristic: Heuristic,
}

impl Default for Integrator {
    fn default() -> Self {
        Self { kind: IntegratorKind::Bdpt, max_depth: 8, heuristic: Heuristic::Power }
    }
}

/// Which samples of which sequence to take.
#[derive(Clone, Copy, Debug)]
pub struct Samples {
    /// Family of sequences.
    pub sampler: SamplerKind,
    /// Scramble of the whole picture.
    pub seed: u64,
    /// First sample index of every pixel.
    pub first: u32,
    /// Samples per pixel.
    pub count: u32,
}

impl Samples {
    /// The same samples of an independent scramble, the `r`-th.
    #[must_use]
    pub fn replicate(self, r: u64) -> Self {
        Self { seed: hash_words(&[self.seed, r]), ..self }
    }
}

/// A scene as a camera sees it.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera, whose film size is that of the picture.
    pub camera: &'a Camera,
}

/// Values of the background at which light is carried, the largest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values<const N: usize>(pub [f32; N]);
