//! Range of each term within reach of a scene's lights, and what to say of it.

use std::ops::ControlFlow;

use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{
    evaluator::{Evaluator, Scratch},
    search::spread,
};
use crate::{
    objective::{Evaluation, ObjectiveError, Smoothing, Term, TermValue},
    optim,
    variables::ParamVector,
};

/// Points of the box at which all terms are measured: more see more of the range, each for an estimate on
/// the reduced picture. 256 and then 128 were used before, and given up for time.
const N_POINTS: u32 = 64;
/// Evaluations of the descent of a term alone: more find lower ends. 30 and then 20 were used before, and
/// given up for time; the lights found are counted in, since so short a descent may miss them.
const EVALUATIONS: u32 = 12;
/// Largest component of the first trial step of that descent, as in those of f_q: without a limit a steep
/// term jumps to a corner of the box and its few evaluations are spent on the way back.
const FIRST_STEP: f64 = 0.1;
/// Smoothing of that descent, as in the last stage of those of f_q on the reduced picture.
const DELTA: f64 = 5e-3;
/// Share of its target below which the object's mean luminance is called almost black. Set by reasoning, as
/// the next two.
const DARK: f64 = 0.4;
/// Target of the object's mean luminance above which a dark object is not what was meant.
const BRIGHT_TARGET: f64 = 0.1;
/// f of the histogram up to which it is called met.
const MET: f64 = 0.3;
/// Least f of a term by itself above which the user is told: less is within the error of most estimates.
/// Set by reasoning.
const NOTABLE: f64 = 0.02;

/// Range of a term within reach of the lights.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Reach {
    /// The term.
    #[serde(skip)]
    pub term: Term,
    /// Target of the term's measured value.
    pub target: f64,
    /// Least f of the term that was found, whatever the other terms; 0 if the measured value can meet its
    /// target.
    pub floor: f64,
    /// Least measured value found.
    pub least: f64,
    /// Largest measured value found.
    pub largest: f64,
}

/// Range of each term over the box of the variables.
///
/// All terms are measured on the `reduced` picture at the points of a low-discrepancy set, and each
/// descends by itself from its best point. The best points, and the lights `found`, are then measured on
/// the whole picture, where each distance between distributions descends once more. A measured value that
/// can lie on both sides of its target can also meet it, since it is continuous over the box.
///
/// # Errors
/// With too few replicates.
pub fn reach(
    whole: &Evaluator,
    reduced: &Evaluator,
    found: &[f64],
    seed: u32,
) -> Result<Vec<Reach>, ObjectiveError> {
    let measure = |evaluator: &Evaluator, points: Vec<Vec<f64>>| {
        let estimates = evaluator.estimates(&points.iter().map(Vec::as_slice).collect::<Vec<_>>(), 1)?;
        let evaluations = estimates.into_iter().map(|e| e.evaluation);
        Ok::<_, ObjectiveError>(points.into_iter().zip(evaluations).collect::<Vec<_>>())
    };
    let points = measure(reduced, spread(N_POINTS, whole.variables.len(), seed).collect())?;
    let terms: Vec<Term> = whole.objective.listed().collect();
    let candidates: Vec<Vec<f64>> = terms
        .par_iter()
        .flat_map(|&term| {
            let by = |key: fn(&TermValue) -> f64| {
                let least = points.iter().min_by(|a, b| key(&a.1[term]).total_cmp(&key(&b.1[term])));
                least.map(|(u, _)| u.clone())
            };
            let start = by(|t| t.f);
            let end = start.as_ref().and_then(|start| descend(reduced, term, start));
            [start, end, by(|t| t.value), by(|t| -t.value)]
        })
        .flatten()
        .chain([found.to_vec()])
        .collect();
    // Many points are best for several terms.
    let mut different: Vec<Vec<f64>> = Vec::new();
    for u in candidates {
        if !different.contains(&u) {
            different.push(u);
        }
    }
    let mut measured = measure(whole, different)?;
    for &distance in terms.iter().filter(|term| term.is_distance()) {
        let best = measured.iter().min_by(|a, b| a.1[distance].f.total_cmp(&b.1[distance].f));
        let last = best.and_then(|(u, _)| descend(whole, distance, u));
        measured.extend(measure(whole, last.into_iter().collect())?);
    }
    let of = |term: Term| {
        let terms = || measured.iter().map(move |(_, e)| &e[term]);
        let target = measured[0].1[term].target;
        let least = terms().map(|t| t.value).fold(f64::INFINITY, f64::min);
        let largest = terms().map(|t| t.value).fold(f64::NEG_INFINITY, f64::max);
        let floor = terms().map(|t| t.f).fold(f64::INFINITY, f64::min);
        let is_crossed = (least..=largest).contains(&target);
        Reach { term, target, floor: if is_crossed { 0.0 } else { floor }, least, largest }
    };
    Ok(terms.into_iter().map(of).collect())
}

