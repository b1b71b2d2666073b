//! Optimisation on the transport basis: one render, many evaluations.
//!
//! Samples are added until the error of f_q is small enough; a check render with
//! samples of its own gives the f_q that is reported; while both disagree the
//! basis is rendered again, with its size knots around the lights found.

use std::{path::PathBuf, time::Instant};

use rayon::prelude::*;
use serde_json::json;

use super::{
    Camera, Problem, Purpose, Reporter, RunError, RunOptions, Shot,
    attainable::{self, Reach},
    attribute,
    evaluator::{Evaluator, Scratch},
    search::{self, Polished, Trial},
    seed_for,
};
use crate::{
    audit::{RunDir, picture, stored::About},
    integrator::{RenderError, aov::Aovs},
    light::SizeDensity,
    math::hash::{hash_bytes, hash_words},
    objective::{JackknifeEstimate, Objective},
    optim::{OptimError, StopReason},
    params::{ParamVector, survey::SizeBounds},
    scene::{Scene, sidecar::FreeKind},
    transport::{Knots, Layout, LightingPoint, SizeBins, Source, TransportBasis, ValueNodes},
};

/// Replicates, from which errors are estimated.
const REPLICATES: usize = 4;
/// Knots of a light's size, and the fewest that memory may leave.
const KNOTS: usize = 24;
const MIN_KNOTS: usize = 8;
/// Knots of a basis around what was found: half of them close to it.
const FOCUS_KNOTS: usize = 12;
/// Knots after refocusing lie within this share of the size found.
const FOCUS: f64 = 0.15;
/// Times the basis is rendered anew around what was found.
const MAX_REFOCUS: u32 = 4;
/// Samples of a basis around what was found, times those of the first basis.
const FOCUS_FACTOR: f64 = 1.5;
/// Samples of a replicate that are rendered at a time, whatever the user wants meanwhile.
const UNINTERRUPTED: u32 = 8;
/// Weight with which a light that contributes nothing is chosen, beside 1 of all of them.
const FAINT_LIGHT: f32 = 0.05;
/// Times that samples are added for the tolerance.
const MAX_ADDITIONS: u32 = 6;
/// Samples per pixel after which no more are added, of all replicates.
const MAX_SAMPLES: u32 = 4096;
/// The picture on which starts are screened is smaller by this factor.
const REDUCTION: u32 = 4;

/// What a basis of a scene leaves open.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Sizes that vary, by light.
    sizes: Vec<SizeBounds>,
    /// The largest value of a background that varies.
    value: Option<f32>,
    knots: usize,
    /// The lighting of what does not vary.
    fixed: LightingPoint,
}

/// What a basis is made for: the lights found.
#[derive(Clone, Debug)]
struct Focus {
    lighting: LightingPoint,
    /// How often each light is chosen.
    weights: Vec<f32>,
}

/// A basis and what it is made of.
pub struct Engine {
    plan: Plan,
    basis: TransportBasis,
    focus: Option<Focus>,
    seed: u64,
    /// Where it is stored, and how many samples are there.
    stored: Option<(PathBuf, u32)>,
}

/// What was found for one target.
pub struct Found {
    /// The point, in the unit cube.
    pub u: Vec<f64>,
    /// f_q there, from samples that chose nothing.
    pub check: JackknifeEstimate,
    /// Evaluations with gradient.
    pub evaluations: u32,
    /// Why the last search ended.
    pub stop: StopReason,
    /// What of each term the lights can reach.
    pub reach: Vec<Reach>,
}

