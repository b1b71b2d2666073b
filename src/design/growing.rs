//! Pictures of several lightings that grow together, from one render, until they are good enough.
//!
//! A light's size is an indicator and its radiance a factor, so that the samples of one render make the
//! picture of every lighting. They come in [`REPLICATES`] replicates, from whose differences the noise is
//! known. The first half of the replicates makes one picture of each light, the second half another: two
//! halves that are independent, for whoever must not look at what it judges.
//!
//! A render proceeds in rounds, after each of which it is asked whether that is enough, and if not, how many
//! samples each tile of the picture is to have next; all replicates have the same number in a tile. A round
//! proceeds in passes, of which each adds samples to one replicate. Both are the same for every render, so that
//! a picture of some number of samples is the same whatever the threads and the clock, and whether the
//! render was stopped on the way.

use std::{
    io::{self, Write},
    ops::Range,
    sync::atomic::{AtomicU64, Ordering},
};

use glam::UVec2;
use rayon::prelude::*;

use super::render::Renderer;
use crate::{
    denoise::{denoise, denoise_picture},
    files::parts::write_numbers,
    film::{Picture, RgbFilm, tiling::Tiling},
    integrator::{Observer, RenderError, TileSamples, Values, View, Work, aov::Features, seed_of_replicate},
    lighting::{Lighting, SampleCounts, SamplingPlan},
    math::{Measure, display::luminance},
};

/// Replicates of a picture: the jackknife's bias and error estimates need four.
pub const REPLICATES: usize = 4;
/// Replicates of each of the two halves.
const OF_HALF: usize = REPLICATES / 2;
/// Samples of each replicate in the first round. With 2 or 3 the fruit basket took a quarter more time, since less
/// was known of where its noise lies.
const FIRST_ROUND: u32 = 4;
/// Samples of a replicate in a pass at most, in the mean over the tiles: an interrupt loses no more of them,
/// while emptying the film takes a fiftieth of the time of a pass of the fruit basket.
const MAX_PASS: u32 = 4;
/// Side of the tiles that have numbers of samples of their own, pixels.
const SIDE: u32 = 16;

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

impl Wanted<'_> {
    /// Samples per pixel of the r-th replicate at most.
    fn most(&self, r: usize) -> u32 {
        let spp = self.spp.max(REPLICATES as u32);
        spp / REPLICATES as u32 + u32::from((r as u32) < spp % REPLICATES as u32)
    }
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
    /// Called after each round but the last that there may be: `None` if the pictures are good enough,
    /// otherwise the samples per pixel of each replicate that every tile of [`Grown::tiling`] is to have after the
    /// next round. The answer must depend on the pictures alone.
    fn next_round(&self, grown: &Grown) -> Option<Vec<u32>> {
        Some(vec![u32::MAX; grown.tiling().len()])
    }
}

impl<F: Fn() -> bool + Sync> Between for F {
    fn is_over(&self) -> bool {
        self()
    }
}

/// Sums of samples, as `[pixel][picture][rgb]`.
#[derive(Clone, Debug)]
struct Sums {
    /// What the pixels' own samples bring.
    own: Vec<f32>,
    /// What light subpaths bring to pixels that the camera sees them in.
    splats: Vec<f32>,
}

impl Sums {
    fn new(n: usize) -> Self {
        Self { own: vec![0.0; 3 * n], splats: vec![0.0; 3 * n] }
    }
}

/// Pictures of several lightings with the samples that they have.
#[derive(Clone, Debug)]
pub struct Grown {
    tiling: Tiling,
    lightings: Vec<Lighting>,
    /// Numbers of light samples and light subpaths of a camera subpath.
    sampling: SampleCounts,
    /// Samples per pixel of each replicate, by tile, when the present round began.
    done: Vec<u32>,
    /// Samples per pixel of each replicate, by tile, when the present round is done.
    wanted: Vec<u32>,
    /// Samples of each replicate in the present round so far, in the tiles that have the most of them.
    passed: [u32; REPLICATES],
    /// Samples per pixel of each replicate at most.
    most: [u32; REPLICATES],
    /// Whether they are good enough or have as many samples as they may.
    is_complete: bool,
    /// Sums of either half of the replicates, of the pictures of each light in each lighting, for unit radiance.
    halves: [Sums; 2],
    /// Sums of each replicate, of the picture of each lighting with all lights at their radiance.
    beauties: [Sums; REPLICATES],
}

