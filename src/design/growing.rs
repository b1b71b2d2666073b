//! Pictures of several lightings that grow together, from one render, until they are good enough.
//!
//! A light's size is an indicator and its radiance a factor, so that the samples of one render make the
//! picture of every lighting. They come in [`REPLICATES`] replicates, from whose differences the noise is known.
//! The first half of the replicates makes one picture of each light, the second half another: two halves
//! that are independent, for whoever must not look at what it judges.
//!
//! A render proceeds in passes, of which each adds samples to every replicate in turn, and in rounds, after
//! each of which it is asked whether that is enough. Both are the same for every render, so that a picture
//! of some number of samples is the same whatever the threads and the clock, and whether the render was
//! stopped on the way.

use std::io::{self, Write};

use glam::UVec2;
use rayon::prelude::*;

use super::render::Renderer;
use crate::{
    denoise::{denoise, denoise_picture},
    files::parts::write_numbers,
    film::{Picture, RgbFilm},
    integrator::{Observer, RenderError, Samples, Values, View, aov::Features},
    lighting::{Lighting, SamplingPlan},
    math::display::luminance,
};

/// Replicates of a picture: the jackknife's bias and error estimates need four.
pub const REPLICATES: usize = 4;
/// Replicates of each of the two halves.
const OF_HALF: usize = REPLICATES / 2;
/// Samples of each replicate in the first round: less tells little of the noise.
const FIRST_ROUND: u32 = 4;
/// Factor by which the samples of a replicate grow from round to round, rounded up: what is rendered beyond
/// what was needed is a quarter of it at most, and less than a sample of each replicate.
const ROUND_GROWTH: f64 = 1.25;
/// Samples of a replicate in a pass at most: an interrupt loses no more of them, while emptying the film
/// takes a fiftieth of the time of a pass of the fruit basket.
const MAX_PASS: u32 = 4;

/// Pictures to be rendered together.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Scene and camera.
    pub view: View<'a>,
    /// The lightings, at most [`SamplingPlan::MAX_TOGETHER`].
    pub lightings: &'a [&'a Lighting],
    /// Sampling plan, best [`SamplingPlan::for_pictures`] of them.
    pub plan: &'a SamplingPlan,
    /// Seed of the scrambles.
    pub seed: u64,
    /// Samples per pixel over all replicates at most; each replicate has one at least.
    pub spp: u32,
}

/// What happens between the passes of pictures that grow.
pub trait Between: Sync {
    /// Whether the render is to end, with the samples that it has.
    fn is_over(&self) -> bool;
    /// What an earlier attempt has written by [`Grown::write`].
    fn kept(&self) -> Option<Vec<u8>> {
        None
    }
    /// Called after each pass of a replicate, and with `is_last` when there are no more to come.
    fn passed(&self, _grown: &Grown, _is_last: bool) {}
    /// Called after each round; whether the pictures are good enough. The answer must depend on them alone.
    fn is_enough(&self, _grown: &Grown) -> bool {
        false
    }
}

impl<F: Fn() -> bool + Sync> Between for F {
    fn is_over(&self) -> bool {
        self()
    }
}

/// Pictures of several lightings with the samples that they have.
#[derive(Clone, Debug)]
pub struct Grown {
    size: UVec2,
    lightings: Vec<Lighting>,
    /// Samples per pixel of each replicate.
    counts: [u32; REPLICATES],
    /// Whether they are good enough or have as many samples as they may.
    is_complete: bool,
    /// Sums of the samples of each half as `[pixel][lighting][light][rgb]`, for unit radiance.
    halves: [Vec<f64>; 2],
    /// Sums of the samples of each replicate as `[replicate][pixel][lighting]`, with all lights at their
    /// radiance.
    beauties: [Vec<[f32; 3]>; REPLICATES],
}

