//! Paper mode: a fresh render for each evaluation, forward differences with common random numbers, and
//! NLopt's bounded L-BFGS from one start.

use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};

use serde_json::{Value, json};

use super::{
    Progress, Reporter, RunError,
    deadline::Deadline,
    observer::{InTime, Unstoppable},
    pictures::{attribute, write_found},
    precision::{MAX_SAMPLES, Precision},
    products::picture_key,
    render::{Budget, MeasuredPicture},
    seeds::{Purpose, seed_for},
    setup::{Found, Setup, Stage, Task},
};
use crate::{
    audit::{picture, products::Products},
    film::Picture,
    integrator::RenderError,
    lighting::{Lighting, SamplingPlan},
    objective::{Evaluation, JackknifeEstimate, Smoothing},
    optim::{self, Interrupt, OptimError, StopReason, difference},
};

/// A descent with its smoothing and its limits.
struct Restart {
    /// Smoothing of the residuals.
    delta: f64,
    /// Share of the allowed evaluations; the last descent has all that are left.
    share: f64,
    /// Largest component of the first trial step in the unit cube: NLopt tries x0 − ∇f, and f is scaled to
    /// make that a sane step.
    first_step: f64,
}

/// Descents one after the other, with ten times less smoothing each and smaller first steps, since each
/// begins nearer to a minimum. Later descents bring little: the fruit basket's best point came after about
/// a third of the evaluations.
const RESTARTS: [Restart; 3] = [
    Restart { delta: Smoothing::DELTA_FIRST, share: 0.5, first_step: 0.1 },
    Restart { delta: 5e-3, share: 0.3, first_step: 0.02 },
    Restart { delta: Smoothing::DELTA_LAST, share: 0.2, first_step: 0.005 },
];
/// Change of f_q per iteration below which a descent ends: ten times that of a descent on the basis, since
/// evaluations are dear and noisy. Set by reasoning.
const F_TOLERANCE: f64 = 1e-5;
/// Change of all variables per iteration below which a descent ends, likewise.
const X_TOLERANCE: f64 = 1e-4;
/// Samples per pixel of the first renders, if none are asked for: the fruit basket needs 12 in low-key
/// and 16 in high-key at the default tolerance.
const FIRST_SAMPLES: u32 = 12;
/// Replicates of a working render, from which the error of f_q is estimated; more narrow Student's
/// interval, but make every jackknife dearer.
const REPLICATES: u32 = 4;
/// Function values from which the noise of f_q is estimated: they give six orders of differences, of
/// which three must agree.
const NOISE_POINTS: usize = 7;
/// Spacing of those values in the unit cube: half of the least difference step, so that f_q is smooth over
/// all of them.
const NOISE_SPACING: f64 = 1e-3;

/// Replicates of a render whose f_q is reported: Student's 95 % quantile is 2.4 with 8, 3.2 with 4.
const REPORTED_REPLICATES: u32 = 8;
/// Samples of a render whose f_q is reported, over those of a working render: four times as many halve its
/// error, for two renders of some two hundred.
const REPORTED_FACTOR: u32 = 4;
/// Samples of a working picture whose check fits into the time that an interrupted run has left: those of its
/// check, [`REPORTED_FACTOR`] times as many, take an eighth of a second on two processors.
const INTERRUPTED_SAMPLES: u32 = 1 << 15;
/// Kind of a value of f_q.
const VALUE: &str = "value";
/// Samples per pixel of the survey. Bounds and starts follow from means over the picture, which converge
/// long before its pixels; the survey is one render of some two hundred.
const SURVEY_SPP: u32 = 64;

/// A render of a stage with every light at radiance 1.
pub(super) fn unit_picture(stage: &Stage, reporter: &impl Reporter) -> Result<Picture, RunError> {
    let lighting = stage.fitted.lighting.at_unit_radiance();
    let seed = seed_for(stage.options.seed, Purpose::Survey);
    let budget = Budget { seed, spp: SURVEY_SPP, n_replicates: 1 };
    let plan = stage.plan(&lighting);
    Ok(stage.render_once(&lighting, &plan, budget, reporter, reporter)?.picture)
}

