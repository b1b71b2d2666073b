//! Many starts on the basis: screened cheaply, few polished.
//!
//! Starts are the given ones and points of a low-discrepancy set. All are
//! measured on a reduced picture; the best of them that lie apart descend there, smoothed.
//! Which of the ends is best the whole picture tells: the best of them settle there in the kinks
//! of f_q, and the best of these goes on, as far as the errors of the terms let it. With more
//! samples the same ends settle anew. All descents move in [coordinates](super::coordinates) in
//! which a light keeps its flux. What wins is the f_q, unsmoothed and freed of noise bias, whose
//! error bar ends lowest.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    coordinates::Coordinates,
    evaluator::{Evaluator, Scratch},
};
use crate::{
    objective::{JackknifeEstimate, LABELLINGS, N_SCALARS, Smoothing},
    optim::{self, Interrupt, Method, OptimError, StopReason},
};

/// Points of the low-discrepancy set.
const N_POINTS: u32 = 512;
/// Starts that descend on the reduced picture.
const N_COARSE: usize = 16;
/// Points nearer than this to a better one in all directions, in units of the box, are left.
const APART: f64 = 0.1;
/// Evaluations of each stage of a descent on the reduced picture.
const EVALUATIONS: u32 = 40;
/// Change of f_q below which a descent on the whole picture is settled.
const SETTLED: f64 = 1e-4;
/// Evaluations of a search over the whole box.
const GLOBAL_EVALUATIONS: u32 = 20_000;
/// Share of a noise correction that counts as an error when ends are compared.
const BIAS_LEFT: f64 = 0.5;

/// How hard ends are polished.
pub struct Effort {
    /// Those that settle.
    ends: usize,
    /// Evaluations of each of them, and of the best when it goes on.
    evaluations: [u32; 2],
}

/// Where samples are few.
const ROUGH: Effort = Effort { ends: 4, evaluations: [10, 15] };
/// Where they are enough.
pub const THOROUGH: Effort = Effort { ends: 4, evaluations: [15, 30] };

/// A start and what became of it.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Where it comes from.
    pub name: String,
    /// The start.
    pub start: Vec<f64>,
    /// Smoothed f_q of the start on the reduced picture.
    pub screened: f64,
    /// The end of its descent there, if it was among the best.
    pub end: Option<Vec<f64>>,
    /// What followed on the whole picture, if it was among the best of those.
    pub polished: Option<Polished>,
}

/// The end of a descent on the whole picture.
#[derive(Clone, Debug)]
pub struct Polished {
    /// The point found.
    pub u: Vec<f64>,
    /// f_q there.
    pub estimate: JackknifeEstimate,
    /// Every evaluation: point, smoothed f_q and length of the gradient.
    pub evaluations: Vec<(Vec<f64>, f64, f64)>,
    /// Why the last stage ended.
    pub stop: StopReason,
}

impl Polished {
    /// The end of a later descent, with the evaluations of both.
    #[must_use]
    pub fn followed_by(&self, next: &Self) -> Self {
        Self { evaluations: [self.evaluations.clone(), next.evaluations.clone()].concat(), ..next.clone() }
    }
}

/// Smoothing and the largest component of the first trial step of the stages.
const STAGES: [(f64, f64); 2] = [(Smoothing::DELTA_FIRST, 0.1), (5e-3, 0.02)];

/// Points of a low-discrepancy set in the unit cube of `n` dimensions.
pub fn spread(count: u32, n: usize, seed: u32) -> impl Iterator<Item = Vec<f64>> {
    let at = move |i| move |d| f64::from(sobol_burley::sample(i, d as u32 % 256, seed));
    (0..count).map(move |i| (0..n).map(at(i)).collect())
}

/// The first of the points in their order that lie apart, `count` at most.
fn apart<'a>(points: impl Iterator<Item = (usize, &'a [f64])>, count: usize) -> Vec<usize> {
    let mut kept: Vec<(usize, &[f64])> = Vec::new();
    for (i, p) in points {
        let far = |q: &[f64]| p.iter().zip(q).any(|(a, b)| (a - b).abs() > APART);
        if kept.len() < count && kept.iter().all(|(_, q)| far(q)) {
            kept.push((i, p));
        }
    }
    kept.into_iter().map(|(i, _)| i).collect()
}

