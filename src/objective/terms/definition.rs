//! What a term has to say of itself.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use super::{Statistics, Term};
use crate::objective::adjoint::Adjoint;
use crate::objective::palette::Palette;
use crate::objective::picture::Picture;
use crate::objective::problem::TargetProblem;
use crate::objective::signature::Signature;
use crate::objective::smoothing::Smoothing;

/// A term: its names, its default weight, and how it is measured, compared and differentiated.
pub(in crate::objective) struct Definition {
    /// Name in files and tables, the paper's where it has one.
    pub(super) name: &'static str,
    /// The measured quantity, as the subject of a sentence.
    pub(super) words: &'static str,
    /// A short name for people.
    pub(super) label: &'static str,
    /// Weight in f_q where a target file names none. Every target has a goal for a term of positive
    /// default weight; any other term is neither measured nor listed unless the target has one.
    pub(super) weight: f64,
    /// The kind of the term, with the functions that measure, compare and differentiate it.
    pub(super) kind: Kind,
}

/// The two kinds of terms.
pub(in crate::objective) enum Kind {
    /// The modulus of a number less its target.
    Scalar(Scalar),
    /// A distance between distributions.
    Distance(Distance),
}

/// A term `|value − t| / max(t − low, high − t)`, where `value` is its statistic or the root of it.
#[derive(Clone, Copy)]
pub(in crate::objective) struct Scalar {
    /// Measures the statistic of a picture.
    pub(in crate::objective) measure: fn(&Picture) -> f64,
    /// Adds `d · ∂statistic/∂l` to an adjoint, given `d` and the statistics of the picture.
    pub(in crate::objective) add_adjoint: fn(f64, &Statistics, &mut Adjoint),
    /// Terms whose statistics `add_adjoint` reads; they are measured whenever this one is.
    pub(in crate::objective) reads: &'static [Term],
    /// Whether the statistic is the square of the value: squares combine over replicates, and the
    /// root is taken of what they combine to.
    pub(in crate::objective) is_square: bool,
    /// Interval `[low, high]` whose farther end is the largest miss of a target inside it.
    pub(in crate::objective) range: [f64; 2],
    /// The values that a target file may ask for.
    pub(in crate::objective) targets: Interval,
    /// A bound that no picture passes, if targets may lie beyond it.
    pub(in crate::objective) limit: Option<Limit>,
}

/// An interval of numbers.
#[derive(Clone, Copy)]
pub(in crate::objective) struct Interval {
    /// Least number.
    pub(in crate::objective) low: f64,
    /// Largest number.
    pub(in crate::objective) high: f64,
    /// The interval as messages tell it.
    pub(in crate::objective) words: &'static str,
}

/// The largest value that any picture has.
#[derive(Clone, Copy)]
pub(in crate::objective) struct Limit {
    /// That value.
    pub(in crate::objective) value: f64,
    /// The reason why no picture reaches a target above it, to follow a semicolon.
    pub(in crate::objective) words: &'static str,
}

/// A term that compares the distribution of a picture's pixels over bins with that of a signature.
pub(in crate::objective) struct Distance {
    /// Number of statistics, which is that of the bins.
    pub(in crate::objective) n_bins: usize,
    /// Measures the distribution of a picture.
    pub(in crate::objective) measure: fn(&Picture, &mut [f64]),
    /// The distance of a distribution from the wanted one, and its derivatives into the last slice:
    /// `(wanted, measured, epsilon, derivatives)`. The measured one may lie beyond what a picture
    /// can have, since replicates are combined; `epsilon` smooths it, see [`Smoothing::pixels`].
    pub(in crate::objective) compare: fn(&[f64], &[f64], f64, &mut [f64]) -> f64,
    /// Adds `Σ d_i · ∂statistic_i/∂l` to an adjoint.
    pub(in crate::objective) add_adjoint: fn(&[f64], &mut Adjoint),
    /// Key of the goal in target files.
    pub(in crate::objective) key: &'static str,
    /// Reads the goal from the value of that key; paths in it begin at the given directory.
    pub(in crate::objective) read: fn(&Value, &Path) -> Result<Goal, TargetProblem>,
}

/// What a target asks of a term.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Goal {
    /// The value that is wanted of a scalar term.
    Value(f64),
    /// The distribution that is wanted of the histogram.
    Signature(Signature),
    /// The joint histogram that is wanted of chroma.
    Palette(Palette),
}

impl Scalar {
    /// A term of a value in [0, 1], whose targets lie there too.
    pub(super) const fn unit(
        measure: fn(&Picture) -> f64,
        add_adjoint: fn(f64, &Statistics, &mut Adjoint),
    ) -> Self {
        Self {
            measure,
            add_adjoint,
            reads: &[],
            is_square: false,
            range: [0.0, 1.0],
            targets: Interval { low: 0.0, high: 1.0, words: "a number from 0 to 1" },
            limit: None,
        }
    }

    /// A term of a mean of a or b of Oklab. Those of Rec.709 lie in the interval.
    pub(super) const fn chroma(
        measure: fn(&Picture) -> f64,
        add_adjoint: fn(f64, &Statistics, &mut Adjoint),
    ) -> Self {
        Self {
            range: [-0.32, 0.32],
            targets: Interval { low: -0.32, high: 0.32, words: "a number from -0.32 to 0.32" },
            ..Self::unit(measure, add_adjoint)
        }
    }

    /// The value, and its derivative by the statistic `z`.
    pub(in crate::objective) fn value(&self, z: f64, smoothing: &Smoothing) -> (f64, f64) {
        if self.is_square { smoothing.root(z) } else { (z, 1.0) }
    }

    /// The largest possible miss of `target`.
    fn largest_miss(&self, target: f64) -> f64 {
        let [low, high] = self.range;
        (target - low).max(high - target)
    }
}

impl Definition {
    /// Number of statistics of the term.
    pub(super) const fn n_statistics(&self) -> usize {
        match &self.kind {
            Kind::Scalar(_) => 1,
            Kind::Distance(distance) => distance.n_bins,
        }
    }

    /// The most by which the value can differ from `target`: what 1 means of f.
    pub(super) fn largest_miss(&self, target: f64) -> f64 {
        match &self.kind {
            Kind::Scalar(scalar) => scalar.largest_miss(target),
            Kind::Distance(_) => 1.0,
        }
    }
}

impl Goal {
    /// Writes what the term's statistics are compared with into their places.
    pub(in crate::objective) fn write(&self, out: &mut [f64]) {
        match self {
            Self::Value(value) => out.fill(*value),
            Self::Signature(signature) => out.copy_from_slice(&signature.cumulated()),
            Self::Palette(palette) => out.copy_from_slice(palette.shares()),
        }
    }
}
