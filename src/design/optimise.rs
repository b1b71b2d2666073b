//! Paper mode: a fresh render per evaluation, forward differences with common
//! random numbers, NLopt's bounded L-BFGS from one start.

use std::{ops::ControlFlow, time::Instant};

use serde_json::json;

use super::{
    Progress, Purpose, Reporter, RunError, Setting, Shot, Task, attribute,
    precision::{MAX_SAMPLES, Precision},
    seed_for,
};
use crate::{
    audit::picture,
    integrator::RenderError,
    objective::Smoothing,
    optim::{self, Interrupt, OptimError, StopReason, difference},
};

/// One of the restarts.
struct Stage {
    /// Smoothing of the residuals.
    delta: f64,
    /// Share of the evaluations.
    share: f64,
    /// Largest component of the first trial step: NLopt tries x0 − ∇f, so f is
    /// scaled to make that a sane step.
    first_step: f64,
}

const STAGES: [Stage; 3] = [
    Stage { delta: Smoothing::DELTA_FIRST, share: 0.5, first_step: 0.1 },
    Stage { delta: 5e-3, share: 0.3, first_step: 0.02 },
    Stage { delta: Smoothing::DELTA_LAST, share: 0.2, first_step: 0.005 },
];
/// Samples per pixel of the first renders, if nobody says how many.
pub const FIRST_SAMPLES: u32 = 12;
/// Replicates of an evaluation, from which its error is estimated.
const REPLICATES: u32 = 4;
/// Function values from which the noise is estimated, and their spacing.
const NOISE_POINTS: usize = 7;
const NOISE_SPACING: f64 = 1e-3;

/// What was found.
pub struct Found {
    /// Best point, in the unit cube.
    pub u: Vec<f64>,
    /// Samples per pixel of an evaluation.
    pub spp: u32,
    /// Evaluations with gradient.
    pub evaluations: u32,
    /// Why the last search ended.
    pub stop: StopReason,
}

struct Search<'a, 'b, R> {
    setting: &'a mut Setting<'b>,
    task: &'a mut Task<'b>,
    renders: &'a mut u64,
    reporter: &'a R,
    /// Samples per pixel of a render.
    spp: u32,
    /// Of the differences.
    step: f64,
    evaluations: u32,
    iterations: u32,
    /// Best unsmoothed f_q and its point.
    best: Option<(f64, Vec<f64>)>,
}

/// Optimises from the best of the task's starts.
pub fn by_differences<'a>(
    task: &mut Task<'a>,
    setting: &mut Setting<'a>,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Found, RunError> {
    let n = setting.variables.len();
    let budget = setting.options.max_evaluations;
    let spp = setting.options.spp.unwrap_or(FIRST_SAMPLES);
    let (step, evaluations, iterations, best) = (0.0, 0, 0, None);
    let mut search = Search { setting, task, renders, reporter, spp, step, evaluations, iterations, best };
    reporter.stage("optimising", None);
    let start = search.choose()?;
    match search.find_step(&start) {
        Ok(step) => search.step = step,
        Err(RunError::Render(RenderError::Cancelled)) => {
            return Ok(Found { u: start, spp, evaluations: 0, stop: StopReason::Interrupted });
        }
        Err(e) => return Err(e),
    }

    let mut u = start.clone();
    let mut stop = StopReason::NoProgress;
    for (i, Stage { delta, share, first_step }) in STAGES.into_iter().enumerate() {
        let left = budget - search.evaluations;
        if left == 0 {
            break;
        }
        match search.find_samples(&u) {
            Err(RunError::Render(RenderError::Cancelled)) => {
                stop = StopReason::Interrupted;
                break;
            }
            other => other?,
        }
        let allowed =
            if i + 1 == STAGES.len() { left } else { ((f64::from(budget) * share) as u32).clamp(1, left) };
        let smoothing = Smoothing::with_delta(delta);
        let mut scale = None;
        let mut failure = None;
        let options = optim::Options {
            max_evaluations: Some(allowed),
            f_tol_abs: 1e-5,
            x_tol_abs: 1e-4,
            ..Default::default()
        };
        let result = optim::minimize(&u, &vec![0.0; n], &vec![1.0; n], &options, |u, gradient| match search
            .evaluate(u, &smoothing)
        {
            Ok((f, slopes)) => {
                let steepest = slopes.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
                let c = *scale.get_or_insert(if steepest > first_step { first_step / steepest } else { 1.0 });
                for (g, s) in gradient.iter_mut().zip(slopes) {
                    *g = c * s;
                }
                ControlFlow::Continue(c * f)
            }
            Err(e) => {
                failure = Some(e);
                ControlFlow::Break(Interrupt)
            }
        });
        match failure {
            Some(RunError::Render(RenderError::Cancelled)) => {
                stop = StopReason::Interrupted;
                break;
            }
            Some(e) => return Err(e),
            None => {}
        }
        let outcome = result.map_err(|e: OptimError| RunError::from(e))?;
        u = outcome.x;
        stop = outcome.stop;
    }
    let u = search.best.map_or(start, |(_, u)| u);
    Ok(Found { u, spp: search.spp, evaluations: search.evaluations, stop })
}

