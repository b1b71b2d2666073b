//! Bounds, start and scale of a variable.

use serde::{Deserialize, Serialize};

/// How `u ∈ [0, 1]` maps to a value between the bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Proportional.
    Linear,
    /// In equal ratios: `lower·(upper/lower)^u`, for a positive lower bound.
    Logarithmic,
    /// By the sRGB transfer function: even steps look even, and the slope at
    /// the lower bound is not zero, so that a light that is off can come on.
    Perceptual,
}

/// Bounds, start and scale of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Unit of the value.
    pub unit: &'static str,
    /// Least value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
    /// Value at the start.
    pub initial: f64,
    /// Map from the optimiser's unit interval.
    pub scale: Scale,
}
