//! Values of the objective and of its terms.

use std::ops::Index;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::terms::{N_TERMS, Statistics, Term};

/// Value of one term at a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TermValue {
    /// The term that was evaluated.
    pub term: Term,
    /// Measured value of a scalar term: mean, σ or g. Of a distance, f itself.
    pub value: f64,
    /// Value that is wanted of a scalar term; 0 of a distance.
    pub target: f64,
    /// Weight of the term in f_q, ≥ 0.
    pub weight: f64,
    /// f_s, the miss relative to the largest that is possible: 0 when the target is met.
    pub f: f64,
}

impl TermValue {
    /// Share of the term in f_q: `weight · f`.
    #[must_use]
    pub fn contribution(&self) -> f64 {
        self.weight * self.f
    }

    /// Measured value less its target, relative to the largest possible miss: signed.
    #[must_use]
    pub fn residual(&self) -> f64 {
        (self.value - self.target) / self.term.largest_miss(self.target)
    }
}

impl Serialize for TermValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(4))?;
        map.serialize_entry("value", &self.value)?;
        map.serialize_entry("target", &self.target)?;
        map.serialize_entry("f", &self.f)?;
        map.serialize_entry("weight", &self.weight)?;
        map.end()
    }
}

/// Value of the objective with those terms that its target has goals for; serialises as
/// `{f_q, terms: {name: {…}}}`.
///
/// The index of a term gives its value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Σ weight · f over the terms.
    pub f_q: f64,
    #[serde(serialize_with = "terms_by_name")]
    pub(super) terms: [Option<TermValue>; N_TERMS],
}

fn terms_by_name<S: Serializer>(
    terms: &[Option<TermValue>; N_TERMS],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(terms.iter().flatten().map(|t| (t.term.name(), t)))
}

impl Evaluation {
    /// Values of the terms, in the order of [`Term::ALL`].
    pub fn terms(&self) -> impl Iterator<Item = &TermValue> {
        self.terms.iter().flatten()
    }

    /// Value of a term; `None` if the target has no goal for it.
    #[must_use]
    pub fn get(&self, term: Term) -> Option<&TermValue> {
        self.terms[term as usize].as_ref()
    }

    /// Value, target, f and weight of each term, by its name.
    #[must_use]
    pub fn terms_json(&self) -> serde_json::Value {
        self.terms().map(|t| (t.term.name().to_owned(), serde_json::json!(t))).collect()
    }
}

impl Index<Term> for Evaluation {
    type Output = TermValue;

    /// # Panics
    /// When the target has no goal for the term.
    fn index(&self, term: Term) -> &TermValue {
        let name = term.name();
        self.get(term).unwrap_or_else(|| panic!("the target has no goal for {name}"))
    }
}

/// A share of f_q before its modulus is taken.
#[derive(Clone, Debug)]
pub struct Residual {
    /// Factor on the share in f_q.
    pub weight: f64,
    /// The share itself: normalised, signed.
    pub value: f64,
    /// Derivative of the share by each statistic.
    pub by_statistics: Statistics,
}

/// The terms of f_q before moduli are taken.
#[derive(Clone, Debug)]
pub struct Residuals {
    /// Residuals of the scalar terms that the target has goals for, in the order of [`Term::ALL`]; `None`
    /// of all other terms.
    pub scalars: [Option<Residual>; N_TERMS],
    /// Weighted sum of the distances, which have no modulus.
    pub distances: Residual,
}
