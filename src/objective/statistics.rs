//! The raw measured values z of a picture, before roots and moduli.
//!
//! They are what combines over replicates (see [`super::jackknife`]): means, σ², g² and
//! every `q_i`.

use super::histogram::{self, BINS, Cumulated};
use super::region::Regions;
use super::{ObjectiveError, Ramp, gradient, moments};

/// Raw statistics of a display-luminance picture; also the gradient of a function of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    /// Mean over the object.
    pub mean_obj: f64,
    /// Mean over the background.
    pub mean_back: f64,
    /// Population variance σ² over the object.
    pub var_obj: f64,
    /// Population variance σ² over the background.
    pub var_back: f64,
    /// g²: mean squared gradient over the object.
    pub grad2: f64,
    /// Cumulated histogram `q` of the whole picture.
    pub cumulated: Cumulated,
}

impl Statistics {
    /// Statistics of display luminance `l`, `width` × `height` row-major, as the definition
    /// has them; `mask` is true on the main object.
    ///
    /// # Errors
    /// When the sizes do not fit, or the mask leaves the object or the background empty.
    ///
    /// # Panics
    /// When `l` has another size than the mask.
    pub fn measure(l: &[f64], width: usize, height: usize, mask: &[bool]) -> Result<Self, ObjectiveError> {
        Ok(Self::of_regions(l, &Regions::checked(width, height, mask)?, Ramp::Linear))
    }

    /// Statistics of a picture without a mask: all of it is the object, and the background
    /// has the object's mean and variance.
    ///
    /// # Panics
    /// When `l` is empty or has not `width` × `height` values.
    #[must_use]
    pub fn measure_whole(l: &[f64], width: usize, height: usize) -> Self {
        assert!(!l.is_empty(), "an empty picture has nothing to measure");
        let whole = Self::of_regions(l, &Regions::new(width, height, &vec![true; l.len()]), Ramp::Linear);
        Self { mean_back: whole.mean_obj, var_back: whole.var_obj, ..whole }
    }

    pub(super) fn of_regions(l: &[f64], regions: &Regions, ramp: Ramp) -> Self {
        assert_eq!(l.len(), regions.mask().len(), "the picture must have the size of its mask");
        let means = moments::means(l, regions);
        let [var_obj, var_back] = moments::variances(l, means, regions);
        Self {
            mean_obj: means[0],
            mean_back: means[1],
            var_obj,
            var_back,
            grad2: gradient::mean_squared(l, regions),
            cumulated: histogram::cumulated(l, ramp),
        }
    }

    /// What the five scalar terms measure, in their order: means, σ, and g.
    #[must_use]
    pub fn scalars(&self) -> [f64; 5] {
        let root = |z: f64| z.max(0.0).sqrt();
        [self.mean_obj, self.mean_back, root(self.var_obj), root(self.var_back), root(self.grad2)]
    }

    /// A gradient in the scalar statistic `i`, in the order of the terms, alone.
    pub(super) fn only(i: usize, slope: f64) -> Self {
        let mut z = Self::ZERO;
        *[&mut z.mean_obj, &mut z.mean_back, &mut z.var_obj, &mut z.var_back, &mut z.grad2][i] = slope;
        z
    }

    /// All zero.
    pub(super) const ZERO: Self = Self {
        mean_obj: 0.0,
        mean_back: 0.0,
        var_obj: 0.0,
        var_back: 0.0,
        grad2: 0.0,
        cumulated: [0.0; BINS],
    };

    /// `self += weight · other`, value by value.
    pub(super) fn add_scaled(&mut self, weight: f64, other: &Self) {
        self.mean_obj += weight * other.mean_obj;
        self.mean_back += weight * other.mean_back;
        self.var_obj += weight * other.var_obj;
        self.var_back += weight * other.var_back;
        self.grad2 += weight * other.grad2;
        for (a, b) in self.cumulated.iter_mut().zip(&other.cumulated) {
            *a += weight * b;
        }
    }
}
