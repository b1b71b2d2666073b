//! Check renders of the lights found, with samples that chose nothing.

use std::io::{self, Write};

use rayon::prelude::*;

use super::{
    Reporter, RunError,
    deadline::Deadline,
    observer::Unstoppable,
    precision::{MAX_SAMPLES, Precision},
    products::samples_key,
    setup::Setup,
    working_basis::{Focus, MAX_TOGETHER, REPLICATES},
};
use crate::{
    audit::products::Products,
    film::RgbFilm,
    integrator::{Samples, Values},
    light::{LightSampler, SizeDensity},
    lighting::{Lighting, SamplingPlan},
    objective::{JackknifeEstimate, LABELLINGS, Objective, ObjectiveError, Replicates},
};

/// Samples of each replicate that are taken before a check looks whether it must end: fewer shorten the
/// wait after an interrupt, more start parallel work less often. Set by reasoning.
const PASS: u32 = 4;

/// Results of a check.
pub struct Checks {
    /// f_q of each lighting.
    pub estimates: Vec<JackknifeEstimate>,
    /// Number of renders that it took.
    pub renders: u64,
}

/// Measures f_q of some lightings, each by its own objective, from one render of all their pictures
/// without feathered edges: of `spp` samples per pixel over all replicates, and of more until every
/// error is small enough.
///
/// # Errors
/// When a render fails.
///
/// # Panics
/// With more than [`MAX_TOGETHER`] lightings.
pub fn check(
    foci: &[Focus],
    objectives: &[&Objective],
    setup: Setup,
    seed: u64,
    spp: u32,
    reporter: &impl Reporter,
) -> Result<Checks, RunError> {
    match foci.len() {
        1 => check_nodes::<1>(foci, objectives, setup, seed, spp, reporter),
        2 => check_nodes::<2>(foci, objectives, setup, seed, spp, reporter),
        _ => check_nodes::<MAX_TOGETHER>(foci, objectives, setup, seed, spp, reporter),
    }
}

/// Kind of the films of a check.
const KIND: &str = "check";

/// How far a check has got.
#[derive(Clone, Copy, Debug, Default)]
struct Growth {
    /// Samples per pixel that each replicate has.
    first: u32,
    /// Samples per pixel after which it is looked whether they are enough.
    wanted: u32,
    /// Number of times that it was looked.
    renders: u64,
}

impl Growth {
    /// Takes up films, and how far they have got, where an earlier attempt has kept them.
    fn take_up(&mut self, films: &mut [RgbFilm], kept: Option<Vec<u8>>) {
        let Some(kept) = kept else { return };
        let Some((numbers, mut rest)) = kept.split_first_chunk::<16>() else { return };
        let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| numbers[at + i]));
        for film in films {
            match film.read_sums(rest) {
                Some(after) => rest = after,
                None => return,
            }
        }
        *self = Self { first: number(0), wanted: number(4), renders: u64::from(number(8)) };
    }

    fn write(self, films: &[RgbFilm], out: &mut dyn Write) -> io::Result<()> {
        for number in [self.first, self.wanted, self.renders as u32, 0] {
            out.write_all(&number.to_le_bytes())?;
        }
        films.iter().try_for_each(|film| film.write_sums(out))
    }
}