impl Grown {
    /// Pictures without samples.
    fn new(size: UVec2, lightings: &[&Lighting]) -> Self {
        let n_pixels = size.element_product() as usize;
        let n_layers: usize = lightings.iter().map(|x| x.n_lights()).sum();
        Self {
            size,
            lightings: lightings.iter().map(|&x| x.clone()).collect(),
            counts: [0; REPLICATES],
            is_complete: false,
            halves: std::array::from_fn(|_| vec![0.0; 3 * n_pixels * n_layers]),
            beauties: std::array::from_fn(|_| vec![[0.0; 3]; n_pixels * lightings.len()]),
        }
    }

    /// Memory that the picture of one lighting takes while it grows, its film included, bytes.
    #[must_use]
    pub fn bytes(size: UVec2, n_lights: usize) -> u64 {
        // Sums of two halves; sums and splats of the film; those of the replicates.
        let of_pixel = n_lights * (2 * 24 + 2 * 24) + REPLICATES * 12;
        u64::from(size.x) * u64::from(size.y) * of_pixel as u64
    }

    /// Whether the pictures are good enough or have as many samples as they may.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Samples per pixel of all replicates.
    #[must_use]
    pub fn spp(&self) -> u32 {
        self.counts.iter().sum()
    }

    /// Picture of the k-th lighting with all samples.
    #[must_use]
    pub fn picture(&self, k: usize) -> Picture {
        Layers { of: self, k, sums: &[&self.halves[0], &self.halves[1]], count: self.spp() }.picture()
    }

    /// Radiance of the k-th lighting with all samples, row by row: that of [`Self::picture`].
    #[must_use]
    pub fn beauty(&self, k: usize) -> Vec<[f32; 3]> {
        Layers { of: self, k, sums: &[&self.halves[0], &self.halves[1]], count: self.spp() }.beauty()
    }

    /// Pictures of the k-th lighting with the samples of either half of the replicates.
    #[must_use]
    pub fn halves(&self, k: usize) -> [Picture; 2] {
        let count = |h: usize| self.counts[h * OF_HALF..][..OF_HALF].iter().sum();
        std::array::from_fn(|h| Layers { of: self, k, sums: &[&self.halves[h]], count: count(h) }.picture())
    }

    /// Picture of the k-th lighting without its noise.
    #[must_use]
    pub fn denoised(&self, k: usize, features: &Features) -> Picture {
        denoise_picture(features, &self.halves(k))
    }

    /// Radiance of the k-th lighting from either half of the replicates, each without its noise, row by row:
    /// two that are independent.
    #[must_use]
    pub fn denoised_halves(&self, k: usize, features: &Features) -> [Vec<[f32; 3]>; 2] {
        let replicates = self.replicates(k);
        std::array::from_fn(|h| {
            let [a, b] = [0, 1].map(|r| std::slice::from_ref(&replicates[h * OF_HALF + r]));
            denoise(features, [a, b]).remove(0)
        })
    }

    /// Radiance of each replicate of the k-th lighting, row by row.
    #[must_use]
    pub fn replicates(&self, k: usize) -> [Vec<[f32; 3]>; REPLICATES] {
        self.of_replicates(k, |rgb| rgb)
    }

    /// Linear luminance of each replicate of the k-th lighting, row by row.
    #[must_use]
    pub fn luminances(&self, k: usize) -> [Vec<f32>; REPLICATES] {
        self.of_replicates(k, |rgb| luminance(rgb) as f32)
    }

    fn of_replicates<T: Send>(&self, k: usize, of: impl Fn([f32; 3]) -> T + Sync) -> [Vec<T>; REPLICATES] {
        let n = self.lightings.len();
        std::array::from_fn(|r| {
            let share = 1.0 / self.counts[r].max(1) as f32;
            let pixels = self.beauties[r].par_chunks_exact(n);
            pixels.map(|lightings| of(lightings[k].map(|v| v * share))).collect()
        })
    }

