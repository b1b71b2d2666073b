//! Fronts between two aims, on a transport basis: lightings of which none is better in both.
//!
//! The ε-constraint method: the first aim descends while the second may not exceed a bound, for bounds from one
//! end of the front to the other. A bound is kept by an augmented Lagrangian, whose multiplier grows in a few
//! rounds. Ends of descents alone may be on the front: points that were measured on the way are as good as their
//! neighbours in nothing but the gaps between those.
//!
//! # References
//! \[Haimes71\] (ε-constraint); \[Nocedal06\] ch. 17 (augmented Lagrangian).

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    coordinates::Coordinates,
    evaluator::{Evaluator, Scratch},
    search::{apart, spread},
};
use crate::{
    lighting::Lighting,
    objective::{Objective, ObjectiveError, Smoothing},
    optim,
    transport::LightingGradient,
};

/// Points of the box among which descents find their starts: more find more valleys, each for two estimates.
const N_POINTS: u32 = 1024;
/// Rounds of the augmented Lagrangian: smoothing δ of the moduli of the terms, by which aims are off at most, and
/// evaluations at most. Straight at the last of them descents stop in the first kink: so high-key alone ended at .160
/// on the fruit basket, where a run finds .143.
const ROUNDS: [(f64, u32); 4] = [(2e-2, 20), (5e-3, 20), (1e-3, 30), (5e-4, 40)];
/// The round with which a descent begins that starts at an end of others.
const NEAR: usize = 2;
/// Weight of the squared excess over a bound in the first round. With aims of the order of 1 an excess of a tenth
/// counts as much as the aim.
const PENALTY: f64 = 20.0;
/// Growth of that weight from round to round.
const GROWTH: f64 = 3.0;
/// Largest component of the first trial step.
const FIRST_STEP: f64 = 0.05;
/// Starts of each descent among the points that keep its bound.
const STARTS: usize = 3;
/// Times that every point of the front is sought again from its neighbours: so a valley that was found under one
/// bound is followed under all.
const FOLLOWED: usize = 2;
/// Part of the distance between bounds by which a point must be better in an aim than others, unless it is hardly
/// worse in the other: of two ends under one bound, each in a valley of its own, one is all but dominated.
const APART: f64 = 0.1;
/// How much more a point may lose in one aim than it gains in the other, in shares of the front, where it gains less
/// than [`APART`].
const WORTH: f64 = 5.0;

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
    /// What a value of 1 stands for: a power in watts, or f_q itself.
    #[must_use]
    pub fn unit(&self) -> f64 {
        match self {
            Self::Look(_) => 1.0,
            Self::Power { unit, .. } => *unit,
        }
    }

    /// Value at the point `u`, with its gradient; `scratch` has the images of `u`.
    fn evaluate<'a>(
        &'a self,
        on: &Evaluator<'a>,
        u: &[f64],
        smoothing: &Smoothing,
        gradient: &mut [f64],
        scratch: &mut Scratch<'a>,
    ) -> Result<f64, ObjectiveError> {
        match self {
            Self::Look(objective) => {
                let on = Evaluator { objective, ..*on };
                on.evaluate_prepared(u, smoothing, Some(gradient), scratch)
            }
            Self::Power { lights, unit } => {
                let x = on.lighting(&on.variables.decode(u));
                let mut by_lighting = LightingGradient::zero(x.n_lights());
                for (l, &(watts, grows)) in lights.iter().enumerate() {
                    let size = if grows { x.size[l] } else { 1.0 };
                    by_lighting.radiance[l] = watts * size * size / unit;
                    by_lighting.size[l] = if grows { 2.0 * watts * size * x.radiance[l] / unit } else { 0.0 };
                }
                on.variables.pull_back(u, &x, &by_lighting, gradient);
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

/// Power of all lights together in a lighting: of each its power at radiance 1 and size 1, W, and whether it grows with
/// the square of its size.
#[must_use]
pub fn power(lights: &[(f64, bool)], x: &Lighting) -> f64 {
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

/// The front between two aims, by rising value of the first, with about as many lightings as `bounds`; `on` has the
/// basis and the variables, its objective does not count. All of them are ends of descents.
///
/// # Errors
/// With fewer than two replicates.
pub fn front(
    on: &Evaluator,
    aims: &[Aim; 2],
    bounds: usize,
    seed: u32,
) -> Result<Vec<FrontPoint>, ObjectiveError> {
    let points = std::iter::once(on.variables.start()).chain(spread(N_POINTS, on.variables.len(), seed));
    let mut known = Known { seen: measured(on, aims, points.collect())?, ends: Vec::new() };
    // Descents from neighbours that were made already: where those stay, they would end at the same point.
    let mut made: Vec<(f64, Vec<f64>)> = Vec::new();
    let search = |first: usize, bound: f64| Search { on, aims, first, bound };
    known.descend([0, 1].map(|k| search(k, f64::INFINITY)))?;
    let [low, high] = [known.least(1)[1], known.least(0)[1]];
    let even = |i: usize| search(0, low + (high - low) * i as f64 / bounds as f64);
    // The least of each aim leaves the other free where it is not alone.
    let edge = search(1, known.least(0)[0]);
    known.descend((0..bounds).map(even).chain([edge]))?;
    // Where the front is flat, the second aim's bounds lie far apart in the first.
    let front = thinned(known.not_dominated(), bounds);
    let step = range(&front, 0) / bounds as f64;
    let between = front.windows(2).flat_map(|pair| {
        let [from, to] = [pair[0].values[0], pair[1].values[0]];
        let n = if step > 0.0 { ((to - from) / step) as usize } else { 0 };
        (1..n).map(move |i| from + (to - from) * i as f64 / n as f64)
    });
    known.descend(between.map(|bound| search(1, bound)))?;
    for _ in 0..FOLLOWED {
        let front = thinned(known.not_dominated(), bounds);
        let starts = |i: usize| {
            let near = front[i.saturating_sub(1)..].iter().take(if i == 0 { 2 } else { 3 });
            near.map(|p| p.u.clone()).collect::<Vec<_>>()
        };
        let mut all = Vec::new();
        for (i, bound) in front.iter().map(|p| p.values[1]).enumerate() {
            let mut new: Vec<(f64, Vec<f64>)> = starts(i).into_iter().map(|u| (bound, u)).collect();
            new.retain(|descent| !made.contains(descent));
            all.push((search(0, bound), new.iter().map(|(_, u)| u.clone()).collect()));
            made.extend(new);
        }
        known.descend_from(all, NEAR)?;
    }
    Ok(thinned(known.not_dominated(), bounds))
}

/// Points that were measured.
struct Known {
    /// Points of the box.
    seen: Vec<FrontPoint>,
    /// Ends of descents.
    ends: Vec<FrontPoint>,
}

impl Known {
    fn all(&self) -> impl Iterator<Item = &FrontPoint> {
        self.ends.iter().chain(&self.seen)
    }

    /// Values of the point with the least of an aim.
    fn least(&self, k: usize) -> [f64; 2] {
        self.all().min_by(|a, b| a.values[k].total_cmp(&b.values[k])).map_or([0.0; 2], |p| p.values)
    }

    /// Adds the ends of searches from the best starts.
    fn descend<'s, 'a: 's>(
        &mut self,
        searches: impl IntoIterator<Item = Search<'s, 'a>>,
    ) -> Result<(), ObjectiveError> {
        let searches = searches.into_iter().map(|search| (search, search.starts(self))).collect();
        self.descend_from(searches, 0)
    }

    /// Adds the ends of searches, each from some starts, with the rounds from one on.
    fn descend_from(
        &mut self,
        searches: Vec<(Search, Vec<Vec<f64>>)>,
        round: usize,
    ) -> Result<(), ObjectiveError> {
        let Some(&(Search { on, aims, .. }, _)) = searches.first() else { return Ok(()) };
        let of = |(search, starts): &(Search, Vec<Vec<f64>>)| -> Vec<Vec<f64>> {
            starts.iter().map(|start| search.descend(start.clone(), &ROUNDS[round..])).collect()
        };
        let found = searches.par_iter().flat_map_iter(of).collect();
        self.ends.extend(measured(on, aims, found)?);
        Ok(())
    }

    /// Ends of descents of which none is dominated by another, by rising value of the first aim.
    fn not_dominated(&self) -> Vec<FrontPoint> {
        not_dominated(self.ends.clone())
    }
}

/// Points with the values of both aims.
fn measured(
    on: &Evaluator,
    aims: &[Aim; 2],
    points: Vec<Vec<f64>>,
) -> Result<Vec<FrontPoint>, ObjectiveError> {
    let values = measure(on, aims, &points)?;
    Ok(points.into_iter().zip(values).map(|(u, values)| FrontPoint { u, values }).collect())
}

/// Points of which none is dominated by another, which is better in one aim and as good in the other, by rising value
/// of the first aim.
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

/// Extent of a front in an aim.
fn range(front: &[FrontPoint], k: usize) -> f64 {
    front.first().zip(front.last()).map_or(0.0, |(a, b)| (b.values[k] - a.values[k]).abs())
}

/// A front without the points that another all but dominates, and without those that are all but another; its ends
/// stay.
fn thinned(front: Vec<FrontPoint>, bounds: usize) -> Vec<FrontPoint> {
    let ranges = [0, 1].map(|k| range(&front, k).max(f64::MIN_POSITIVE));
    let apart = APART / bounds as f64;
    let shares = |a: &FrontPoint, b: &FrontPoint| -> [f64; 2] {
        std::array::from_fn(|k| (a.values[k] - b.values[k]) / ranges[k])
    };
    // How much the first is better in an aim and worse in the other.
    let is_worth_it = |p: &FrontPoint, q: &FrontPoint| {
        let [a, b] = shares(p, q);
        let (gain, loss) = (-a.min(b), a.max(b));
        gain >= apart || loss <= WORTH * gain
    };
    let last = front.len().saturating_sub(1);
    let mut kept: Vec<FrontPoint> = Vec::new();
    for (i, p) in front.iter().enumerate() {
        let is_end = i == 0 || i == last;
        let is_new = kept.last().is_none_or(|q| shares(p, q).iter().any(|d| d.abs() >= apart));
        if is_end || (is_new && front.iter().all(|q| q == p || is_worth_it(p, q))) {
            kept.push(p.clone());
        }
    }
    kept
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
    /// The best points that keep the bound and lie apart, and the one that is nearest to it.
    fn starts(&self, known: &Known) -> Vec<Vec<f64>> {
        let (first, other) = (self.first, 1 - self.first);
        let mut inside: Vec<&FrontPoint> = known.all().filter(|p| p.values[other] <= self.bound).collect();
        inside.sort_by(|a, b| a.values[first].total_cmp(&b.values[first]));
        let chosen = apart(inside.iter().enumerate().map(|(i, p)| (i, p.u.as_slice())), STARTS);
        let excess = |p: &&FrontPoint| p.values[first] + 4.0 * (p.values[other] - self.bound).max(0.0);
        let near = known.all().min_by(|a, b| excess(a).total_cmp(&excess(b)));
        let mut starts: Vec<Vec<f64>> =
            chosen.into_iter().map(|i| inside[i]).chain(near).map(|p| p.u.clone()).collect();
        starts.dedup();
        starts
    }

    /// The end of the descent from `start` in some rounds.
    fn descend(&self, start: Vec<f64>, rounds: &[(f64, u32)]) -> Vec<f64> {
        let n = start.len();
        let (mut u, mut multiplier, mut weight) = (start, 0.0, PENALTY);
        let mut of_other = vec![0.0; n];
        for &(delta, evaluations) in rounds {
            let smoothing = Smoothing::with_delta(delta);
            let options = optim::Options {
                max_evaluations: Some(evaluations),
                first_step: Some(FIRST_STEP),
                ..Default::default()
            };
            let mut scratch = Scratch::of_descent();
            let coordinates = Coordinates::around(&u, self.on.variables);
            let result = optim::minimize(&u, &vec![0.0; n], &vec![1.0; n], &options, |y, gradient| {
                let u = &coordinates.to_cube(y);
                self.on.prepare(u, true, &mut scratch);
                let f = self.value(self.first, u, &smoothing, gradient, &mut scratch);
                let mut lagrangian = f;
                if self.bound.is_finite() {
                    let g = self.value(1 - self.first, u, &smoothing, &mut of_other, &mut scratch);
                    // [Nocedal06] eq. 17.65
                    let push = (multiplier + weight * (g - self.bound)).max(0.0);
                    gradient.iter_mut().zip(&of_other).for_each(|(d, o)| *d += push * o);
                    lagrangian += (push * push - multiplier * multiplier) / (2.0 * weight);
                }
                coordinates.pull_back(y, u, gradient);
                ControlFlow::Continue(lagrangian)
            });
            let Ok(outcome) = result else { break };
            u = coordinates.to_cube(&outcome.x);
            if self.bound.is_finite() {
                self.on.prepare(&u, true, &mut scratch);
                let other = self.value(1 - self.first, &u, &smoothing, &mut of_other, &mut scratch);
                multiplier = f64::max(0.0, multiplier + weight * (other - self.bound));
                weight *= GROWTH;
            }
        }
        u
    }

    /// Value of an aim at `u`, with its gradient.
    fn value<'a>(
        &'a self,
        k: usize,
        u: &[f64],
        smoothing: &Smoothing,
        gradient: &mut [f64],
        scratch: &mut Scratch<'a>,
    ) -> f64 {
        self.aims[k].evaluate(self.on, u, smoothing, gradient, scratch).unwrap_or(f64::NAN)
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

    #[test]
    fn what_gains_next_to_nothing_for_much_is_left_out() {
        let of = |values: [[f64; 2]; 5]| {
            let front = values.map(|values| FrontPoint { u: Vec::new(), values }).to_vec();
            thinned(front, 10).into_iter().map(|p| p.values).collect::<Vec<_>>()
        };
        let even = [[0.0, 1.0], [0.2, 0.7], [0.5, 0.5], [0.7, 0.3], [1.0, 0.0]];
        assert_eq!(of(even), even);
        // The third gains .001 on the second for .2; the fourth is the third.
        let found = of([[0.0, 1.0], [0.2, 0.7], [0.4, 0.699], [0.401, 0.6985], [1.0, 0.0]]);
        assert_eq!(found, [[0.0, 1.0], [0.2, 0.7], [1.0, 0.0]]);
    }
}
