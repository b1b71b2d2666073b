//! The search for the lights of one look: its next step, and its record.

use std::time::Instant;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{
    RunError,
    alternatives::{self, Alternative, Ground, WITHIN},
    attainable,
    evaluator::Evaluator,
    pictures::{attribute, write_found, write_pick},
    precision::{AIMED_SAMPLES, MAX_SAMPLES, MIN_SAMPLES, Precision},
    search::{self, Polished, Trial},
    setup::{Found, Setup, Task},
    working_basis::WorkingBasis,
};
use crate::{
    audit::picture, film::exr::ExrImage, objective::JackknifeEstimate, optim::StopReason,
    variables::ParamVector,
};

/// Upper bound of the times that the basis is rendered anew around the lights found, with twice the samples
/// each: the looks of the fruit basket need none, those of a bowl of glass one or two.
pub const MAX_REFOCUS: u32 = 4;
/// Upper bound of the times that samples are added for the tolerance: by a factor of 2.5 at most each,
/// six lead from 16 samples to [`MAX_SAMPLES`].
const MAX_ADDITIONS: u32 = 6;

/// Next step of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Add this many samples to the first basis, aimed at the best point.
    Aim(u32),
    /// Render a finer basis of this many samples around the best point.
    Refocus(u32),
    /// Add this many samples to the present basis.
    Add(u32),
    /// Search the present basis once more, since it has more samples.
    Search,
    /// Check the best point.
    Check,
}

impl Step {
    /// Step that serves all looks on a basis of `samples` samples: what one of them needs.
    pub fn for_all(steps: &[Self], samples: u32) -> Self {
        let of = |step: &Self| match *step {
            Self::Refocus(n) | Self::Aim(n) => n,
            Self::Add(n) => samples + n,
            Self::Search | Self::Check => 0,
        };
        let most = steps.iter().map(of).max().unwrap_or(0);
        let any = |is: fn(&Self) -> bool| steps.iter().any(is);
        if any(|step| matches!(step, Self::Refocus(_))) {
            Self::Refocus(most)
        } else if any(|step| matches!(step, Self::Aim(_))) {
            Self::Aim(most)
        } else if any(|step| matches!(step, Self::Add(_))) {
            Self::Add(most - samples)
        } else if any(|step| matches!(step, Self::Search)) {
            Self::Search
        } else {
            Self::Check
        }
    }
}

/// Numbers of bases and additions of samples so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spent {
    /// Number of bases rendered around the lights found.
    pub rounds: u32,
    /// Number of times that samples were added.
    pub additions: u32,
}

/// The search for the lights of one look.
pub struct LookSearch<'t, 'a> {
    /// Index of the look among those that are sought together.
    pub index: usize,
    /// The look, its objective and its record.
    pub task: &'t mut Task<'a>,
    /// Starts of the search, and what was found from each.
    pub trials: Vec<Trial>,
    /// Best end found so far.
    pub best: Polished,
    /// Number of evaluations of f_q with its gradient so far.
    pub evaluations: u32,
    /// Number of samples of the present basis when all trials were last searched.
    pub searched: u32,
}

impl LookSearch<'_, '_> {
    /// Logs the seconds of a stage that began at `since`.
    pub fn log_time(&mut self, stage: &str, since: Instant) -> Result<(), RunError> {
        self.task.dir.log_timing(&json!({"stage": stage, "seconds": since.elapsed().as_secs_f64()}))?;
        Ok(())
    }

    /// Whether the basis has more than a third more samples than when all trials were last searched: fewer
    /// hardly move f_q.
    fn is_due(&self, now: &WorkingBasis) -> bool {
        3 * now.samples() > 4 * self.searched
    }

    /// Next step that this look needs.
    pub fn next_step(&self, now: &WorkingBasis, spent: Spent, setup: Setup, may_go_on: bool) -> Step {
        let may_refocus = may_go_on && spent.rounds < MAX_REFOCUS;
        let may_add = may_go_on && spent.additions < MAX_ADDITIONS && now.samples() < MAX_SAMPLES;
        let precision = Precision::choosing(setup.options.tolerance);
        let missing = MIN_SAMPLES.saturating_sub(now.samples());
        let exact = missing == 0 && precision.is_met(&self.best.estimate);
        if may_go_on && now.may_aim() {
            Step::Aim(AIMED_SAMPLES)
        } else if !exact && may_add {
            Step::Add(precision.more(now.samples(), &self.best.estimate).max(missing))
        } else if self.is_due(now) {
            Step::Search
        } else if exact || !may_refocus {
            Step::Check
        } else {
            Step::Refocus(now.samples())
        }
    }

