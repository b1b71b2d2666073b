//! Many starts on the basis: screened cheaply, few polished.
//!
//! Starts are the given ones and points of a low-discrepancy set. All are
//! measured on a reduced picture; the best of them that lie apart descend there;
//! the best of what these find descend on the whole picture, with less and less
//! smoothing, and the best of them at last settles in the kinks of f_q. All descents move in
//! [coordinates](super::coordinates) in which a light keeps its flux. What wins is the least
//! f_q, unsmoothed and freed of noise bias.

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

/// Starts nearer than this to a better one in all directions, in units of half the
/// box, do not descend.
const APART: f64 = 0.2;
/// Evaluations of each stage of a descent, and of what settles it in the kinks.
const EVALUATIONS: u32 = 40;
const SETTLE_EVALUATIONS: u32 = 30;
/// Change of f_q below which it is settled.
const SETTLED: f64 = 1e-5;

/// Evaluations of a search over the whole box.
const GLOBAL_EVALUATIONS: u32 = 20_000;

/// A start and what became of it.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Where it comes from.
    pub name: String,
    /// The start.
    pub start: Vec<f64>,
    /// Smoothed f_q of the start on the reduced picture.
    pub screened: f64,
    /// Its descent on the whole picture, if it was among the best.
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
    fn new(whole: &Evaluator, descent: Descent) -> Result<Self, OptimError> {
        let Descent { u, evaluations, stop, .. } = descent;
        let estimate = whole.estimate(&u, LABELLINGS).map_err(|_| OptimError::NothingEvaluated)?;
        Ok(Self { u, estimate, evaluations, stop })
    }

    /// The end of a later descent, with the evaluations of both.
    #[must_use]
    pub fn followed_by(&self, next: &Self) -> Self {
        Self { evaluations: [self.evaluations.clone(), next.evaluations.clone()].concat(), ..next.clone() }
    }
}

/// Smoothing and the largest component of the first trial step of the stages.
const STAGES: [(f64, f64); 2] = [(Smoothing::DELTA_FIRST, 0.1), (5e-3, 0.02)];

/// Where a search looks, and how hard.
#[derive(Clone, Debug)]
pub struct Within {
    center: Vec<f64>,
    /// Half the side of the box around it, cut to the unit cube.
    radius: f64,
    /// Points of the low-discrepancy set.
    n_points: u32,
    /// Starts that descend on the reduced picture, and that go on to the whole one.
    n_coarse: usize,
    n_fine: usize,
    /// Whether the first start descends in any case.
    keeps_first: bool,
}

impl Within {
    /// The whole unit cube of `n` dimensions.
    #[must_use]
    pub fn everywhere(n: usize) -> Self {
        Self { center: vec![0.5; n], radius: 0.5, n_points: 512, n_coarse: 16, n_fine: 4, keeps_first: false }
    }

    /// What lies around a point: kinks end a descent early, and beyond one of them
    /// there may be a better end.
    #[must_use]
    pub fn around(u: &[f64]) -> Self {
        Self { center: u.to_vec(), radius: 0.15, n_points: 64, n_coarse: 8, n_fine: 3, keeps_first: true }
    }

    fn point(&self, i: u32, seed: u32) -> Vec<f64> {
        let at = |(d, c): (usize, &f64)| {
            let s = f64::from(sobol_burley::sample(i, d as u32 % 256, seed));
            (c + self.radius * (2.0 * s - 1.0)).clamp(0.0, 1.0)
        };
        self.center.iter().enumerate().map(at).collect()
    }

    /// The first of the points in their order that lie apart, `count` at most.
    fn apart<'a>(&self, points: impl Iterator<Item = (usize, &'a [f64])>, count: usize) -> Vec<usize> {
        let mut kept: Vec<(usize, &[f64])> = Vec::new();
        for (i, p) in points {
            let far = |q: &[f64]| p.iter().zip(q).any(|(a, b)| (a - b).abs() > APART * self.radius);
            if kept.len() < count && kept.iter().all(|(_, q)| far(q)) {
                kept.push((i, p));
            }
        }
        kept.into_iter().map(|(i, _)| i).collect()
    }
}

