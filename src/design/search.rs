//! Many starts on the basis: screened cheaply, few polished.
//!
//! Starts are the given ones and points of a low-discrepancy set. All are
//! measured on a reduced picture; the best of them that lie apart descend there, smoothed.
//! Which of the ends is best the whole picture tells: the best of them settle there in the kinks
//! of f_q, and the best of these goes on, by what is expected of the terms with their errors. With
//! more samples the same ends settle anew. All descents move in [coordinates](super::coordinates) in
//! which a light keeps its flux. What wins is the f_q, unsmoothed and freed of noise bias, whose
//! error bar ends lowest; among few samples, which others will follow, half of the bar counts.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    coordinates::Coordinates,
    evaluator::{Evaluator, Scratch},
};
use crate::{
    objective::{JackknifeEstimate, LABELLINGS, Smoothing},
    optim::{self, Interrupt, Method, OptimError, StopReason},
};

/// Points of the low-discrepancy set.
const N_POINTS: u32 = 256;
/// Starts that descend on the reduced picture.
const N_COARSE: usize = 16;
/// Points nearer than this to a better one in all directions, in units of the box, are left.
const APART: f64 = 0.1;
/// Evaluations of each stage of a descent on the reduced picture.
const EVALUATIONS: u32 = 20;
/// Change of f_q below which a descent on the whole picture is settled, before it goes on and at
/// last: to one side of a kink f_q hardly changes.
const SETTLED: f64 = 1e-4;
const SETTLED_WELL: f64 = 1e-6;
/// Sizes of a light that are tried, and the most lights of which they are.
const N_SIZES: u32 = 7;
const N_SIZED: usize = 8;
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
    /// Whether the best tries other sizes before it goes on: not where samples are aimed, for few are
    /// then far away, and their noise would choose.
    tries_sizes: bool,
    /// Share of the errors that counts when ends are compared.
    doubt: f64,
}

/// Where samples are few: more will tell what is better.
const ROUGH: Effort = Effort { ends: 3, evaluations: [15, 15], tries_sizes: true, doubt: 0.5 };
/// Where they are enough.
pub const THOROUGH: Effort = Effort { ends: 3, evaluations: [24, 48], tries_sizes: false, doubt: 1.0 };
/// Standard errors from four replicates are themselves uncertain: what is known of a residual is
/// Student's distribution of three degrees of freedom, whose standard deviation is this.
const STUDENT: f64 = 1.732_050_8;

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
    /// Whether it was the best of them and went on.
    pub leads: bool,
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
            Trial { name, start, screened, end: None, polished: None, leads: false }
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
pub fn polish<'a>(
    whole: &Evaluator<'a>,
    trials: &mut [Trial],
    effort: &Effort,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<u32, OptimError> {
    let [few, more] = effort.evaluations;
    let lower = whole.lower_bounds();
    let at = |t: &Trial| {
        let u = t.polished.as_ref().map(|p| &p.u).or(t.end.as_ref())?;
        Some(Coordinates::around(u, whole.variables).not_below(u, &lower))
    };
    let ends: Vec<_> = trials.iter().enumerate().filter_map(|(i, t)| Some((i, at(t)?))).collect();
    let measure = |scratch: &mut Scratch<'a>, (i, u): (usize, Vec<f64>)| {
        let f = value(whole, &u, Smoothing::DELTA_LAST, scratch);
        (i, u, f)
    };
    let mut ends: Vec<_> = ends.into_par_iter().map_init(Scratch::default, measure).collect();
    ends.sort_by(|a, b| a.2.total_cmp(&b.2));
    let chosen = apart(ends.iter().enumerate().map(|(k, end)| (k, end.1.as_slice())), effort.ends);
    let settled = chosen.into_par_iter().map(|k| {
        let (i, u, _) = &ends[k];
        Ok((*i, settle(whole, u, None, few, cancelled)?))
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
    let leader = leader(trials, effort.doubt)?;
    for (i, trial) in trials.iter_mut().enumerate() {
        trial.leads = i == leader;
    }
    if let Some(best) = &mut trials[leader].polished {
        if effort.tries_sizes {
            let (at, tried) = try_sizes(whole, &best.u);
            count += tried;
            if at != best.u {
                let moved = settle(whole, &at, None, few, cancelled)?;
                count += moved.evaluations.len();
                *best = best.followed_by(&moved);
            }
        }
        let refined = settle(whole, &best.u, Some(&best.estimate), more, cancelled)?;
        count += refined.evaluations.len();
        *best = best.followed_by(&refined);
    }
    Ok(count as u32)
}

/// Takes the best of some sizes of each light in turn, that which gives most first, from all of
/// its range that samples tell and at constant flux, and returns what it found with the number of points tried. Over
/// the size of a light f_q often falls slowly but far: noise holds a descent, but not a glance at
/// the whole range.
fn try_sizes<'a>(whole: &Evaluator<'a>, u: &[f64]) -> (Vec<f64>, usize) {
    let measure = |scratch: &mut Scratch<'a>, u: Vec<f64>| {
        let f = value(whole, &u, Smoothing::DELTA_LAST, scratch);
        (u, f)
    };
    let lower = whole.lower_bounds();
    let mut best = measure(&mut Scratch::default(), u.to_vec());
    let mut tried = 1;
    let shares = whole.halves.shares(&whole.lighting(&whole.variables.decode(u)));
    let mut sizes: Vec<(usize, f64)> = Vec::new();
    for (i, v) in whole.variables.variables.iter().enumerate() {
        if v.kind.is_tried() {
            sizes.push((i, shares[v.light]));
        }
    }
    sizes.sort_by(|a, b| b.1.total_cmp(&a.1));
    for (i, _) in sizes.into_iter().take(N_SIZED).filter(|(_, share)| *share > 0.0) {
        let coordinates = Coordinates::around(&best.0, whole.variables);
        let at = |k: u32| {
            let mut y = best.0.clone();
            y[i] = lower[i] + (1.0 - lower[i]) * f64::from(k) / f64::from(N_SIZES - 1);
            coordinates.to_cube(&y)
        };
        let points = (0..N_SIZES).into_par_iter().map(at).map_init(Scratch::default, measure);
        let points: Vec<(Vec<f64>, f64)> = points.collect();
        tried += points.len();
        for point in points {
            if point.1 < best.1 {
                best = point;
            }
        }
    }
    (best.0, tried)
}

