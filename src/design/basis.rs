//! Optimisation on the transport basis: one render, many evaluations.
//!
//! Few samples of a basis for all lightings tell where to look. Around the lights found
//! a basis of its own is rendered, whose knots and samples lie there, and the search goes
//! on in it; samples are added until the error of f_q is small enough. A check render with
//! samples that chose nothing gives the f_q that is reported; while both disagree, the
//! basis is rendered anew.

use std::time::Instant;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{
    Problem, Purpose, Reporter, RunError, Shot,
    attainable::{self, Reach},
    attribute,
    engine::{Engine, REPLICATES},
    evaluator::Evaluator,
    search::{self, Polished, Trial},
    seed_for,
};
use crate::{
    audit::{RunDir, picture},
    film::exr::ExrImage,
    integrator::RenderError,
    math::hash::hash_words,
    objective::{JackknifeEstimate, LABELLINGS},
    optim::{OptimError, StopReason},
    params::ParamVector,
};

/// Times the basis is rendered anew around what was found.
const MAX_REFOCUS: u32 = 4;
/// First samples of each replicate of a basis around what was found; more are added as needed.
const FOCUS_SAMPLES: u32 = 4;
/// Samples of a check, of those of the basis: a render of one lighting is less noisy than a basis
/// of all that lie around it.
const CHECK_SHARE: f64 = 2.0 / 3.0;
/// Times that samples are added for the tolerance.
const MAX_ADDITIONS: u32 = 6;
/// Samples per pixel after which no more are added, of all replicates.
const MAX_SAMPLES: u32 = 4096;

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

/// Whether an estimate is as exact as asked for.
fn is_exact(e: &JackknifeEstimate, tolerance: f64) -> bool {
    e.half_width <= tolerance && e.correction.abs() <= 2.0 * tolerance
}

/// Factor on the samples that would make it so. The variance of scrambled nets falls as the
/// power −3/2 of their number where the integrand has edges \[He15\], and with it the
/// correction of f_q.
fn needed(e: &JackknifeEstimate, tolerance: f64) -> f64 {
    let (error, bias) = (e.half_width / tolerance, e.correction.abs() / (2.0 * tolerance));
    error.powf(4.0 / 3.0).max(bias.powf(2.0 / 3.0))
}

/// Samples to add to `n`: as many as an estimate needs, but not too many on the word of few.
fn more(n: u32, e: &JackknifeEstimate, tolerance: f64) -> u32 {
    let wanted = f64::from(n) * needed(e, tolerance).clamp(1.2, 2.5);
    (wanted.ceil() as u32).min(MAX_SAMPLES).saturating_sub(n)
}

/// What to do next.
enum Step {
    /// Render a basis around the best point, of so many samples.
    Refocus(u32),
    /// Add so many samples to the present one.
    Add(u32),
    /// Search the present basis once more, now that its samples are enough.
    Search,
    /// Check the best point.
    Check,
}

/// How far the search around the best point has come: it looks far with the first samples of a
/// basis and again when there are enough, and after that only goes on downhill.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Search {
    Due,
    Began,
    Done,
}

/// How far an optimisation has come.
struct Progress {
    /// What the present basis is made around.
    focus: Vec<f64>,
    /// Bases rendered around a point.
    round: u32,
    /// Times that samples were added.
    additions: u32,
    search: Search,
}

impl Progress {
    fn next(
        &self,
        now: &Engine,
        best: &Polished,
        problem: &Problem,
        may_go_on: bool,
    ) -> Result<Step, RunError> {
        let least = FOCUS_SAMPLES * REPLICATES as u32;
        let may_refocus = may_go_on && self.round < MAX_REFOCUS;
        let may_add = may_go_on && self.additions < MAX_ADDITIONS && now.samples() < MAX_SAMPLES;
        // Few samples that matter are worth more than many that do not.
        // A basis to be kept gets them itself: other looks will need them elsewhere.
        if may_refocus && !now.is_focused() && !now.is_stored() {
            return Ok(Step::Refocus(least));
        }
        let tolerance = problem.options.tolerance;
        let exact = is_exact(&best.estimate, tolerance);
        if exact || !may_add {
            let is_searched = self.search != Search::Due || !now.is_focused();
            return Ok(match (is_searched, exact || !may_refocus) {
                (false, _) => Step::Search,
                (true, true) => Step::Check,
                (true, false) => Step::Refocus(now.samples()),
            });
        }
        if may_refocus && now.is_focused() {
            // Where the search has gone, a new basis may need fewer samples than this one lacks.
            let at_focus = now.evaluator(problem).estimate(&self.focus, LABELLINGS)?;
            let fresh = needed(&at_focus, tolerance);
            if fresh < needed(&best.estimate, tolerance) - 1.0 {
                let samples = (f64::from(now.samples()) * fresh).ceil() as u32;
                return Ok(Step::Refocus(samples.max(least)));
            }
        }
        Ok(Step::Add(more(now.samples(), &best.estimate, tolerance)))
    }
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
    let options = problem.options;
    let late = || options.time_limit.is_some_and(|t| begin.elapsed() >= t);
    reporter.stage("searching the basis", None);
    let everywhere = search::Within::everywhere(problem.variables.len());
    let trials = on_reduced(engine, problem, |whole, reduced| {
        let mut trials =
            search::search(whole, reduced, starts, &everywhere, engine.seed() as u32, &cancelled)?;
        if options.global {
            let (start, n) = search::global(reduced, &cancelled)?;
            let polished = search::refine(whole, &start, &cancelled)?;
            reporter.note(&global_line(&polished, n, &trials));
            let screened = polished.estimate.evaluation.f_q;
            trials.push(Trial { name: "global".into(), start, screened, polished: Some(polished) });
        }
        Ok(trials)
    })?;
    let Some((name, mut best)) = search::best(&trials).map(|(t, p)| (t.name.clone(), p.clone())) else {
        return Err(OptimError::NothingEvaluated.into());
    };
    let mut n_evaluations = search::evaluations(&trials);
    dir.log_starts(trials.iter().map(|t| start_line(t, problem.variables)))?;
    log_time(dir, "search", begin)?;
    reporter.note(&format!(
        "searched from {} starts; best from \"{name}\": f_q {:.4} ± {:.4}",
        trials.len(),
        best.estimate.evaluation.f_q,
        best.estimate.error_bar()
    ));

