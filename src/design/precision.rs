//! When samples are enough.

use crate::objective::JackknifeEstimate;

/// Samples per pixel after which no more are added, of all replicates.
pub const MAX_SAMPLES: u32 = 4096;

/// Samples per pixel with which an estimate may be trusted, of all replicates. Of fewer, errors
/// are too uncertain and corrections of terms cancel.
pub const LEAST_SAMPLES: u32 = 16;
/// Samples that are aimed at what the first ones found.
pub const AIMED_SAMPLES: u32 = 12;

/// What is asked of an estimate.
#[derive(Clone, Copy, Debug)]
pub struct Precision {
    /// Half width of the 95 % interval, at most.
    half_width: f64,
    /// Noise correction, at most.
    correction: f64,
}

impl Precision {
    /// Of an f_q that is reported.
    pub fn reported(tolerance: f64) -> Self {
        Self { half_width: tolerance, correction: 2.0 * tolerance }
    }

    /// Of one by which lights are chosen: a third of that. Near an optimum f_q hardly depends on
    /// where exactly it is sought, what is minimised reckons with its errors, and what is reported
    /// comes from other samples.
    pub fn choosing(tolerance: f64) -> Self {
        Self::reported(3.0 * tolerance)
    }

    /// Of what finite differences minimise, uncorrected: half of that.
    pub fn differences(tolerance: f64) -> Self {
        Self::reported(2.0 * tolerance)
    }

    /// Whether an estimate is precise enough.
    pub fn is_met(&self, e: &JackknifeEstimate) -> bool {
        e.half_width <= self.half_width && e.correction.abs() <= self.correction
    }

    /// Whether f_q uncorrected is, in which the noise's bias is an error like any other.
    pub fn is_met_uncorrected(&self, e: &JackknifeEstimate) -> bool {
        e.error_bar() <= self.half_width
    }

    /// Samples to add to `n` that it may be.
    pub fn more_uncorrected(&self, n: u32, e: &JackknifeEstimate) -> u32 {
        added(n, e.error_bar() / self.half_width)
    }

    /// Factor on the samples that would make it so. The variance of scrambled nets falls as the
    /// power −3/2 of their number where the integrand has edges \[He15\], and with it the
    /// correction of f_q.
    pub fn needed(&self, e: &JackknifeEstimate) -> f64 {
        let (error, bias) = (e.half_width / self.half_width, e.correction.abs() / self.correction);
        error.powf(4.0 / 3.0).max(bias.powf(2.0 / 3.0))
    }

    /// Samples to add to `n` that it may be.
    pub fn more(&self, n: u32, e: &JackknifeEstimate) -> u32 {
        added(n, self.needed(e))
    }
}

/// As many as are needed, but not too many on the word of few.
fn added(n: u32, needed: f64) -> u32 {
    let wanted = f64::from(n) * needed.clamp(1.2, 2.5);
    (wanted.ceil() as u32).min(MAX_SAMPLES).saturating_sub(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::{Objective, Target};

    fn estimate(half_width: f64, correction: f64) -> JackknifeEstimate {
        let target = Target::resolve("high-key").unwrap();
        let objective = Objective::new(&target, 2, 1, &[true, false]).unwrap();
        let evaluation = objective.evaluate(&[0.3, 0.6]);
        let naive = evaluation.f_q + correction;
        JackknifeEstimate {
            evaluation,
            naive,
            standard_error: 0.0,
            half_width,
            correction,
            residual_errors: vec![0.0; objective.scalars().count()],
            replicates: 4,
        }
    }

    #[test]
    fn what_chooses_may_be_a_third_as_precise_as_what_is_reported() {
        for (half_width, correction) in [(0.014, 0.0), (0.0, -0.029)] {
            let e = estimate(half_width, correction);
            assert!(!Precision::reported(0.005).is_met(&e) && Precision::choosing(0.005).is_met(&e));
        }
        assert!(!Precision::choosing(0.005).is_met(&estimate(0.016, 0.0)));
    }

    #[test]
    fn what_is_not_corrected_errs_by_the_correction_too() {
        let precision = Precision::differences(0.005);
        assert!(precision.is_met_uncorrected(&estimate(0.004, -0.005)));
        let e = estimate(0.004, 0.008);
        assert!(precision.is_met(&e) && !precision.is_met_uncorrected(&e));
        assert_eq!(precision.more_uncorrected(40, &estimate(0.01, 0.005)), 20);
    }

    #[test]
    fn samples_are_added_by_the_need_but_neither_few_nor_too_many() {
        let precision = Precision::reported(0.005);
        let more = |half_width, correction| precision.more(40, &estimate(half_width, correction));
        assert_eq!(more(0.0051, 0.0), 8);
        assert_eq!(more(0.005, 0.02), (40.0_f64 * 2.0_f64.powf(2.0 / 3.0)).ceil() as u32 - 40);
        assert_eq!(more(1.0, 0.0), 60);
        assert_eq!(precision.more(MAX_SAMPLES - 1, &estimate(1.0, 0.0)), 1);
        assert_eq!(precision.more(MAX_SAMPLES, &estimate(1.0, 0.0)), 0);
    }
}
