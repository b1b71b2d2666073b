//! The aesthetic objective f_q of a picture, with its exact derivative.
//!
//! `f_q = Σ w_s f_s` over six terms: mean and spread of the display luminance `l` over
//! the main object and over the background, the object's mean gradient, and the distance
//! of the cumulated histogram to a signature. Pictures are row-major slices of `l` in
//! [0, 1], all f64; sums run in pixel order, so values do not depend on threads.
//!
//! A picture is measured once ([`Objective::statistics`]); the terms are functions of
//! those statistics alone ([`Objective::terms`]), so that replicates can be combined
//! before roots and moduli are taken ([`Objective::jackknife`]).
//!
//! # References
//! \[PG14\] eqs. (1)–(8).

mod gradient;
pub mod histogram;
pub mod jackknife;
mod moments;
mod region;
pub mod replicates;
pub mod signature;
pub mod smoothing;
pub mod special;
mod statistics;
pub mod target;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use thiserror::Error;

pub use crate::math::display::LuminanceMode;
pub use jackknife::{JackknifeEstimate, Jackknifed};
pub use replicates::{LABELLINGS, Replicates};
pub use smoothing::{Ramp, Smoothing};
pub use statistics::Statistics;
pub use target::Target;

use histogram::Cumulated;
use region::Regions;

/// The terms of the objective, in the order in which they are summed and listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// Mean luminance of the object, eq. (2).
    MeanObj,
    /// Mean luminance of the background, eq. (3).
    MeanBack,
    /// Standard deviation over the object, eq. (4).
    VarObj,
    /// Standard deviation over the background, eq. (5).
    VarBack,
    /// Root mean squared gradient over the object, eqs. (6) and (7).
    Grad,
    /// Distance of the cumulated histogram to the signature, eq. (8).
    Hist,
}

impl Term {
    /// All six.
    pub const ALL: [Self; 6] =
        [Self::MeanObj, Self::MeanBack, Self::VarObj, Self::VarBack, Self::Grad, Self::Hist];

    /// Its name in files and tables, the paper's.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::MeanObj => "meanObj",
            Self::MeanBack => "meanBack",
            Self::VarObj => "varObj",
            Self::VarBack => "varBack",
            Self::Grad => "grad",
            Self::Hist => "hist",
        }
    }
}

/// Terms that are a modulus of a number less its target, eqs. (2) to (7): all but the histogram.
pub const N_SCALARS: usize = 5;

/// One term of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TermValue {
    /// Which one.
    pub term: Term,
    /// What was measured: mean, σ or g; for the histogram the distance itself.
    pub value: f64,
    /// What it should be; for the histogram 0.
    pub target: f64,
    /// Its weight in f_q.
    pub weight: f64,
    /// f_s: the normalised residual, 0 when the target is met.
    pub f: f64,
}

impl TermValue {
    /// Its share of f_q: `weight · f`.
    #[must_use]
    pub fn contribution(&self) -> f64 {
        self.weight * self.f
    }

    /// The most by which a scalar can miss its target, eqs. (2) to (7).
    fn norm(&self) -> f64 {
        self.target.max(1.0 - self.target)
    }

    /// What is measured less its target, relative to the most that can be missed: signed.
    #[must_use]
    pub fn residual(&self) -> f64 {
        (self.value - self.target) / self.norm()
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

/// Value of the objective with its terms; serialises as `{f_q, terms: {name: {…}}}`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Σ weight · f.
    pub f_q: f64,
    /// The terms, in the order of [`Term::ALL`].
    #[serde(serialize_with = "terms_by_name")]
    pub terms: [TermValue; 6],
}

fn terms_by_name<S: Serializer>(terms: &[TermValue; 6], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(terms.iter().map(|t| (t.term.name(), t)))
}

impl Evaluation {
    /// The terms by name: value, target, f and weight of each.
    #[must_use]
    pub fn terms_json(&self) -> serde_json::Value {
        self.terms.iter().map(|t| (t.term.name().to_owned(), serde_json::json!(t))).collect()
    }

