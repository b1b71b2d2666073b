//! The aesthetic objective f_q of a picture, with its exact derivative.
//!
//! `f_q = Σ w_s f_s` over the terms of the table in [`terms`]: mean and spread of the display
//! luminance `l` over the main object and over the background, the object's mean gradient, and the
//! distance of the cumulated histogram to a signature. Pictures are row-major slices of `l` in
//! [0, 1], all f64; sums run in an order that does not depend on threads, and neither do values.
//!
//! A picture is measured once ([`Objective::statistics`]); the terms are functions of
//! those statistics alone ([`Objective::terms`]), so that replicates can be combined
//! before roots and moduli are taken ([`Objective::jackknife`]).
//!
//! # References
//! \[PG14\] eqs. (1)–(8).

mod adjoint;
pub mod chroma;
mod evaluation;
pub mod histogram;
pub mod jackknife;
mod moments;
pub mod palette;
mod picture;
mod problem;
mod region;
pub mod replicates;
pub mod signature;
pub mod smoothing;
pub mod special;
pub mod target;
pub mod terms;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use thiserror::Error;

pub use crate::math::display::LuminanceMode;
pub use evaluation::{Evaluation, Residual, Residuals, TermValue};
pub use jackknife::{JackknifeEstimate, Jackknifed};
pub use replicates::{LABELLINGS, Replicates};
pub use smoothing::{Ramp, Smoothing};
pub use target::Target;
pub use terms::{Goal, N_TERMS, Statistics, Term, Values};

use adjoint::Adjoint;
use picture::Picture;
use region::Regions;
use terms::{Distance, Kind, Scalar};

/// Why an objective cannot be set up, or an error not be estimated.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ObjectiveError {
    /// The picture has no pixels.
    #[error("a picture of {width} x {height} pixels has nothing to measure")]
    EmptyPicture {
        /// Width of the picture, pixels.
        width: usize,
        /// Height of the picture, pixels.
        height: usize,
    },
    /// Mask and picture differ in size.
    #[error("the mask has {mask} pixels, the picture {width} x {height} = {}", width * height)]
    MaskSize {
        /// Number of pixels of the mask.
        mask: usize,
        /// Width of the picture, pixels.
        width: usize,
        /// Height of the picture, pixels.
        height: usize,
    },
    /// No pixel belongs to the object.
    #[error(
        "the mask marks no pixel as main object, so the terms meanObj, varObj and grad cannot be \
         measured; of a scene, name an object that the camera sees"
    )]
    EmptyObject,
    /// Every pixel belongs to the object.
    #[error(
        "the mask marks every pixel as main object, so the terms meanBack and varBack cannot be \
         measured; leave some background in the picture or, of a scene, name less as `[main_object]`"
    )]
    EmptyBackground,
    /// The jackknife needs at least two replicates.
    #[error("an error estimate needs at least 2 replicates, got {replicates}")]
    TooFewReplicates {
        /// Number of replicates that there were.
        replicates: usize,
    },
}

/// The objective for pictures of one size with one mask.
///
/// ```
/// use lightopt_embree::objective::{Objective, Smoothing, Target};
///
/// // Two columns of object, two of background; brightness as a display shows it, 0 to 1.
/// let mask = [true, true, false, false].repeat(3);
/// let objective = Objective::new(&Target::resolve("high-key")?, 4, 3, &mask)?;
/// let picture = [0.3, 0.6, 0.7, 0.9].repeat(3);
/// let f_q = objective.evaluate(&picture).f_q;
///
/// // Brighten the picture where its derivative says that it should be: f_q falls.
/// let mut adjoint = vec![0.0; picture.len()];
/// objective.evaluate_smooth(&picture, &Smoothing::with_delta(1e-3), Some(&mut adjoint));
/// let better: Vec<f64> = picture.iter().zip(&adjoint).map(|(l, d)| l - 0.01 * d).collect();
/// assert!(objective.evaluate(&better).f_q < f_q);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Objective {
    regions: Regions,
    /// Target values and the signature's cumulated histogram, in the places of the statistics that are
    /// compared with them.
    aims: Statistics,
    /// Weights in f_q, in the order of [`Term::ALL`].
    weights: [f64; N_TERMS],
    /// Whether the target has a goal for each term, in the order of [`Term::ALL`].
    has_goal: [bool; N_TERMS],
    /// Whether the statistics of each term are measured: of those with a goal, and of those whose
    /// statistics they read.
    is_measured: [bool; N_TERMS],
}

impl Objective {
    /// Sets up the objective: `mask` is true on the main object, row-major.
    ///
    /// # Errors
    /// When the mask does not fit the size, or leaves the object or the background empty:
    /// their terms would have no value, whatever their weights.
    pub fn new(target: &Target, width: usize, height: usize, mask: &[bool]) -> Result<Self, ObjectiveError> {
        Ok(Self::of_regions(target, Regions::checked(width, height, mask)?))
    }

    /// Sets up the objective where every pixel belongs to the object with a share in [0, 1], row-major, and to the
    /// background with the rest: means, spreads and the gradient are weighted by it.
    ///
    /// # Errors
    /// When the shares do not fit the size, or leave the object or the background less than a pixel.
    pub fn weighted(
        target: &Target,
        width: usize,
        height: usize,
        weights: &[f64],
    ) -> Result<Self, ObjectiveError> {
        Ok(Self::of_regions(target, Regions::weighted(width, height, weights)?))
    }

