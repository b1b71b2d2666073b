//! Optimisation on the transport basis: one render, many evaluations.
//!
//! Few samples of a basis for all lightings tell where to look. Around the lights found
//! a basis of its own is rendered, whose knots and samples lie there, and the search goes
//! on in it; samples are added until the error of f_q is small enough. A check render with
//! samples that chose nothing gives the f_q that is reported; while both disagree, the
//! basis is rendered anew. Several looks share all renders.

use std::time::Instant;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{
    Purpose, Reporter, RunError, Setting, Task,
    attainable::{self, Reach},
    attribute, check,
    engine::{Aim, Engine, REPLICATES},
    evaluator::Evaluator,
    precision::{MAX_SAMPLES, is_exact, more, needed},
    search::{self, Polished, Trial},
    seed_for,
};
use crate::{
    audit::picture,
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
const CHECK_SHARE: f64 = 0.5;
/// Times that samples are added for the tolerance.
const MAX_ADDITIONS: u32 = 6;

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

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
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

impl Step {
    /// What serves all looks on a basis of `samples`: what one needs, the others take along.
    fn for_all(wishes: &[Self], samples: u32) -> Self {
        let of = |wish: &Self| match *wish {
            Self::Refocus(n) => n,
            Self::Add(n) => samples + n,
            Self::Search | Self::Check => 0,
        };
        let most = wishes.iter().map(of).max().unwrap_or(0);
        let any = |is: fn(&Self) -> bool| wishes.iter().any(is);
        if any(|w| matches!(w, Self::Refocus(_))) {
            Self::Refocus(most)
        } else if any(|w| matches!(w, Self::Add(_))) {
            Self::Add(most - samples)
        } else if any(|w| matches!(w, Self::Search)) {
            Self::Search
        } else {
            Self::Check
        }
    }
}

/// How far the search around the best point has come: it looks far with the first samples of a
/// basis and again when there are enough, and after that only goes on downhill.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Search {
    Due,
    Began,
    Done,
}

/// What the bases have cost so far.
#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    /// Bases rendered around a point.
    rounds: u32,
    /// Times that samples were added.
    additions: u32,
}

/// A look on its way.
struct Quest<'t, 'a> {
    /// Its place among those that are sought together.
    index: usize,
    task: &'t mut Task<'a>,
    /// The search of the first basis.
    trials: Vec<Trial>,
    best: Polished,
    evaluations: u32,
    /// What the present basis is made around.
    focus: Vec<f64>,
    search: Search,
}

