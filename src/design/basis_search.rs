//! Optimisation on the transport basis: one render, many evaluations.
//!
//! A search in a first basis of few samples tells where to look. The next samples are aimed at the
//! lights found, and more are added until the error of f_q is small enough. A check render with samples
//! that chose nothing gives the f_q that is reported; where it disagrees with the basis, a finer one is
//! rendered around the lights found and the search goes on in that. Several looks share all renders.

use std::time::Instant;

use rayon::prelude::*;

use super::{
    Reporter, RunError, check,
    look::{LookSearch, MAX_REFOCUS, Spent, Step, evaluators, start_line},
    precision::{MIN_SAMPLES, Precision},
    search::{self, Polished, Trial},
    seeds::{Purpose, seed_for},
    setup::{Found, Setup, Task},
    working_basis::{Focus, REPLICATES, WorkingBasis},
};
use crate::{
    integrator::RenderError,
    math::hash::hash_words,
    objective::JackknifeEstimate,
    optim::{OptimError, StopReason},
};

/// Samples with which a check begins, over those of the basis: a render of one lighting is less noisy than
/// a basis of all around it, and more samples follow if its error needs them. There are at least
/// [`MIN_SAMPLES`], and a power of two in each replicate, after which Sobol's sequence has the least
/// noise.
const CHECK_SHARE: f64 = 0.5;
/// Range of the factor on a look's samples by which it gets its part of common samples: errors estimated
/// from few samples must not leave another look without any. Set by reasoning.
const NEED_RANGE: [f64; 2] = [0.1, 10.0];
/// Power of the factor on each look's samples by which the samples of a basis are divided among looks: with
/// 1/2 the sum of the factors that are then left is least.
const BASIS_SHARE_POWER: f64 = 0.5;
/// Power of that factor by which the samples of a check are divided: with 1 the largest of the factors that
/// are then left is least, and a check lasts until the last look is precise.
const CHECK_SHARE_POWER: f64 = 1.0;