    /// Adds the samples of a replicate that are in a film, and empties it.
    fn add(&mut self, replicate: usize, count: u32, film: &mut RgbFilm) {
        let n = self.lightings.len();
        let lightings = &self.lightings;
        let from = &*film;
        self.beauties[replicate].par_chunks_exact_mut(n).enumerate().for_each(|(pixel, beauties)| {
            for (k, (beauty, x)) in beauties.iter_mut().zip(lightings).enumerate() {
                for (l, &radiance) in x.radiance.iter().enumerate() {
                    let sum = from.sum(pixel, k * x.n_lights() + l);
                    let radiance = f64::from(radiance as f32);
                    *beauty = std::array::from_fn(|c| beauty[c] + (sum[c] * radiance) as f32);
                }
            }
        });
        film.move_onto(&mut self.halves[replicate / OF_HALF]);
        self.counts[replicate] += count;
    }

    /// Writes the samples so far, exactly.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        write_numbers(out, self.counts.iter().map(|count| count.to_le_bytes()))?;
        write_numbers(out, self.halves.iter().flatten().map(|sum| sum.to_le_bytes()))?;
        write_numbers(out, self.beauties.iter().flat_map(|sums| sums.as_flattened()).map(|v| v.to_le_bytes()))
    }

    /// Takes the samples of pictures of the same size and lightings that [`Self::write`] has written, and
    /// says whether they could be read.
    fn read(&mut self, bytes: &[u8]) -> bool {
        let words = 4 * REPLICATES;
        let [sums, beauties] = [self.halves[0].len(), 3 * self.beauties[0].len()];
        if bytes.len() != words + 2 * 8 * sums + REPLICATES * 4 * beauties {
            return false;
        }
        let (counts, rest) = bytes.split_at(words);
        self.counts.iter_mut().zip(counts.as_chunks().0).for_each(|(n, b)| *n = u32::from_le_bytes(*b));
        let (halves, rest) = rest.split_at(2 * 8 * sums);
        for (half, bytes) in self.halves.iter_mut().zip(halves.chunks((8 * sums).max(1))) {
            half.iter_mut().zip(bytes.as_chunks().0).for_each(|(v, b)| *v = f64::from_le_bytes(*b));
        }
        for (beauty, bytes) in self.beauties.iter_mut().zip(rest.chunks((4 * beauties).max(1))) {
            let values = beauty.as_flattened_mut().iter_mut();
            values.zip(bytes.as_chunks().0).for_each(|(v, b)| *v = f32::from_le_bytes(*b));
        }
        true
    }
}

/// Means of some samples for each light of a lighting.
struct Layers<'a> {
    of: &'a Grown,
    /// Index of the lighting.
    k: usize,
    /// Sums of the samples, as [`Grown::halves`] are.
    sums: &'a [&'a Vec<f64>],
    /// Number of samples per pixel in the sums.
    count: u32,
}

impl Layers<'_> {
    fn lighting(&self) -> &Lighting {
        &self.of.lightings[self.k]
    }

    /// Radiance of a pixel that is due to a light.
    fn value(&self, pixel: usize, light: usize) -> [f64; 3] {
        let lighting = self.lighting();
        let n_lights = lighting.n_lights();
        let at = 3 * ((pixel * self.of.lightings.len() + self.k) * n_lights + light);
        let gain = f64::from(lighting.radiance[light] as f32) / f64::from(self.count.max(1));
        std::array::from_fn(|c| gain * self.sums.iter().map(|sums| sums[at + c]).sum::<f64>())
    }

    fn pixels<T: Send>(&self, of: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        (0..self.of.size.element_product() as usize).into_par_iter().map(of).collect()
    }

    fn beauty(&self) -> Vec<[f32; 3]> {
        let add = |total: [f64; 3], v: [f64; 3]| std::array::from_fn(|c| total[c] + v[c]);
        let lights = 0..self.lighting().n_lights();
        let all = |p| lights.clone().map(|l| self.value(p, l)).fold([0.0; 3], add);
        self.pixels(|p| all(p).map(|v| v as f32))
    }

    fn picture(&self) -> Picture {
        let light = |l| self.pixels(|p| self.value(p, l).map(|v| v as f32));
        let UVec2 { x: width, y: height } = self.of.size;
        Picture {
            width: width as usize,
            height: height as usize,
            rgb: self.beauty(),
            lights: (0..self.lighting().n_lights()).map(light).collect(),
        }
    }
}