/// f_q with its error.
fn estimate(whole: &Evaluator, u: &[f64]) -> Result<JackknifeEstimate, OptimError> {
    whole.estimate(u, LABELLINGS).map_err(|_| OptimError::NothingEvaluated)
}

/// Smoothed f_q.
fn value<'a>(evaluator: &Evaluator<'a>, u: &[f64], delta: f64, scratch: &mut Scratch<'a>) -> f64 {
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

/// Settles around `u` by what is expected of the terms with their errors.
///
/// # Errors
/// As [`search`].
pub fn refine(
    whole: &Evaluator,
    u: &[f64],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, OptimError> {
    let u = Coordinates::around(u, whole.variables).not_below(u, &whole.lower_bounds());
    settle(whole, &u, Some(&estimate(whole, &u)?), THOROUGH.evaluations[1], cancelled)
}

/// Descends with less and less smoothing.
fn descend(
    evaluator: &Evaluator,
    start: &[f64],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Vec<f64>, OptimError> {
    let n = start.len();
    let mut scratch = Scratch::of_descent();
    let mut at = start.to_vec();
    for (delta, first_step) in STAGES {
        let smoothing = Smoothing::with_delta(delta);
        let options = optim::Options {
            max_evaluations: Some(EVALUATIONS),
            f_tol_abs: 1e-6,
            x_tol_abs: 1e-5,
            first_step: Some(first_step),
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
            ControlFlow::Continue(f)
        });
        match outcome {
            Ok(outcome) => at = coordinates.to_cube(&outcome.x),
            Err(OptimError::NothingEvaluated) => break,
            Err(e) => return Err(e),
        }
    }
    Ok(at)
}

/// Goes from `u`, which samples tell, into the kinks of the terms' moduli and along them; or, where an estimate at `u`
/// tells the errors of the terms, to the least f_q expected with them. Residuals are then those of
/// all replicates, less their bias: on one side of a kink f_q often rises much faster than on the
/// other, and a small error of the wrong sign costs much.
fn settle(
    whole: &Evaluator,
    u: &[f64],
    known: Option<&JackknifeEstimate>,
    evaluations: u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, OptimError> {
    let mut log = Vec::new();
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
    let weights = whole.objective.scalar_weights();
    let mut scratch = Scratch::of_descent();
    let (errors, defects) = match known {
        None => (vec![0.0; weights.len()], vec![0.0; weights.len()]),
        Some(estimate) => {
            let defects = whole.defects(u, &smoothing, &mut scratch);
            let defects = defects.map_err(|_| OptimError::NothingEvaluated)?;
            (estimate.residual_errors.iter().map(|e| STUDENT * e).collect(), defects)
        }
    };
    let tolerance = if known.is_some() { SETTLED_WELL } else { SETTLED };
    let coordinates = Coordinates::around(u, whole.variables);
    let lower = whole.lower_bounds();
    let outcome =
        optim::minimize_moduli(u, &lower, &weights, &errors, tolerance, evaluations, |y, moduli| {
            let u = &coordinates.to_cube(y);
            if cancelled() || whole.residuals(u, &smoothing, moduli, &mut scratch).is_err() {
                return ControlFlow::Break(Interrupt);
            }
            moduli.residuals.iter_mut().zip(&defects).for_each(|(r, defect)| *r += defect);
            log.push((u.to_vec(), moduli.value(&weights, &errors), moduli.slope(&weights, &errors)));
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

/// The trial that went on, and what became of it.
///
/// # Errors
/// When none is polished.
pub fn best(trials: &[Trial]) -> Result<(&Trial, &Polished), OptimError> {
    let best = trials.iter().find(|trial| trial.leads).ok_or(OptimError::NothingEvaluated)?;
    Ok((best, best.polished.as_ref().ok_or(OptimError::NothingEvaluated)?))
}

/// Lets the trial that leads go on to the end of a later descent, so that what is polished next begins
/// there.
pub fn extend_best(trials: &mut [Trial], next: &Polished) {
    for polished in trials.iter_mut().filter(|trial| trial.leads).filter_map(|t| t.polished.as_mut()) {
        *polished = polished.followed_by(next);
    }
}

/// The polished trial of which the upper end of the error bar, of which a share counts, is the
/// least: where f_q hardly differs, what is known best is the better choice. Of the noise correction
/// a part counts, since the jackknife leaves a part of the bias; all of it would favour lights that
/// make no noise.
fn leader(trials: &[Trial], doubt: f64) -> Result<usize, OptimError> {
    let most = |p: &Polished| {
        let e = &p.estimate;
        e.evaluation.f_q + doubt * (e.half_width + BIAS_LEFT * e.correction.abs())
    };
    let polished = trials.iter().enumerate().filter_map(|(i, t)| Some((i, most(t.polished.as_ref()?))));
    let least = polished.min_by(|a, b| a.1.total_cmp(&b.1));
    least.map(|(i, _)| i).ok_or(OptimError::NothingEvaluated)
}