impl Plan {
    /// Plans a basis of the scene, whose sizes have been fitted, within the memory
    /// allowed.
    ///
    /// # Errors
    /// When even the fewest knots need more memory than allowed.
    pub fn new(
        scene: &Scene,
        sizes: &[SizeBounds],
        largest_value: Option<f32>,
        options: &RunOptions,
        reporter: &impl Reporter,
    ) -> Result<Self, RunError> {
        let free = |kind| options.free.contains(kind);
        let open = |l: usize| free(FreeKind::Size) && scene.light_bounds[l].size_free;
        let mut plan = Self {
            sizes: sizes.iter().enumerate().map(|(l, s)| s.filter(|_| open(l))).collect(),
            value: largest_value.filter(|_| free(FreeKind::Background)),
            knots: KNOTS,
            fixed: LightingPoint {
                radiance: scene.lights.iter().map(|l| f64::from(l.radiance)).collect(),
                size: scene.lights.iter().map(|l| f64::from(l.size)).collect(),
                value: f64::from(scene.background_value()),
            },
        };
        let need = |plan: &Self| plan.layout(scene, options, None).memory(REPLICATES);
        while need(&plan) > options.memory && plan.knots > MIN_KNOTS {
            plan.knots -= 4;
        }
        let bytes = need(&plan);
        if bytes > options.memory {
            return Err(RunError::Memory { needed: bytes >> 20, allowed: options.memory >> 20 });
        }
        let layout = plan.layout(scene, options, None);
        let reduced = if plan.knots < KNOTS { ", fewer to fit the memory allowed" } else { "" };
        reporter.note(&format!(
            "transport basis: {} x {} pixels, {} cells of light and size ({} knots a size{reduced}), {} value \
             nodes, {REPLICATES} replicates, {} MiB",
            layout.size.x,
            layout.size.y,
            layout.n_cells(),
            plan.knots,
            layout.nodes.len(),
            bytes >> 20,
        ));
        Ok(plan)
    }

    /// The layout, with knots around the sizes of `focus` if given.
    fn layout(&self, scene: &Scene, options: &RunOptions, focus: Option<&Focus>) -> Layout {
        let bins = self.sizes.iter().enumerate().map(|(l, range)| match (range, focus) {
            (None, _) => SizeBins::Fixed(scene.lights[l].size),
            (Some([lo, hi]), None) => {
                SizeBins::Free(Knots::geometric(f64::from(*lo), f64::from(*hi), self.knots))
            }
            (Some([lo, hi]), Some(x)) => SizeBins::Free(Knots::around(
                f64::from(*lo),
                f64::from(*hi),
                x.lighting.size[l],
                FOCUS,
                self.knots.min(FOCUS_KNOTS),
            )),
        });
        let nodes = match self.value {
            None => ValueNodes::new(f64::from(scene.background_value()), 1),
            Some(v) => ValueNodes::new(f64::from(v), options.integrator.max_depth),
        };
        Layout::new(options.work_size, bins.collect(), nodes)
    }

    /// Makes the scene sample every size and the largest value, most of all what is
    /// in focus.
    fn open(&self, scene: &mut Scene, focus: Option<&Focus>) {
        scene.select_all_lights();
        if let Some(focus) = focus {
            scene.select_lights(&focus.weights);
        }
        for (l, (light, range)) in scene.lights.iter_mut().zip(&self.sizes).enumerate() {
            if let Some(range) = *range {
                let likely = |f: &Focus| (f.lighting.size[l] * (1.0 + FOCUS)) as f32;
                light.size_density = focus
                    .map_or_else(|| SizeDensity::any_size(range), |f| SizeDensity::focused(range, likely(f)));
            }
        }
        if let Some(v) = self.value {
            scene.set_background_value(v, v);
        }
    }
}

impl Engine {
    /// Renders the first samples of a basis.
    ///
    /// # Errors
    /// As [`TransportBasis::render`].
    pub fn new(
        plan: Plan,
        scene: &mut Scene,
        camera: &Camera,
        options: &RunOptions,
        reporter: &impl Reporter,
    ) -> Result<Self, RunError> {
        let layout = plan.layout(scene, options, None);
        let seed = seed_for(options.seed, Purpose::Optimise);
        let stored = options.cache.as_ref().map(|directory| {
            plan.open(scene, None);
            let sampling = format!("{:?} {:?} {seed}", camera.integrator, camera.sampler);
            let words = format!("{layout:?} {sampling} {REPLICATES} {}", env!("LIGHTOPT_COMMIT"));
            let key = hash_words(&[scene.fingerprint(), hash_bytes(words.bytes())]);
            (directory.join(format!("{}-{key:016x}.basis", scene.name)), 0)
        });
        let mut engine =
            Self { plan, basis: TransportBasis::new(layout.clone(), REPLICATES), focus: None, seed, stored };
        if let Some((path, samples)) = &mut engine.stored
            && path.exists()
        {
            match TransportBasis::load(path) {
                Ok((basis, _)) if *basis.layout() == layout && basis.n_replicates() == REPLICATES => {
                    *samples = basis.n_samples();
                    engine.basis = basis;
                    reporter.note(&format!(
                        "using {}: {} samples a pixel, nothing to render",
                        path.display(),
                        *samples * REPLICATES as u32
                    ));
                    return Ok(engine);
                }
                Ok(_) => {}
                // It is written anew.
                Err(e) => reporter.note(&format!("{e}; rendering it again")),
            }
        }
        engine.add(options.spp, scene, camera, options, reporter)?;
        Ok(engine)
    }