impl Grown {
    /// Pictures without samples.
    fn new(wanted: &Wanted) -> Self {
        let tiling = Tiling { size: wanted.view.camera.size(), side: SIDE };
        let n_pixels = tiling.size.element_product() as usize;
        let n_layers: usize = wanted.lightings.iter().map(|x| x.n_lights()).sum();
        let most: [u32; REPLICATES] = std::array::from_fn(|r| wanted.most(r));
        Self {
            tiling,
            lightings: wanted.lightings.iter().map(|&x| x.clone()).collect(),
            sampling: wanted.plan.counts,
            done: vec![0; tiling.len()],
            wanted: vec![FIRST_ROUND.min(most[0]); tiling.len()],
            passed: [0; REPLICATES],
            most,
            is_complete: false,
            halves: std::array::from_fn(|_| Sums::new(n_pixels * n_layers)),
            beauties: std::array::from_fn(|_| Sums::new(n_pixels * wanted.lightings.len())),
        }
    }

    /// Memory that the picture of one lighting takes while it grows, its film included, bytes.
    #[must_use]
    pub fn bytes(size: UVec2, n_lights: usize) -> u64 {
        // Sums and splats of the film; those of two halves, and those of the replicates.
        let of_pixel = n_lights * (2 * 24 + 2 * 24) + REPLICATES * 24;
        u64::from(size.x) * u64::from(size.y) * of_pixel as u64
    }

    /// Whether the pictures are good enough or have as many samples as they may.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Numbers of light samples and light subpaths of a camera subpath.
    #[must_use]
    pub fn sampling(&self) -> SampleCounts {
        self.sampling
    }

    /// The tiles that have numbers of samples of their own.
    #[must_use]
    pub fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// Samples per pixel of a replicate in a tile.
    fn count(&self, replicate: usize, tile: usize) -> u32 {
        self.count_at(self.passed[replicate], replicate, tile)
    }

    /// Samples per pixel of a replicate in a tile when it has `passed` of them in the present round.
    fn count_at(&self, passed: u32, replicate: usize, tile: usize) -> u32 {
        (self.done[tile].saturating_add(passed)).min(self.wanted[tile]).min(self.most[replicate])
    }

    /// Samples per pixel of a replicate, the mean over all pixels.
    fn mean_count(&self, replicate: usize) -> f64 {
        self.tiling.mean(|t| self.count(replicate, t))
    }

    /// Samples per pixel of each replicate, by tile, after a round.
    #[must_use]
    pub fn counts(&self) -> Vec<u32> {
        (0..self.tiling.len()).map(|t| self.count(0, t)).collect()
    }

    /// Samples per pixel of each replicate at most.
    #[must_use]
    pub fn most(&self) -> u32 {
        self.most[0]
    }

    /// Samples of all pixels and replicates.
    #[must_use]
    pub fn n_samples(&self) -> u64 {
        (0..REPLICATES).map(|r| self.tiling.total(|t| self.count(r, t))).sum()
    }

    /// Samples per pixel of all replicates, the mean over all pixels, rounded.
    #[must_use]
    pub fn spp(&self) -> u32 {
        (0..REPLICATES).map(|r| self.mean_count(r)).sum::<f64>().round() as u32
    }

    /// Whether every pixel of every replicate has a sample.
    fn has_pictures(&self) -> bool {
        (0..REPLICATES).all(|r| (0..self.tiling.len()).all(|t| self.count(r, t) > 0))
    }

    /// Whether every pixel has as many samples as it may.
    fn is_full(&self) -> bool {
        (0..REPLICATES).all(|r| (0..self.tiling.len()).all(|t| self.count(r, t) == self.most[r]))
    }

    /// The next pass of the present round: the replicate, and its samples in the round when the pass is done;
    /// `None` at the end of the round.
    fn next_pass(&self) -> Option<(usize, u32)> {
        let in_round = |t: usize| self.wanted[t] - self.done[t];
        let most = (0..self.tiling.len()).map(in_round).max()?;
        let n_passes = (self.tiling.mean(in_round) / f64::from(MAX_PASS)).ceil().max(1.0) as u32;
        let (replicate, &passed) = self.passed.iter().enumerate().min_by_key(|(_, n)| **n)?;
        // Short passes first, so that there is a picture soon.
        let step = if self.done[0] == 0 { passed.clamp(1, MAX_PASS) } else { most.div_ceil(n_passes) };
        (passed < most).then(|| (replicate, (passed + step).min(most)))
    }

