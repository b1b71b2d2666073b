//! Ranges and scales of variables.

use serde::{Deserialize, Serialize};

/// Map from the optimiser's unit interval to a value between the bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Linear: `lower + (upper − lower)·u`.
    Linear,
    /// In equal ratios: `lower·(upper/lower)^u`, for a positive lower bound.
    Logarithmic,
    /// In equal steps of the reciprocal, for a positive lower bound: temperatures of colours, of which equal steps in
    /// mired look equal.
    Reciprocal,
    /// By the sRGB decoding function: even steps look even, and the slope at the lower bound is not zero,
    /// so that a light that is off can come on.
    Perceptual,
}

/// Unit, bounds, start and scale of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Unit of the value.
    pub unit: &'static str,
    /// Lower bound of the value.
    pub lower: f64,
    /// Upper bound of the value.
    pub upper: f64,
    /// Value at the neutral start.
    pub initial: f64,
    /// Map from the optimiser's unit interval to the value.
    pub scale: Scale,
}
