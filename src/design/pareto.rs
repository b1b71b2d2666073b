//! Fronts between two aims, on a transport basis: lightings of which none is better in both.
//!
//! The ε-constraint method: the first aim descends while the second may not exceed a bound, for bounds from one
//! end of the front to the other. A bound is kept by an augmented Lagrangian, whose multiplier grows in a few
//! rounds. All that was measured on the way may be on the front.
//!
//! # References
//! \[Haimes71\] (ε-constraint); \[Nocedal06\] ch. 17 (augmented Lagrangian).

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    evaluator::{Evaluator, Scratch},
    search::spread,
};
use crate::{
    lighting::Lighting,
    objective::{Objective, ObjectiveError, Smoothing},
    optim,
    transport::LightingGradient,
};

/// Points of the box among which descents find their starts: more find more valleys, each for two estimates.
const N_POINTS: u32 = 1024;
/// Evaluations of each descent at most: those of two dozen variables end before.
const EVALUATIONS: u32 = 40;
/// Rounds of the augmented Lagrangian: after four the bounds of the fruit basket were kept to 1e-3.
const ROUNDS: u32 = 4;
/// Weight of the squared excess over a bound in the first round, and its growth from round to round. With aims of the
/// order of 1 an excess of a tenth counts as much as the aim.
const PENALTY: f64 = 20.0;
/// Growth of that weight.
const GROWTH: f64 = 3.0;
/// Smoothing of the moduli of the terms, by which aims are off at most.
const DELTA: f64 = 5e-4;
/// Largest component of the first trial step.
const FIRST_STEP: f64 = 0.05;
/// Starts of each descent.
const STARTS: usize = 3;

/// What is made small.
#[derive(Clone, Debug)]
pub enum Aim {
    /// f_q of a look, or a term of it alone.
    Look(Box<Objective>),
    /// Power of all lights together, of each at radiance 1 and size 1, and whether it grows with the square of its
    /// size; in units of `unit`, which makes it of the order of 1.
    Power {
        /// Power and growth of each light.
        lights: Vec<(f64, bool)>,
        /// Power that counts as 1.
        unit: f64,
    },
}

/// A lighting with the values of both aims.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontPoint {
    /// Point of the unit cube.
    pub u: Vec<f64>,
    /// Values of the aims, the lower the better.
    pub values: [f64; 2],
}

impl Aim {
    /// Value at the point `u`, with its gradient if wanted; smoothed by [`DELTA`].
    fn evaluate<'a>(
        &'a self,
        on: &Evaluator<'a>,
        u: &[f64],
        gradient: Option<&mut [f64]>,
        scratch: &mut Scratch<'a>,
    ) -> Result<f64, ObjectiveError> {
        match self {
            Self::Look(objective) => {
                Evaluator { objective, ..*on }.evaluate(u, &Smoothing::with_delta(DELTA), gradient, scratch)
            }
            Self::Power { lights, unit } => {
                let x = on.lighting(&on.variables.decode(u));
                if let Some(gradient) = gradient {
                    let mut by_lighting = LightingGradient::zero(x.n_lights());
                    for (l, &(watts, grows)) in lights.iter().enumerate() {
                        let size = if grows { x.size[l] } else { 1.0 };
                        by_lighting.radiance[l] = watts * size * size / unit;
                        by_lighting.size[l] =
                            if grows { 2.0 * watts * size * x.radiance[l] / unit } else { 0.0 };
                    }
                    on.variables.pull_back(u, &x, &by_lighting, gradient);
                }
                Ok(power(lights, &x) / unit)
            }
        }
    }

    /// Values at many points, unsmoothed.
    fn measure(&self, on: &Evaluator, points: &[Vec<f64>]) -> Result<Vec<f64>, ObjectiveError> {
        match self {
            Self::Look(objective) => {
                let points: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
                let estimates = Evaluator { objective, ..*on }.estimates(&points, 1)?;
                Ok(estimates.into_iter().map(|e| e.evaluation.f_q).collect())
            }
            Self::Power { lights, unit } => {
                let of = |u: &Vec<f64>| power(lights, &on.lighting(&on.variables.decode(u))) / unit;
                Ok(points.iter().map(of).collect())
            }
        }
    }
}

