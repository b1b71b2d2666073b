//! Choice of a rig: which of a carrier's lamps, and how bright.
//!
//! From darkness, or from the scene's own lights, lamps are added one by one. A lamp's price is the least f_q over
//! a few radiances of it with the others as they are or weaker: in a black picture most derivatives vanish, and
//! f_q is not convex. The cheapest descend in all radiances; several rigs of each number go on. Then each lamp
//! in turn is exchanged for every other one while f_q falls. A rig has as few lamps as it takes: each must gain
//! more than the tolerance.

use rayon::prelude::*;

use super::carrier::{Candidate, Carrier, Part};
use crate::{
    design::{
        evaluator::Scratch,
        search::{descend, value},
    },
    lighting::Lighting,
    objective::{Objective, Smoothing},
    optim::OptimError,
    variables::Variable,
};

/// Radiances at which a lamp is priced, in the optimiser's units: the middle ones show what it lights at half
/// to nine tenths of white.
const LEVELS: [f64; 6] = [0.1, 0.18, 0.27, 0.38, 0.52, 0.7];
/// Factors on the optimiser's values of the other lamps' radiances at which a lamp is priced.
const OTHERS: [f64; 2] = [1.0, 0.7];
/// Values of the background at which a first lamp is priced, in the optimiser's units.
const VALUES: [f64; 3] = [0.08, 0.35, 0.8];
/// Smoothing of f_q at which lamps are priced.
const PRICED: Smoothing = Smoothing::with_delta(0.02);
/// Rigs of each number of lamps that go on.
const RIGS: usize = 3;
/// Lamps that are tried with each of them: the cheapest.
const TRIED: usize = 6;
/// Lamps that are tried in the place of another.
const EXCHANGED: usize = 4;
/// Rounds of exchanges at most: each needs a gain.
const MAX_EXCHANGES: usize = 6;
/// Gain in f_q below which a lamp stays where it is: a tenth of the tolerance that runs have by
/// default.
const LEAST_GAIN: f64 = 5e-4;

/// Lights of a carrier that shine, with the point of the unit cube of their variables.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Indices of the lights: the scene's own first, then the lamps.
    pub lights: Vec<usize>,
    /// Point of the unit cube of the variables of [`Carrier::part`].
    pub u: Vec<f64>,
    /// f_q on the pictures of the carrier, corrected for noise bias.
    pub f_q: f64,
}

/// What a lamp would do that is added to a rig.
#[derive(Clone, Copy, Debug)]
pub struct Offer {
    /// Index of the lamp among all lights.
    pub light: usize,
    /// f_q with the lamp at the best radiance of those at which lamps are priced, or without it.
    pub f_q: f64,
    /// That radiance, W·m⁻²·sr⁻¹.
    pub radiance: f64,
    /// Change of f_q by a little light of the lamp.
    pub change: f64,
}

/// Search for a rig of one look on a carrier.
pub struct Chooser<'a, L, C> {
    /// The lamps.
    pub carrier: &'a Carrier<L>,
    /// Objectives of the whole pictures and of the reduced ones.
    pub objectives: [Objective; 2],
    /// Whether the search must end.
    pub cancelled: &'a C,
}