    /// Samples of each tile that a replicate is to take until it has `passed` of them in the round.
    fn pass(&self, replicate: usize, passed: u32) -> Vec<Range<u32>> {
        let of_tile = |t| self.count(replicate, t)..self.count_at(passed, replicate, t);
        (0..self.tiling.len()).map(of_tile).collect()
    }

    /// Begins a round at whose end tiles are to have some numbers of samples per replicate, or those that they
    /// have where these are more; whether there is anything to be done.
    fn begin_round(&mut self, wanted: &[u32]) -> bool {
        self.done = self.counts();
        self.passed = [0; REPLICATES];
        let most = self.most[0];
        self.wanted = wanted.iter().zip(&self.done).map(|(&n, &done)| n.min(most).max(done)).collect();
        self.wanted != self.done
    }

    /// Picture of the k-th lighting with all samples.
    #[must_use]
    pub fn picture(&self, k: usize) -> Picture {
        Layers::new(self, k, 0..2).picture()
    }

    /// Radiance of the k-th lighting with all samples, row by row: that of [`Self::picture`].
    #[must_use]
    pub fn beauty(&self, k: usize) -> Vec<[f32; 3]> {
        Layers::new(self, k, 0..2).beauty()
    }

    /// Pictures of the k-th lighting with the samples of either half of the replicates.
    #[must_use]
    pub fn halves(&self, k: usize) -> [Picture; 2] {
        std::array::from_fn(|h| Layers::new(self, k, h..h + 1).picture())
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

    /// Planes of each replicate of the k-th lighting, as [`Measure::planes`] but with the digits that a file
    /// keeps.
    #[must_use]
    pub fn planes(&self, k: usize, measure: Measure) -> [Vec<f32>; REPLICATES] {
        if measure.n_planes() == 1 {
            return self.of_replicates(k, |rgb| luminance(rgb) as f32);
        }
        self.replicates(k).map(|rgb| measure.planes(&rgb).into_iter().map(|v| v as f32).collect())
    }

    fn of_replicates<T: Send>(&self, k: usize, of: impl Fn([f32; 3]) -> T + Sync) -> [Vec<T>; REPLICATES] {
        let n = self.lightings.len();
        std::array::from_fn(|r| {
            let shares = self.shares(r..r + 1);
            let sums = &self.beauties[r];
            let pixel = |p: usize| of(shares.mean(sums, p, 3 * (p * n + k)).map(|v| v as f32));
            (0..self.tiling.size.element_product() as usize).into_par_iter().map(pixel).collect()
        })
    }

    /// What the sums of some replicates are multiplied by.
    fn shares(&self, replicates: Range<usize>) -> Shares {
        let inverse = |n: f64| if n > 0.0 { 1.0 / n } else { 0.0 };
        let of_tile = |t| replicates.clone().map(|r| f64::from(self.count(r, t))).sum::<f64>();
        Shares {
            tiling: self.tiling,
            own: (0..self.tiling.len()).map(|t| inverse(of_tile(t))).collect(),
            splats: inverse(replicates.clone().map(|r| self.mean_count(r)).sum()),
        }
    }

    /// Adds the samples of a replicate that are in a film, and empties it.
    fn add(&mut self, replicate: usize, passed: u32, film: &mut RgbFilm) {
        let n = self.lightings.len();
        let lightings = &self.lightings;
        let from = &*film;
        let gains: Vec<Vec<[f64; 3]>> = lightings.iter().map(gains).collect();
        let Sums { own, splats } = &mut self.beauties[replicate];
        let pixels = own.par_chunks_exact_mut(3 * n).zip(splats.par_chunks_exact_mut(3 * n));
        pixels.enumerate().for_each(|(pixel, (own, splats))| {
            for (k, x) in lightings.iter().enumerate() {
                for (l, gain) in gains[k].iter().enumerate() {
                    let parts = from.parts(pixel, k * x.n_lights() + l);
                    for c in 0..3 {
                        own[3 * k + c] += (parts[0][c] * gain[c]) as f32;
                        splats[3 * k + c] += (parts[1][c] * gain[c]) as f32;
                    }
                }
            }
        });
        let Sums { own, splats } = &mut self.halves[replicate / OF_HALF];
        film.move_onto(own, splats);
        self.passed[replicate] = passed;
    }

    /// All sums, in the order in which they are written.
    fn sums(&self) -> impl Iterator<Item = &Vec<f32>> {
        self.halves.iter().chain(&self.beauties).flat_map(|sums| [&sums.own, &sums.splats])
    }

    /// Writes the samples so far, exactly.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let counts = self.done.iter().chain(&self.wanted).chain(&self.passed);
        write_numbers(out, counts.map(|count| count.to_le_bytes()))?;
        write_numbers(out, self.sums().flatten().map(|sum| sum.to_le_bytes()))
    }