/// Samples of each replicate at the ends of the rounds, without end.
fn round_ends() -> impl Iterator<Item = u32> {
    let next = |&end: &u32| Some((f64::from(end) * ROUND_GROWTH).ceil() as u32);
    std::iter::successors(Some(FIRST_ROUND), next)
}

/// Samples of each replicate at the end of the pass that begins with `first` samples and is of the round that
/// ends with `round_end`: the first passes are short, so that there is a picture soon.
fn pass_end(first: u32, round_end: u32) -> u32 {
    (first + first.clamp(1, MAX_PASS)).min(round_end)
}

impl Renderer {
    /// Renders pictures of several lightings together, until they are good enough, have as many samples as
    /// they may, or the render is over.
    ///
    /// Once every replicate has a sample, an observer that cancels and a render that is over end it at once;
    /// what is left of the pass is lost.
    ///
    /// # Errors
    /// Every error of [`Integrator::render`](crate::integrator::Integrator::render); cancelled only where a
    /// replicate has no sample yet.
    ///
    /// # Panics
    /// Without lightings, or with more than [`SamplingPlan::MAX_TOGETHER`].
    pub fn grow(
        &self,
        wanted: &Wanted,
        between: &dyn Between,
        observer: &impl Observer,
    ) -> Result<Grown, RenderError> {
        let Wanted { view, lightings, seed, .. } = *wanted;
        let size = view.camera.size();
        let nodes = Nodes::of(lightings);
        let shown: Vec<(&Lighting, usize)> = lightings.iter().map(|&x| (x, nodes.of_value(x))).collect();
        let mut film = RgbFilm::by_light_in(size, &shown);
        let mut grown = Grown::new(size, lightings);
        if let Some(kept) = between.kept() {
            grown.read(&kept);
        }
        observer.advance(u64::from(grown.spp()) * u64::from(size.y));
        let most = wanted.spp.max(REPLICATES as u32);
        'rounds: for end in round_ends() {
            while let Some((replicate, first)) = next_of(&grown.counts, end, most) {
                let has_picture = grown.counts.iter().all(|&n| n > 0);
                if has_picture && (between.is_over() || observer.cancelled()) {
                    break 'rounds;
                }
                let round =
                    Samples { sampler: self.sampler, seed, first, count: pass_end(first, end) - first };
                let count = round.count.min(most - grown.spp());
                let samples = Samples { count, ..round }.replicate(replicate as u64);
                let watched = EndsWithin { observer, between: has_picture.then_some(between), count };
                match self.render_nodes(wanted, &nodes, &mut film, samples, &watched) {
                    Err(RenderError::Cancelled) if has_picture => break 'rounds,
                    other => other?,
                }
                grown.add(replicate, count, &mut film);
                between.passed(&grown, false);
            }
            // What an earlier attempt has rendered beyond this round was not enough.
            let is_round = grown.counts.iter().all(|&n| n == end) || grown.spp() == most;
            grown.is_complete = (is_round && between.is_enough(&grown)) || grown.spp() == most;
            if grown.is_complete {
                break;
            }
        }
        between.passed(&grown, true);
        Ok(grown)
    }

    /// Adds samples of some values of the background to a film.
    fn render_nodes(
        &self,
        wanted: &Wanted,
        nodes: &Nodes,
        film: &mut RgbFilm,
        samples: Samples,
        observer: &impl Observer,
    ) -> Result<(), RenderError> {
        let Wanted { view, plan, .. } = *wanted;
        let (integrator, samples) = (&self.integrator, &[samples]);
        match nodes.0.len() {
            1 => integrator.render_values(view, &nodes.values::<1>(), plan, film, samples, observer),
            2 => integrator.render_values(view, &nodes.values::<2>(), plan, film, samples, observer),
            _ => {
                let values = nodes.values::<{ SamplingPlan::MAX_TOGETHER }>();
                integrator.render_values(view, &values, plan, film, samples, observer)
            }
        }
    }
}