    /// Stores the basis, if there is a cache and more in it than there was.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn store(
        &self,
        scene: &Scene,
        aovs: &Aovs,
        variables: &ParamVector,
        options: &RunOptions,
    ) -> Result<(), RunError> {
        let Some((path, samples)) = &self.stored else { return Ok(()) };
        if *samples == self.basis.n_samples() {
            return Ok(());
        }
        let about = About::new(scene, &self.plan.fixed, aovs, variables, options.luminance);
        let about = serde_json::to_value(about).map_err(std::io::Error::from).map_err(RunError::About)?;
        self.basis.save(path, &about)?;
        Ok(())
    }

    /// Adds samples: `spp` per pixel over all replicates. An interrupt leaves a whole
    /// basis of fewer samples.
    ///
    /// # Errors
    /// When a render fails, or was interrupted before there were any samples.
    fn add(
        &mut self,
        spp: u32,
        scene: &mut Scene,
        camera: &Camera,
        options: &RunOptions,
        reporter: &impl Reporter,
    ) -> Result<(), RunError> {
        let mut left = spp.div_ceil(REPLICATES as u32).max(1);
        let renders = u64::from(left.div_ceil(UNINTERRUPTED)) * REPLICATES as u64;
        reporter.stage("rendering the transport basis", Some(u64::from(options.work_size.y) * renders));
        self.plan.open(scene, self.focus.as_ref());
        let source =
            Source { scene, integrator: &camera.integrator, sampler: camera.sampler, seed: self.seed };
        while left > 0 {
            if reporter.cancelled() {
                let is_empty = self.basis.n_samples() == 0;
                return if is_empty { Err(RenderError::Cancelled.into()) } else { Ok(()) };
            }
            let count = left.min(UNINTERRUPTED);
            self.basis.render(source, count, &super::Unstoppable(reporter))?;
            left -= count;
        }
        Ok(())
    }

    /// Samples per pixel of all replicates.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.basis.n_samples() * REPLICATES as u32
    }

    /// The picture with every light at radiance 1, its present size, and the
    /// background as it is.
    #[must_use]
    pub fn unit_picture(&self) -> crate::film::Picture {
        let x = &self.plan.fixed;
        self.basis.picture(&LightingPoint { radiance: vec![1.0; x.radiance.len()], ..x.clone() })
    }

    /// An empty basis around what was found.
    fn around(&self, lighting: LightingPoint, round: u32, scene: &Scene, options: &RunOptions) -> Self {
        let weights = self.basis.shares(&lighting).iter().map(|s| FAINT_LIGHT + s.sqrt() as f32).collect();
        let focus = Focus { lighting, weights };
        Self {
            plan: self.plan.clone(),
            basis: TransportBasis::new(self.plan.layout(scene, options, Some(&focus)), REPLICATES),
            focus: Some(focus),
            seed: hash_words(&[self.seed, u64::from(round) + 1]),
            stored: None,
        }
    }

    /// Whether the basis is made for these lights: those that shine have the size in focus.
    fn is_around(&self, x: &LightingPoint) -> bool {
        self.focus.as_ref().is_some_and(|f| {
            let near = |l: usize| {
                self.plan.sizes[l].is_none()
                    || x.radiance[l] == 0.0
                    || (x.size[l] / f.lighting.size[l] - 1.0).abs() <= FOCUS
            };
            (0..x.size.len()).all(near)
        })
    }

    fn evaluator<'a>(
        &'a self,
        basis: &'a TransportBasis,
        objective: &'a Objective,
        variables: &'a ParamVector,
        scene: &Scene,
        options: &RunOptions,
    ) -> Evaluator<'a> {
        Evaluator {
            basis,
            objective,
            variables,
            fixed: &self.plan.fixed,
            luminance: options.luminance,
            exposure: f64::from(scene.exposure),
        }
    }
}