    fn of_regions(target: &Target, regions: Regions) -> Self {
        let mut aims = Statistics::ZERO;
        for (term, goal) in target.goals() {
            goal.write(&mut aims[term]);
        }
        let is_needed = |term: Term| target.goals().any(|(other, _)| other == term || other.reads(term));
        Self {
            regions,
            aims,
            weights: Term::ALL.map(|term| target.weight(term)),
            has_goal: Term::ALL.map(|term| target.goal(term).is_some()),
            is_measured: Term::ALL.map(is_needed),
        }
    }

    /// The same objective with `term` alone, at weight 1.
    #[must_use]
    pub fn only(&self, term: Term) -> Self {
        let mut weights = [0.0; N_TERMS];
        weights[term as usize] = 1.0;
        Self { weights, ..self.clone() }
    }

    /// The terms of an evaluation, in the order of [`Term::ALL`]: those that the target has goals for.
    pub fn listed(&self) -> impl Iterator<Item = Term> {
        Term::ALL.into_iter().filter(|&term| self.has_goal[term as usize])
    }

    /// The [listed](Self::listed) terms that are moduli: all but the distances.
    pub fn scalars(&self) -> impl Iterator<Item = Term> {
        self.listed().filter(|term| !term.is_distance())
    }

    /// Weights of the [scalar terms](Self::scalars).
    #[must_use]
    pub fn scalar_weights(&self) -> Vec<f64> {
        self.scalars().map(|term| self.weights[term as usize]).collect()
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

    /// Whether chroma must stand behind the display luminance of pictures that are measured: see
    /// [`Measure::n_shown`](crate::math::Measure::n_shown).
    #[must_use]
    pub fn needs_color(&self) -> bool {
        self.listed().any(Term::is_of_color)
    }

    /// Raw statistics of display luminance `l`, as far as the target has goals for them; `ramp` is that
    /// of the smoothing in use.
    ///
    /// # Panics
    /// When `l` has another size than the objective.
    #[must_use]
    pub fn statistics(&self, l: &[f64], ramp: Ramp) -> Statistics {
        let picture = Picture::new(l, &self.regions, ramp);
        Statistics::of_picture(&picture, |term| self.is_measured[term as usize])
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
        let mut gradient = Statistics::ZERO;
        let terms = Term::ALL.map(|term| {
            let by_statistics = &mut gradient[term];
            self.has_goal[term as usize].then(|| match term.kind() {
                Kind::Scalar(scalar) => self.scalar(term, scalar, z, smoothing, by_statistics),
                Kind::Distance(distance) => self.distance(term, distance, z, smoothing, by_statistics),
            })
        });
        let f_q = terms.iter().flatten().map(TermValue::contribution).sum(); // [PG14] eq. (1)
        (Evaluation { f_q, terms }, gradient)
    }

    /// Value of a scalar term; the derivative of its share in f_q is written to `by_statistics`.
    fn scalar(
        &self,
        term: Term,
        scalar: &Scalar,
        z: &Statistics,
        smoothing: &Smoothing,
        by_statistics: &mut [f64],
    ) -> TermValue {
        let (value, d_value) = scalar.value(z.scalar(term), smoothing);
        let (target, weight) = (self.aims.scalar(term), self.weights[term as usize]);
        let value = TermValue { term, value, target, weight, f: 0.0 };
        let (f, slope) = smoothing.absolute(value.residual()); // [PG14] eqs. (2)-(5), (7)
        by_statistics.fill(weight * slope / term.largest_miss(target) * d_value);
        TermValue { f, ..value }
    }

    /// Value of a distance; the derivative of its share in f_q is written to `by_statistics`.
    fn distance(
        &self,
        term: Term,
        distance: &Distance,
        z: &Statistics,
        smoothing: &Smoothing,
        by_statistics: &mut [f64],
    ) -> TermValue {
        let epsilon = smoothing.pixels / self.regions.n_pixels();
        let f = (distance.compare)(&self.aims[term], &z[term], epsilon, by_statistics);
        let weight = self.weights[term as usize];
        by_statistics.iter_mut().for_each(|d| *d *= weight);
        TermValue { term, value: f, target: 0.0, weight, f }
    }

    /// The terms as the moduli that they are: signed residuals of the scalar terms and the sum of the
    /// distances, each with its weight and its derivative by the statistics. f_q is the sum of
    /// the distances and of `weight · |residual|`.
    #[must_use]
    pub fn residuals(&self, z: &Statistics, smoothing: &Smoothing) -> Residuals {
        let (evaluation, dz) = self.terms_with_gradient(z, smoothing);
        let scalars = evaluation.terms.map(|value| {
            let value = value?;
            let Kind::Scalar(scalar) = value.term.kind() else { return None };
            let (_, slope) = scalar.value(z.scalar(value.term), smoothing);
            let mut by_statistics = Statistics::ZERO;
            by_statistics[value.term].fill(slope / value.term.largest_miss(value.target));
            Some(Residual { weight: value.weight, value: value.residual(), by_statistics })
        });
        let mut distances = Residual { weight: 1.0, value: 0.0, by_statistics: Statistics::ZERO };
        for distance in evaluation.terms().filter(|value| value.term.is_distance()) {
            distances.value += distance.contribution();
            distances.by_statistics[distance.term].copy_from_slice(&dz[distance.term]);
        }
        Residuals { scalars, distances }
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
        let picture = Picture::new(l, &self.regions, ramp);
        let mut adjoint = Adjoint::new(&picture, out);
        let dz = dz.scaled(weight);
        for term in Term::ALL.into_iter().filter(|&term| dz[term].iter().any(|&d| d != 0.0)) {
            match term.kind() {
                Kind::Scalar(scalar) => (scalar.add_adjoint)(dz.scalar(term), z, &mut adjoint),
                Kind::Distance(distance) => (distance.add_adjoint)(&dz[term], &mut adjoint),
            }
        }
        adjoint.finish();
    }
}
