//! The raw measured values z of a picture, before roots and moduli.
//!
//! They are what combines over replicates (see [`crate::objective::jackknife`]): means, σ², g² and
//! every value of the cumulated histogram.

use std::ops::{Index, IndexMut, Range};

use super::{DEFINITIONS, Kind, N_TERMS, Term, Values};
use crate::objective::histogram::Cumulated;
use crate::objective::picture::Picture;
use crate::objective::region::Regions;
use crate::objective::{ObjectiveError, Ramp, Smoothing};

/// Where the statistics of each term begin, and after the last where they end.
const BOUNDS: [usize; N_TERMS + 1] = {
    let mut bounds = [0; N_TERMS + 1];
    let mut i = 0;
    while i < N_TERMS {
        bounds[i + 1] = bounds[i] + DEFINITIONS[i].n_statistics();
        i += 1;
    }
    bounds
};

/// Number of statistics of all terms.
const N_STATISTICS: usize = BOUNDS[N_TERMS];

/// Raw statistics of a display-luminance picture, or whatever else has a number for each of them:
/// the gradient of a function of the statistics, or the values that are wanted.
///
/// The index of a term gives its statistics: one number of a scalar term, a value for each bin of a
/// distance. Those of terms that were not measured are 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    values: [f64; N_STATISTICS],
}

fn place(term: Term) -> Range<usize> {
    BOUNDS[term as usize]..BOUNDS[term as usize + 1]
}

impl Index<Term> for Statistics {
    type Output = [f64];

    fn index(&self, term: Term) -> &[f64] {
        &self.values[place(term)]
    }
}

impl IndexMut<Term> for Statistics {
    fn index_mut(&mut self, term: Term) -> &mut [f64] {
        &mut self.values[place(term)]
    }
}

impl Statistics {
    /// All zero.
    pub(in crate::objective) const ZERO: Self = Self { values: [0.0; N_STATISTICS] };

    /// The standing statistics of display luminance `l`, behind which chroma may stand, `width` × `height` row-major, as the
    /// definition has them; `mask` is true on the main object.
    ///
    /// # Errors
    /// When the sizes do not fit, or the mask leaves the object or the background empty.
    ///
    /// # Panics
    /// When `l` has another size than the mask.
    pub fn measure(l: &[f64], width: usize, height: usize, mask: &[bool]) -> Result<Self, ObjectiveError> {
        let regions = Regions::checked(width, height, mask)?;
        Ok(Self::of_whole_picture(&Picture::new(l, &regions, Ramp::Linear)))
    }

    /// The standing statistics, and those of colour where chroma is known.
    fn of_whole_picture(picture: &Picture) -> Self {
        Self::of_picture(picture, |term| term.is_standing() || (picture.has_chroma() && term.is_of_color()))
    }

    /// The standing statistics of a picture without a mask: all of it is the object, and the
    /// background has the object's mean and variance.
    ///
    /// # Panics
    /// When `l` is empty or has not `width` × `height` values.
    #[must_use]
    pub fn measure_whole(l: &[f64], width: usize, height: usize) -> Self {
        assert!(!l.is_empty(), "an empty picture has nothing to measure");
        let regions = Regions::new(width, height, &vec![true; width * height]);
        Self::of_whole_picture(&Picture::new(l, &regions, Ramp::Linear))
    }

    /// Statistics of those terms of which `is_measured` holds.
    pub(in crate::objective) fn of_picture(picture: &Picture, is_measured: impl Fn(Term) -> bool) -> Self {
        let mut z = Self::ZERO;
        for term in Term::ALL.into_iter().filter(|&term| is_measured(term)) {
            match term.kind() {
                Kind::Scalar(scalar) => z[term].fill((scalar.measure)(picture)),
                Kind::Distance(distance) => (distance.measure)(picture, &mut z[term]),
            }
        }
        z
    }

    /// The statistic of a scalar term.
    pub(in crate::objective) fn scalar(&self, term: Term) -> f64 {
        self.values[BOUNDS[term as usize]]
    }

    /// Values of the standing scalar terms: means, σ, and g.
    #[must_use]
    pub fn values(&self) -> Values {
        self.values_of(Term::is_standing)
    }

    /// Values of all scalar terms, those of colour too, of a picture whose chroma is known.
    #[must_use]
    pub fn values_with_color(&self) -> Values {
        self.values_of(|_| true)
    }

    /// Shares of the pixels in the bins of chroma, of a picture whose chroma is known.
    #[must_use]
    pub fn palette(&self) -> Vec<f64> {
        self[Term::Chroma].to_vec()
    }

    fn values_of(&self, is_asked_for: impl Fn(Term) -> bool) -> Values {
        Term::ALL.map(|term| match term.kind() {
            Kind::Scalar(scalar) if is_asked_for(term) => {
                Some(scalar.value(self.scalar(term), &Smoothing::NONE).0)
            }
            _ => None,
        })
    }

    /// The cumulated histogram of the whole picture.
    #[must_use]
    pub fn cumulated(&self) -> Cumulated {
        std::array::from_fn(|bin| self[Term::Hist][bin])
    }

    /// `weight · self`.
    pub(in crate::objective) fn scaled(&self, weight: f64) -> Self {
        Self { values: self.values.map(|z| weight * z) }
    }

    /// `self += weight · other`, value by value.
    pub(in crate::objective) fn add_scaled(&mut self, weight: f64, other: &Self) {
        for (a, b) in self.values.iter_mut().zip(&other.values) {
            *a += weight * b;
        }
    }
}
