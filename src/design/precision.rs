//! Precision that is asked of an estimate of f_q, and the samples it needs.

use crate::objective::JackknifeEstimate;

/// Samples per pixel of all replicates after which no more are added, so that a tolerance that cannot be
/// met ends some time: the noise is then a sixteenth of that with [`MIN_SAMPLES`] at most.
pub const MAX_SAMPLES: u32 = 4096;

/// Samples per pixel of all replicates with which an estimate may be trusted. On the fruit basket in
/// low-key the error bar covered 67 % with 8, where corrections of the terms cancel and their bias
/// stays, 97 % with 12 and 100 % with 16; at another lighting 77 % with 12, 93 % with 16.
pub const MIN_SAMPLES: u32 = 16;
/// Samples per pixel that are aimed at the lights found by the first ones. True f_q on the fruit basket
/// over 24 seeds, mean (worst): high-key .1363 (.1386) and low-key .5850 (.5864), with 16 samples .1365
/// (.1384) and .5850 (.5862).
pub const AIMED_SAMPLES: u32 = 12;

/// Bounds of the error of an estimate.
#[derive(Clone, Copy, Debug)]
pub struct Precision {
    /// Upper bound of the half width of the 95 % interval.
    half_width: f64,
    /// Upper bound of the noise correction.
    correction: f64,
}

impl Precision {
    /// Precision of an f_q that is reported: the tolerance for the half width, twice as much for the noise
    /// correction, of which the jackknife leaves a part only.
    pub fn reported(tolerance: f64) -> Self {
        Self { half_width: tolerance, correction: 2.0 * tolerance }
    }

    /// Precision of an f_q by which lights are chosen: a third of that of a reported one. Near an optimum
    /// f_q hardly depends on the exact point, the function minimised allows for its errors, and what is
    /// reported comes from other samples.
    pub fn choosing(tolerance: f64) -> Self {
        Self::reported(3.0 * tolerance)
    }

    /// Precision of an f_q that finite differences minimise uncorrected: half of that of a reported one.
    pub fn differences(tolerance: f64) -> Self {
        Self::reported(2.0 * tolerance)
    }

    /// Whether an estimate is precise enough.
    pub fn is_met(&self, e: &JackknifeEstimate) -> bool {
        e.half_width <= self.half_width && e.correction.abs() <= self.correction
    }

    /// Whether the uncorrected f_q is precise enough, where the bias by noise is an error like any other.
    pub fn is_met_uncorrected(&self, e: &JackknifeEstimate) -> bool {
        e.error_bound() <= self.half_width
    }

    /// Samples to add to `n` for the uncorrected f_q to be precise enough.
    pub fn more_uncorrected(&self, n: u32, e: &JackknifeEstimate) -> u32 {
        added(n, e.error_bound() / self.half_width)
    }

    /// Factor on the number of samples that makes an estimate precise enough. The variance of scrambled nets
    /// falls as the power −3/2 of their number where the integrand has edges \[He15\], and with it the
    /// noise correction.
    pub fn sample_factor(&self, e: &JackknifeEstimate) -> f64 {
        let (error, bias) = (e.half_width / self.half_width, e.correction.abs() / self.correction);
        error.powf(4.0 / 3.0).max(bias.powf(2.0 / 3.0))
    }

    /// Samples to add to `n` for an estimate to be precise enough.
    pub fn more(&self, n: u32, e: &JackknifeEstimate) -> u32 {
        added(n, self.sample_factor(e))
    }
}

/// Least and largest factor by which samples are multiplied at a time: less than a fifth more changes
/// little, and an estimate at a point that noise has chosen may ask for far too many (620 in a glass bowl
/// where 40 were enough).
const FACTOR_RANGE: [f64; 2] = [1.2, 2.5];

/// Samples to add to `n`, where `factor` times as many are needed.
fn added(n: u32, factor: f64) -> u32 {
    let [least, most] = FACTOR_RANGE;
    let wanted = f64::from(n) * factor.clamp(least, most);
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