/// Estimates f_q at `u` from the basis.
///
/// # Errors
/// With too few replicates.
pub fn estimate(engine: &Engine, problem: &Problem, u: &[f64]) -> Result<JackknifeEstimate, RunError> {
    let Problem { scene, objective, variables, options, .. } = problem;
    let evaluator = engine.evaluator(&engine.basis, objective, variables, scene, options);
    Ok(evaluator.estimate(u, &mut Scratch::default())?)
}

/// Whether an estimate is as exact as asked for.
fn is_exact(e: &JackknifeEstimate, tolerance: f64) -> bool {
    e.half_width <= tolerance && e.correction.abs() <= 2.0 * tolerance
}

/// Factor on the samples that would make it so.
fn lacking(e: &JackknifeEstimate, tolerance: f64) -> f64 {
    (e.half_width / tolerance).powi(2).max(e.correction.abs() / (2.0 * tolerance))
}

/// Finds the lights: searches, adds samples, checks, refocuses.
///
/// # Errors
/// When a render or the record fails.
pub fn optimise(
    engine: &mut Engine,
    starts: &[(String, Vec<f64>)],
    problem: &mut Problem<'_>,
    dir: &mut RunDir,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Found, RunError> {
    let begin = Instant::now();
    let cancelled = || reporter.cancelled();
    let late = |options: &RunOptions| options.time_limit.is_some_and(|t| begin.elapsed() >= t);
    reporter.stage("searching the basis", None);
    let trials = search_from(engine, starts, problem, &cancelled)?;
    let Some((name, mut best)) = search::best(&trials).map(|(t, p)| (t.name.clone(), p.clone())) else {
        return Err(OptimError::NothingEvaluated.into());
    };
    let mut n_evaluations: u32 =
        trials.iter().filter_map(|t| t.polished.as_ref()).map(|p| p.evaluations.len() as u32).sum();
    dir.log_starts(trials.iter().map(|t| start_line(t, problem.variables)))?;
    log_time(dir, "search", begin)?;
    reporter.note(&format!(
        "searched from {} starts; best from \"{name}\": f_q {:.4} ± {:.4}",
        trials.len(),
        best.estimate.evaluation.f_q,
        best.estimate.error_bar()
    ));

    let tolerance = problem.options.tolerance;
    let first_samples = f64::from(problem.options.spp);
    let mut own: Option<Engine> = None;
    let (mut round, mut additions) = (0, 0);
    let check = loop {
        let now = own.as_ref().unwrap_or(engine);
        let lighting = evaluator_of(now, problem).lighting(&problem.variables.decode(&best.u));
        let may_refocus = round < MAX_REFOCUS && !cancelled() && !late(problem.options);
        let may_add = additions < MAX_ADDITIONS
            && now.samples() < MAX_SAMPLES
            && !cancelled()
            && !late(problem.options);
        let exact = is_exact(&best.estimate, tolerance);
        if exact || !(may_refocus || may_add) {
            let clock = Instant::now();
            let measured = check_at(&best, problem, round, renders, reporter)?;
            log_time(dir, "check", clock)?;
            let (f, checked) = (best.estimate.evaluation.f_q, measured.evaluation.f_q);
            let allowed = best.estimate.error_bar() + measured.error_bar();
            reporter.note(&format!(
                "basis of {} samples: f_q {f:.4} ± {:.4}; check: {checked:.4} ± {:.4}",
                now.samples(),
                best.estimate.error_bar(),
                measured.error_bar()
            ));
            if (f - checked).abs() <= allowed || !may_refocus {
                break measured;
            }
            reporter.note("they disagree: rendering the basis anew around the lights found");
        }
        let clock = Instant::now();
        // Few samples that matter are worth more than many that do not.
        let refocus = may_refocus && (exact || !now.is_around(&lighting) || !may_add);
        if refocus {
            let mut fresh = now.around(lighting, round, problem.scene, problem.options);
            let samples = match now.focus {
                None => (FOCUS_FACTOR * first_samples).ceil() as u32,
                Some(_) => now.samples(),
            };
            round += 1;
            match fresh.add(samples, problem.scene, problem.camera, problem.options, reporter) {
                Err(RunError::Render(RenderError::Cancelled)) => continue,
                other => other?,
            }
            own = Some(fresh);
        } else {
            additions += 1;
            let wanted = f64::from(now.samples()) * lacking(&best.estimate, tolerance).clamp(1.2, 4.0);
            let more = (wanted.ceil() as u32).min(MAX_SAMPLES).saturating_sub(now.samples());
            let engine = own.as_mut().unwrap_or(engine);
            engine.add(more, problem.scene, problem.camera, problem.options, reporter)?;
        }
        log_time(dir, "basis", clock)?;
        let clock = Instant::now();
        let engine = own.as_ref().unwrap_or(engine);
        best = refine(engine, &best, problem, &mut n_evaluations, &cancelled)?;
        log_time(dir, "refine", clock)?;
    };
    let engine = own.as_ref().unwrap_or(engine);
    let clock = Instant::now();
    record(engine, &best, problem, dir)?;
    log_time(dir, "record", clock)?;
    let stop = if cancelled() { StopReason::Interrupted } else { best.stop };
    let clock = Instant::now();
    let reach = on_reduced(engine, problem, |whole, reduced| {
        attainable::reach(reduced.unwrap_or(whole), engine.seed as u32)
    })?;
    log_time(dir, "attainability", clock)?;
    Ok(Found { u: best.u, check, evaluations: n_evaluations, stop, reach })
}

fn log_time(dir: &mut RunDir, stage: &str, since: Instant) -> Result<(), RunError> {
    dir.log_timing(&json!({"stage": stage, "seconds": since.elapsed().as_secs_f64()}))?;
    Ok(())
}

fn evaluator_of<'a>(engine: &'a Engine, problem: &'a Problem) -> Evaluator<'a> {
    engine.evaluator(&engine.basis, problem.objective, problem.variables, problem.scene, problem.options)
}

fn search_from(
    engine: &Engine,
    starts: &[(String, Vec<f64>)],
    problem: &Problem,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Vec<Trial>, RunError> {
    on_reduced(engine, problem, |whole, reduced| {
        search::search(whole, reduced.unwrap_or(whole), starts, engine.seed as u32, cancelled)
    })
}

/// Calls `f` with the problem and, where object and background are large enough
/// for it, with the same problem on a smaller picture.
fn on_reduced<T, E: Into<RunError>>(
    engine: &Engine,
    problem: &Problem,
    f: impl FnOnce(&Evaluator, Option<&Evaluator>) -> Result<T, E>,
) -> Result<T, RunError> {
    let whole = evaluator_of(engine, problem);
    let size = problem.options.work_size / REDUCTION;
    let wide = problem.aovs.width;
    let (side, n) = (REDUCTION as usize, (REDUCTION * REDUCTION) as usize);
    // A small pixel is the object's when most of its pixels are.
    let mask: Vec<bool> = (0..size.element_product() as usize)
        .map(|i| {
            let (x, y) = (i % size.x as usize * side, i / size.x as usize * side);
            let covered = (0..n).filter(|k| problem.aovs.mask[(y + k / side) * wide + x + k % side]).count();
            2 * covered >= n
        })
        .collect();
    let Ok(objective) = Objective::new(problem.target, size.x as usize, size.y as usize, &mask) else {
        return f(&whole, None).map_err(Into::into);
    };
    let basis = engine.basis.reduced(REDUCTION);
    let reduced = engine.evaluator(&basis, &objective, problem.variables, problem.scene, problem.options);
    f(&whole, Some(&reduced)).map_err(Into::into)
}

fn refine(
    engine: &Engine,
    best: &Polished,
    problem: &Problem,
    n_evaluations: &mut u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, RunError> {
    let refined = search::refine(&evaluator_of(engine, problem), &best.u, cancelled)?;
    *n_evaluations += refined.evaluations.len() as u32;
    let evaluations = [best.evaluations.clone(), refined.evaluations.clone()].concat();
    Ok(Polished { evaluations, ..refined })
}

/// Renders what was found with samples that chose nothing, as many as its error needs.
fn check_at(
    best: &Polished,
    problem: &mut Problem,
    round: u32,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<JackknifeEstimate, RunError> {
    let Problem { scene, camera, objective, variables, options, .. } = problem;
    let x = variables.decode(&best.u);
    variables.apply(scene, &x);
    scene.select_shining_lights();
    if let Some(value) = variables.background_value(&x) {
        scene.set_background_value(value as f32, value as f32);
    }
    let seed = hash_words(&[seed_for(options.seed, Purpose::Check), u64::from(round)]);
    let replicates = super::CHECK_REPLICATES;
    let observer = super::Unstoppable(reporter);
    let rows = u64::from(options.work_size.y * replicates);
    let mut shot: Option<Shot> = None;
    let mut spp = options.spp.max(replicates);
    loop {
        reporter.stage("checking the result with new samples", Some(rows));
        let first = shot.as_ref().map_or(0, Shot::samples);
        let next = camera.shoot_from(scene, seed, first, spp, replicates, &observer)?;
        *renders += 1;
        let all = match shot.take() {
            None => next,
            Some(before) => before.joined(&next),
        };
        let measured = all.measure(objective)?.estimate;
        let now = all.samples() * replicates;
        if is_exact(&measured, options.tolerance) || now >= MAX_SAMPLES || reporter.cancelled() {
            return Ok(measured);
        }
        let wanted = f64::from(now) * lacking(&measured, options.tolerance).clamp(1.2, 4.0);
        spp = (wanted.ceil() as u32).min(MAX_SAMPLES) - now;
        shot = Some(all);
    }
}

fn start_line(t: &Trial, variables: &ParamVector) -> serde_json::Value {
    json!({
        "start": t.name,
        "x": variables.named(&variables.decode(&t.start)),
        "screened": t.screened,
        "f_q": t.polished.as_ref().map(|p| p.estimate.evaluation.f_q),
        "f_q_error": t.polished.as_ref().map(|p| p.estimate.error_bar()),
        "found": t.polished.as_ref().map(|p| variables.named(&variables.decode(&p.u))),
        "evaluations": t.polished.as_ref().map(|p| p.evaluations.len()),
        "stop": t.polished.as_ref().map(|p| p.stop.to_string()),
    })
}

/// Writes the evaluations that led to the result, and a picture of each improvement.
fn record(engine: &Engine, best: &Polished, problem: &Problem, dir: &mut RunDir) -> Result<(), RunError> {
    let Problem { scene, variables, options, aovs, target, objective, .. } = problem;
    let evaluator = evaluator_of(engine, problem);
    let estimates: Vec<JackknifeEstimate> = best
        .evaluations
        .par_iter()
        .map_init(Scratch::default, |scratch, (u, _, _)| evaluator.estimate(u, scratch))
        .collect::<Result<_, _>>()?;
    let names: Vec<&str> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    let mut least = f64::INFINITY;
    for (i, ((u, f, slope), e)) in best.evaluations.iter().zip(&estimates).enumerate() {
        let x = variables.decode(u);
        let f_q = e.evaluation.f_q;
        let mut line = json!({
            "evaluation": i + 1,
            "x": variables.named(&x),
            "f_q": f_q,
            "f_q_error": e.error_bar(),
            "f_q_naive": e.naive,
            "f_q_smoothed": f,
            "terms": e.evaluation.terms_json(),
            "gradient_norm": slope,
        });
        dir.log_evaluation(&line)?;
        if f_q < least {
            least = f_q;
            let picture = engine.basis.picture(&evaluator.lighting(&x));
            let exposure = f64::from(scene.exposure);
            let display = options.luminance.encode_image(&picture.rgb, exposure);
            let shown = objective.evaluate(&display);
            let attribute = attribute(scene, options, target, variables, &x, &shown, engine.samples());
            let exr = picture::exr(&picture, aovs, &names, exposure, options.luminance, attribute);
            // Of the picture as it is, noise included: what `evaluate` finds in the file.
            line["f_q_picture"] = shown.f_q.into();
            dir.log_iteration(&line, &exr)?;
        }
    }
    Ok(())
}
