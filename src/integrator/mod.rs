//! Light transport: path tracing, bidirectional path tracing, and the driver that runs them over a
//! film.
//!
//! Both integrators share one model: paths of up to `max_depth` edges after the camera, lights that do
//! not block, Russian roulette that never biases. Every light-carrying contribution goes to a
//! [`Recorder`] with its light and size coordinate.

pub mod aov;
pub mod bdpt;
mod context;
mod direct;
mod kind;
mod options;
pub mod path;
mod pilot;
mod roulette;
mod work;

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use crate::{
    film::{Contribution, Film, Recorder, RowRecorder},
    lighting::{Lighting, SamplingPlan},
    sampler::Sampler,
};

pub use crate::film::Strategy;
pub use context::{Context, SampledLight};
pub use kind::IntegratorKind;
pub use options::{Heuristic, Integrator, Samples, Taken, TileSamples, Values, View, seed_of_replicate};
pub use pilot::Pilot;
pub use work::Work;

/// Why a render has no picture.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RenderError {
    /// Contributions to a fixed-point sum of the film that did not fit into it, by their number.
    #[error("{0} contributions overflowed the film; lower the lights' radiance or the exposure")]
    Overflow(u64),
    /// More than one contribution in a million was not a number.
    #[error(
        "{dropped} contributions of {samples} samples were not finite: the scene's scale or geometry is broken"
    )]
    NonFinite {
        /// Number of contributions that were not finite.
        dropped: u64,
        /// Number of samples taken.
        samples: u64,
    },
    /// The render was stopped by its [`Observer`].
    #[error("interrupted")]
    Cancelled,
}

/// Contributions dropped per sample above which a render fails: rounding produces one that is not
/// finite on rare paths, but a picture of which more is missing is wrong.
const MAX_NON_FINITE: f64 = 1e-6;

/// Watches a render and may stop it.
pub trait Observer: Sync {
    /// Called when `rows` more rows of pixels are done; a row counts once for each replicate.
    fn advance(&self, rows: u64);
    /// Whether the render is to stop.
    fn cancelled(&self) -> bool {
        false
    }
}

/// An observer that never stops a render.
impl Observer for () {
    fn advance(&self, _rows: u64) {}
}

impl Integrator {
    /// Adds samples of a picture of one lighting to a film, and counts their work. Runs in the current rayon pool;
    /// the film is the same whatever its number of threads.
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
    /// When the film overflowed, too many contributions were not finite, or the observer stopped the
    /// render; the film is then of no use.
    pub fn render<F: Film>(
        &self,
        view: View,
        lighting: &Lighting,
        plan: &SamplingPlan,
        film: &mut F,
        samples: Samples,
        observer: &impl Observer,
    ) -> Result<Work, RenderError> {
        self.render_values(view, &Values([lighting.value as f32]), plan, film, &[samples], observer)
    }

    /// Adds samples for several values of the background at once, in several replicates, to a film that
    /// multiplies the lights' radiances in and selects their sizes itself; otherwise as [`Self::render`].
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn render_values<const N: usize, F: Film<N>>(
        &self,
        view: View,
        values: &Values<N>,
        plan: &SamplingPlan,
        film: &mut F,
        replicates: &[impl Taken],
        observer: &impl Observer,
    ) -> Result<Work, RenderError> {
        let context = Context::new(*self, view, *values, plan);
        let size = film.size();
        let (bad_before, over_before) = film.defects();
        let rows = film.rows().into_par_iter().enumerate().with_max_len(1).map(|(y, mut row)| {
            let mut work = Work::default();
            row.open();
            for samples in replicates {
                if !observer.cancelled() {
                    work += render_row(&context, &mut row, samples, y as u32, size.x);
                    row.end_replicate();
                    observer.advance(1);
                }
            }
            row.close();
            work
        });
        let work = rows.sum();
        if observer.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let (bad, over) = film.defects();
        if over > over_before {
            return Err(RenderError::Overflow(over - over_before));
        }
        let samples: u64 = replicates.iter().map(|r| r.total(size)).sum();
        let dropped = bad - bad_before;
        if dropped as f64 > MAX_NON_FINITE * samples as f64 {
            return Err(RenderError::NonFinite { dropped, samples });
        }
        Ok(work)
    }
}

/// Takes the samples of row `y` of a film that is `width` pixels wide.
fn render_row<const N: usize>(
    context: &Context<N>,
    row: &mut impl RowRecorder<N>,
    samples: &impl Taken,
    y: u32,
    width: u32,
) -> Work {
    let (kind, seed) = samples.sequence();
    let mut sampler = Sampler::new(kind, seed);
    let mut workspace = bdpt::Workspace::default();
    let mut work = Work::default();
    for x in 0..width {
        row.set_pixel(x as usize);
        let pixel = UVec2::new(x, y);
        for index in samples.indices(pixel) {
            sampler.start(pixel, index);
            work += match context.integrator.kind {
                IntegratorKind::Path => path::sample(context, &mut sampler, pixel, row),
                IntegratorKind::Bdpt => bdpt::sample(context, &mut sampler, pixel, &mut workspace, row),
            };
        }
    }
    work
}

/// A function as a recorder, called with each contribution and, for t = 1, its raster position.
impl<const N: usize, F: FnMut(Option<Vec2>, &Contribution<N>)> Recorder<N> for F {
    fn add(&mut self, c: &Contribution<N>) {
        self(None, c);
    }
    fn splat(&mut self, raster: Vec2, c: &Contribution<N>) {
        self(Some(raster), c);
    }
}
