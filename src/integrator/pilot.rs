//! Numbers of samples that suit a scene, found on small pictures of it.
//!
//! How many light samples a vertex takes, how many camera subpaths share a light subpath, and where Russian roulette
//! begins trade noise for work, and what is best depends on the scene: several lights ask for several samples, one
//! panel in a diffuse room for one, a caustic for light subpaths. Small pictures are rendered in replicates with
//! numbers that differ in one step, and the step is kept if it lowers the product of variance and work, the inverse
//! of what \[Veach97\] 9.1 calls efficiency. Work is counted, so that the choice is the same on every machine, and
//! all pictures are rendered with the same variates, so that what differs is the numbers.
//!
//! # References
//! \[Grittmann22\] (choice of sample counts by estimated variance and cost).

use glam::UVec2;

use super::{
    Integrator, IntegratorKind, RenderError, Samples, Values, View, Work, options::seed_of_replicate,
};
use crate::{
    film::RgbFilm,
    lighting::{Lighting, SampleCounts, SamplingPlan},
    math::display::luminance,
    sampler::SamplerKind,
};

/// Samples per pixel of a render, below which nothing is tried.
const LEAST_SPP: u32 = 32;
/// Samples for each pixel of the render that are taken beforehand, at most: an eighth of its time where it has
/// [`LEAST_SPP`]. They do not depend on how many it has, so that a render that was stopped has the first samples of
/// what was asked for.
const SAMPLES: f64 = 4.0;
/// Number of small pictures that are rendered, about.
const PICTURES: f64 = 9.0;
/// Replicates of a small picture: its variance is known by their differences.
const REPLICATES: usize = 4;
/// Samples per pixel of a replicate. With fewer, what a sequence samples evenly only later counts for too much: with
/// 4 the fruit basket was given 4 and 2 light samples of its 3 lights, which left twice the error at 64.
const SPP: u32 = 8;
/// Pixels of a small picture at least, below which nothing can be told and nothing is tried, and at most.
const PIXELS: [f64; 2] = [128.0, 2048.0];
/// Factor by which a step must lower the product of variance and work: smaller differences
/// are noise.
const GAIN: f64 = 0.95;
/// Radiance below which errors count as if it were this, relative to the mean of the picture.
const DARK: f64 = 0.1;

/// Steps of the number of camera subpaths for each light subpath.
const CAMERA_SUBPATHS: [u32; 5] = [1, 2, 4, 8, 16];
/// Steps of the number of light samples at the first surface and at later ones.
const LIGHT_SAMPLES: [[u32; 2]; 6] = [[1, 1], [2, 1], [4, 2], [6, 3], [8, 4], [12, 6]];
/// Most lights of which every one has as many samples as the others at each vertex.
const FEW_LIGHTS: u32 = 3;
/// Steps of the number of edges after which Russian roulette begins.
const FIRST_ROULETTE: [u32; 3] = [3, 5, 8];

/// What numbers of samples are to be found for.
#[derive(Clone, Copy, Debug)]
pub struct Pilot<'a> {
    /// Integrator with its options.
    pub integrator: Integrator,
    /// Scene and camera.
    pub view: View<'a>,
    /// Lightings of the pictures that are rendered together, at least one.
    pub lightings: &'a [&'a Lighting],
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Seed of the scrambles.
    pub seed: u64,
    /// Samples per pixel of the render to come.
    pub spp: u32,
}

