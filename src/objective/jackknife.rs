//! Estimates freed of noise bias by the delete-one jackknife, with error bars.
//!
//! `z_J = R·z(l(Ȳ)) − (R−1)·mean_r z(l(Ȳ₋ᵣ))` for every statistic z, from the mean Ȳ of
//! R independent replicates and the R means Ȳ₋ᵣ that leave one out. Roots, moduli and
//! clipping come after. An f_q that is reported is estimated so.
//!
//! A bias of the order R⁻² is left, which the [second order](second_order) removes.
//!
//! # References
//! \[Efron82\] ch. 2 (bias, eq. 2.8) and ch. 3 (standard error, eq. 3.1); \[Schucany71\].

use super::special::student_t_95;
use super::{Evaluation, Objective, ObjectiveError, Ramp, Smoothing, Statistics};

/// f_q estimated from R replicates of a picture, with its error.
#[derive(Clone, Debug, PartialEq)]
pub struct JackknifeEstimate {
    /// Estimate f_J of f_q and its terms, from the bias-corrected statistics.
    pub evaluation: Evaluation,
    /// f_q of the mean picture, biased by the noise that is left in it.
    pub naive: f64,
    /// Standard error of f_q by the delete-one jackknife.
    pub standard_error: f64,
    /// Half width of the 95 % interval of f_q: the standard error times Student's t with R−1 degrees
    /// of freedom. The [error bar](Self::error_bar) adds the size of `correction`.
    pub half_width: f64,
    /// Noise correction `c = f_naive − f_J`: by how much noise raises f_q of the mean picture.
    pub correction: f64,
    /// Standard errors of the [normalised residuals](super::TermValue::residual) of the scalar terms
    /// that the target has goals for, in their order.
    pub residual_errors: Vec<f64>,
    /// Number R of replicates, ≥ 2.
    pub replicates: usize,
}

/// Noise correction from which on all of it is an error: below, the part that the jackknife leaves shrinks with it.
const WHOLE_CORRECTION: f64 = 0.04;

impl JackknifeEstimate {
    /// Half width of the interval that is reported, `half_width + |c| min(1, |c| / 0.04)` of the correction c. The
    /// correction is a bias of the order R⁻¹, and the jackknife leaves one of R⁻², the more the larger c is.
    #[must_use]
    pub fn error_bar(&self) -> f64 {
        let c = self.correction.abs();
        self.half_width + c * (c / WHOLE_CORRECTION).min(1.0)
    }

    /// Bound of the error, `half_width + |correction|`, by which it is decided whether more samples are needed.
    #[must_use]
    pub fn error_bound(&self) -> f64 {
        self.half_width + self.correction.abs()
    }
}

/// Bias-corrected statistics `z_J`, unclipped: from the statistics of the mean picture and, for each
/// labelling of the R replicates, of the R means that leave one out. Labellings are averaged.
///
/// # Errors
/// With fewer than two replicates.
pub fn corrected(full: &Statistics, labellings: &[Vec<Statistics>]) -> Result<Statistics, ObjectiveError> {
    let [weight_full, weight_one] = weights(labellings.first().map_or(0, Vec::len))?;
    let mut z = Statistics::ZERO;
    z.add_scaled(weight_full, full);
    for one in labellings.iter().flatten() {
        z.add_scaled(weight_one / labellings.len() as f64, one);
    }
    Ok(z)
}

/// The second-order jackknife of every statistic, unclipped, from those of the mean picture, of the
/// R means that leave one replicate out, and of the R(R−1)/2 that leave out two: free of bias to
/// the order R⁻².
///
/// # Panics
/// With fewer than three replicates.
#[must_use]
pub fn second_order(full: &Statistics, one_out: &[Statistics], two_out: &[Statistics]) -> Statistics {
    assert!(one_out.len() >= 3, "the second order needs three replicates, not {}", one_out.len());
    let r = one_out.len() as f64;
    let mut z = Statistics::ZERO;
    // [Schucany71], biases a/R + b/R².
    for (weight, of) in [
        (0.5 * r * r, std::slice::from_ref(full)),
        (-(r - 1.0).powi(2), one_out),
        (0.5 * (r - 2.0).powi(2), two_out),
    ] {
        of.iter().for_each(|one| z.add_scaled(weight / of.len() as f64, one));
    }
    z
}