    /// The term `term`.
    #[must_use]
    pub fn get(&self, term: Term) -> &TermValue {
        &self.terms[term as usize]
    }
}

/// Why an objective cannot be set up or used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ObjectiveError {
    /// The picture has no pixels.
    #[error("a picture of {width} x {height} pixels has nothing to measure")]
    EmptyPicture {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
    /// Mask and picture differ in size.
    #[error("the mask has {mask} pixels, the picture {width} x {height} = {}", width * height)]
    MaskSize {
        /// Pixels of the mask.
        mask: usize,
        /// Width of the picture.
        width: usize,
        /// Height of the picture.
        height: usize,
    },
    /// No pixel belongs to the object.
    #[error(
        "the mask marks no pixel as main object, so the terms meanObj, varObj and grad cannot be \
         measured; name an object that the camera sees"
    )]
    EmptyObject,
    /// Every pixel belongs to the object.
    #[error(
        "the mask marks every pixel as main object, so the terms meanBack and varBack cannot be \
         measured; leave some background in the picture"
    )]
    EmptyBackground,
    /// The jackknife needs at least two replicates.
    #[error("an error estimate needs at least 2 replicates, got {replicates}")]
    TooFewReplicates {
        /// How many there were.
        replicates: usize,
    },
}

/// A term before its modulus is taken.
#[derive(Clone, Debug)]
pub struct Residual {
    /// Its weight in f_q.
    pub weight: f64,
    /// Normalised, signed.
    pub value: f64,
    /// Derivative by the statistics.
    pub by_statistics: Statistics,
}

/// The terms before moduli are taken.
#[derive(Clone, Debug)]
pub struct Residuals {
    /// Of the terms of eqs. (2) to (7).
    pub scalars: [Residual; N_SCALARS],
    /// The share of the histogram, eq. (8), which has no modulus.
    pub hist: Residual,
}

/// The objective for pictures of one size with one mask.
#[derive(Clone, Debug)]
pub struct Objective {
    regions: Regions,
    /// Targets of the five scalar terms, in the order of [`Term::ALL`].
    targets: [f64; N_SCALARS],
    weights: [f64; 6],
    signature: Cumulated,
}

impl Objective {
    /// Sets up the objective: `mask` is true on the main object, row-major.
    ///
    /// # Errors
    /// When the mask does not fit the size, or leaves the object or the background empty:
    /// their terms would have no value, whatever their weights.
    pub fn new(target: &Target, width: usize, height: usize, mask: &[bool]) -> Result<Self, ObjectiveError> {
        Ok(Self {
            regions: Regions::checked(width, height, mask)?,
            targets: target.targets,
            weights: target.weights,
            signature: target.signature.cumulated(),
        })
    }

    /// The same objective with `term` alone, at weight 1.
    #[must_use]
    pub fn only(&self, term: Term) -> Self {
        let mut weights = [0.0; 6];
        weights[term as usize] = 1.0;
        Self { weights, ..self.clone() }
    }

    /// Weights of the five scalar terms.
    #[must_use]
    pub fn scalar_weights(&self) -> [f64; N_SCALARS] {
        std::array::from_fn(|i| self.weights[i])
    }

    /// Number of pixels of a picture.
    #[must_use]
    pub fn n_pixels(&self) -> usize {
        self.regions.mask().len()
    }

    /// f_q of display luminance `l`, unsmoothed: eqs. (1)–(8).
    ///
    /// # Panics
    /// When `l` has another size than the objective.
    #[must_use]
    pub fn evaluate(&self, l: &[f64]) -> Evaluation {
        self.evaluate_smooth(l, &Smoothing::NONE, None)
    }

    /// The optimiser's smoothed f_q and, if asked for, its exact adjoint picture `∂f/∂l`
    /// (overwritten).
    ///
    /// # Panics
    /// When `l` or `adjoint` has another size than the objective.
    pub fn evaluate_smooth(
        &self,
        l: &[f64],
        smoothing: &Smoothing,
        adjoint: Option<&mut [f64]>,
    ) -> Evaluation {
        let z = self.statistics(l, smoothing.ramp);
        let Some(out) = adjoint else {
            return self.terms(&z, smoothing);
        };
        let (evaluation, dz) = self.terms_with_gradient(&z, smoothing);
        out.fill(0.0);
        self.add_adjoint(l, &z, &dz, 1.0, smoothing.ramp, out);
        evaluation
    }

    /// Raw statistics of display luminance `l`; `ramp` is that of the smoothing in use.
    ///
    /// # Panics
    /// When `l` has another size than the objective.
    #[must_use]
    pub fn statistics(&self, l: &[f64], ramp: Ramp) -> Statistics {
        Statistics::of_regions(l, &self.regions, ramp)
    }

    /// f_q and its terms from raw statistics; every `q_i` is clipped to [0, 1], variances
    /// and g² below 0 count as 0 (estimates from noisy replicates may lie beyond).
    #[must_use]
    pub fn terms(&self, z: &Statistics, smoothing: &Smoothing) -> Evaluation {
        self.terms_with_gradient(z, smoothing).0
    }