/// Searches from `starts` and from a low-discrepancy set; `reduced` is the same
/// problem on a smaller picture. The trials come back in the order of their
/// starts, with the number of evaluations on the whole picture; at least one is polished.
///
/// # Errors
/// When NLopt fails, or f_q is not a number.
pub fn search(
    whole: &Evaluator,
    reduced: &Evaluator,
    starts: &[(String, Vec<f64>)],
    seed: u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<(Vec<Trial>, u32), OptimError> {
    let points = spread(N_POINTS, whole.variables.len(), seed);
    let spread = points.enumerate().map(|(i, point)| (format!("spread {i}"), point));
    let mut trials: Vec<Trial> = starts
        .iter()
        .cloned()
        .chain(spread)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map_init(Scratch::default, |scratch, (name, start)| {
            let screened = value(reduced, &start, Smoothing::DELTA_FIRST, scratch);
            Trial { name, start, screened, end: None, polished: None }
        })
        .collect();
    let mut order: Vec<usize> = (0..trials.len()).collect();
    order.sort_by(|&a, &b| trials[a].screened.total_cmp(&trials[b].screened));
    let chosen = apart(order.iter().map(|&i| (i, trials[i].start.as_slice())), N_COARSE);
    let ends = chosen.into_par_iter().map(|i| Ok((i, descend(reduced, &trials[i].start, cancelled)?)));
    for (i, end) in ends.collect::<Result<Vec<_>, OptimError>>()? {
        trials[i].end = Some(end);
    }
    let evaluations = polish(whole, &mut trials, &ROUGH, cancelled)?;
    Ok((trials, evaluations))
}

/// Settles the best of the ends on the whole picture, from where they were left, and returns the
/// number of evaluations there.
///
/// # Errors
/// As [`search`].
pub fn polish(
    whole: &Evaluator,
    trials: &mut [Trial],
    effort: &Effort,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<u32, OptimError> {
    let [few, more] = effort.evaluations;
    let at = |t: &Trial| t.polished.as_ref().map_or_else(|| t.end.clone(), |p| Some(p.u.clone()));
    let ends: Vec<_> = trials.iter().enumerate().filter_map(|(i, t)| Some((i, at(t)?))).collect();
    let measure = |scratch: &mut Scratch, (i, u): (usize, Vec<f64>)| {
        let f = value(whole, &u, Smoothing::DELTA_LAST, scratch);
        (i, u, f)
    };
    let mut ends: Vec<_> = ends.into_par_iter().map_init(Scratch::default, measure).collect();
    ends.sort_by(|a, b| a.2.total_cmp(&b.2));
    let chosen = apart(ends.iter().enumerate().map(|(k, end)| (k, end.1.as_slice())), effort.ends);
    let settled = chosen.into_par_iter().map(|k| {
        let (i, u, _) = &ends[k];
        Ok((*i, settle(whole, u, &[0.0; N_SCALARS], few, cancelled)?))
    });
    let settled: Vec<(usize, Polished)> = settled.collect::<Result<_, OptimError>>()?;
    let mut count: usize = settled.iter().map(|(_, p)| p.evaluations.len()).sum();
    // What was polished with fewer samples does not compare.
    let mut earlier: Vec<Option<Polished>> = trials.iter_mut().map(|t| t.polished.take()).collect();
    for (i, p) in settled {
        trials[i].polished = Some(match earlier[i].take() {
            Some(before) => before.followed_by(&p),
            None => p,
        });
    }
    if let Some(best) = &mut trials[leader(trials)?].polished {
        let refined = settle(whole, &best.u, &best.estimate.residual_errors, more, cancelled)?;
        count += refined.evaluations.len();
        *best = best.followed_by(&refined);
    }
    Ok(count as u32)
}

/// f_q with its error.
fn estimate(whole: &Evaluator, u: &[f64]) -> Result<JackknifeEstimate, OptimError> {
    whole.estimate(u, LABELLINGS).map_err(|_| OptimError::NothingEvaluated)
}

/// Smoothed f_q.
fn value(evaluator: &Evaluator, u: &[f64], delta: f64, scratch: &mut Scratch) -> f64 {
    evaluator.evaluate(u, &Smoothing::with_delta(delta), None, scratch).unwrap_or(f64::INFINITY)
}

/// The best point of the whole box on the `reduced` problem, found without any start.
///
/// # Errors
/// As [`search`].
pub fn global(
    reduced: &Evaluator,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<(Vec<f64>, u32), OptimError> {
    let n = reduced.variables.len();
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
    let options = optim::Options {
        method: Method::DirectL,
        max_evaluations: Some(GLOBAL_EVALUATIONS),
        f_tol_abs: 0.0,
        x_tol_abs: 0.0,
        ..Default::default()
    };
    let mut scratch = Scratch::default();
    let outcome = optim::minimize(&vec![0.5; n], &vec![0.0; n], &vec![1.0; n], &options, |u, _| {
        if cancelled() {
            return ControlFlow::Break(Interrupt);
        }
        ControlFlow::Continue(reduced.evaluate(u, &smoothing, None, &mut scratch).unwrap_or(f64::NAN))
    })?;
    Ok((outcome.x, outcome.evaluations))
}

/// Settles in the kinks of f_q around `u`, as far as the errors of the terms let it.
///
/// # Errors
/// As [`search`].
pub fn refine(
    whole: &Evaluator,
    u: &[f64],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, OptimError> {
    let estimate = estimate(whole, u)?;
    settle(whole, u, &estimate.residual_errors, THOROUGH.evaluations[1], cancelled)
}

/// Descends with less and less smoothing.
fn descend(
    evaluator: &Evaluator,
    start: &[f64],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Vec<f64>, OptimError> {
    let n = start.len();
    let mut scratch = Scratch::default();
    let mut at = start.to_vec();
    for (delta, first_step) in STAGES {
        let smoothing = Smoothing::with_delta(delta);
        let mut scale = None;
        let options = optim::Options {
            max_evaluations: Some(EVALUATIONS),
            f_tol_abs: 1e-6,
            x_tol_abs: 1e-5,
            ..Default::default()
        };
        let coordinates = Coordinates::around(&at, evaluator.variables);
        let outcome = optim::minimize(&at, &vec![0.0; n], &vec![1.0; n], &options, |y, gradient| {
            if cancelled() {
                return ControlFlow::Break(Interrupt);
            }
            let u = &coordinates.to_cube(y);
            let f = evaluator.evaluate(u, &smoothing, Some(gradient), &mut scratch).unwrap_or(f64::NAN);
            coordinates.pull_back(y, u, gradient);
            let steepest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            let c = *scale.get_or_insert(if steepest > first_step { first_step / steepest } else { 1.0 });
            gradient.iter_mut().for_each(|g| *g *= c);
            ControlFlow::Continue(c * f)
        });
        match outcome {
            Ok(outcome) => at = coordinates.to_cube(&outcome.x),
            Err(OptimError::NothingEvaluated) => break,
            Err(e) => return Err(e),
        }
    }
    Ok(at)
}

/// Goes from `u` into the kinks of the terms' moduli and along them. Residuals below their `floors`
/// count as these: with the terms' errors for floors it leaves a kink that may be elsewhere when
/// other terms gain by it. On one side of it f_q often rises much faster than on the other, so
/// that to hit it exactly in samples that err is to pass it half of the time, at a price.
fn settle(
    whole: &Evaluator,
    u: &[f64],
    floors: &[f64; N_SCALARS],
    evaluations: u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, OptimError> {
    let mut log = Vec::new();
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
    let weights = whole.objective.scalar_weights();
    let mut scratch = Scratch::default();
    let coordinates = Coordinates::around(u, whole.variables);
    let outcome = optim::minimize_moduli(u, &weights, floors, SETTLED, evaluations, |y, moduli| {
        let u = &coordinates.to_cube(y);
        if cancelled() || whole.residuals(u, &smoothing, moduli, &mut scratch).is_err() {
            return ControlFlow::Break(Interrupt);
        }
        log.push((u.to_vec(), moduli.value(&weights, floors), moduli.slope(&weights, floors)));
        moduli.gradients().for_each(|gradient| coordinates.pull_back(y, u, gradient));
        ControlFlow::Continue(())
    });
    let (u, stop) = match outcome {
        Ok(outcome) => (coordinates.to_cube(&outcome.x), outcome.stop),
        Err(OptimError::NothingEvaluated) => (u.to_vec(), StopReason::Interrupted),
        Err(e) => return Err(e),
    };
    let estimate = estimate(whole, &u)?;
    Ok(Polished { u, estimate, evaluations: log, stop })
}

/// The polished trial of which the upper end of the error bar is the least: where f_q hardly
/// differs, what is known best is the better choice. Of the noise correction a part counts, since
/// the jackknife leaves a part of the bias; all of it would favour lights that make no noise.
///
/// # Errors
/// When none is polished.
pub fn best(trials: &[Trial]) -> Result<(&Trial, &Polished), OptimError> {
    let best = &trials[leader(trials)?];
    Ok((best, best.polished.as_ref().ok_or(OptimError::NothingEvaluated)?))
}

fn leader(trials: &[Trial]) -> Result<usize, OptimError> {
    let most = |p: &Polished| {
        let e = &p.estimate;
        e.evaluation.f_q + e.half_width + BIAS_LEFT * e.correction.abs()
    };
    let polished = trials.iter().enumerate().filter_map(|(i, t)| Some((i, most(t.polished.as_ref()?))));
    let least = polished.min_by(|a, b| a.1.total_cmp(&b.1));
    least.map(|(i, _)| i).ok_or(OptimError::NothingEvaluated)
}