/// f_q at the neutral start, with its error.
pub(super) fn measure_start(
    task: &Task,
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<JackknifeEstimate, RunError> {
    let spp = setup.options.spp.unwrap_or(FIRST_SAMPLES);
    let what = (Purpose::Initial, "measuring the start");
    measure(task, setup, &setup.variables.start(), spp, what, reporter)
}

/// Measures f_q at the point `u` by a render of its own, which `spp` samples of a working render
/// correspond to.
fn measure(
    task: &Task,
    setup: Setup,
    u: &[f64],
    spp: u32,
    (purpose, stage): (Purpose, &str),
    reporter: &impl Reporter,
) -> Result<JackknifeEstimate, RunError> {
    reporter.stage(stage, Some(u64::from(setup.options.work_size.y * REPORTED_REPLICATES)));
    let lighting = setup.lighting(u);
    let seed = seed_for(setup.options.seed, purpose);
    let budget = Budget { seed, spp: REPORTED_FACTOR * spp, n_replicates: REPORTED_REPLICATES };
    let (plan, observer) = (setup.plan(&lighting), Unstoppable(reporter));
    let rendered = setup.render_once(&lighting, &plan, budget, reporter, &observer)?;
    Ok(rendered.measure(&task.objective)?.estimate)
}

/// Finds the lights of a look from the best of its starts, and checks them.
pub(super) fn find(
    task: &mut Task,
    setup: Setup,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Found, RunError> {
    reporter.stage("optimising", None);
    let spp = setup.options.spp.unwrap_or(FIRST_SAMPLES);
    let (step, evaluations, iterations, best) = (0.0, 0, 0, None);
    let mut search =
        DifferenceSearch { setup, task, renders, reporter, spp, step, evaluations, iterations, best };
    let (u, stop) = search.descend()?;
    if search.best.is_none() {
        write_found(search.task, &u, None, setup)?;
    }
    let (evaluations, spp) = (search.evaluations, search.spp);
    *renders += 2;
    let check = check(task, setup, &u, (spp, stop), renders, reporter)?;
    Ok(Found { u, check, evaluations, stop, reach: Vec::new(), alternatives: Vec::new() })
}

/// Measures f_q at the point `u` that a search with `spp` samples a pixel found, with new ones, of which there
/// are fewer where it was cut short.
fn check(
    task: &Task,
    setup: Setup,
    u: &[f64],
    (spp, stop): (u32, StopReason),
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<JackknifeEstimate, RunError> {
    let what = (Purpose::Check, "checking the result with new samples");
    let of_spp = |spp| measure(task, setup, u, spp, what, reporter);
    let least = spp.min(INTERRUPTED_SAMPLES / setup.options.work_size.element_product()).max(2);
    let clock = Instant::now();
    match stop {
        StopReason::Interrupted => of_spp(least),
        StopReason::TimeLimit => {
            let check = of_spp(least)?;
            let left = setup.deadline.left_until(Deadline::CHECK).unwrap_or_default();
            let more = that_fit(least, clock.elapsed(), left).min(spp);
            if more <= least {
                return Ok(check);
            }
            *renders += 1;
            of_spp(more)
        }
        _ => of_spp(spp),
    }
}

/// Number of samples that fit into the time left, where `n` took a time.
fn that_fit(n: u32, taken: Duration, left: Duration) -> u32 {
    (f64::from(n) * left.as_secs_f64() / taken.as_secs_f64().max(1e-9)) as u32
}

/// A search by forward differences of fresh renders.
struct DifferenceSearch<'s, 'a, R> {
    setup: Setup<'s>,
    task: &'s mut Task<'a>,
    renders: &'s mut u64,
    reporter: &'s R,
    /// Samples per pixel of a working render.
    spp: u32,
    /// Step of the differences in the unit cube.
    step: f64,
    /// Number of evaluations of f_q with its gradient so far.
    evaluations: u32,
    /// Number of evaluations so far that improved on the best.
    iterations: u32,
    /// Least f_q so far, without smoothing, and its point.
    best: Option<(f64, Vec<f64>)>,
}

/// The result of a render, or `None` if an interrupt or the time limit ended it.
fn unless_cancelled<T>(result: Result<T, RunError>) -> Result<Option<T>, RunError> {
    match result {
        Err(RunError::Render(RenderError::Cancelled)) => Ok(None),
        other => other.map(Some),
    }
}

impl<R: Reporter> DifferenceSearch<'_, '_, R> {
    /// Descends from the best start with less and less smoothing; returns the best point and the reason
    /// why the last descent ended.
    fn descend(&mut self) -> Result<(Vec<f64>, StopReason), RunError> {
        let budget = self.setup.options.max_evaluations;
        let start = self.choose()?;
        let Some(step) = unless_cancelled(self.find_step(&start))? else {
            return Ok((start, self.cut_short()));
        };
        self.step = step;
        let mut u = start.clone();
        let mut stop = StopReason::NoProgress;
        for (i, restart) in RESTARTS.into_iter().enumerate() {
            let left = budget - self.evaluations;
            if left == 0 {
                break;
            }
            if unless_cancelled(self.find_samples(&u))?.is_none() {
                stop = self.cut_short();
                break;
            }
            let share = (f64::from(budget) * restart.share) as u32;
            let allowed = if i + 1 == RESTARTS.len() { left } else { share.clamp(1, left) };
            let Some(outcome) = unless_cancelled(self.descend_once(&u, &restart, allowed))? else {
                stop = self.cut_short();
                break;
            };
            (u, stop) = (outcome.x, outcome.stop);
        }
        let best = self.best.as_ref().map(|(_, u)| u.clone());
        Ok((best.unwrap_or(start), stop))
    }

    /// The reason why a render of the search was cancelled.
    fn cut_short(&self) -> StopReason {
        if self.reporter.cancelled() { StopReason::Interrupted } else { StopReason::TimeLimit }
    }

    /// Observer of the renders of the search.
    fn observer(&self) -> InTime<'_, R> {
        InTime { reporter: self.reporter, deadline: self.setup.deadline }
    }

    /// A descent from `u` of at most `allowed` evaluations.
    fn descend_once(
        &mut self,
        u: &[f64],
        restart: &Restart,
        allowed: u32,
    ) -> Result<optim::Outcome, RunError> {
        let n = u.len();
        let smoothing = Smoothing::with_delta(restart.delta);
        let mut failure = None;
        let options = optim::Options {
            max_evaluations: Some(allowed),
            f_tol_abs: F_TOLERANCE,
            x_tol_abs: X_TOLERANCE,
            first_step: Some(restart.first_step),
            ..Default::default()
        };
        let result = optim::minimize(u, &vec![0.0; n], &vec![1.0; n], &options, |u, gradient| {
            match self.evaluate(u, &smoothing) {
                Ok((f, slopes)) => {
                    gradient.copy_from_slice(&slopes);
                    ControlFlow::Continue(f)
                }
                Err(e) => {
                    failure = Some(e);
                    ControlFlow::Break(Interrupt)
                }
            }
        });
        match failure {
            Some(e) => Err(e),
            None => result.map_err(|e: OptimError| e.into()),
        }
    }

    /// What a working render of the point `u` is made from; counts it.
    fn working(&mut self, u: &[f64]) -> (Lighting, SamplingPlan, Budget) {
        let setup = self.setup;
        let lighting = setup.lighting(u);
        *self.renders += 1;
        let seed = seed_for(setup.options.seed, Purpose::Optimise);
        let budget = Budget { seed, spp: self.spp, n_replicates: REPLICATES };
        let plan = setup.plan(&lighting);
        (lighting, plan, budget)
    }

    /// Working render of the point `u`.
    fn render(&mut self, u: &[f64]) -> Result<MeasuredPicture, RunError> {
        let (lighting, plan, budget) = self.working(u);
        self.setup.render_once(&lighting, &plan, budget, self.reporter, &self.observer())
    }

    /// Smoothed f_q of the working render of the point `u`; of what is only measured so, the number is kept
    /// and not the picture.
    fn value(&mut self, u: &[f64], smoothing: &Smoothing) -> Result<f64, RunError> {
        let (lighting, plan, budget) = self.working(u);
        let (setup, reporter) = (self.setup, self.reporter);
        let words = format!("{smoothing:?} {:?}", self.task.job.target);
        let key = Products::key(&words, &[picture_key(&setup, &lighting, &plan, setup.camera, budget)]);
        let kept = setup.products.load(key, VALUE);
        if let Some(bytes) = kept.and_then(|bytes| bytes.try_into().ok()) {
            return Ok(f64::from_le_bytes(bytes));
        }
        let rendered = setup.renderer().render(setup.view(), &lighting, &plan, budget, &self.observer())?;
        let f = rendered.smoothed(&self.task.objective, smoothing);
        setup.products.save(key, VALUE, |text| reporter.note(text), |out| out.write_all(&f.to_le_bytes()));
        Ok(f)
    }

    /// Start with the least f_q; after an interrupt or the time limit, of those measured.
    fn choose(&mut self) -> Result<Vec<f64>, RunError> {
        let starts = self.task.starts.clone();
        let mut best: Option<(f64, &(String, Vec<f64>))> = None;
        for start in &starts {
            let Some(f_q) = unless_cancelled(self.value(&start.1, &Smoothing::NONE))? else { break };
            self.task.dir.log_evaluation(&json!({
                "start": start.0,
                "x": self.setup.variables.named(&self.setup.variables.decode(&start.1)),
                "f_q": f_q,
                "renders": *self.renders,
            }))?;
            if best.is_none_or(|(least, _)| f_q < least) {
                best = Some((f_q, start));
            }
        }
        let Some((f_q, (name, u))) = best else {
            // Cut short before the first was measured.
            return starts.first().map(|(_, u)| u.clone()).ok_or(OptimError::NoVariables.into());
        };
        self.reporter
            .note(&format!("starting with {name}: f_q {f_q:.4}, the best of {} starts", starts.len()));
        Ok(u.clone())
    }

    /// Sets as many samples as the tolerance needs at the point `u`, unless a number was asked for: f_q is
    /// minimised as the renders have it, noise included.
    fn find_samples(&mut self, u: &[f64]) -> Result<(), RunError> {
        let options = self.setup.options;
        let precision = Precision::differences(options.tolerance);
        while options.spp.is_none() && self.spp < MAX_SAMPLES {
            let estimate = self.render(u)?.measure(&self.task.objective)?.estimate;
            if precision.is_met_uncorrected(&estimate) {
                break;
            }
            self.spp =
                (self.spp + precision.more_uncorrected(self.spp, &estimate)).next_multiple_of(REPLICATES);
            // What was measured with fewer samples does not compare.
            self.best.iter_mut().for_each(|(f_q, _)| *f_q = f64::INFINITY);
        }
        self.reporter.note(&format!("{} samples a pixel for every render", self.spp));
        Ok(())
    }

    /// Step of the differences, from the noise of f_q along the diagonal of the cube at `start`.
    fn find_step(&mut self, start: &[f64]) -> Result<f64, RunError> {
        let smoothing = Smoothing::with_delta(Smoothing::DELTA_FIRST);
        let values = (0..NOISE_POINTS)
            .map(|i| {
                let along = NOISE_SPACING * i as f64;
                let u: Vec<f64> =
                    start.iter().map(|&u| if u < 0.5 { u + along } else { u - along }).collect();
                self.value(&u, &smoothing)
            })
            .collect::<Result<Vec<f64>, RunError>>()?;
        let noise = difference::noise(&values);
        let step = difference::step(noise);
        self.reporter.note(&format!(
            "noise of f_q under common random numbers {noise:.1e}, difference step {step:.4}"
        ));
        Ok(step)
    }

    /// Smoothed f_q at `u` with its gradient; logs the unsmoothed f_q.
    fn evaluate(&mut self, u: &[f64], smoothing: &Smoothing) -> Result<(f64, Vec<f64>), RunError> {
        let clock = Instant::now();
        let rendered = self.render(u)?;
        let measured = rendered.measure(&self.task.objective)?;
        let f = rendered.smoothed(&self.task.objective, smoothing);
        let step = self.step;
        let slopes = difference::gradient(u, f, step, |u| self.value(u, smoothing))?;
        self.evaluations += 1;
        let f_q = measured.plain.f_q;
        let line = json!({
            "evaluation": self.evaluations,
            "x": self.setup.variables.named(&self.setup.variables.decode(u)),
            "f_q": f_q,
            "f_q_error": measured.estimate.error_bar(),
            "f_q_corrected": measured.estimate.evaluation.f_q,
            "terms": measured.plain.terms_json(),
            "gradient_norm": slopes.iter().map(|g| g * g).sum::<f64>().sqrt(),
            "smoothing": smoothing.delta,
            "renders": *self.renders,
        });
        self.task.dir.log_evaluation(&line)?;
        self.task.dir.log_timing(&json!({
            "stage": "evaluation",
            "evaluation": self.evaluations,
            "seconds": clock.elapsed().as_secs_f64(),
        }))?;
        if self.best.as_ref().is_none_or(|(best, _)| f_q < *best) {
            self.record_iteration(u, line, &rendered, &measured.plain)?;
            write_found(self.task, u, Some(&rendered.shown(self.setup.features)), self.setup)?;
            self.best = Some((f_q, u.to_vec()));
        }
        self.reporter.evaluated(&Progress {
            evaluation: self.evaluations,
            max_evaluations: self.setup.options.max_evaluations,
            iterations: self.iterations,
            f_q,
            best: self.best.as_ref().map_or(f_q, |(best, _)| *best),
            renders: *self.renders,
        });
        Ok((f, slopes))
    }

    /// Records an evaluation that improved on the best, with its picture.
    fn record_iteration(
        &mut self,
        u: &[f64],
        line: Value,
        rendered: &MeasuredPicture,
        plain: &Evaluation,
    ) -> Result<(), RunError> {
        let setup = self.setup;
        let attribute = attribute(setup, &self.task.job.target, u, plain, self.spp);
        let (names, exposure) = (setup.scene.light_names(), setup.lighting(u).exposure);
        let measure = setup.options.measure;
        let exr = picture::exr(&rendered.picture, setup.aovs, &names, exposure, measure, attribute);
        self.task.dir.log_iterations(&[(line, exr)])?;
        self.iterations += 1;
        Ok(())
    }
}