    /// Takes the samples of pictures of the same size and lightings that [`Self::write`] has written, and
    /// says whether they could be read.
    fn read(&mut self, bytes: &[u8]) -> bool {
        let n_words = 2 * self.tiling.len() + REPLICATES + self.sums().map(Vec::len).sum::<usize>();
        if bytes.len() != 4 * n_words {
            return false;
        }
        let mut words = bytes.as_chunks().0.iter();
        let counts = self.done.iter_mut().chain(&mut self.wanted).chain(&mut self.passed);
        counts.zip(&mut words).for_each(|(n, b)| *n = u32::from_le_bytes(*b));
        let parts = self.halves.iter_mut().chain(&mut self.beauties);
        let sums = parts.flat_map(|sums| [&mut sums.own, &mut sums.splats]).flatten();
        sums.zip(words).for_each(|(sum, b)| *sum = f32::from_le_bytes(*b));
        true
    }
}

/// Factors that make means of sums.
struct Shares {
    tiling: Tiling,
    /// Inverse of the number of a pixel's own samples, by tile.
    own: Vec<f64>,
    /// Inverse of the mean number of samples of all pixels: splats come from the samples of all.
    splats: f64,
}

impl Shares {
    /// Mean of the sums of a pixel that begin at an index.
    fn mean(&self, sums: &Sums, pixel: usize, at: usize) -> [f64; 3] {
        let own = self.own[self.tiling.of_index(pixel)];
        std::array::from_fn(|c| {
            f64::from(sums.own[at + c]) * own + f64::from(sums.splats[at + c]) * self.splats
        })
    }
}

/// Means of some samples for each light of a lighting.
struct Layers<'a> {
    of: &'a Grown,
    /// Index of the lighting.
    k: usize,
    /// Factors on the contributions of each light.
    gains: Vec<[f64; 3]>,
    /// Sums of the samples of some halves.
    sums: &'a [Sums],
    /// What makes means of the sums of all these halves together.
    shares: Shares,
}

/// Factors on the contributions of each light in a lighting.
fn gains(x: &Lighting) -> Vec<[f64; 3]> {
    (0..x.n_lights()).map(|l| x.gain_of(l)).collect()
}

impl<'a> Layers<'a> {
    /// Layers of the k-th lighting, with the samples of a range of the halves of the replicates.
    fn new(of: &'a Grown, k: usize, halves: Range<usize>) -> Self {
        let shares = of.shares(OF_HALF * halves.start..OF_HALF * halves.end);
        Self { of, k, gains: gains(&of.lightings[k]), sums: &of.halves[halves], shares }
    }

    fn lighting(&self) -> &Lighting {
        &self.of.lightings[self.k]
    }

    /// Radiance of a pixel that is due to a light.
    fn value(&self, pixel: usize, light: usize) -> [f64; 3] {
        let lighting = self.lighting();
        let n_lights = lighting.n_lights();
        let at = 3 * ((pixel * self.of.lightings.len() + self.k) * n_lights + light);
        let gain = self.gains[light];
        let means = self.sums.iter().map(|sums| self.shares.mean(sums, pixel, at));
        means.fold([0.0; 3], |total, mean| std::array::from_fn(|c| total[c] + gain[c] * mean[c]))
    }

    fn pixels<T: Send>(&self, of: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        (0..self.of.tiling.size.element_product() as usize).into_par_iter().map(of).collect()
    }

    fn beauty(&self) -> Vec<[f32; 3]> {
        let add = |total: [f64; 3], v: [f64; 3]| std::array::from_fn(|c| total[c] + v[c]);
        let lights = 0..self.lighting().n_lights();
        let all = |p| lights.clone().map(|l| self.value(p, l)).fold([0.0; 3], add);
        self.pixels(|p| all(p).map(|v| v as f32))
    }

