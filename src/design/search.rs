//! Multi-start search on a basis: many starts are screened cheaply, few ends are polished.
//!
//! Starts are the given ones and the points of a low-discrepancy set. All are measured on a reduced
//! picture, and the best of them that lie apart descend there with smoothed terms. The best ends on the
//! whole picture settle there in the kinks of f_q. The one with the least upper end of its error bar, of
//! f_q unsmoothed and corrected for noise bias, goes on to the least f_q expected with the terms' errors;
//! with few samples, which others will follow, half of the bar counts. With more samples the same ends
//! settle anew. All descents move in [coordinates](super::coordinates) in which a light keeps its flux.

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

/// Points of the low-discrepancy set that are screened. Twice as many, with longer descents and more
/// samples, ended at a true f_q of .1346 in high-key on the fruit basket (mean of 24 seeds) where a half of
/// all that ended at .1355 to .1359; trying sizes makes up for most of it.
const N_POINTS: u32 = 256;
/// Starts that descend on the reduced picture. With 8 of them and shorter polishing the true f_q of
/// high-key was .1362, worst .1407, with 16 it is .1353, worst .1379 (fruit basket, 24 seeds), for .12 s.
const N_COARSE: usize = 16;
/// Distance from a better point, in the direction in which they differ most and in units of the box, below
/// which a point is left out: more of it spreads few descents over the box, less follows several good
/// points of one valley. Set by reasoning.
const MIN_DISTANCE: f64 = 0.1;
/// Evaluations of each stage of a descent on the reduced picture. 40 were used before; half of them, with
/// half the starts, gave .1355 in high-key where all gave .1346 (fruit basket, 24 seeds).
const EVALUATIONS: u32 = 20;
/// Change of f_q below which an end on the whole picture has settled, before ends are compared: 1e-5 was
/// used before and only took more evaluations.
const SETTLED: f64 = 1e-4;
/// Change of f_q below which the best end has settled at last: on one side of a kink f_q hardly changes, so
/// that [`SETTLED`] would stop there too early. Its evaluations are limited in any case.
const SETTLED_WELL: f64 = 1e-6;
/// Sizes of a light that are tried at constant flux: with sizes in a range of 20 they are 65 % apart. From a
/// hard rim light to a soft one high-key's f_q falls from .1424 to .1369, too slowly for a descent in noise.
const N_SIZES: u32 = 7;
/// Upper bound of the number of lights whose sizes are tried, the strongest first: each costs [`N_SIZES`]
/// evaluations. Set by reasoning.
const N_SIZED: usize = 8;
/// Evaluations of a search over the whole box: a check that the starts missed nothing, which must be long to
/// prove anything. Set by reasoning.
const GLOBAL_EVALUATIONS: u32 = 20_000;
/// Share of the noise correction that counts as an error when ends are compared, since the jackknife leaves
/// a part of the bias: all of it favoured lights that make no noise, none chose bad ends more often.
const BIAS_LEFT: f64 = 0.5;

/// Effort with which ends are polished.
pub struct Effort {
    /// Number of ends that settle.
    ends: usize,
    /// Upper bounds of the evaluations of each end that settles, and of the best when it goes on.
    evaluations: [u32; 2],
    /// Whether the best end tries other sizes before it goes on: not where samples are aimed, since few are
    /// then far away and their noise would choose.
    tries_sizes: bool,
    /// Share of the error bar that counts when ends are compared.
    error_weight: f64,
}

/// Effort in a basis of few samples, where more will decide between ends. Two ends and half of the error bar
/// were chosen on the fruit basket; a third end was added with the longer polishing of [`N_COARSE`].
const ROUGH: Effort = Effort { ends: 3, evaluations: [15, 15], tries_sizes: true, error_weight: 0.5 };
/// Effort in a basis whose samples are enough. See [`N_COARSE`] for what it gained.
pub const THOROUGH: Effort = Effort { ends: 3, evaluations: [24, 48], tries_sizes: false, error_weight: 1.0 };
/// Standard deviation of Student's distribution of three degrees of freedom, √3, by which a standard error
/// from four replicates is multiplied: it is itself uncertain.
const STUDENT_DEVIATION: f64 = 1.732_050_8;

/// A start with the ends that were found from it.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Name of the start.
    pub name: String,
    /// Point of the unit cube at which it begins.
    pub start: Vec<f64>,
    /// Smoothed f_q of the start on the reduced picture.
    pub screened: f64,
    /// End of its descent on the reduced picture; `None` if it was not among the best.
    pub end: Option<Vec<f64>>,
    /// End of its descents on the whole picture; `None` if it was not among the best ends.
    pub polished: Option<Polished>,
    /// Whether the trial is the best one, which goes on.
    pub leads: bool,
}

/// End of the descents of a trial on the whole picture.
#[derive(Clone, Debug)]
pub struct Polished {
    /// Point found, in the unit cube.
    pub u: Vec<f64>,
    /// f_q at that point, with its error.
    pub estimate: JackknifeEstimate,
    /// All evaluations: point, smoothed f_q and length of its gradient.
    pub evaluations: Vec<(Vec<f64>, f64, f64)>,
    /// Reason why the last descent ended.
    pub stop: StopReason,
}

impl Polished {
    /// The end `next` of a later descent, with the evaluations of both.
    #[must_use]
    pub fn followed_by(&self, next: &Self) -> Self {
        Self { evaluations: [self.evaluations.clone(), next.evaluations.clone()].concat(), ..next.clone() }
    }
}