/// The replicate that is to be rendered next in a round, and the samples that it has; `None` at the end of the
/// round, or where there are `most` samples.
fn next_of(counts: &[u32; REPLICATES], end: u32, most: u32) -> Option<(usize, u32)> {
    let (replicate, &first) = counts.iter().enumerate().min_by_key(|(_, n)| **n)?;
    (first < end && counts.iter().sum::<u32>() < most).then_some((replicate, first))
}

/// Values of the background, each once, the largest first.
struct Nodes(Vec<f32>);

impl Nodes {
    fn of(lightings: &[&Lighting]) -> Self {
        let mut values: Vec<f32> = lightings.iter().map(|x| x.value as f32).collect();
        values.sort_by(|a, b| b.total_cmp(a));
        values.dedup();
        assert!((1..=SamplingPlan::MAX_TOGETHER).contains(&values.len()), "{} lightings", lightings.len());
        Self(values)
    }

    /// Index of the node of a lighting.
    fn of_value(&self, x: &Lighting) -> usize {
        self.0.iter().position(|&v| v == x.value as f32).unwrap_or(0)
    }

    /// The values as nodes of a render; the rest is 0.
    fn values<const N: usize>(&self) -> Values<N> {
        Values(std::array::from_fn(|k| self.0.get(k).copied().unwrap_or(0.0)))
    }
}

/// An observer of a pass that counts a row once for each sample, and ends the pass when the render is over.
struct EndsWithin<'a, O> {
    observer: &'a O,
    /// Tells whether the render is over; `None` as long as it may not be.
    between: Option<&'a dyn Between>,
    /// Samples per pixel of the pass.
    count: u32,
}