/// End of a descent from `start` by one term alone; `None` if the search fails.
fn descend(evaluator: &Evaluator, term: Term, start: &[f64]) -> Option<Vec<f64>> {
    let objective = evaluator.objective.only(term);
    let alone = Evaluator { objective: &objective, ..*evaluator };
    let smoothing = Smoothing::with_delta(DELTA);
    let options = optim::Options {
        max_evaluations: Some(EVALUATIONS),
        first_step: Some(FIRST_STEP),
        ..Default::default()
    };
    let (mut scratch, n) = (Scratch::of_descent(), start.len());
    let outcome = optim::minimize(start, &vec![0.0; n], &vec![1.0; n], &options, |u, gradient| {
        let f = alone.evaluate(u, &smoothing, Some(gradient), &mut scratch).unwrap_or(f64::NAN);
        ControlFlow::Continue(f)
    });
    outcome.ok().map(|o| o.x)
}

/// The ranges as a JSON object, by the names of the terms.
#[must_use]
pub fn to_json(reach: &[Reach]) -> Value {
    let entries: Map<String, Value> = reach.iter().map(|r| (r.term.name().to_owned(), json!(r))).collect();
    entries.into()
}

/// A sentence about each term that the lights cannot bring to its target.
#[must_use]
pub fn in_words(reach: &[Reach]) -> Vec<String> {
    reach
        .iter()
        .filter(|r| r.floor > NOTABLE)
        .map(|r| {
            let (name, floor) = (r.term.words(), r.floor);
            if r.term.is_distance() {
                return format!("{name} is at least {floor:.3} with these lights");
            }
            let (bound, reached) = if r.least > r.target { ("at least", r.least) } else { ("at most", r.largest) };
            let why = r.term.beyond_all_pictures(r.target).map(|why| format!("; {why}")).unwrap_or_default();
            let term = r.term.name();
            format!("{name} is {bound} {reached:.3} with these lights, {:.3} is wanted: {term} stays at {floor:.3} or more{why}", r.target)
        })
        .collect()
}

/// Advice about a result that meets the histogram by darkness alone; `None` for a result that shows its
/// object.
#[must_use]
pub fn degenerate(result: &Evaluation, variables: &ParamVector, x: &[f64]) -> Option<String> {
    let (object, histogram) = (result.get(Term::MeanObj)?, result.get(Term::Hist)?);
    let is_dark = object.value < DARK * object.target && object.target > BRIGHT_TARGET;
    if !is_dark || histogram.f > MET {
        return None;
    }
    let mut at = variables.variables.iter().zip(x);
    let advice = if at.clone().all(|(v, _)| v.kind.keyword() != "background") {
        "let the background's value vary (--free, or a background material in the sidecar)".to_owned()
    } else {
        at.find_map(|(v, &x)| v.advice_for_darkness(x)).unwrap_or_else(|| {
            "move or narrow a light, so that it lights the object and not the background".to_owned()
        })
    };
    Some(format!(
        "the object is almost black (mean {:.3}, {:.3} wanted): the histogram is met by darkness; {advice}",
        object.value, object.target
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reach(term: Term, target: f64, floor: f64, least: f64, largest: f64) -> Reach {
        Reach { term, target, floor, least, largest }
    }

    #[test]
    fn only_what_cannot_be_reached_is_said_and_why() {
        let words = in_words(&[
            reach(Term::MeanObj, 0.47, 0.0, 0.0, 0.9),
            reach(Term::MeanBack, 0.04, 0.1, 0.14, 0.9),
            reach(Term::VarObj, 0.63, 0.5, 0.0, 0.31),
            reach(Term::Hist, 0.0, 0.2, 0.2, 0.8),
        ]);
        assert_eq!(words.len(), 3);
        assert!(
            words[0].contains("is at least 0.140") && words[0].contains("0.040 is wanted"),
            "{}",
            words[0]
        );
        assert!(words[1].contains("at most 0.310") && words[1].contains("no picture has one above 0.5"));
        assert!(words[2].contains("at least 0.200"));
    }
}