/// Power of all lights together.
fn power(lights: &[(f64, bool)], x: &Lighting) -> f64 {
    let of = |(l, &(watts, grows)): (usize, &(f64, bool))| {
        let size = if grows { x.size[l] } else { 1.0 };
        watts * size * size * x.radiance[l]
    };
    lights.iter().enumerate().map(of).sum()
}

/// Values of both aims at many points of the unit cube.
///
/// # Errors
/// With fewer than two replicates.
pub fn measure(
    on: &Evaluator,
    aims: &[Aim; 2],
    points: &[Vec<f64>],
) -> Result<Vec<[f64; 2]>, ObjectiveError> {
    let [a, b] = [aims[0].measure(on, points)?, aims[1].measure(on, points)?];
    Ok(a.into_iter().zip(b).map(|(a, b)| [a, b]).collect())
}

/// The front between two aims with as many bounds, by rising value of the first; `on` has the basis and the
/// variables, its objective does not count.
///
/// # Errors
/// With fewer than two replicates.
pub fn front(
    on: &Evaluator,
    aims: &[Aim; 2],
    bounds: usize,
    seed: u32,
) -> Result<Vec<FrontPoint>, ObjectiveError> {
    let n = on.variables.len();
    let points: Vec<Vec<f64>> =
        std::iter::once(on.variables.start()).chain(spread(N_POINTS, n, seed)).collect();
    let values = measure(on, aims, &points)?;
    let mut known: Vec<FrontPoint> =
        points.into_iter().zip(values).map(|(u, values)| FrontPoint { u, values }).collect();
    let ends = [0, 1].map(|k| Search { on, aims, first: k, bound: f64::INFINITY });
    let found = descended(&ends, &known);
    add(on, aims, &mut known, found)?;
    let least = |known: &[FrontPoint], k: usize| {
        known.iter().min_by(|a, b| a.values[k].total_cmp(&b.values[k])).map_or([0.0; 2], |p| p.values)
    };
    let [low, high] = [least(&known, 1)[1], least(&known, 0)[1]];
    // Twice: the second time from what was found beside.
    for _ in 0..2 {
        let bound = |i: usize| low + (high - low) * (i as f64 + 0.5) / bounds as f64;
        let searches: Vec<Search> =
            (0..bounds).map(|i| Search { on, aims, first: 0, bound: bound(i) }).collect();
        let found = descended(&searches, &known);
        add(on, aims, &mut known, found)?;
    }
    Ok(not_dominated(known))
}

/// Ends of the descents of all searches from their starts.
fn descended(searches: &[Search], known: &[FrontPoint]) -> Vec<Vec<f64>> {
    let of = |search: &Search| {
        let starts = search.starts(known);
        starts.into_iter().map(|start| search.descend(start)).collect::<Vec<_>>()
    };
    searches.par_iter().flat_map_iter(of).collect()
}

/// Measures points and adds them to those known.
fn add(
    on: &Evaluator,
    aims: &[Aim; 2],
    known: &mut Vec<FrontPoint>,
    found: Vec<Vec<f64>>,
) -> Result<(), ObjectiveError> {
    let values = measure(on, aims, &found)?;
    known.extend(found.into_iter().zip(values).map(|(u, values)| FrontPoint { u, values }));
    Ok(())
}