/// [`check`] of up to `N` lightings, each at a node of the background's value.
fn check_nodes<const N: usize>(
    foci: &[Focus],
    objectives: &[&Objective],
    setup: Setup,
    seed: u64,
    spp: u32,
    reporter: &impl Reporter,
) -> Result<Checks, RunError> {
    let order = by_falling_value(foci);
    let value = |k: usize| order.get(k).map_or(0.0, |&i| foci[i].lighting.value as f32);
    let values = Values::<N>(std::array::from_fn(value));
    let lightings: Vec<&Lighting> = order.iter().map(|&i| &foci[i].lighting).collect();
    let plan = sampling(foci, setup, values.0[0]);
    let renderer = setup.renderer();

    let film = || RgbFilm::by_lighting(setup.camera.size(), &lightings);
    let mut films: Vec<RgbFilm> = (0..REPLICATES).map(|_| film()).collect();
    let is_over = || reporter.cancelled() || setup.deadline.has_passed(Deadline::CHECK);
    let mut growth = Growth { wanted: spp.div_ceil(REPLICATES as u32).max(1), ..Growth::default() };
    let key = {
        let targets: Vec<_> = setup.options.jobs.iter().map(|job| &job.target).collect();
        let words = format!("{lightings:?} {targets:?} {} {spp}", setup.options.tolerance);
        Products::key(&words, &[samples_key(&setup, setup.camera, &plan, seed)])
    };
    growth.take_up(&mut films, setup.products.load(key, KIND));
    let keep = |growth: Growth, films: &[RgbFilm]| {
        setup.products.save(key, KIND, |text| reporter.note(text), |out| growth.write(films, out));
    };
    loop {
        let Growth { first, wanted, .. } = growth;
        let passes = u64::from((wanted - first).div_ceil(PASS)) * REPLICATES as u64;
        let rows = passes * u64::from(setup.options.work_size.y);
        reporter.stage("checking the result with new samples", Some(rows));
        setup.products.begin_growing();
        while growth.first < wanted && !(growth.first > 0 && is_over()) {
            let count = PASS.min(wanted - growth.first);
            let samples = Samples { sampler: renderer.sampler, seed, first: growth.first, count };
            for (r, film) in films.iter_mut().enumerate() {
                let replicate = [samples.replicate(r as u64)];
                let observer = Unstoppable(reporter);
                let integrator = renderer.integrator;
                integrator.render_values(setup.view(), &values, &plan, film, &replicate, &observer)?;
            }
            growth.first += count;
            if setup.products.is_due() {
                keep(growth, &films);
            }
        }
        if growth.first > first {
            keep(growth, &films);
        }
        growth.renders += 1;
        let measured = order.par_iter().enumerate().map(|(node, &i)| {
            Ok((i, measure(&films, node, growth.first, objectives[i], setup, &foci[i].lighting)?))
        });
        let mut estimates = measured.collect::<Result<Vec<_>, ObjectiveError>>()?;
        estimates.sort_by_key(|(i, _)| *i);
        let estimates: Vec<JackknifeEstimate> = estimates.into_iter().map(|(_, e)| e).collect();
        let now = growth.first * REPLICATES as u32;
        let precision = Precision::reported(setup.options.tolerance);
        let wanted = estimates.iter().filter(|e| !precision.is_met(e)).map(|e| precision.more(now, e)).max();
        match wanted {
            Some(more) if now < MAX_SAMPLES && !is_over() => {
                growth.wanted = growth.first + more.div_ceil(REPLICATES as u32).max(1);
            }
            _ => return Ok(Checks { estimates, renders: growth.renders }),
        }
    }
}

/// Indices of the lightings by falling value of the background, since sampling goes by the first node.
fn by_falling_value(foci: &[Focus]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..foci.len()).collect();
    order.sort_by(|&a, &b| foci[b].lighting.value.total_cmp(&foci[a].lighting.value));
    order
}

/// Sampling plan for the sizes and lights of all lightings.
fn sampling(foci: &[Focus], setup: Setup, largest_value: f32) -> SamplingPlan {
    let density = |light: usize| {
        let sizes = Focus::sizes(foci, light);
        let is_same = sizes.iter().all(|s| s.0 == sizes[0].0);
        if is_same { SizeDensity::uniform_area(sizes[0].0) } else { SizeDensity::one_of(&sizes) }
    };
    SamplingPlan {
        lights: LightSampler::new(&Focus::light_weights(foci)),
        sizes: (0..setup.scene.lights.len()).map(density).collect(),
        largest_value,
        ..setup.plan(&foci[0].lighting)
    }
}

/// f_q of the picture of the lighting at `node`, from films of `samples` samples per pixel each.
fn measure(
    films: &[RgbFilm],
    node: usize,
    samples: u32,
    objective: &Objective,
    setup: Setup,
    lighting: &Lighting,
) -> Result<JackknifeEstimate, ObjectiveError> {
    let pixel = |film: &RgbFilm, p| film.sum(p, node).map(|v| (v / f64::from(samples)) as f32);
    let n = setup.camera.size().element_product() as usize;
    let (measure, exposure) = (setup.options.measure, lighting.exposure);
    let planes = |film: &RgbFilm| measure.planes(&(0..n).map(|p| pixel(film, p)).collect::<Vec<_>>());
    let linear: Vec<Vec<f64>> = films.iter().map(planes).collect();
    Replicates { linear: &linear, measure, exposure }.measure(objective, LABELLINGS)
}