impl<R: Reporter> Search<'_, '_, R> {
    fn shoot(&mut self, u: &[f64], purpose: Purpose) -> Result<Shot, RunError> {
        let Setting { scene, camera, variables, options, .. } = &mut *self.setting;
        variables.apply(scene, &variables.decode(u));
        *self.renders += 1;
        Ok(camera.shoot(scene, seed_for(options.seed, purpose), self.spp, REPLICATES, self.reporter)?)
    }

    /// The start with the least f_q; after an interrupt, of those measured.
    fn choose(&mut self) -> Result<Vec<f64>, RunError> {
        let starts = self.task.starts.clone();
        let mut best: Option<(f64, &(String, Vec<f64>))> = None;
        for start in &starts {
            let shot = match self.shoot(&start.1, Purpose::Optimise) {
                Err(RunError::Render(RenderError::Cancelled)) => break,
                shot => shot?,
            };
            let f_q = shot.smoothed(&self.task.objective, &Smoothing::NONE);
            self.task.dir.log_evaluation(&json!({
                "start": start.0,
                "x": self.setting.variables.named(&self.setting.variables.decode(&start.1)),
                "f_q": f_q,
                "renders": *self.renders,
            }))?;
            if best.is_none_or(|(least, _)| f_q < least) {
                best = Some((f_q, start));
            }
        }
        let Some((f_q, (name, u))) = best else {
            // Interrupted before the first was measured.
            return starts.first().map(|(_, u)| u.clone()).ok_or(OptimError::NoVariables.into());
        };
        self.reporter
            .note(&format!("starting with {name}: f_q {f_q:.4}, the best of {} starts", starts.len()));
        Ok(u.clone())
    }

    /// As many samples as the tolerance needs at a point, unless somebody said how many: f_q as the
    /// renders have it, noise included, is what is minimised.
    fn find_samples(&mut self, u: &[f64]) -> Result<(), RunError> {
        let options = self.setting.options;
        let precision = Precision::differences(options.tolerance);
        while options.spp.is_none() && self.spp < MAX_SAMPLES {
            let estimate = self.shoot(u, Purpose::Optimise)?.measure(&self.task.objective)?.estimate;
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

    /// The step of the differences, from the noise of f along the diagonal.
    fn find_step(&mut self, start: &[f64]) -> Result<f64, RunError> {
        let smoothing = Smoothing::with_delta(Smoothing::DELTA_FIRST);
        let values = (0..NOISE_POINTS)
            .map(|i| {
                let along = NOISE_SPACING * i as f64;
                let u: Vec<f64> =
                    start.iter().map(|&u| if u < 0.5 { u + along } else { u - along }).collect();
                Ok(self.shoot(&u, Purpose::Optimise)?.smoothed(&self.task.objective, &smoothing))
            })
            .collect::<Result<Vec<f64>, RunError>>()?;
        let noise = difference::noise(&values);
        let step = difference::step(noise);
        self.reporter.note(&format!(
            "noise of f_q under common random numbers {noise:.1e}, difference step {step:.4}"
        ));
        Ok(step)
    }

    /// Smoothed f_q with its gradient; logs the unsmoothed one.
    fn evaluate(&mut self, u: &[f64], smoothing: &Smoothing) -> Result<(f64, Vec<f64>), RunError> {
        let clock = Instant::now();
        let shot = self.shoot(u, Purpose::Optimise)?;
        let measured = shot.measure(&self.task.objective)?;
        let f = shot.smoothed(&self.task.objective, smoothing);
        let step = self.step;
        let slopes = difference::gradient(u, f, step, |u| {
            let shot = self.shoot(u, Purpose::Optimise)?;
            Ok::<_, RunError>(shot.smoothed(&self.task.objective, smoothing))
        })?;
        self.evaluations += 1;

        let Setting { scene, variables, options, aovs, .. } = &mut *self.setting;
        let target = &self.task.job.target;
        let x = variables.decode(u);
        let f_q = measured.plain.f_q;
        let line = json!({
            "evaluation": self.evaluations,
            "x": variables.named(&x),
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
            variables.apply(scene, &x);
            let names: Vec<&str> = scene.lights.iter().map(|l| l.name.as_str()).collect();
            let attribute = attribute(scene, options, target, variables, &x, &measured.plain, self.spp);
            let exposure = f64::from(scene.exposure);
            let exr = picture::exr(&shot.picture, aovs, &names, exposure, options.luminance, attribute);
            self.task.dir.log_iterations(&[(line, exr)])?;
            self.iterations += 1;
            self.best = Some((f_q, u.to_vec()));
        }
        self.reporter.evaluated(&Progress {
            evaluation: self.evaluations,
            max_evaluations: options.max_evaluations,
            iterations: self.iterations,
            f_q,
            best: self.best.as_ref().map_or(f_q, |(best, _)| *best),
            renders: *self.renders,
        });
        Ok((f, slopes))
    }
}