/// Those points of which no other is better in one aim and as good in the other, by rising value of the first.
fn not_dominated(mut points: Vec<FrontPoint>) -> Vec<FrontPoint> {
    let by = |p: &FrontPoint| (p.values[0], p.values[1]);
    points.sort_by(|a, b| by(a).partial_cmp(&by(b)).unwrap_or(std::cmp::Ordering::Equal));
    let mut least = f64::INFINITY;
    points.retain(|p| {
        let is_better = p.values[1] < least;
        least = least.min(p.values[1]);
        is_better
    });
    points
}

/// A descent of one aim while the other keeps a bound.
#[derive(Clone, Copy)]
struct Search<'s, 'a> {
    on: &'s Evaluator<'a>,
    aims: &'s [Aim; 2],
    /// The aim that descends.
    first: usize,
    /// Bound of the other.
    bound: f64,
}

impl Search<'_, '_> {
    /// The best points that keep the bound, and the one that is nearest to it.
    fn starts(&self, known: &[FrontPoint]) -> Vec<Vec<f64>> {
        let (first, other) = (self.first, 1 - self.first);
        let mut inside: Vec<&FrontPoint> = known.iter().filter(|p| p.values[other] <= self.bound).collect();
        inside.sort_by(|a, b| a.values[first].total_cmp(&b.values[first]));
        inside.truncate(STARTS - 1);
        let excess = |p: &&FrontPoint| p.values[first] + 4.0 * (p.values[other] - self.bound).max(0.0);
        let near = known.iter().min_by(|a, b| excess(a).total_cmp(&excess(b)));
        let mut starts: Vec<Vec<f64>> = inside.into_iter().chain(near).map(|p| p.u.clone()).collect();
        starts.dedup();
        starts
    }

    /// The end of the descent from `start`.
    fn descend(&self, start: Vec<f64>) -> Vec<f64> {
        let n = start.len();
        let (mut u, mut multiplier, mut weight) = (start, 0.0, PENALTY);
        let rounds = if self.bound.is_finite() { ROUNDS } else { 1 };
        let options = optim::Options {
            max_evaluations: Some(EVALUATIONS),
            first_step: Some(FIRST_STEP),
            ..Default::default()
        };
        for _ in 0..rounds {
            let (mut first, mut second) = (Scratch::of_descent(), Scratch::of_descent());
            let mut of_other = vec![0.0; n];
            let result = optim::minimize(&u, &vec![0.0; n], &vec![1.0; n], &options, |u, gradient| {
                let [aim, other] = [&self.aims[self.first], &self.aims[1 - self.first]];
                let f = aim.evaluate(self.on, u, Some(&mut *gradient), &mut first).unwrap_or(f64::NAN);
                if !self.bound.is_finite() {
                    return ControlFlow::Continue(f);
                }
                let g = other.evaluate(self.on, u, Some(&mut of_other), &mut second).unwrap_or(f64::NAN);
                // [Nocedal06] eq. 17.65
                let push = (multiplier + weight * (g - self.bound)).max(0.0);
                gradient.iter_mut().zip(&of_other).for_each(|(d, o)| *d += push * o);
                ControlFlow::Continue(f + (push * push - multiplier * multiplier) / (2.0 * weight))
            });
            let Ok(outcome) = result else { break };
            u = outcome.x;
            let mut scratch = Scratch::default();
            let other = self.aims[1 - self.first].evaluate(self.on, &u, None, &mut scratch).unwrap_or(0.0);
            multiplier = f64::max(0.0, multiplier + weight * (other - self.bound));
            weight *= GROWTH;
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_worse_in_both_is_not_on_the_front() {
        let point = |a, b| FrontPoint { u: Vec::new(), values: [a, b] };
        let points =
            vec![point(3.0, 1.0), point(1.0, 3.0), point(2.0, 3.0), point(2.0, 2.0), point(3.0, 1.5)];
        let front: Vec<[f64; 2]> = not_dominated(points).into_iter().map(|p| p.values).collect();
        assert_eq!(front, [[1.0, 3.0], [2.0, 2.0], [3.0, 1.0]]);
    }
}