    let mut own: Option<Engine> = None;
    let mut progress = Progress { focus: Vec::new(), round: 0, additions: 0, search: Search::Done };
    let check = loop {
        let now = own.as_ref().unwrap_or(engine);
        let may_go_on = !cancelled() && !late();
        let mut step = progress.next(now, &best, problem, may_go_on)?;
        if let Step::Check = step {
            let clock = Instant::now();
            let measured = check_at(&best, now.samples(), problem, progress.round, renders, reporter)?;
            log_time(dir, "check", clock)?;
            let (f, checked) = (best.estimate.evaluation.f_q, measured.evaluation.f_q);
            let allowed = best.estimate.error_bar() + measured.error_bar();
            reporter.note(&format!(
                "basis of {} samples: f_q {f:.4} ± {:.4}; check: {checked:.4} ± {:.4}",
                now.samples(),
                best.estimate.error_bar(),
                measured.error_bar()
            ));
            if (f - checked).abs() <= allowed || !may_go_on || progress.round == MAX_REFOCUS {
                break measured;
            }
            reporter.note("they disagree: rendering the basis anew around the lights found");
            step = Step::Refocus(now.samples());
        }
        let clock = Instant::now();
        match step {
            Step::Refocus(samples) => {
                let lighting = now.lighting(problem.variables, &best.u);
                let mut fresh = now.around(lighting, progress.round, problem.scene, problem.options);
                if !now.is_focused() {
                    progress.search = Search::Due;
                }
                progress.round += 1;
                progress.focus.clone_from(&best.u);
                own = None;
                match fresh.add(samples, problem.scene, problem.camera, problem.options, reporter) {
                    Err(RunError::Render(RenderError::Cancelled)) => continue,
                    other => other?,
                }
                own = Some(fresh);
            }
            Step::Add(samples) => {
                progress.additions += 1;
                let engine = own.as_mut().unwrap_or(engine);
                engine.add(samples, problem.scene, problem.camera, problem.options, reporter)?;
            }
            Step::Search | Step::Check => {}
        }
        if matches!(step, Step::Refocus(_) | Step::Add(_)) {
            log_time(dir, "basis", clock)?;
        }
        let clock = Instant::now();
        let now = own.as_ref().unwrap_or(engine);
        best = match (&step, progress.search) {
            (Step::Search, _) | (Step::Refocus(_), Search::Due) => {
                search_around(now, &best, &trials, problem, &mut n_evaluations, &cancelled)?
            }
            (_, Search::Done) => refine(now, &best, problem, &mut n_evaluations, &cancelled)?,
            _ => Polished { estimate: now.evaluator(problem).estimate(&best.u, LABELLINGS)?, ..best },
        };
        progress.search = match step {
            Step::Search => Search::Done,
            Step::Add(_) if progress.search == Search::Began => Search::Due,
            Step::Refocus(_) if progress.search == Search::Due => Search::Began,
            _ => progress.search,
        };
        log_time(dir, "refine", clock)?;
    };
    let engine = own.as_ref().unwrap_or(engine);
    let clock = Instant::now();
    record(engine, &best, problem, dir)?;
    log_time(dir, "record", clock)?;
    let stop = if cancelled() { StopReason::Interrupted } else { best.stop };
    let clock = Instant::now();
    let reach = on_reduced(engine, problem, |whole, reduced| {
        Ok(attainable::reach(whole, reduced, &best.u, engine.seed() as u32)?)
    })?;
    log_time(dir, "attainability", clock)?;
    Ok(Found { u: best.u, check, evaluations: n_evaluations, stop, reach })
}

fn log_time(dir: &mut RunDir, stage: &str, since: Instant) -> Result<(), RunError> {
    dir.log_timing(&json!({"stage": stage, "seconds": since.elapsed().as_secs_f64()}))?;
    Ok(())
}