impl Quest<'_, '_> {
    /// Evaluators of the whole picture and, if possible, of a smaller one.
    fn evaluators<'e>(&'e self, now: &'e Engine, setting: &'e Setting) -> [Evaluator<'e>; 2] {
        evaluators(now, setting, self.task)
    }

    fn log_time(&mut self, stage: &str, since: Instant) -> Result<(), RunError> {
        self.task.dir.log_timing(&json!({"stage": stage, "seconds": since.elapsed().as_secs_f64()}))?;
        Ok(())
    }

    /// What this look needs next.
    fn wish(&self, now: &Engine, spent: Spent, setting: &Setting, may_go_on: bool) -> Result<Step, RunError> {
        let least = FOCUS_SAMPLES * REPLICATES as u32;
        let may_refocus = may_go_on && spent.rounds < MAX_REFOCUS;
        let may_add = may_go_on && spent.additions < MAX_ADDITIONS && now.samples() < MAX_SAMPLES;
        let tolerance = setting.options.tolerance;
        // Few samples that matter are worth more than many that do not.
        // A basis to be kept gets them itself: other looks will need them elsewhere.
        if may_refocus && !now.is_focused() && !now.is_stored() {
            // A basis of its own has less noise: what this one would need is enough.
            let enough = f64::from(now.samples()) * needed(&self.best.estimate, tolerance);
            return Ok(Step::Refocus((enough as u32).clamp(least, 2 * least)));
        }
        let exact = is_exact(&self.best.estimate, tolerance);
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
            let [whole, _] = self.evaluators(now, setting);
            let fresh = needed(&whole.estimate(&self.focus, LABELLINGS)?, tolerance);
            if fresh < needed(&self.best.estimate, tolerance) - 1.0 {
                let samples = (f64::from(now.samples()) * fresh).ceil() as u32;
                return Ok(Step::Refocus(samples.max(least)));
            }
        }
        Ok(Step::Add(more(now.samples(), &self.best.estimate, tolerance)))
    }

    /// Goes on after a step.
    fn advance(
        &mut self,
        step: Step,
        now: &Engine,
        setting: &Setting,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<(), RunError> {
        let seed = now.seed() as u32;
        let evaluators = self.evaluators(now, setting);
        let whole = evaluators[0];
        let (best, evaluations) = match (step, self.search) {
            (Step::Search | Step::Refocus(_), Search::Due) => {
                self.search_around(evaluators, seed, cancelled)?
            }
            (Step::Search | Step::Check, _) => return Ok(()),
            (_, Search::Done) => {
                let refined = search::refine(&whole, &self.best.u, cancelled)?;
                let n = refined.evaluations.len() as u32;
                (self.best.followed_by(&refined), n)
            }
            _ => {
                let estimate = whole.estimate(&self.best.u, LABELLINGS)?;
                (Polished { estimate, ..self.best.clone() }, 0)
            }
        };
        self.best = best;
        self.evaluations += evaluations;
        self.search = match (step, self.search) {
            (Step::Search, _) => Search::Done,
            (Step::Add(_), Search::Began) => Search::Due,
            (Step::Refocus(_), Search::Due) => Search::Began,
            (_, same) => same,
        };
        Ok(())
    }

    /// Searches a new basis around the best point, and from the other ends that were found.
    fn search_around(
        &self,
        [whole, reduced]: [Evaluator; 2],
        seed: u32,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<(Polished, u32), RunError> {
        let ends = self.trials.iter().filter_map(|t| Some((t.name.clone(), t.polished.as_ref()?.u.clone())));
        let starts: Vec<_> = std::iter::once(("best".to_owned(), self.best.u.clone())).chain(ends).collect();
        let within = search::Within::around(&self.best.u);
        let again = search::search(&whole, &reduced, &starts, &within, seed, cancelled)?;
        let found = search::best(&again).map_or_else(|| self.best.clone(), |(_, p)| self.best.followed_by(p));
        Ok((found, search::evaluations(&again)))
    }

    /// Writes the record, and tells what the lights can reach.
    fn finish(
        mut self,
        check: JackknifeEstimate,
        now: &Engine,
        setting: &Setting,
        is_interrupted: bool,
    ) -> Result<(usize, Found), RunError> {
        let clock = Instant::now();
        record(now, &self.best, setting, self.task)?;
        self.log_time("record", clock)?;
        let clock = Instant::now();
        let [whole, reduced] = self.evaluators(now, setting);
        let reach = attainable::reach(&whole, &reduced, &self.best.u, now.seed() as u32)?;
        self.log_time("attainability", clock)?;
        let Self { best: Polished { u, stop, .. }, evaluations, index, .. } = self;
        let stop = if is_interrupted { StopReason::Interrupted } else { stop };
        Ok((index, Found { u, check, evaluations, stop, reach }))
    }
}

/// Evaluators of a task's whole picture and, if possible, of a smaller one.
fn evaluators<'e>(now: &'e Engine, setting: &'e Setting, task: &'e Task) -> [Evaluator<'e>; 2] {
    let whole = now.evaluator(setting, &task.objective);
    let reduced = task.reduced.as_ref().map_or(whole, |objective| now.reduced(setting, objective));
    [whole, reduced]
}

