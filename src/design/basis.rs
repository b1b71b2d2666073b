//! Optimisation on the transport basis: one render, many evaluations.
//!
//! Few samples of a basis for all lightings tell where to look. Around the lights found
//! a basis of its own is rendered, whose knots and samples lie there, and the search goes
//! on in it; samples are added until the error of f_q is small enough. A check render with
//! samples that chose nothing gives the f_q that is reported; while both disagree, the
//! basis is rendered anew. Several looks share all renders.

use std::time::Instant;

use rayon::prelude::*;

use super::{
    Purpose, Reporter, RunError, Setting, Task, check,
    engine::{Aim, Engine, REPLICATES},
    precision::{LEAST_SAMPLES, Precision},
    quest::{Found, MAX_REFOCUS, Quest, Spent, Step, evaluators, start_line},
    search::{self, Polished, Trial},
    seed_for,
};
use crate::{integrator::RenderError, math::hash::hash_words, objective::JackknifeEstimate};

/// Samples of a check, of those of the basis: a render of one lighting is less noisy than a basis
/// of all that lie around it. They are as many at least as can be trusted, and become a power of
/// two a replicate, after which Sobol's sequence leaves the least noise.
const CHECK_SHARE: f64 = 0.5;

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
    engine.release();
    let mut open = begin_quests(engine, tasks, setting, reporter)?;
    let mut found: Vec<Option<Found>> = open.iter().map(|_| None).collect();

    let mut own: Option<Engine> = None;
    let mut spent = Spent::default();
    let mut disagree = false;
    while !open.is_empty() {
        let now = own.as_ref().unwrap_or(engine);
        let may_go_on = !cancelled() && !late();
        let step = if disagree {
            // As many would let noise choose again.
            Step::Refocus(2 * now.samples())
        } else {
            let wishes = open.iter().map(|quest| quest.wish(now, spent, setting, may_go_on));
            Step::for_all(&wishes.collect::<Vec<_>>(), now.samples())
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
                let aims = aims(&open, now, setting, 0.5);
                let mut fresh = now.around(aims, spent.rounds, setting.scene, options);
                open.iter_mut().for_each(|quest| quest.searched = 0);
                spent.rounds += 1;
                own = None;
                match fresh.add(samples, setting.scene, setting.camera, options, reporter) {
                    Err(RunError::Render(RenderError::Cancelled)) => continue,
                    other => other?,
                }
                own = Some(fresh);
            }
            Step::Aim(samples) => {
                engine.aim_at(aims(&open, now, setting, 0.5));
                engine.add(samples, setting.scene, setting.camera, options, reporter)?;
            }
            Step::Add(samples) => {
                spent.additions += 1;
                let engine = own.as_mut().unwrap_or(engine);
                engine.add(samples, setting.scene, setting.camera, options, reporter)?;
            }
            Step::Search => {}
        }
        if matches!(step, Step::Refocus(_) | Step::Aim(_) | Step::Add(_)) {
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
    let seed = engine.seed() as u32;
    let found = tasks
        .par_iter()
        .map(|task| {
            let [whole, reduced] = evaluators(engine, setting, task);
            let (mut trials, mut evaluations) =
                search::search(&whole, &reduced, &task.starts, seed, &cancelled)?;
            let mut line = None;
            if setting.options.global {
                let (start, n) = search::global(&reduced, &cancelled)?;
                let polished = search::refine(&whole, &start, &cancelled)?;
                evaluations += polished.evaluations.len() as u32;
                let best = search::best(&trials)?.1;
                line = Some(global_line(&polished, n, best));
                let screened = polished.estimate.evaluation.f_q;
                let leads = screened < best.estimate.evaluation.f_q;
                trials.iter_mut().for_each(|trial| trial.leads &= !leads);
                let (name, end) = ("global".into(), None);
                trials.push(Trial { name, start, screened, end, polished: Some(polished), leads });
            }
            Ok((trials, evaluations, line))
        })
        .collect::<Result<Vec<_>, RunError>>()?;
    let mut quests = Vec::new();
    for (index, (task, (trials, evaluations, line))) in tasks.iter_mut().zip(found).enumerate() {
        let look = task.job.target.name();
        line.iter().for_each(|line| reporter.note(&format!("{look}: {line}")));
        let (start, best) = search::best(&trials)?;
        reporter.note(&format!(
            "{look}: searched from {} starts; best from \"{}\": f_q {:.4} ± {:.4}",
            trials.len(),
            start.name,
            best.estimate.evaluation.f_q,
            best.estimate.error_bar()
        ));
        task.dir.log_starts(trials.iter().map(|t| start_line(t, setting.variables)))?;
        let mut quest = Quest { index, task, best: best.clone(), evaluations, trials, searched: 0 };
        quest.log_time("search", clock)?;
        quests.push(quest);
    }
    Ok(quests)
}

/// What was found for every look: the more it lacks of the tolerance, the more samples are its, by a
/// power of that. With 1/2 the sum of what they then lack is the least, with 1 the most that one lacks.
fn aims(quests: &[Quest], now: &Engine, setting: &Setting, power: f64) -> Vec<Aim> {
    let aim = |quest: &Quest| {
        let precision = Precision::reported(setting.options.tolerance);
        let share = precision.needed(&quest.best.estimate).clamp(0.1, 10.0).powf(power);
        now.aim(now.lighting(setting.variables, &quest.best.u), share)
    };
    quests.par_iter().map(aim).collect()
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
    let aims = aims(quests, now, setting, 1.0);
    let seed = hash_words(&[seed_for(setting.options.seed, Purpose::Check), u64::from(round)]);
    let wanted = ((f64::from(now.samples()) * CHECK_SHARE) as u32).max(LEAST_SAMPLES);
    let spp = wanted.div_ceil(REPLICATES as u32).next_power_of_two() * REPLICATES as u32;
    check::check(&aims, &objectives, setting, seed, spp, renders, reporter)
}

/// What a search over the whole box says of the starts.
fn global_line(global: &Polished, evaluations: u32, best: &Polished) -> String {
    let [found, best] = [global, best].map(|p| p.estimate.evaluation.f_q);
    let verdict = if found < best { "better" } else { "no better" };
    format!(
        "{evaluations} evaluations over the whole box: f_q {found:.4} ± {:.4}, {verdict} than {best:.4} from the starts",
        global.estimate.error_bar()
    )
}
