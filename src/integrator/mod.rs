//! Light transport: the path tracer and the bidirectional path tracer, and
//! the driver that runs them over a film.
//!
//! Both share one model: `max_depth` edges after the camera, lights that do
//! not block, Russian roulette that never biases. Every light-carrying
//! contribution goes to a [`Recorder`] with its light and size coordinate.

pub mod aov;
pub mod bdpt;
mod context;
mod direct;
mod kind;
pub mod path;

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use crate::{
    camera::Camera,
    film::{Contribution, Film, Recorder, RowRecorder},
    lighting::{Lighting, SamplingPlan},
    math::{Rgb, hash::hash_words},
    sampler::SamplerKind,
    scene::Scene,
};

pub use crate::film::Strategy;
pub use context::Context;
pub use kind::IntegratorKind;

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

/// Why a render has no picture.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RenderError {
    /// A splat did not fit its fixed-point cell.
    #[error("{0} contributions overflowed the film; lower the lights' radiance or the exposure")]
    Overflow(u64),
    /// More than one contribution in a million was not a number.
    #[error(
        "{dropped} contributions of {samples} samples were not finite: the scene's scale or geometry is broken"
    )]
    NonFinite {
        /// How many.
        dropped: u64,
        /// Of how many samples.
        samples: u64,
    },
    /// [`Observer::cancelled`] said so.
    #[error("interrupted")]
    Cancelled,
}

/// Contributions dropped per sample above which a render fails.
const MAX_NON_FINITE: f64 = 1e-6;

/// Watches and may stop a render.
pub trait Observer: Sync {
    /// Called when `rows` more rows of the film are done.
    fn advance(&self, rows: u64);
    /// Whether to stop.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Watches nothing.
impl Observer for () {
    fn advance(&self, _rows: u64) {}
}

/// A scene as a camera sees it.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera, whose film size is that of the picture.
    pub camera: &'a Camera,
}

impl Integrator {
    /// Adds samples of a picture of one lighting to a film; runs in the current rayon pool and
    /// gives the same film whatever its number of threads.
    ///
    /// ```
    /// use lightopt_embree::{
    ///     film::RgbFilm,
    ///     import,
    ///     integrator::{Integrator, Samples, View},
    ///     lighting::{Lighting, SamplingPlan},
    ///     sampler::SamplerKind,
    /// };
    ///
    /// let scene = import::load("tests/mitsuba/scenes/cornell.obj".as_ref())?.scene;
    /// let view = View { scene: &scene, camera: &scene.camera };
    /// let lighting = Lighting::authored(&scene);
    /// let plan = SamplingPlan::for_picture(&lighting);
    ///
    /// let mut film = RgbFilm::by_light(scene.camera.size(), &lighting);
    /// let samples = Samples { sampler: SamplerKind::Sobol, seed: 0, first: 0, count: 2 };
    /// Integrator::default().render(view, &lighting, &plan, &mut film, samples, &())?;
    ///
    /// let picture = film.develop(&lighting, samples.count);
    /// assert_eq!((picture.width, picture.height, picture.lights.len()), (64, 48, 1));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When the film overflowed, too many contributions were not finite, or
    /// the observer stopped it; the film is then of no use.
    pub fn render<F: Film>(
        &self,
        view: View,
        lighting: &Lighting,
        plan: &SamplingPlan,
        film: &mut F,
        samples: Samples,
        observer: &impl Observer,
    ) -> Result<(), RenderError> {
        self.render_values(view, &Values([lighting.value as f32]), plan, film, &[samples], observer)
    }

    /// As [`Self::render`], for several values of the background at once and for several
    /// replicates. What the film makes of the lights' radiances and sizes is its own affair.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn render_values<const N: usize, F: Film<N>>(
        &self,
        view: View,
        values: &Values<N>,
        plan: &SamplingPlan,
        film: &mut F,
        replicates: &[Samples],
        observer: &impl Observer,
    ) -> Result<(), RenderError> {
        let context = Context::new(*self, view, *values, plan);
        let UVec2 { x: width, y: height } = film.size();
        let (bad_before, over_before) = film.defects();
        film.rows().into_par_iter().enumerate().with_max_len(1).for_each(|(y, mut row)| {
            row.open();
            for samples in replicates {
                if !observer.cancelled() {
                    context.render_row(&mut row, samples, y as u32, width);
                    row.end_replicate();
                    observer.advance(1);
                }
            }
            row.close();
        });
        if observer.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let (bad, over) = film.defects();
        if over > over_before {
            return Err(RenderError::Overflow(over - over_before));
        }
        let count: u32 = replicates.iter().map(|r| r.count).sum();
        let samples = u64::from(width) * u64::from(height) * u64::from(count);
        let dropped = bad - bad_before;
        if dropped as f64 > MAX_NON_FINITE * samples as f64 {
            return Err(RenderError::NonFinite { dropped, samples });
        }
        Ok(())
    }
}

/// Values of the background at which light is carried, the largest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values<const N: usize>(pub [f32; N]);

/// Edges after which Russian roulette begins.
const ROULETTE_START: usize = 3;
/// A subpath survives at least this often, so that no light it could still
/// meet becomes a rare and bright event.
const MIN_SURVIVAL: f32 = 0.1;

/// Russian roulette after `n_edges`: the factor on the throughput of a
/// survivor, or `None`. \[Veach97\] 10.4.1.
fn roulette(n_edges: usize, throughput: Rgb, u: f32) -> Option<f32> {
    if n_edges < ROULETTE_START {
        return Some(1.0);
    }
    let survival = throughput.max_element().clamp(MIN_SURVIVAL, 1.0);
    (u < survival).then_some(1.0 / survival)
}

/// Raster position of a sample: uniform over the pixel.
fn film_position(pixel: UVec2, u: Vec2) -> Vec2 {
    // Rounding must not push a sample of one pixel into the next.
    (pixel.as_vec2() + u).min((pixel + UVec2::ONE).as_vec2() * crate::math::ONE_MINUS_EPSILON)
}

/// Used by tests and tools that look at contributions one by one.
impl<const N: usize, F: FnMut(Option<Vec2>, &Contribution<N>)> Recorder<N> for F {
    fn add(&mut self, c: &Contribution<N>) {
        self(None, c);
    }
    fn splat(&mut self, raster: Vec2, c: &Contribution<N>) {
        self(Some(raster), c);
    }
}