/// Searches from `starts` and from a low-discrepancy set; `reduced` is the same
/// problem on a smaller picture. The trials come back in the order of their
/// starts; at least one is polished.
///
/// # Errors
/// When NLopt fails, or f_q is not a number.
pub fn search(
    whole: &Evaluator,
    reduced: &Evaluator,
    starts: &[(String, Vec<f64>)],
    within: &Within,
    seed: u32,
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Vec<Trial>, OptimError> {
    let spread = (0..within.n_points).map(|i| (format!("spread {i}"), within.point(i, seed)));
    let mut trials: Vec<Trial> = starts
        .iter()
        .cloned()
        .chain(spread)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map_init(Scratch::default, |scratch, (name, start)| {
            let smoothing = Smoothing::with_delta(Smoothing::DELTA_FIRST);
            let screened = reduced.evaluate(&start, &smoothing, None, scratch).unwrap_or(f64::INFINITY);
            Trial { name, start, screened, polished: None }
        })
        .collect();

    let mut order: Vec<usize> = (0..trials.len()).collect();
    let ahead = |i: usize| within.keeps_first && i == 0;
    order.sort_by(|&a, &b| ahead(b).cmp(&ahead(a)).then(trials[a].screened.total_cmp(&trials[b].screened)));
    let chosen = within.apart(order.iter().map(|&i| (i, trials[i].start.as_slice())), within.n_coarse);
    let mut coarse: Vec<(usize, Vec<f64>, f64)> = chosen
        .into_par_iter()
        .map(|i| {
            let descent = descend(reduced, &trials[i].start, &STAGES, cancelled)?;
            Ok((i, descent.u, descent.best))
        })
        .collect::<Result<_, OptimError>>()?;
    coarse.sort_by(|a, b| ahead(b.0).cmp(&ahead(a.0)).then(a.2.total_cmp(&b.2)));
    let chosen = within.apart(coarse.iter().enumerate().map(|(k, c)| (k, c.1.as_slice())), within.n_fine);
    let polished: Vec<(usize, Polished)> = chosen
        .into_par_iter()
        .map(|k| {
            let (i, u, _) = &coarse[k];
            Ok((*i, Polished::new(whole, descend(whole, u, &STAGES[1..], cancelled)?)?))
        })
        .collect::<Result<_, OptimError>>()?;
    for (i, p) in polished {
        trials[i].polished = Some(p);
    }
    if let Some(best) = leader(&trials).and_then(|i| trials[i].polished.as_mut()) {
        *best = best.followed_by(&Polished::new(whole, settle(whole, &best.u, cancelled)?)?);
    }
    Ok(trials)
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

/// Descends from `u` on the whole picture, and settles in the kinks of f_q there.
///
/// # Errors
/// As [`search`].
pub fn refine(
    whole: &Evaluator,
    u: &[f64],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Polished, OptimError> {
    let descent = descend(whole, u, &STAGES[1..], cancelled)?;
    let mut settled = settle(whole, &descent.u, cancelled)?;
    settled.evaluations.splice(0..0, descent.evaluations);
    Polished::new(whole, settled)
}

struct Descent {
    u: Vec<f64>,
    best: f64,
    evaluations: Vec<(Vec<f64>, f64, f64)>,
    stop: StopReason,
}

fn descend(
    evaluator: &Evaluator,
    start: &[f64],
    stages: &[(f64, f64)],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Descent, OptimError> {
    let n = start.len();
    let mut scratch = Scratch::default();
    let mut out = Descent {
        u: start.to_vec(),
        best: f64::INFINITY,
        evaluations: Vec::new(),
        stop: StopReason::NoProgress,
    };
    for (delta, first_step) in stages {
        let smoothing = Smoothing::with_delta(*delta);
        let mut scale = None;
        let options = optim::Options {
            max_evaluations: Some(EVALUATIONS),
            f_tol_abs: 1e-6,
            x_tol_abs: 1e-5,
            ..Default::default()
        };
        let log = &mut out.evaluations;
        let coordinates = Coordinates::around(&out.u, evaluator.variables);
        let outcome = optim::minimize(&out.u, &vec![0.0; n], &vec![1.0; n], &options, |y, gradient| {
            if cancelled() {
                return ControlFlow::Break(Interrupt);
            }
            let u = &coordinates.to_cube(y);
            let mut g = vec![0.0; n];
            let f = evaluator.evaluate(u, &smoothing, Some(&mut g), &mut scratch).unwrap_or(f64::NAN);
            log.push((u.to_vec(), f, g.iter().map(|g| g * g).sum::<f64>().sqrt()));
            coordinates.pull_back(y, u, &mut g);
            let steepest = g.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            let c = *scale.get_or_insert(if steepest > *first_step { first_step / steepest } else { 1.0 });
            for (out, g) in gradient.iter_mut().zip(g) {
                *out = c * g;
            }
            ControlFlow::Continue(c * f)
        });
        match outcome {
            Ok(outcome) => {
                out.u = coordinates.to_cube(&outcome.x);
                out.best = outcome.f / scale.unwrap_or(1.0);
                out.stop = outcome.stop;
            }
            Err(OptimError::NothingEvaluated) => {
                out.stop = StopReason::Interrupted;
                break;
            }
            Err(e) => return Err(e),
        }
    }
    Ok(out)
}

/// Goes on from where a descent ended, into the kinks of the terms' moduli and along them.
fn settle(
    whole: &Evaluator,
    u: &[f64],
    cancelled: &(impl Fn() -> bool + Sync),
) -> Result<Descent, OptimError> {
    let stop = StopReason::Interrupted;
    let mut out = Descent { u: u.to_vec(), best: f64::INFINITY, evaluations: Vec::new(), stop };
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
    let weights = whole.objective.scalar_weights();
    let mut scratch = Scratch::default();
    let coordinates = Coordinates::around(&out.u, whole.variables);
    let log = &mut out.evaluations;
    let outcome = optim::minimize_moduli(&out.u, &weights, SETTLED, SETTLE_EVALUATIONS, |y, moduli| {
        let u = &coordinates.to_cube(y);
        if cancelled() || whole.residuals(u, &smoothing, moduli, &mut scratch).is_err() {
            return ControlFlow::Break(Interrupt);
        }
        log.push((u.to_vec(), moduli.value(&weights), moduli.slope(&weights)));
        moduli.gradients().for_each(|gradient| coordinates.pull_back(y, u, gradient));
        ControlFlow::Continue(())
    });
    match outcome {
        Ok(outcome) => {
            Ok(Descent { u: coordinates.to_cube(&outcome.x), best: outcome.f, stop: outcome.stop, ..out })
        }
        Err(OptimError::NothingEvaluated) => Ok(out),
        Err(e) => Err(e),
    }
}

/// Evaluations on the whole picture.
#[must_use]
pub fn evaluations(trials: &[Trial]) -> u32 {
    trials.iter().filter_map(|t| t.polished.as_ref()).map(|p| p.evaluations.len() as u32).sum()
}

/// The polished trial with the least f_q.
#[must_use]
pub fn best(trials: &[Trial]) -> Option<(&Trial, &Polished)> {
    let leader = &trials[leader(trials)?];
    Some((leader, leader.polished.as_ref()?))
}

fn leader(trials: &[Trial]) -> Option<usize> {
    let f_q = |t: &Trial| t.polished.as_ref().map(|p| p.estimate.evaluation.f_q);
    let polished = trials.iter().enumerate().filter_map(|(i, t)| Some((i, f_q(t)?)));
    polished.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}