    /// Continues the search in the basis after a step.
    pub fn advance(
        &mut self,
        step: Step,
        now: &WorkingBasis,
        setup: Setup,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<(), RunError> {
        let whole = now.evaluator(setup, &self.task.objective);
        match (step, self.is_due(now)) {
            (Step::Check, _) | (Step::Search, false) => {}
            (_, true) => {
                self.evaluations += search::polish(&whole, &mut self.trials, &search::THOROUGH, cancelled)?;
                self.searched = now.samples();
            }
            (_, false) => {
                let refined = search::refine(&whole, &self.best.u, cancelled)?;
                self.evaluations += refined.evaluations.len() as u32;
                search::extend_best(&mut self.trials, &refined);
            }
        }
        self.best = search::best(&self.trials)?.1.clone();
        Ok(())
    }

    /// Writes the best lights so far, with their picture from the basis.
    pub fn write(&self, now: &WorkingBasis, setup: Setup) -> Result<(), RunError> {
        let u = &self.best.u;
        write_found(self.task, u, Some(&now.shown(&setup.lighting(u), setup.features)), setup)
    }

    /// Writes the record and finds the range of each term; `cut_short` is the reason if the search was ended
    /// before it was done.
    pub fn finish(
        mut self,
        check: JackknifeEstimate,
        now: &WorkingBasis,
        setup: Setup,
        cut_short: Option<StopReason>,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<(usize, Found), RunError> {
        let clock = Instant::now();
        record(now, &self.best, setup, self.task)?;
        self.log_time("record", clock)?;
        let clock = Instant::now();
        let [whole, reduced] = evaluators(now, setup, self.task);
        let reach = match cut_short {
            // Whoever interrupts does not wait for it.
            Some(StopReason::Interrupted) => Vec::new(),
            _ => attainable::reach(&whole, &reduced, &self.best.u, now.seed() as u32)?,
        };
        self.log_time("attainability", clock)?;
        let alternatives = match cut_short {
            None if setup.options.alternatives => self.alternatives(now, setup, cancelled)?,
            _ => Vec::new(),
        };
        let Self { best: Polished { u, stop, .. }, evaluations, index, .. } = self;
        Ok((index, Found { u, check, evaluations, stop: cut_short.unwrap_or(stop), reach, alternatives }))
    }

    /// Finds lightings to choose from, and writes each with its small picture; none when it is cancelled on the way.
    fn alternatives(
        &mut self,
        now: &WorkingBasis,
        setup: Setup,
        cancelled: &(impl Fn() -> bool + Sync),
    ) -> Result<Vec<Alternative>, RunError> {
        let clock = Instant::now();
        let [whole, reduced] = evaluators(now, setup, self.task);
        let best = (self.best.u.as_slice(), self.best.estimate.evaluation.f_q);
        let found = Ground { whole: &whole, reduced: &reduced }.find(&self.trials, best, cancelled)?;
        let limit = best.1 + WITHIN;
        let found = alternatives::measured(found, limit, &self.task.objective, setup, cancelled)?;
        for (i, (alternative, shown)) in found.iter().enumerate() {
            write_pick(self.task, i + 2, &alternative.u, shown, setup)?;
        }
        self.log_time("alternatives", clock)?;
        Ok(found.into_iter().map(|(alternative, _)| alternative).collect())
    }
}

/// Evaluators of f_q on the whole picture and on the reduced one; twice the same where there is no reduced
/// one.
pub fn evaluators<'e>(now: &'e WorkingBasis, setup: Setup<'e>, task: &'e Task) -> [Evaluator<'e>; 2] {
    let whole = now.evaluator(setup, &task.objective);
    let reduced = task.reduced.as_ref().map_or(whole, |objective| now.reduced(setup, objective));
    [whole, reduced]
}

/// Line of the record about a start and its end.
pub fn start_line(t: &Trial, variables: &ParamVector) -> Value {
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

/// Records the evaluations that led to the result, with a picture of each that improved on the best.
fn record(basis: &WorkingBasis, best: &Polished, setup: Setup, task: &mut Task) -> Result<(), RunError> {
    let (variables, options) = (setup.variables, setup.options);
    let Task { job, objective, dir, .. } = task;
    let target = &job.target;
    let evaluator = basis.evaluator(setup, objective);
    let points: Vec<&[f64]> = best.evaluations.iter().map(|(u, _, _)| u.as_slice()).collect();
    let estimates = evaluator.estimates(&points, 1)?;
    let names = setup.scene.light_names();
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
            let u = &best.evaluations[i].0;
            let lighting = setup.lighting(u);
            let picture = basis.picture(&lighting);
            let exposure = lighting.exposure;
            let display = options.measure.encode_image(&picture.rgb, exposure);
            let shown = objective.evaluate(&display);
            let attribute = attribute(setup, target, u, &shown, basis.samples());
            let mut line = lines[i].clone();
            // f_q of the picture, noise included: what `evaluate` finds in the file.
            line["f_q_picture"] = shown.f_q.into();
            (line, picture::exr(&picture, setup.aovs, &names, exposure, options.measure, attribute))
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
        let next = |steps: &[Step]| Step::for_all(steps, 16);
        assert_eq!(next(&[Step::Check, Step::Check]), Step::Check);
        assert_eq!(next(&[Step::Check, Step::Search]), Step::Search);
        assert_eq!(next(&[Step::Search, Step::Add(4), Step::Add(12)]), Step::Add(12));
        assert_eq!(next(&[Step::Refocus(16), Step::Check]), Step::Refocus(16));
        assert_eq!(next(&[Step::Refocus(16), Step::Add(8)]), Step::Refocus(24), "as many as it would have");
        assert_eq!(next(&[Step::Aim(24), Step::Check]), Step::Aim(24));
    }
}