    /// [`Objective::terms`] with `∂f_q/∂z` for every statistic.
    #[must_use]
    pub fn terms_with_gradient(&self, z: &Statistics, smoothing: &Smoothing) -> (Evaluation, Statistics) {
        let (sigma_obj, d_sigma_obj) = smoothing.root(z.var_obj);
        let (sigma_back, d_sigma_back) = smoothing.root(z.var_back);
        let (g, d_g) = smoothing.root(z.grad2);
        let values = [z.mean_obj, z.mean_back, sigma_obj, sigma_back, g];
        let d_values = [1.0, 1.0, d_sigma_obj, d_sigma_back, d_g];

        let epsilon = smoothing.pixels / self.regions.n_pixels();
        let clipped = z.cumulated.map(|q| q.clamp(0.0, 1.0));
        let (f_hist, d_hist) = histogram::distance(&self.signature, &clipped, epsilon);

        let mut terms = Term::ALL.map(|term| TermValue {
            term,
            value: f_hist,
            target: 0.0,
            weight: self.weights[term as usize],
            f: f_hist,
        });
        let mut slopes = [0.0; N_SCALARS];
        for (i, (&value, &t)) in values.iter().zip(&self.targets).enumerate() {
            let term = TermValue { value, target: t, ..terms[i] };
            let (f, slope) = smoothing.absolute(term.residual()); // eqs. (2)-(5), (7)
            terms[i] = TermValue { f, ..term };
            slopes[i] = self.weights[i] * slope / term.norm() * d_values[i];
        }
        let f_q = terms.iter().map(TermValue::contribution).sum(); // eq. (1)

        let mut cumulated = d_hist.map(|d| self.weights[Term::Hist as usize] * d);
        for (d, q) in cumulated.iter_mut().zip(&z.cumulated) {
            if !(0.0..=1.0).contains(q) {
                *d = 0.0;
            }
        }
        let gradient = Statistics {
            mean_obj: slopes[0],
            mean_back: slopes[1],
            var_obj: slopes[2],
            var_back: slopes[3],
            grad2: slopes[4],
            cumulated,
        };
        (Evaluation { f_q, terms }, gradient)
    }

    /// The terms as the moduli that they are: signed residuals of the five scalar terms and
    /// the histogram's distance, each with its weight and its derivative by the statistics.
    /// f_q is the distance's share and the sum of `weight · |residual|`.
    #[must_use]
    pub fn residuals(&self, z: &Statistics, smoothing: &Smoothing) -> Residuals {
        let (evaluation, dz) = self.terms_with_gradient(z, smoothing);
        let scalars = std::array::from_fn(|i| {
            let term = &evaluation.terms[i];
            let slope = match i {
                0 | 1 => 1.0,
                2 => smoothing.root(z.var_obj).1,
                3 => smoothing.root(z.var_back).1,
                _ => smoothing.root(z.grad2).1,
            };
            let by_statistics = Statistics::only(i, slope / term.norm());
            Residual { weight: term.weight, value: term.residual(), by_statistics }
        });
        let hist = evaluation.get(Term::Hist);
        let by_statistics = Statistics { cumulated: dz.cumulated, ..Statistics::ZERO };
        Residuals { scalars, hist: Residual { weight: 1.0, value: hist.contribution(), by_statistics } }
    }

    /// Adds `weight · Σ_z dz · ∂z/∂l` to `out`: carries a gradient in the statistics `dz`
    /// back to the picture `l`, whose statistics are `z`.
    ///
    /// # Panics
    /// When `l` or `out` has another size than the objective.
    pub fn add_adjoint(
        &self,
        l: &[f64],
        z: &Statistics,
        dz: &Statistics,
        weight: f64,
        ramp: Ramp,
        out: &mut [f64],
    ) {
        assert_eq!(l.len(), self.n_pixels(), "the picture must have the objective's size");
        assert_eq!(out.len(), self.n_pixels(), "the adjoint must have the objective's size");
        let regions = &self.regions;
        let means = [z.mean_obj, z.mean_back];
        let d_mean = [weight * dz.mean_obj, weight * dz.mean_back];
        let d_var = [weight * dz.var_obj, weight * dz.var_back];
        if d_mean.iter().chain(&d_var).any(|&d| d != 0.0) {
            moments::add_adjoint(l, means, regions, d_mean, d_var, out);
        }
        if dz.grad2 != 0.0 {
            gradient::add_adjoint(l, regions, weight * dz.grad2, out);
        }
        if dz.cumulated.iter().any(|&d| d != 0.0) {
            histogram::add_adjoint(l, ramp, &dz.cumulated.map(|d| weight * d), out);
        }
    }
}