/// Finds the lights of several looks: searches, adds samples, checks, refocuses.
///
/// # Errors
/// When a render or the record fails.
pub fn optimise(
    engine: &mut Engine,
    tasks: &mut [Task<'_>],
    setting: &mut Setting<'_>,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<Found>, RunError> {
    let begin = Instant::now();
    let cancelled = || reporter.cancelled();
    let options = setting.options;
    let late = || options.time_limit.is_some_and(|t| begin.elapsed() >= t);
    reporter.stage("searching the basis", None);
    let mut open = begin_quests(engine, tasks, setting, reporter)?;
    let mut found: Vec<Option<Found>> = open.iter().map(|_| None).collect();

    let mut own: Option<Engine> = None;
    let mut spent = Spent::default();
    let mut disagree = false;
    while !open.is_empty() {
        let now = own.as_ref().unwrap_or(engine);
        let may_go_on = !cancelled() && !late();
        let wishes = open
            .par_iter()
            .map(|quest| quest.wish(now, spent, setting, may_go_on))
            .collect::<Result<Vec<_>, _>>()?;
        let step = match disagree {
            true => Step::Refocus(now.samples()),
            false => Step::for_all(&wishes, now.samples()),
        };
        disagree = false;
        let clock = Instant::now();
        match step {
            Step::Check => {
                let checks = check_all(&open, now, setting, spent.rounds, renders, reporter)?;
                let mut agreed = Vec::new();
                for (mut quest, measured) in std::mem::take(&mut open).into_iter().zip(checks) {
                    quest.log_time("check", clock)?;
                    let expected = &quest.best.estimate;
                    let (f, checked) = (expected.evaluation.f_q, measured.evaluation.f_q);
                    reporter.note(&format!(
                        "{}: basis of {} samples: f_q {f:.4} ± {:.4}; check: {checked:.4} ± {:.4}",
                        quest.task.job.target.name(),
                        now.samples(),
                        expected.error_bar(),
                        measured.error_bar()
                    ));
                    let allowed = expected.error_bar() + measured.error_bar();
                    if (f - checked).abs() <= allowed || !may_go_on || spent.rounds == MAX_REFOCUS {
                        agreed.push((quest, measured));
                    } else {
                        open.push(quest);
                    }
                }
                let is_interrupted = cancelled();
                let finished = agreed
                    .into_par_iter()
                    .map(|(quest, measured)| quest.finish(measured, now, setting, is_interrupted))
                    .collect::<Result<Vec<_>, _>>()?;
                finished.into_iter().for_each(|(index, f)| found[index] = Some(f));
                disagree = !open.is_empty();
                if disagree {
                    reporter.note("they disagree: rendering the basis anew around the lights found");
                }
                continue;
            }
            Step::Refocus(samples) => {
                let aims = aims(&open, now, setting);
                let mut fresh = now.around(aims, spent.rounds, setting.scene, options);
                for quest in &mut open {
                    if !now.is_focused() {
                        quest.search = Search::Due;
                    }
                    quest.focus.clone_from(&quest.best.u);
                }
                spent.rounds += 1;
                own = None;
                match fresh.add(samples, setting.scene, setting.camera, options, reporter) {
                    Err(RunError::Render(RenderError::Cancelled)) => continue,
                    other => other?,
                }
                own = Some(fresh);
            }
            Step::Add(samples) => {
                spent.additions += 1;
                let engine = own.as_mut().unwrap_or(engine);
                engine.add(samples, setting.scene, setting.camera, options, reporter)?;
            }
            Step::Search => {}
        }
        if matches!(step, Step::Refocus(_) | Step::Add(_)) {
            open.iter_mut().try_for_each(|quest| quest.log_time("basis", clock))?;
        }
        let clock = Instant::now();
        let now = own.as_ref().unwrap_or(engine);
        let setting = &*setting;
        open.par_iter_mut().try_for_each(|quest| quest.advance(step, now, setting, &cancelled))?;
        open.iter_mut().try_for_each(|quest| quest.log_time("refine", clock))?;
    }
    Ok(found.into_iter().flatten().collect())
}

/// Searches the first basis for every look.
fn begin_quests<'t, 'a>(
    engine: &Engine,
    tasks: &'t mut [Task<'a>],
    setting: &Setting,
    reporter: &impl Reporter,
) -> Result<Vec<Quest<'t, 'a>>, RunError> {
    let clock = Instant::now();
    let cancelled = || reporter.cancelled();
    let everywhere = search::Within::everywhere(setting.variables.len());
    let seed = engine.seed() as u32;
    let found = tasks
        .par_iter()
        .map(|task| {
            let [whole, reduced] = evaluators(engine, setting, task);
            let mut trials = search::search(&whole, &reduced, &task.starts, &everywhere, seed, &cancelled)?;
            let mut line = None;
            if setting.options.global {
                let (start, n) = search::global(&reduced, &cancelled)?;
                let polished = search::refine(&whole, &start, &cancelled)?;
                line = Some(global_line(&polished, n, &trials));
                let screened = polished.estimate.evaluation.f_q;
                trials.push(Trial { name: "global".into(), start, screened, polished: Some(polished) });
            }
            Ok((trials, line))
        })
        .collect::<Result<Vec<_>, RunError>>()?;
    let mut quests = Vec::new();
    for (index, (task, (trials, line))) in tasks.iter_mut().zip(found).enumerate() {
        let look = task.job.target.name();
        line.iter().for_each(|line| reporter.note(&format!("{look}: {line}")));
        let (start, best) = search::best(&trials).ok_or(OptimError::NothingEvaluated)?;
        reporter.note(&format!(
            "{look}: searched from {} starts; best from \"{}\": f_q {:.4} ± {:.4}",
            trials.len(),
            start.name,
            best.estimate.evaluation.f_q,
            best.estimate.error_bar()
        ));
        task.dir.log_starts(trials.iter().map(|t| start_line(t, setting.variables)))?;
        let (best, evaluations) = (best.clone(), search::evaluations(&trials));
        let (focus, search) = (Vec::new(), Search::Done);
        let mut quest = Quest { index, task, best, evaluations, trials, focus, search };
        quest.log_time("search", clock)?;
        quests.push(quest);
    }
    Ok(quests)
}