    fn picture(&self) -> Picture {
        let light = |l| self.pixels(|p| self.value(p, l).map(|v| v as f32));
        let UVec2 { x: width, y: height } = self.of.tiling.size;
        Picture {
            width: width as usize,
            height: height as usize,
            rgb: self.beauty(),
            lights: (0..self.lighting().n_lights()).map(light).collect(),
        }
    }
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
        let mut grown = Grown::new(wanted);
        if let Some(kept) = between.kept() {
            grown.read(&kept);
        }
        observer.advance(u64::from(grown.spp()) * u64::from(size.y));
        'rounds: loop {
            while let Some((replicate, passed)) = grown.next_pass() {
                let has_picture = grown.has_pictures();
                if has_picture && (between.is_over() || observer.cancelled()) {
                    break 'rounds;
                }
                let samples = TileSamples {
                    sampler: self.sampler,
                    seed: seed_of_replicate(seed, replicate as u64),
                    tiling: grown.tiling,
                    indices: grown.pass(replicate, passed),
                };
                let mean = grown.tiling.mean(|t| samples.indices[t].len() as u32);
                let between_rows = has_picture.then_some(between);
                let watched = EndsWithin { observer, between: between_rows, mean, rows: AtomicU64::new(0) };
                match self.render_nodes(wanted, &nodes, &mut film, samples, &watched) {
                    Err(RenderError::Cancelled) if has_picture => break 'rounds,
                    other => other?,
                };
                grown.add(replicate, passed, &mut film);
                between.passed(&grown, false);
            }
            let next = if grown.is_full() { None } else { between.next_round(&grown) };
            grown.is_complete = !next.is_some_and(|wanted| grown.begin_round(&wanted));
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
        samples: TileSamples,
        observer: &impl Observer,
    ) -> Result<Work, RenderError> {
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

/// An observer of a pass that counts a row once for each sample per pixel, and ends the pass when the render is
/// over.
struct EndsWithin<'a, O> {
    observer: &'a O,
    /// Tells whether the render is over; `None` as long as it may not be.
    between: Option<&'a dyn Between>,
    /// Samples per pixel of the pass, the mean over all pixels.
    mean: f64,
    /// Rows that are done.
    rows: AtomicU64,
}

