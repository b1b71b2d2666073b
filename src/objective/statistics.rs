//! The raw measured values z of a picture, before roots and moduli.
//!
//! They are what combines over replicates (see [`super::jackknife`]): means, σ², g² and
//! every `q_i`.

use super::histogram::{BINS, Cumulated};

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
