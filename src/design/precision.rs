//! When samples are enough.

use crate::objective::JackknifeEstimate;

/// Samples per pixel after which no more are added, of all replicates.
pub const MAX_SAMPLES: u32 = 4096;

/// Whether an estimate is as exact as asked for.
pub fn is_exact(e: &JackknifeEstimate, tolerance: f64) -> bool {
    e.half_width <= tolerance && e.correction.abs() <= 2.0 * tolerance
}

/// Factor on the samples that would make it so. The variance of scrambled nets falls as the
/// power −3/2 of their number where the integrand has edges \[He15\], and with it the
/// correction of f_q.
pub fn needed(e: &JackknifeEstimate, tolerance: f64) -> f64 {
    let (error, bias) = (e.half_width / tolerance, e.correction.abs() / (2.0 * tolerance));
    error.powf(4.0 / 3.0).max(bias.powf(2.0 / 3.0))
}

/// Samples to add to `n`: as many as an estimate needs, but not too many on the word of few.
pub fn more(n: u32, e: &JackknifeEstimate, tolerance: f64) -> u32 {
    let wanted = f64::from(n) * needed(e, tolerance).clamp(1.2, 2.5);
    (wanted.ceil() as u32).min(MAX_SAMPLES).saturating_sub(n)
}