/// Calls `f` with the problem on the whole picture and, if possible, on a smaller one.
fn on_reduced<T>(
    engine: &Engine,
    problem: &Problem,
    f: impl FnOnce(&Evaluator, &Evaluator) -> Result<T, RunError>,
) -> Result<T, RunError> {
    let whole = engine.evaluator(problem);
    match engine.reduced(problem) {
        None => f(&whole, &whole),
        Some((basis, objective)) => {
            f(&whole, &Evaluator { basis: &basis, halves: &basis, objective: &objective, ..whole })
        }
    }
}

/// Searches a new basis around the best point, and from the other ends that were found.
fn search_around(
    engine: &Engine,
    best: &Polished,
    trials: &[Trial],
    problem: &Problem,
    n_evaluations: &mut u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, RunError> {
    let ends = trials.iter().filter_map(|t| Some((t.name.clone(), t.polished.as_ref()?.u.clone())));
    let starts: Vec<_> = std::iter::once(("best".to_owned(), best.u.clone())).chain(ends).collect();
    let within = search::Within::around(&best.u);
    let again = on_reduced(engine, problem, |whole, reduced| {
        Ok(search::search(whole, reduced, &starts, &within, engine.seed() as u32, cancelled)?)
    })?;
    *n_evaluations += search::evaluations(&again);
    let Some((_, found)) = search::best(&again) else { return Ok(best.clone()) };
    let evaluations = [best.evaluations.clone(), found.evaluations.clone()].concat();
    Ok(Polished { evaluations, ..found.clone() })
}

fn refine(
    engine: &Engine,
    best: &Polished,
    problem: &Problem,
    n_evaluations: &mut u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, RunError> {
    let refined = search::refine(&engine.evaluator(problem), &best.u, cancelled)?;
    *n_evaluations += refined.evaluations.len() as u32;
    let evaluations = [best.evaluations.clone(), refined.evaluations.clone()].concat();
    Ok(Polished { evaluations, ..refined })
}

/// Renders what was found with samples that chose nothing: a share of the samples that found
/// it, and more if its error needs them.
fn check_at(
    best: &Polished,
    found_with: u32,
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
    let replicates = REPLICATES as u32;
    let mut spp = ((f64::from(found_with) * CHECK_SHARE) as u32).next_multiple_of(replicates);
    let observer = super::Unstoppable(reporter);
    let rows = u64::from(options.work_size.y * replicates);
    let mut shot: Option<Shot> = None;
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
        spp = more(now, &measured, options.tolerance);
        shot = Some(all);
    }
}

/// What a search over the whole box says of the starts.
fn global_line(global: &Polished, evaluations: u32, trials: &[Trial]) -> String {
    let found = global.estimate.evaluation.f_q;
    let best = search::best(trials).map_or(f64::INFINITY, |(_, p)| p.estimate.evaluation.f_q);
    let verdict = if found < best { "better" } else { "no better" };
    format!(
        "{evaluations} evaluations over the whole box: f_q {found:.4} ± {:.4}, {verdict} than {best:.4} from the starts",
        global.estimate.error_bar()
    )
}

fn start_line(t: &Trial, variables: &ParamVector) -> Value {
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
    let evaluator = engine.evaluator(problem);
    let estimates: Vec<JackknifeEstimate> =
        best.evaluations.par_iter().map(|(u, _, _)| evaluator.estimate(u, 1)).collect::<Result<_, _>>()?;
    let names: Vec<&str> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    let lines: Vec<Value> = best
        .evaluations
        .iter()
        .zip(&estimates)
        .enumerate()
        .map(|(i, ((u, f, slope), e))| {
            json!({
                "evaluation": i + 1,
                "x": variables.named(&variables.decode(u)),
                "f_q": e.evaluation.f_q,
                "f_q_error": e.error_bar(),
                "f_q_naive": e.naive,
                "f_q_smoothed": f,
                "terms": e.evaluation.terms_json(),
                "gradient_norm": slope,
            })
        })
        .collect();
    let mut least = f64::INFINITY;
    let mut improvements = Vec::new();
    for (i, (line, e)) in lines.iter().zip(&estimates).enumerate() {
        dir.log_evaluation(line)?;
        if e.evaluation.f_q < least {
            least = e.evaluation.f_q;
            improvements.push(i);
        }
    }
    let iterations: Vec<(Value, ExrImage)> = improvements
        .into_par_iter()
        .map(|i| {
            let x = variables.decode(&best.evaluations[i].0);
            let picture = engine.picture(&evaluator.lighting(&x));
            let exposure = f64::from(scene.exposure);
            let display = options.luminance.encode_image(&picture.rgb, exposure);
            let shown = objective.evaluate(&display);
            let attribute = attribute(scene, options, target, variables, &x, &shown, engine.samples());
            let mut line = lines[i].clone();
            // Of the picture as it is, noise included: what `evaluate` finds in the file.
            line["f_q_picture"] = shown.f_q.into();
            (line, picture::exr(&picture, aovs, &names, exposure, options.luminance, attribute))
        })
        .collect();
    dir.log_iterations(&iterations)?;
    Ok(())
}