impl Pilot<'_> {
    /// Numbers of samples for the render to come, no worse than those of `plan` as far as is known; those of `plan`
    /// where the render is too short to try others.
    #[must_use]
    pub fn choose(&self, plan: &SamplingPlan) -> SampleCounts {
        let full = self.view.camera.size().as_dvec2();
        let of_picture = SAMPLES / PICTURES * full.element_product();
        let pixels = of_picture / (REPLICATES as f64 * f64::from(SPP));
        if pixels < PIXELS[0] || self.spp < LEAST_SPP || self.lightings.is_empty() {
            return plan.counts;
        }
        let shrink = (pixels.min(PIXELS[1]) / full.element_product()).sqrt().min(1.0);
        let size = (full * shrink).round().as_uvec2().max(UVec2::ONE);
        // Without a picture nothing is chosen; the render to come says why there is none.
        self.descend(plan, size).unwrap_or(plan.counts)
    }

    /// Coordinate descent from the numbers of `plan`, on pictures of `size`.
    fn descend(&self, plan: &SamplingPlan, size: UVec2) -> Result<SampleCounts, RenderError> {
        let camera = self.view.camera.resized(size);
        let small = Pilot { view: View { camera: &camera, ..self.view }, ..*self };
        let mut best = plan.counts;
        let first = small.take(plan, best)?;
        let weights = first.weights(size.x as usize);
        let mut least = first.product(&weights);
        for steps in self.steps() {
            let (less, more): (Vec<Step>, Vec<Step>) =
                steps.into_iter().partition(|step| step.is_less(&best));
            for steps in [more, less.into_iter().rev().collect()] {
                let before = best;
                for step in steps {
                    let counts = step.of(best);
                    if counts == best {
                        continue;
                    }
                    let product = small.take(plan, counts)?.product(&weights);
                    if product >= GAIN * least {
                        break;
                    }
                    (best, least) = (counts, product);
                }
                if best != before {
                    break;
                }
            }
        }
        Ok(best)
    }

    /// Steps of each number, in rising order; the number that has most to gain comes first.
    fn steps(&self) -> [Vec<Step>; 3] {
        let n_lights = self.lightings.first().map_or(0, |x| x.n_lights());
        let shines = |l: usize| self.lightings.iter().any(|x| x.radiance[l] > 0.0);
        let n_shining = (0..n_lights).filter(|&l| shines(l)).count() as u32;
        let multiple =
            |n: u32| if n_shining <= FEW_LIGHTS { n.next_multiple_of(n_shining.max(1)) } else { n };
        let mut light_samples: Vec<[u32; 2]> = LIGHT_SAMPLES.map(|each| each.map(multiple)).to_vec();
        light_samples.dedup();
        let camera_subpaths = match self.integrator.kind {
            IntegratorKind::Path => Vec::new(),
            IntegratorKind::Bdpt => CAMERA_SUBPATHS.map(Step::CameraSubpaths).to_vec(),
        };
        [
            camera_subpaths,
            light_samples.into_iter().map(Step::LightSamples).collect(),
            FIRST_ROULETTE.map(Step::FirstRoulette).to_vec(),
        ]
    }

    /// Renders the replicates of a small picture with some numbers of samples.
    fn take(&self, plan: &SamplingPlan, counts: SampleCounts) -> Result<Trial, RenderError> {
        let plan = SamplingPlan { counts, ..plan.clone() };
        match self.lightings.len() {
            1 => self.take_values::<1>(&plan),
            2 => self.take_values::<2>(&plan),
            _ => self.take_values::<{ SamplingPlan::MAX_TOGETHER }>(&plan),
        }
    }

    fn take_values<const N: usize>(&self, plan: &SamplingPlan) -> Result<Trial, RenderError> {
        let values: Values<N> =
            Values(std::array::from_fn(|k| self.lightings.get(k).map_or(0.0, |x| x.value as f32)));
        let size = self.view.camera.size();
        let mut trial = Trial { replicates: Vec::with_capacity(REPLICATES), work: Work::default() };
        for r in 0..REPLICATES {
            let mut film = RgbFilm::by_lighting(size, self.lightings);
            // Other variates than the render to come: what fits these by chance does not fit that.
            let seed = seed_of_replicate(self.seed, u64::MAX - r as u64);
            let samples = Samples { sampler: self.sampler, seed, first: 0, count: SPP };
            trial.work +=
                self.integrator.render_values(self.view, &values, plan, &mut film, &[samples], &())?;
            let picture = |k| (0..size.element_product() as usize).map(move |p| (p, k));
            let cells = (0..self.lightings.len()).flat_map(picture);
            let shown = |(p, k)| luminance(film.sum(p, k).map(|v| (v / f64::from(SPP)) as f32));
            trial.replicates.push(cells.map(shown).collect());
        }
        Ok(trial)
    }
}

/// A value of one of the numbers of samples.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Camera subpaths for each light subpath.
    CameraSubpaths(u32),
    /// Light samples at the first surface and at later ones.
    LightSamples([u32; 2]),
    /// Edges after which Russian roulette begins.
    FirstRoulette(u32),
}

impl Step {
    /// Whether the value is less than that in `counts`.
    fn is_less(self, counts: &SampleCounts) -> bool {
        match self {
            Self::CameraSubpaths(n) => n < counts.camera_subpaths,
            Self::LightSamples([first, later]) => {
                [first, later] < [counts.first_light_samples, counts.light_samples]
            }
            Self::FirstRoulette(n) => n < counts.first_roulette,
        }
    }

    /// `counts` with the value.
    fn of(self, counts: SampleCounts) -> SampleCounts {
        match self {
            Self::CameraSubpaths(camera_subpaths) => SampleCounts { camera_subpaths, ..counts },
            Self::LightSamples([first_light_samples, light_samples]) => {
                SampleCounts { first_light_samples, light_samples, ..counts }
            }
            Self::FirstRoulette(first_roulette) => SampleCounts { first_roulette, ..counts },
        }
    }
}

/// A small picture of each lighting with some numbers of samples.
struct Trial {
    /// Linear luminance of each replicate, row by row, one picture after the other.
    replicates: Vec<Vec<f64>>,
    work: Work,
}

impl Trial {
    /// Product of variance and work.
    fn product(&self, weights: &[f64]) -> f64 {
        self.variance(weights) * self.work.cost()
    }

    /// Mean over the replicates.
    fn mean(&self, i: usize) -> f64 {
        self.replicates.iter().map(|y| y[i]).sum::<f64>() / REPLICATES as f64
    }

    /// What the variance of each pixel counts by: the inverse of the square of its radiance, which is taken from
    /// its row's neighbours too, so that a bright sample does not hide itself.
    fn weights(&self, width: usize) -> Vec<f64> {
        let n = self.replicates[0].len();
        let means: Vec<f64> = (0..n).map(|i| self.mean(i)).collect();
        let floor = DARK * means.iter().sum::<f64>() / n as f64;
        let near = |i: usize| {
            let row = i / width * width;
            let about = &means[i.saturating_sub(1).max(row)..(i + 2).min(row + width)];
            about.iter().sum::<f64>() / about.len() as f64
        };
        (0..n).map(|i| 1.0 / (near(i).powi(2) + floor.powi(2)).max(f64::MIN_POSITIVE)).collect()
    }

    /// Weighted sum of the variances of all pixels.
    fn variance(&self, weights: &[f64]) -> f64 {
        let of_pixel = |i: usize| {
            let mean = self.mean(i);
            self.replicates.iter().map(|y| (y[i] - mean).powi(2)).sum::<f64>()
        };
        weights.iter().enumerate().map(|(i, weight)| weight * of_pixel(i)).sum()
    }
}