impl<L: Candidate + Sync, C: Fn() -> bool + Sync> Chooser<'_, L, C> {
    /// The best rigs of up to `most` lamps more than those of `start`, one for each number of lamps; fewer where
    /// there is no other lamp. The first has no lamp more, unless there is no light at all.
    ///
    /// # Errors
    /// When NLopt fails.
    pub fn rigs(&self, start: &Choice, most: usize) -> Result<Vec<Choice>, OptimError> {
        let mut rigs = vec![start.clone()];
        let mut best = Vec::new();
        if !start.lights.is_empty() {
            rigs = vec![self.exchanged(self.polished(start.lights.clone(), &start.u)?)?];
            best.clone_from(&rigs);
        }
        for _ in 0..most {
            let next = self.extended(&rigs)?;
            let Some(first) = next.first() else { break };
            best.push(self.exchanged(first.clone())?);
            rigs = next;
            rigs[0] = best[best.len() - 1].clone();
        }
        Ok(best)
    }

    /// Some lights with the radiances and the value of the background of a lighting.
    #[must_use]
    pub fn choice(&self, lights: Vec<usize>, lighting: &Lighting) -> Choice {
        let part = self.carrier.part(&lights);
        let mut lighting = lighting.clone();
        let u = part.variables.variables.iter().map(|v| v.encode(*v.kind.value(&mut lighting, v.light)));
        Choice { u: u.collect(), lights, f_q: f64::INFINITY }
    }

    /// The best rigs of one lamp more than some rigs have, best first.
    fn extended(&self, rigs: &[Choice]) -> Result<Vec<Choice>, OptimError> {
        let mut tried: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
        for rig in rigs {
            for (lights, u) in self.cheapest(rig, None, TRIED) {
                if tried.iter().all(|(other, _)| !is_same_set(other, &lights)) {
                    tried.push((lights, u));
                }
            }
        }
        let mut next = self.all_polished(tried)?;
        next.truncate(RIGS);
        Ok(next)
    }

    /// Rigs of one lamp more than a rig has: the `count` that cost least, best first.
    ///
    /// # Errors
    /// When NLopt fails.
    pub fn with_one_more(&self, rig: &Choice, count: usize) -> Result<Vec<Choice>, OptimError> {
        self.all_polished(self.cheapest(rig, None, count))
    }

    /// Lights and their points, each after a descent, best first.
    fn all_polished(&self, tried: Vec<(Vec<usize>, Vec<f64>)>) -> Result<Vec<Choice>, OptimError> {
        let ends = tried.into_par_iter().map(|(lights, u)| self.polished(lights, &u));
        let mut ends = ends.collect::<Result<Vec<_>, _>>()?;
        ends.sort_by(|a, b| a.f_q.total_cmp(&b.f_q));
        Ok(ends)
    }

    /// The rigs with one lamp more that cost least, each with its point, at most `count`; the lamp is one that
    /// stands for the scene's own light `of`, or for none.
    fn cheapest(&self, rig: &Choice, of: Option<usize>, count: usize) -> Vec<(Vec<usize>, Vec<f64>)> {
        let is_free = |c: &usize| !rig.lights.contains(c) && self.carrier.lamp(*c).of() == of;
        let priced = self.carrier.candidates().into_par_iter().filter(is_free);
        let priced = priced.map(|candidate| {
            let mut lights = rig.lights.clone();
            lights.push(candidate);
            let (u, price) = self.price(&lights, rig);
            (lights, u, price)
        });
        let mut priced: Vec<(Vec<usize>, Vec<f64>, f64)> = priced.collect();
        priced.sort_by(|a, b| a.2.total_cmp(&b.2));
        priced.truncate(count);
        priced.into_iter().map(|(lights, u, _)| (lights, u)).collect()
    }

    /// Least f_q on the reduced pictures over the radiance of the last of `lights`, with the point where it
    /// is; the others are those of `rig`.
    fn price(&self, lights: &[usize], rig: &Choice) -> (Vec<f64>, f64) {
        let part = self.carrier.reduced_part(lights);
        let evaluator = part.evaluator(&self.objectives[1]);
        let mut scratch = Scratch::default();
        let mut best = (Vec::new(), f64::INFINITY);
        for u in starts(&part, lights.len() - 1, rig) {
            let f = value(&evaluator, &u, PRICED.delta, &mut scratch);
            if f < best.1 {
                best = (u, f);
            }
        }
        best
    }

    /// f_q of a rig as it is, and what every lamp would do that is added to it; not a number without lamps.
    #[must_use]
    pub fn offers(&self, rig: &Choice) -> (f64, Vec<Offer>) {
        let candidates = self.carrier.candidates();
        let present = candidates.first().map_or(f64::NAN, |&light| self.with(rig, light, &[0.0])[0].0);
        let offer = |light: usize| {
            let levels = self.with(rig, light, &LEVELS);
            let change = levels[0].0 - present;
            let best = levels.into_iter().fold((present, 0.0), |best, l| if l.0 < best.0 { l } else { best });
            Offer { light, f_q: best.0, radiance: best.1, change }
        };
        (present, candidates.into_par_iter().map(offer).collect())
    }

    /// f_q of the reduced pictures of a rig with one lamp more at some levels, with the lamp's radiance at each.
    fn with(&self, rig: &Choice, light: usize, levels: &[f64]) -> Vec<(f64, f64)> {
        let mut lights = rig.lights.clone();
        lights.push(light);
        let added = lights.len() - 1;
        let part = self.carrier.reduced_part(&lights);
        let evaluator = part.evaluator(&self.objectives[1]);
        let at = |&level: &f64| {
            let mut rest = rig.u.iter().copied();
            let variables = part.variables.variables.iter();
            let u: Vec<f64> =
                variables.map(|v| if is_of(v, added) { level } else { rest.next().unwrap_or(0.0) }).collect();
            let f = value(&evaluator, &u, Smoothing::DELTA_LAST, &mut Scratch::default());
            (f, part.lighting(&u).radiance[added])
        };
        levels.iter().map(at).collect()
    }

    /// Descends in all variables of some lights from `u`.
    ///
    /// # Errors
    /// When NLopt fails.
    pub fn polished(&self, lights: Vec<usize>, u: &[f64]) -> Result<Choice, OptimError> {
        let part = self.carrier.part(&lights);
        let evaluator = part.evaluator(&self.objectives[0]);
        // Own lights of which nothing is free have no variables.
        let u = if u.is_empty() { Vec::new() } else { descend(&evaluator, u, self.cancelled)? };
        let f_q = value(&evaluator, &u, Smoothing::DELTA_LAST, &mut Scratch::default());
        Ok(Choice { lights, u, f_q })
    }

    /// The rig with lamps exchanged for others, one at a time, while f_q falls.
    ///
    /// # Errors
    /// When NLopt fails.
    pub fn exchanged(&self, rig: Choice) -> Result<Choice, OptimError> {
        let mut best = rig;
        let n_own = self.carrier.n_own;
        let n = best.lights.len() - n_own;
        if n == 0 {
            return Ok(best);
        }
        let (mut k, mut unchanged) = (0, 0);
        for _ in 0..MAX_EXCHANGES * n {
            if unchanged == n || (self.cancelled)() {
                break;
            }
            let place = n_own + k;
            let rest = self.without(&best, place);
            let of = self.carrier.lamp(best.lights[place]).of();
            let mut tried = self.cheapest(&rest, of, EXCHANGED);
            tried.retain(|(lights, _)| lights.last() != Some(&best.lights[place]));
            match self.all_polished(tried)?.into_iter().next() {
                // The new lamp is the last, and that which follows has its place.
                Some(better) if better.f_q < best.f_q - LEAST_GAIN => (best, unchanged) = (better, 0),
                _ => (k, unchanged) = ((k + 1) % n, unchanged + 1),
            }
        }
        Ok(best)
    }

    /// A rig without its light at `place`.
    fn without(&self, rig: &Choice, place: usize) -> Choice {
        let part = self.carrier.part(&rig.lights);
        let mut lights = rig.lights.clone();
        lights.remove(place);
        let kept = part.variables.variables.iter().zip(&rig.u).filter(|(v, _)| !is_of(v, place));
        Choice { lights, u: kept.map(|(_, u)| *u).collect(), f_q: f64::INFINITY }
    }
}