/// Finds the lights of several looks: searches, adds samples, checks, and renders finer bases.
///
/// # Errors
/// When a render or the record fails.
pub fn optimise(
    basis: &mut WorkingBasis,
    tasks: &mut [Task<'_>],
    setup: Setup,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<Found>, RunError> {
    reporter.stage("searching the basis", None);
    basis.release();
    let open = begin_searches(basis, tasks, setup, reporter)?;
    let found = open.iter().map(|_| None).collect();
    let spent = Spent::default();
    let mut search =
        BasisSearch { setup, reporter, basis, focused: None, open, found, spent, disagree: false, renders };
    while !search.open.is_empty() {
        let may_go_on = !setup.search_is_over(reporter);
        match search.next_step(may_go_on) {
            Step::Check => search.check(may_go_on)?,
            step => search.take(step)?,
        }
    }
    Ok(search.found.into_iter().flatten().collect())
}

/// The search for the lights of several looks on common bases.
struct BasisSearch<'b, 't, 'a, R> {
    setup: Setup<'b>,
    reporter: &'b R,
    /// Basis of all lightings.
    basis: &'b mut WorkingBasis,
    /// Finer basis around the lights found; `None` until one is needed.
    focused: Option<WorkingBasis>,
    /// Looks whose lights are still sought.
    open: Vec<LookSearch<'t, 'a>>,
    /// Result for each look; `None` while its lights are sought.
    found: Vec<Option<Found>>,
    /// Numbers of bases and additions of samples so far.
    spent: Spent,
    /// Whether the last check disagreed with the basis for some look.
    disagree: bool,
    /// Number of renders of the run so far.
    renders: &'b mut u64,
}

impl<R: Reporter> BasisSearch<'_, '_, '_, R> {
    /// Basis in which the search goes on.
    fn now(&self) -> &WorkingBasis {
        self.focused.as_ref().unwrap_or(self.basis)
    }

    /// Next step that all looks need.
    fn next_step(&mut self, may_go_on: bool) -> Step {
        if std::mem::take(&mut self.disagree) {
            // With as many samples noise would choose again.
            return Step::Refocus(2 * self.now().samples());
        }
        let now = self.now();
        let steps = self.open.iter().map(|look| look.next_step(now, self.spent, self.setup, may_go_on));
        Step::for_all(&steps.collect::<Vec<_>>(), now.samples())
    }

    /// Takes a step other than a check, and continues the search for every look.
    fn take(&mut self, step: Step) -> Result<(), RunError> {
        let (setup, reporter) = (self.setup, self.reporter);
        let clock = Instant::now();
        match step {
            Step::Refocus(samples) => {
                let foci = foci(&self.open, self.now(), setup, BASIS_SHARE_POWER);
                let mut fresh = self.now().around(foci, self.spent.rounds, &setup);
                self.open.iter_mut().for_each(|look| look.searched = 0);
                self.spent.rounds += 1;
                self.focused = None;
                match fresh.add(samples, &setup, reporter) {
                    Err(RunError::Render(RenderError::Cancelled)) => return Ok(()),
                    other => other?,
                }
                self.focused = Some(fresh);
            }
            Step::Aim(samples) => {
                let foci = foci(&self.open, self.now(), setup, BASIS_SHARE_POWER);
                self.basis.aim_at(foci);
                self.basis.add(samples, &setup, reporter)?;
            }
            Step::Add(samples) => {
                self.spent.additions += 1;
                self.focused.as_mut().unwrap_or(self.basis).add(samples, &setup, reporter)?;
            }
            Step::Search | Step::Check => {}
        }
        if !matches!(step, Step::Search) {
            self.open.iter_mut().try_for_each(|look| look.log_time("basis", clock))?;
        }
        let clock = Instant::now();
        let now = self.focused.as_ref().unwrap_or(self.basis);
        let cancelled = || setup.search_is_over(reporter);
        self.open.par_iter_mut().try_for_each(|look| look.advance(step, now, setup, &cancelled))?;
        self.open.iter().try_for_each(|look| look.write(now, setup))?;
        self.open.iter_mut().try_for_each(|look| look.log_time("refine", clock))
    }

    /// Checks the lights of every look with new samples. Looks for which basis and check agree, or nothing
    /// more may be done, are finished.
    fn check(&mut self, may_go_on: bool) -> Result<(), RunError> {
        let (setup, reporter) = (self.setup, self.reporter);
        let clock = Instant::now();
        let open = std::mem::take(&mut self.open);
        let now = self.focused.as_ref().unwrap_or(self.basis);
        let checks = match reporter.cancelled() {
            // Whoever interrupts does not wait for a render: what the basis expects is reported.
            true => open.iter().map(|look| look.best.estimate.clone()).collect(),
            false => check_all(&open, now, setup, self.spent.rounds, self.renders, reporter)?,
        };
        let mut agreed = Vec::new();
        for (mut look, measured) in open.into_iter().zip(checks) {
            look.log_time("check", clock)?;
            let expected = &look.best.estimate;
            let (f, checked) = (expected.evaluation.f_q, measured.evaluation.f_q);
            reporter.note(&format!(
                "{}: basis of {} samples: f_q {f:.4} ± {:.4}; check: {checked:.4} ± {:.4}",
                look.task.job.target.name(),
                now.samples(),
                expected.error_bar(),
                measured.error_bar()
            ));
            let allowed = expected.error_bound() + measured.error_bound();
            if (f - checked).abs() <= allowed || !may_go_on || self.spent.rounds == MAX_REFOCUS {
                agreed.push((look, measured));
            } else {
                self.open.push(look);
            }
        }
        let cut_short = match reporter.cancelled() {
            true => Some(StopReason::Interrupted),
            false => (!may_go_on).then_some(StopReason::TimeLimit),
        };
        if !agreed.is_empty() && setup.options.alternatives {
            reporter.stage("recording the search, and seeking lightings to choose from", None);
        }
        let cancelled = || setup.search_is_over(reporter);
        let finished = agreed
            .into_par_iter()
            .map(|(look, measured)| look.finish(measured, now, setup, cut_short, &cancelled))
            .collect::<Result<Vec<_>, _>>()?;
        finished.into_iter().for_each(|(index, f)| self.found[index] = Some(f));
        self.disagree = !self.open.is_empty();
        if self.disagree {
            reporter.note("they disagree: rendering the basis anew around the lights found");
        }
        Ok(())
    }
}