/// Stages of a descent on the reduced picture: smoothing δ of the moduli, and the largest component of the
/// first trial step, which is smaller for the second since it begins near a minimum.
const STAGES: [(f64, f64); 2] = [(Smoothing::DELTA_FIRST, 0.1), (5e-3, 0.02)];

/// The first `count` points of a scrambled Sobol set in the unit cube of `n` dimensions.
pub fn spread(count: u32, n: usize, seed: u32) -> impl Iterator<Item = Vec<f64>> {
    let at = move |i| move |d| f64::from(sobol_burley::sample(i, d as u32 % 256, seed));
    (0..count).map(move |i| (0..n).map(at(i)).collect())
}

/// Indices of the first points in their order that lie apart by [`MIN_DISTANCE`], at most `count`.
pub(super) fn apart<'a>(points: impl Iterator<Item = (usize, &'a [f64])>, count: usize) -> Vec<usize> {
    let mut kept: Vec<(usize, &[f64])> = Vec::new();
    for (i, p) in points {
        let far = |q: &[f64]| p.iter().zip(q).any(|(a, b)| (a - b).abs() > MIN_DISTANCE);
        if kept.len() < count && kept.iter().all(|(_, q)| far(q)) {
            kept.push((i, p));
        }
    }
    kept.into_iter().map(|(i, _)| i).collect()
}

/// Searches from `starts` and from a low-discrepancy set, where `reduced` evaluates f_q on the reduced
/// picture. Returns the trials in the order of their starts, at least one of them polished, with the
/// number of evaluations on the whole picture.
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

/// Settles the best ends of the trials on the whole picture, from where they were left; the best of them
/// goes on. Returns the number of evaluations on the whole picture.
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
    // Ends that were polished with fewer samples do not compare.
    let mut earlier: Vec<Option<Polished>> = trials.iter_mut().map(|t| t.polished.take()).collect();
    for (i, p) in settled {
        trials[i].polished = Some(match earlier[i].take() {
            Some(before) => before.followed_by(&p),
            None => p,
        });
    }
    let leader = leader(trials, effort.error_weight)?;
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

/// Tries sizes from the whole range of each light at constant flux, the strongest light first, and keeps the
/// best of each. Returns the point found and the number of points tried. Over the size of a light f_q
/// often falls slowly but far, so that noise stops a descent, but not a comparison of distant sizes.
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

/// f_q at the point `u`, with its error.
fn estimate(whole: &Evaluator, u: &[f64]) -> Result<JackknifeEstimate, OptimError> {
    whole.estimate(u, LABELLINGS).map_err(|_| OptimError::NothingEvaluated)
}

/// Smoothed f_q at the point `u`; infinite if it cannot be evaluated.
pub(super) fn value<'a>(evaluator: &Evaluator<'a>, u: &[f64], delta: f64, scratch: &mut Scratch<'a>) -> f64 {
    evaluator.evaluate(u, &Smoothing::with_delta(delta), None, scratch).unwrap_or(f64::INFINITY)
}

/// Best point of the whole box on the reduced picture, found by dividing the box without any start, with the
/// number of evaluations.
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

/// Descends around `u` on the whole picture to the least f_q expected with the errors of the terms.
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

/// Descends on the reduced picture with less and less smoothing; returns the end.
pub(super) fn descend(
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

/// Descends on the whole picture from `u`, which lies above the lower bounds, into the kinks of the terms'
/// moduli and along them; or, with the estimate `known` at `u`, to the least f_q expected with the errors of
/// the terms. Residuals are then those of all replicates, corrected for bias: on one side of a kink f_q
/// often rises much faster than on the other, and a small error of the wrong sign costs much.
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
    let (errors, corrections) = match known {
        None => (vec![0.0; weights.len()], vec![0.0; weights.len()]),
        Some(estimate) => {
            let corrections = whole.residual_corrections(u, &smoothing, &mut scratch);
            let corrections = corrections.map_err(|_| OptimError::NothingEvaluated)?;
            (estimate.residual_errors.iter().map(|e| STUDENT_DEVIATION * e).collect(), corrections)
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
            moduli.residuals.iter_mut().zip(&corrections).for_each(|(r, correction)| *r += correction);
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

/// The best trial, with its end.
///
/// # Errors
/// When none is polished.
pub fn best(trials: &[Trial]) -> Result<(&Trial, &Polished), OptimError> {
    let best = trials.iter().find(|trial| trial.leads).ok_or(OptimError::NothingEvaluated)?;
    Ok((best, best.polished.as_ref().ok_or(OptimError::NothingEvaluated)?))
}

/// Moves the best trial to the end `next` of a later descent, at which it is polished next.
pub fn extend_best(trials: &mut [Trial], next: &Polished) {
    for polished in trials.iter_mut().filter(|trial| trial.leads).filter_map(|t| t.polished.as_mut()) {
        *polished = polished.followed_by(next);
    }
}

/// Index of the polished trial with the least upper end of the error bar, of which the share `error_weight`
/// counts: where f_q hardly differs, what is known best is the better choice.
fn leader(trials: &[Trial], error_weight: f64) -> Result<usize, OptimError> {
    let most = |p: &Polished| {
        let e = &p.estimate;
        e.evaluation.f_q + error_weight * (e.half_width + BIAS_LEFT * e.correction.abs())
    };
    let polished = trials.iter().enumerate().filter_map(|(i, t)| Some((i, most(t.polished.as_ref()?))));
    let least = polished.min_by(|a, b| a.1.total_cmp(&b.1));
    least.map(|(i, _)| i).ok_or(OptimError::NothingEvaluated)
}