/// What was found for every look: the more it lacks of the tolerance, the more samples are its.
fn aims(quests: &[Quest], now: &Engine, setting: &Setting) -> Vec<Aim> {
    let aim = |quest: &Quest| {
        let share = needed(&quest.best.estimate, setting.options.tolerance).clamp(0.1, 10.0);
        now.aim(now.lighting(setting.variables, &quest.best.u), share)
    };
    quests.iter().map(aim).collect()
}

/// Renders what was found with samples that chose nothing: a share of those that found it, and
/// more if an error needs them.
fn check_all(
    quests: &[Quest],
    now: &Engine,
    setting: &mut Setting,
    round: u32,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<JackknifeEstimate>, RunError> {
    let objectives: Vec<_> = quests.iter().map(|quest| &quest.task.objective).collect();
    let aims = aims(quests, now, setting);
    let seed = hash_words(&[seed_for(setting.options.seed, Purpose::Check), u64::from(round)]);
    let spp = (f64::from(now.samples()) * CHECK_SHARE) as u32;
    check::check(&aims, &objectives, setting, seed, spp, renders, reporter)
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
fn record(engine: &Engine, best: &Polished, setting: &Setting, task: &mut Task) -> Result<(), RunError> {
    let Setting { scene, variables, options, aovs, .. } = setting;
    let Task { job, objective, dir, .. } = task;
    let target = &job.target;
    let evaluator = engine.evaluator(setting, objective);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_share_the_step_that_serves_all() {
        let next = |wishes: &[Step]| Step::for_all(wishes, 16);
        assert_eq!(next(&[Step::Check, Step::Check]), Step::Check);
        assert_eq!(next(&[Step::Check, Step::Search]), Step::Search);
        assert_eq!(next(&[Step::Search, Step::Add(4), Step::Add(12)]), Step::Add(12));
        assert_eq!(next(&[Step::Refocus(16), Step::Check]), Step::Refocus(16));
        assert_eq!(next(&[Step::Refocus(16), Step::Add(8)]), Step::Refocus(24), "as many as it would have");
    }
}