/// Points at which the lamp that was added to `rig` as its `added`-th light is priced.
fn starts(part: &Part, added: usize, rig: &Choice) -> Vec<Vec<f64>> {
    let variables = &part.variables.variables;
    let is_first = rig.lights.is_empty();
    let values: &[Option<f64>] = &if is_first { VALUES.map(Some).to_vec() } else { vec![None] };
    let is_value = |v: &Variable| v.kind.keyword() == "background";
    let has_value = variables.iter().any(is_value);
    let values = if has_value { values } else { &values[..1] };
    let others = if is_first { &OTHERS[..1] } else { &OTHERS[..] };
    let mut points = Vec::new();
    for level in LEVELS {
        for factor in others {
            for value in values {
                let mut rest = rig.u.iter();
                let u = variables.iter().map(|v| {
                    if is_of(v, added) {
                        return level;
                    }
                    let u = rest.next().copied().unwrap_or(0.0);
                    match value {
                        _ if v.kind.is_of_light() => factor * u,
                        Some(value) if is_value(v) => *value,
                        _ => u,
                    }
                });
                points.push(u.collect());
            }
        }
    }
    points
}

/// Whether a variable is that of the light of an index.
fn is_of(v: &Variable, light: usize) -> bool {
    v.kind.is_of_light() && v.light == light
}

fn is_same_set(a: &[usize], b: &[usize]) -> bool {
    a.len() == b.len() && a.iter().all(|l| b.contains(l))
}

/// The rig of as few lamps as it takes: the first that no larger one beats by more than `tolerance` a lamp.
#[must_use]
pub fn as_few_as_it_takes(rigs: &[Choice], tolerance: f64) -> Option<&Choice> {
    let is_enough = |i: &usize| {
        let later = rigs[i + 1..].iter().enumerate();
        let mut gains = later.map(|(k, rig)| rigs[*i].f_q - rig.f_q - tolerance * (k + 1) as f64);
        gains.all(|gain| gain <= 0.0)
    };
    (0..rigs.len()).find(is_enough).map(|i| &rigs[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rig_has_as_few_lamps_as_it_takes() {
        let rigs = |f: &[f64]| -> Vec<Choice> {
            let rig = |(n, &f_q): (usize, &f64)| Choice { lights: (0..=n).collect(), u: Vec::new(), f_q };
            f.iter().enumerate().map(rig).collect()
        };
        let lamps = |f: &[f64]| as_few_as_it_takes(&rigs(f), 0.01).map(|rig| rig.lights.len());
        assert_eq!(lamps(&[]), None);
        assert_eq!(lamps(&[0.5]), Some(1));
        assert_eq!(lamps(&[0.5, 0.3, 0.295]), Some(2));
        // Neither alone, but both together gain enough.
        assert_eq!(lamps(&[0.5, 0.495, 0.4]), Some(3));
        assert_eq!(lamps(&[0.5, 0.495, 0.485]), Some(1));
        assert_eq!(lamps(&[0.5, 0.6, 0.7]), Some(1));
    }
}