impl<O: Observer> Observer for EndsWithin<'_, O> {
    fn advance(&self, rows: u64) {
        let before = self.rows.fetch_add(rows, Ordering::Relaxed);
        let counted = |rows: u64| (rows as f64 * self.mean) as u64;
        self.observer.advance(counted(before + rows) - counted(before));
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
        import,
        integrator::{Integrator, Samples},
        sampler::SamplerKind,
        scene::Scene,
    };

    fn scene() -> Scene {
        import::load("tests/mitsuba/scenes/cornell.obj".as_ref()).unwrap().scene
    }

    fn renderer() -> Renderer {
        let (integrator, sampler) = (Integrator::default(), SamplerKind::Sobol);
        Renderer { integrator, sampler, measure: Measure::default() }
    }

    /// Three lightings, of which two see the same value of the background.
    fn lightings(scene: &Scene) -> [Lighting; 3] {
        let x = Lighting::authored(scene);
        let small = Lighting { radiance: vec![20.0], size: vec![0.5], ..x.clone() };
        let dark = Lighting { value: 0.5, ..small.clone() };
        [x, dark, small]
    }

    fn grow(scene: &Scene, spp: u32, between: &dyn Between) -> Result<Grown, RenderError> {
        let camera = scene.camera.resized(UVec2::new(40, 28));
        let all = lightings(scene);
        let each = all.each_ref();
        let plan = SamplingPlan::for_pictures(&each.map(|x| (x, &[1.0][..])));
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
        /// Whether only every other tile has more samples in the next round.
        uneven: bool,
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
        fn next_round(&self, grown: &Grown) -> Option<Vec<u32>> {
            self.rounds.lock().unwrap().push(grown.spp());
            let each = grown.counts().into_iter().enumerate();
            let next = each.map(|(t, n)| if self.uneven && t % 2 == 0 { n } else { 2 * n }).collect();
            (grown.spp() < self.enough).then_some(next)
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
        let plan = SamplingPlan::for_pictures(&each.map(|x| (x, &[1.0][..])));
        let samples = Samples { sampler: SamplerKind::Sobol, seed: 5, first: 0, count: 4 };
        let render = |film: &mut RgbFilm, value: f64| {
            let values = Values([value as f32]);
            renderer().integrator.render_values(view, &values, &plan, film, &[samples], &()).unwrap();
        };
        // Of one value of the background, at which paths are the same.
        let mut together = RgbFilm::by_light_in(camera.size(), &[(each[0], 0), (each[2], 0)]);
        render(&mut together, each[0].value);
        for (k, x) in [each[0], each[2]].into_iter().enumerate() {
            let mut alone = RgbFilm::by_light(camera.size(), x);
            render(&mut alone, x.value);
            for p in 0..12 * 9 {
                let (a, b) = (together.sum(p, k), alone.sum(p, 0));
                // Splats are rounded to units of the lighting's own white.
                assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-8 * b[c].abs() + 1e-9), "{a:?} {b:?}");
            }
        }
        let before: Vec<[[f64; 3]; 2]> = (0..2 * 12 * 9).map(|i| together.parts(i / 2, i % 2)).collect();
        let mut sums = [vec![0.0; 2 * 3 * 12 * 9], vec![0.0; 2 * 3 * 12 * 9]];
        let [own, splats] = &mut sums;
        together.move_onto(own, splats);
        for (k, sums) in sums.iter().enumerate() {
            let wanted = before.iter().flat_map(|parts| parts[k]).map(|v| v as f32);
            assert!(wanted.eq(sums.iter().copied()));
        }
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
        let cut = grow(&scene, 60, &stopped(12, 1000)).unwrap();
        let alone = grow(&scene, cut.spp(), &|| false).unwrap();
        assert!(cut.spp() == 16 && (0..3).all(|k| cut.picture(k).rgb == alone.picture(k).rgb));
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
        let between = stopped(u32::MAX, 100);
        let grown = grow(&scene, 1000, &between).unwrap();
        assert!(grown.is_complete() && grown.counts() == [32; 6]);
        assert_eq!(*between.rounds.lock().unwrap(), [16, 32, 64, 128]);
        let between = stopped(u32::MAX, 1000);
        let grown = grow(&scene, 30, &between).unwrap();
        assert!(grown.is_complete() && grown.spp() == 30);
        assert_eq!([0, 1, 2, 3].map(|r| grown.count(r, 0)), [8, 8, 7, 7]);
        assert_eq!(*between.rounds.lock().unwrap(), [16]);
        // The jackknife needs all replicates.
        let grown = grow(&scene, 1, &|| true).unwrap();
        assert_eq!([0, 1, 2, 3].map(|r| grown.count(r, 0)), [1; 4]);
        // Taken up at the end of a round, it is asked again.
        let between = stopped(u32::MAX, 1000);
        assert_eq!(grow(&scene, 16, &between).unwrap().counts(), [4; 6]);
        let between = Stopped { kept: Some(between.last.into_inner().unwrap()), ..stopped(0, 16) };
        let grown = grow(&scene, 1000, &between).unwrap();
        assert!(grown.is_complete() && grown.spp() == 16);
        assert_eq!(*between.rounds.lock().unwrap(), [16]);
    }

    #[test]
    fn tiles_have_samples_of_their_own_also_when_stopped() {
        let scene = scene();
        let between = Stopped { uneven: true, ..stopped(u32::MAX, 60) };
        let whole = grow(&scene, 1000, &between).unwrap();
        assert_eq!(whole.counts(), [4, 32, 4, 32, 4, 32]);
        assert_eq!(*between.rounds.lock().unwrap(), [16, 24, 39, 70]);
        let mut kept = None;
        for passes in [13, 2, u32::MAX] {
            let between = Stopped { kept, uneven: true, ..stopped(passes, 60) };
            let part = grow(&scene, 1000, &between).unwrap();
            assert_eq!(part.is_complete(), passes == u32::MAX);
            kept = Some(between.last.into_inner().unwrap());
        }
        let mut bytes = Vec::new();
        whole.write(&mut bytes).unwrap();
        assert!(kept == Some(bytes));
        // No tile may have more than is allowed.
        let between = Stopped { uneven: true, ..stopped(u32::MAX, 60) };
        let grown = grow(&scene, 20, &between).unwrap();
        assert!(grown.is_complete() && grown.counts() == [4, 5, 4, 5, 4, 5]);
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
            assert_eq!(grown.planes(k, Measure::default())[3], wanted);
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