/// Searches the first basis for the lights of every look.
fn begin_searches<'t, 'a>(
    basis: &WorkingBasis,
    tasks: &'t mut [Task<'a>],
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Vec<LookSearch<'t, 'a>>, RunError> {
    let clock = Instant::now();
    let cancelled = || setup.search_is_over(reporter);
    let seed = basis.seed() as u32;
    let found = tasks
        .par_iter()
        .map(|task| {
            let [whole, reduced] = evaluators(basis, setup, task);
            let (mut trials, mut evaluations) =
                search::search(&whole, &reduced, &task.starts, seed, &cancelled)?;
            let mut line = None;
            let global = setup.options.global.then(|| search::global(&reduced, &cancelled));
            if let Some(Err(OptimError::NothingEvaluated)) = global {
                line = Some("no time was left to search the whole box".to_owned());
            } else if let Some(global) = global {
                let (start, n) = global?;
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
    let mut looks = Vec::new();
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
        task.dir.log_starts(trials.iter().map(|t| start_line(t, setup.variables)))?;
        let mut look = LookSearch { index, task, best: best.clone(), evaluations, trials, searched: 0 };
        // What is found so far, whatever may come.
        look.write(basis, setup)?;
        look.log_time("search", clock)?;
        looks.push(look);
    }
    Ok(looks)
}

/// Focus on the lights of every look, with a part of the samples as a `power` of the factor that it needs.
fn foci(looks: &[LookSearch], now: &WorkingBasis, setup: Setup, power: f64) -> Vec<Focus> {
    let [least, most] = NEED_RANGE;
    let focus = |look: &LookSearch| {
        let precision = Precision::reported(setup.options.tolerance);
        let share = precision.sample_factor(&look.best.estimate).clamp(least, most).powf(power);
        now.focus(setup.lighting(&look.best.u), share)
    };
    looks.par_iter().map(focus).collect()
}

/// Measures f_q of the lights of all looks with samples that chose nothing.
fn check_all(
    looks: &[LookSearch],
    now: &WorkingBasis,
    setup: Setup,
    round: u32,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<JackknifeEstimate>, RunError> {
    let objectives: Vec<_> = looks.iter().map(|look| &look.task.objective).collect();
    let foci = foci(looks, now, setup, CHECK_SHARE_POWER);
    let seed = hash_words(&[seed_for(setup.options.seed, Purpose::Check), u64::from(round)]);
    let wanted = ((f64::from(now.samples()) * CHECK_SHARE) as u32).max(MIN_SAMPLES);
    let spp = wanted.div_ceil(REPLICATES as u32).next_power_of_two() * REPLICATES as u32;
    let checks = check::check(&foci, &objectives, setup, seed, spp, reporter)?;
    *renders += checks.renders;
    Ok(checks.estimates)
}

/// Verdict of a search over the whole box on the starts, in words.
fn global_line(global: &Polished, evaluations: u32, best: &Polished) -> String {
    let [found, best] = [global, best].map(|p| p.estimate.evaluation.f_q);
    let verdict = if found < best { "better" } else { "no better" };
    format!(
        "{evaluations} evaluations over the whole box: f_q {found:.4} ± {:.4}, {verdict} than {best:.4} from the starts",
        global.estimate.error_bar()
    )
}