/// Weights of z(Ȳ) and of each z(Ȳ₋ᵣ) in z_J: R and −(R−1)/R. Gradients combine by the same weights.
pub(super) fn weights(replicates: usize) -> Result<[f64; 2], ObjectiveError> {
    if replicates < 2 {
        return Err(ObjectiveError::TooFewReplicates { replicates });
    }
    let r = replicates as f64;
    Ok([r, -(r - 1.0) / r])
}

/// Bias-corrected statistics of replicates, with those from which adjoints are carried back.
#[derive(Clone, Debug)]
pub struct Jackknifed {
    /// Statistics of the mean picture.
    full: Statistics,
    /// Statistics of the R means that leave one replicate out.
    one_out: Vec<Statistics>,
    /// Bias-corrected statistics z_J, unclipped.
    pub corrected: Statistics,
}

impl Objective {
    /// Bias-corrected f_q with its error, from the statistics of the mean picture and of
    /// the R ≥ 2 means that leave one replicate out, for every labelling of the replicates
    /// (see [`super::replicates`]).
    ///
    /// `smoothing` must be that of the statistics: [`Smoothing::NONE`] for what is
    /// reported; then equal replicates give exactly the plain evaluation.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn jackknife(
        &self,
        full: &Statistics,
        labellings: &[Vec<Statistics>],
        smoothing: &Smoothing,
    ) -> Result<JackknifeEstimate, ObjectiveError> {
        let evaluation = self.terms(&corrected(full, labellings)?, smoothing);
        let naive = self.terms(full, smoothing).f_q;
        let replicates = labellings[0].len();
        let r = replicates as f64;
        let one_out: Vec<Vec<Evaluation>> =
            labellings.iter().map(|of| of.iter().map(|z| self.terms(z, smoothing)).collect()).collect();
        let standard_error = |of: &dyn Fn(&Evaluation) -> f64| {
            let variance = |f: &Vec<f64>| {
                let mean = f.iter().sum::<f64>() / r;
                let spread = f.iter().map(|f| (f - mean) * (f - mean)).sum::<f64>();
                (r - 1.0) / r * spread // [Efron82] eq. 3.1
            };
            let values = one_out.iter().map(|labelling| labelling.iter().map(of).collect());
            (values.map(|f| variance(&f)).sum::<f64>() / one_out.len() as f64).sqrt()
        };
        let residual_errors = self.scalars().map(|term| standard_error(&|e| e[term].residual())).collect();
        let standard_error = standard_error(&|e| e.f_q);
        Ok(JackknifeEstimate {
            correction: naive - evaluation.f_q,
            evaluation,
            naive,
            standard_error,
            residual_errors,
            half_width: student_t_95(replicates - 1) * standard_error,
            replicates,
        })
    }

    /// Bias-corrected statistics from the display luminance of the mean picture and of the means that
    /// leave one replicate out.
    ///
    /// # Errors
    /// With fewer than two replicates.
    ///
    /// # Panics
    /// When a picture has another size than the objective.
    pub fn jackknifed(
        &self,
        full: &[f64],
        leave_one_out: &[&[f64]],
        ramp: Ramp,
    ) -> Result<Jackknifed, ObjectiveError> {
        let full = self.statistics(full, ramp);
        let labelling = [leave_one_out.iter().map(|l| self.statistics(l, ramp)).collect::<Vec<_>>()];
        let corrected = corrected(&full, &labelling)?;
        let [one_out] = labelling;
        Ok(Jackknifed { full, one_out, corrected })
    }

    /// Carries a gradient `dz` in the bias-corrected statistics back to the pictures: to the
    /// mean and to those that leave one out (adjoints are overwritten; each has the picture's
    /// size).
    ///
    /// # Errors
    /// With fewer than two replicates.
    ///
    /// # Panics
    /// When a picture or adjoint has another size than the objective.
    pub fn adjoints(
        &self,
        (full, leave_one_out): (&[f64], &[&[f64]]),
        z: &Jackknifed,
        dz: &Statistics,
        ramp: Ramp,
        (out_full, out_one): (&mut [f64], &mut [Vec<f64>]),
    ) -> Result<(), ObjectiveError> {
        assert_eq!(out_one.len(), leave_one_out.len(), "one adjoint a replicate");
        let [weight_full, weight_one] = weights(leave_one_out.len())?;
        out_full.fill(0.0);
        self.add_adjoint(full, &z.full, dz, weight_full, ramp, out_full);
        for ((l, z), out) in leave_one_out.iter().zip(&z.one_out).zip(out_one) {
            out.fill(0.0);
            self.add_adjoint(l, z, dz, weight_one, ramp, out);
        }
        Ok(())
    }
}