impl<O: Observer> Observer for EndsWithin<'_, O> {
    fn advance(&self, rows: u64) {
        self.observer.advance(rows * u64::from(self.count));
    }
    fn cancelled(&self) -> bool {
        self.observer.cancelled() || self.between.is_some_and(Between::is_over)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Mutex,
        atomic::{AtomicU32, Ordering},
    };

    use super::*;
    use crate::{
        import, integrator::Integrator, math::display::LuminanceMode, sampler::SamplerKind, scene::Scene,
    };

    fn scene() -> Scene {
        import::load("tests/mitsuba/scenes/cornell.obj".as_ref()).unwrap().scene
    }

    fn renderer() -> Renderer {
        let (integrator, sampler) = (Integrator::default(), SamplerKind::Sobol);
        Renderer { integrator, sampler, luminance: LuminanceMode::Srgb }
    }

    /// Three lightings, of which two see the same value of the background.
    fn lightings(scene: &Scene) -> [Lighting; 3] {
        let x = Lighting::authored(scene);
        let small = Lighting { radiance: vec![20.0], size: vec![0.5], ..x.clone() };
        let dark = Lighting { value: 0.5, ..small.clone() };
        [x, dark, small]
    }

    fn grow(scene: &Scene, spp: u32, between: &dyn Between) -> Result<Grown, RenderError> {
        let camera = scene.camera.resized(UVec2::new(12, 9));
        let all = lightings(scene);
        let each = all.each_ref();
        let plan = SamplingPlan::for_pictures(&each.map(|x| (x, 1.0)));
        let view = View { scene, camera: &camera };
        renderer().grow(&Wanted { view, lightings: &each, plan: &plan, seed: 3, spp }, between, &())
    }

    fn assert_equal(a: &Grown, b: &Grown) {
        let [a, b] = [a, b].map(|grown| {
            let mut bytes = Vec::new();
            grown.write(&mut bytes).unwrap();
            bytes
        });
        assert!(a == b);
    }

    /// Takes up what was kept, ends after some passes, and keeps the pictures then.
    #[derive(Default)]
    struct Stopped {
        kept: Option<Vec<u8>>,
        passes_left: AtomicU32,
        last: Mutex<Vec<u8>>,
        rounds: Mutex<Vec<u32>>,
        enough: u32,
    }

    impl Between for Stopped {
        fn is_over(&self) -> bool {
            self.passes_left.load(Ordering::Relaxed) == 0
        }
        fn kept(&self) -> Option<Vec<u8>> {
            self.kept.clone()
        }
        fn passed(&self, grown: &Grown, is_last: bool) {
            if is_last {
                grown.write(&mut *self.last.lock().unwrap()).unwrap();
            } else {
                self.passes_left.fetch_sub(1, Ordering::Relaxed);
            }
        }
        fn is_enough(&self, grown: &Grown) -> bool {
            self.rounds.lock().unwrap().push(grown.spp());
            grown.spp() >= self.enough
        }
    }

    fn stopped(passes: u32, enough: u32) -> Stopped {
        Stopped { passes_left: passes.into(), enough, ..Stopped::default() }
    }

    #[test]
    fn a_film_of_several_lightings_holds_what_films_of_each_hold() {
        let scene = scene();
        let camera = scene.camera.resized(UVec2::new(12, 9));
        let view = View { scene: &scene, camera: &camera };
        let all = lightings(&scene);
        let each = all.each_ref();
        let plan = SamplingPlan::for_pictures(&each.map(|x| (x, 1.0)));
        let samples = Samples { sampler: SamplerKind::Sobol, seed: 5, first: 0, count: 4 };
        let render = |film: &mut RgbFilm, value: f64| {
            let values = Values([value as f32]);
            renderer().integrator.render_values(view, &values, &plan, film, &[samples], &()).unwrap();
        };
        // Of one value of the background, at which paths are the same.
        let mut together = RgbFilm::by_light_in(camera.size(), &[(each[0], 0), (each[2], 0)]);
        render(&mut together, each[0].value);
        let mut sums = vec![0.0; 2 * 3 * 12 * 9];
        for (k, x) in [each[0], each[2]].into_iter().enumerate() {
            let mut alone = RgbFilm::by_light(camera.size(), x);
            render(&mut alone, x.value);
            for p in 0..12 * 9 {
                let (a, b) = (together.sum(p, k), alone.sum(p, 0));
                // Splats are rounded to units of the lighting's own white.
                assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-8 * b[c].abs() + 1e-9), "{a:?} {b:?}");
            }
        }
        let before: Vec<[f64; 3]> = (0..2 * 12 * 9).map(|i| together.sum(i / 2, i % 2)).collect();
        together.move_onto(&mut sums);
        assert_eq!(before.as_flattened(), sums);
        assert!((0..2 * 12 * 9).all(|i| together.sum(i / 2, i % 2) == [0.0; 3]));
    }

    #[test]
    fn what_was_stopped_goes_on_to_the_same_pictures() {
        let scene = scene();
        let whole = grow(&scene, 50, &stopped(u32::MAX, 1000)).unwrap();
        assert!(whole.is_complete() && whole.spp() == 50);
        let mut kept = None;
        for passes in [0, 3, 1, 9, u32::MAX] {
            let between = Stopped { kept, ..stopped(passes.max(4), 1000) };
            let part = grow(&scene, 50, &between).unwrap();
            assert_eq!(part.is_complete(), passes == u32::MAX);
            kept = Some(between.last.into_inner().unwrap());
            if part.is_complete() {
                assert_equal(&whole, &part);
            }
        }
        // What does not fit is done without.
        let between = Stopped { kept: Some(vec![1; 99]), ..stopped(u32::MAX, 1000) };
        assert_equal(&whole, &grow(&scene, 50, &between).unwrap());
        // A picture of fewer samples is what a render that was stopped with them has.
        let cut = grow(&scene, 60, &stopped(13, 1000)).unwrap();
        assert_equal(&cut, &grow(&scene, cut.spp(), &|| false).unwrap());
    }

    #[test]
    fn threads_do_not_matter() {
        let scene = scene();
        let [one, two] = [1, 2].map(|n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| grow(&scene, 24, &|| false).unwrap())
        });
        assert_equal(&one, &two);
    }

    #[test]
    fn rounds_end_when_it_is_enough_and_with_the_samples_that_are_allowed() {
        let scene = scene();
        let between = stopped(u32::MAX, 50);
        assert!(grow(&scene, 1000, &between).unwrap().is_complete());
        assert_eq!(*between.rounds.lock().unwrap(), [16, 20, 28, 36, 48, 60]);
        let between = stopped(u32::MAX, 1000);
        assert_eq!(grow(&scene, 30, &between).unwrap().counts, [9, 7, 7, 7]);
        assert_eq!(*between.rounds.lock().unwrap(), [16, 20, 28, 30]);
        // The jackknife needs all replicates.
        assert_eq!(grow(&scene, 1, &|| true).unwrap().counts, [1; 4]);
        // Taken up at the end of a round, it is asked again.
        let between = Stopped { kept: Some(between.last.into_inner().unwrap()), ..stopped(0, 30) };
        assert!(grow(&scene, 30, &between).unwrap().is_complete());
        assert_eq!(*between.rounds.lock().unwrap(), [30]);
    }

    #[test]
    fn halves_and_replicates_are_parts_of_the_picture() {
        let grown = grow(&scene(), 16, &|| false).unwrap();
        let mean = |parts: &[&[[f32; 3]]], p: usize, c: usize| {
            parts.iter().map(|part| f64::from(part[p][c])).sum::<f64>() / parts.len() as f64
        };
        for k in 0..3 {
            let (whole, [a, b], replicates) = (grown.picture(k), grown.halves(k), grown.replicates(k));
            assert_eq!(whole.rgb, grown.beauty(k));
            assert_ne!(a.rgb, b.rgb);
            let each: Vec<&[[f32; 3]]> = replicates.iter().map(Vec::as_slice).collect();
            for (p, rgb) in whole.rgb.iter().enumerate() {
                for (c, &v) in rgb.iter().enumerate() {
                    let parts = [mean(&[&a.rgb, &b.rgb], p, c), mean(&each, p, c), {
                        f64::from(whole.lights[0][p][c])
                    }];
                    let of_a = mean(&each[..2], p, c) - f64::from(a.rgb[p][c]);
                    let v = f64::from(v);
                    assert!(parts.iter().all(|part| (part - v).abs() <= 1e-6 * v), "{v} {parts:?}");
                    assert!(of_a.abs() <= 1e-6 * v.max(1.0));
                }
            }
            let luminance = |rgb: &[f32; 3]| crate::math::display::luminance(*rgb) as f32;
            let wanted: Vec<f32> = replicates[3].iter().map(luminance).collect();
            assert_eq!(grown.luminances(k)[3], wanted);
        }
    }

    #[test]
    fn nobody_waits_for_a_picture_that_has_no_samples() {
        struct Impatient;
        impl Observer for Impatient {
            fn advance(&self, _rows: u64) {}
            fn cancelled(&self) -> bool {
                true
            }
        }
        let scene = scene();
        let x = Lighting::authored(&scene);
        let plan = SamplingPlan::for_picture(&x);
        let view = View { scene: &scene, camera: &scene.camera };
        let wanted = Wanted { view, lightings: &[&x], plan: &plan, seed: 3, spp: 100 };
        assert_eq!(renderer().grow(&wanted, &|| true, &Impatient).unwrap_err(), RenderError::Cancelled);
    }
}
