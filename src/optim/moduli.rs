//! Minimisation of sums of moduli, whose minima lie in their kinks.
//!
//! `f(x) = g(x) + Σ w_i |r_i(x)|` has its minima where residuals vanish. There a method for
//! smooth functions stalls, for no step along its gradient helps. With a bound t_i on every
//! modulus the problem is smooth,
//!
//! ```text
//! min g(x) + Σ w_i t_i   with  −t_i ≤ r_i(x) ≤ t_i,
//! ```
//!
//! and NLopt's `LD_SLSQP` solves it. Where residuals are known but to a standard error e_i, what
//! is expected of a modulus is `E|r_i + e_i N|` with a standard normal N: it takes the place of t_i
//! in the sum, since it rises with the modulus. Its minimum leaves a kink that may be elsewhere by
//! as much as pays: on one side of it f often rises much faster than on the other, so that to hit
//! it exactly with residuals that err is to pass it half of the time, at a price.
//!
//! # References
//! \[Kraft88\]; \[Leone61\] (the folded normal distribution).

use std::cell::RefCell;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use nlopt::{Algorithm, Nlopt, Target};

use super::{
    Interrupt, OptimError, Outcome, StopReason,
    tally::{End, Tally, accepted},
};

/// Values of g and of all residuals r_i at a point, with their derivatives by the n variables.
#[derive(Clone, Debug, Default)]
pub struct Moduli {
    /// Value of g.
    pub rest: f64,
    /// Gradient of g, n numbers.
    pub rest_gradient: Vec<f64>,
    /// Residuals r_i.
    pub residuals: Vec<f64>,
    /// Gradients of the residuals one after the other, n numbers each.
    jacobian: Vec<f64>,
}

/// Expected modulus E|r + e N| with a standard normal N, and its derivative by r. \[Leone61\] eq. 4
fn expected_modulus(r: f64, e: f64) -> [f64; 2] {
    if e <= 0.0 {
        return [r.abs(), r.signum()];
    }
    let z = r / e;
    let slope = libm::erf(z * FRAC_1_SQRT_2);
    [e * (2.0 / PI).sqrt() * (-0.5 * z * z).exp() + r * slope, slope] // [Leone61] eq. 4
}

impl Moduli {
    fn new(n: usize, m: usize) -> Self {
        Self {
            rest: f64::NAN,
            rest_gradient: vec![f64::NAN; n],
            residuals: vec![f64::NAN; m],
            jacobian: vec![f64::NAN; n * m],
        }
    }

    /// Gradient of g, then that of each residual, to be filled in.
    pub fn gradients(&mut self) -> impl Iterator<Item = &mut [f64]> {
        let n = self.rest_gradient.len();
        std::iter::once(self.rest_gradient.as_mut_slice()).chain(self.jacobian.chunks_exact_mut(n))
    }

    /// Expected value of f where the residuals have the standard errors `errors`.
    #[must_use]
    pub fn value(&self, weights: &[f64], errors: &[f64]) -> f64 {
        let moduli = weights.iter().zip(&self.residuals).zip(errors);
        self.rest + moduli.map(|((w, r), e)| w * expected_modulus(*r, *e)[0]).sum::<f64>()
    }

    /// Length of the gradient of that expected value, where the slope of |r| is the sign of r.
    #[must_use]
    pub fn slope(&self, weights: &[f64], errors: &[f64]) -> f64 {
        let n = self.rest_gradient.len();
        let slopes = weights.iter().zip(&self.residuals).zip(errors);
        let slopes: Vec<f64> = slopes.map(|((w, r), e)| w * expected_modulus(*r, *e)[1]).collect();
        let by = |j: usize| {
            let of_moduli = slopes.iter().enumerate().map(|(i, slope)| slope * self.jacobian[i * n + j]);
            self.rest_gradient[j] + of_moduli.sum::<f64>()
        };
        (0..n).map(|j| by(j).powi(2)).sum::<f64>().sqrt()
    }

    fn is_finite(&self) -> bool {
        let slopes = self.rest_gradient.iter().chain(&self.jacobian);
        self.rest.is_finite() && self.residuals.iter().chain(slopes).all(|v| v.is_finite())
    }
}

/// Minimises `g(x) + Σ weights[i] E|r_i(x) + errors[i] N|` from `x0` over the part of the unit cube
/// that begins at `lower`; `f(x, out)` fills in all values and derivatives. The search stops when a
/// step changes the sum by less than `f_tolerance`, and after `max_evaluations`.
///
/// # Errors
/// As [`super::minimize`].
///
/// # Panics
/// With the panic of `f`, if it panics.
pub fn minimize_moduli<F>(
    x0: &[f64],
    lower: &[f64],
    weights: &[f64],
    errors: &[f64],
    f_tolerance: f64,
    max_evaluations: u32,
    f: F,
) -> Result<Outcome, OptimError>
where
    F: FnMut(&[f64], &mut Moduli) -> ControlFlow<Interrupt>,
{
    let n = x0.len();
    if n == 0 {
        return Err(OptimError::NoVariables);
    }
    let bounded: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > 0.0).collect();
    let m = bounded.len();
    let search = RefCell::new(Callbacks {
        f,
        lower,
        weights,
        errors,
        bounded: bounded.clone(),
        max_evaluations,
        at: Vec::new(),
        values: Moduli::new(n, weights.len()),
        tally: Tally::default(),
    });
    search.borrow_mut().move_to(x0);
    let mut y: Vec<f64> = x0.to_vec();
    y.extend(bounded.iter().map(|&i| search.borrow().values.residuals[i].abs()));
    let result = {
        let objective =
            |y: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| search.borrow_mut().objective(y, gradient);
        let bounds = |out: &mut [f64], y: &[f64], jacobian: Option<&mut [f64]>, _: &mut ()| {
            search.borrow_mut().bounds(out, y, jacobian);
        };
        let mut opt = Nlopt::new(Algorithm::Slsqp, n + m, objective, Target::Minimize, ());
        let least: Vec<f64> = lower.iter().copied().chain(std::iter::repeat_n(0.0, m)).collect();
        accepted(opt.set_lower_bounds(&least), "set the lower bounds")?;
        let upper: Vec<f64> = (0..n + m).map(|i| if i < n { 1.0 } else { f64::INFINITY }).collect();
        accepted(opt.set_upper_bounds(&upper), "set the upper bounds")?;
        if m > 0 {
            let tolerances = vec![1e-8; 2 * m];
            accepted(opt.add_inequality_mconstraint(2 * m, bounds, (), &tolerances), "bound the moduli")?;
        }
        accepted(opt.set_ftol_abs(f_tolerance), "set f_tol_abs")?;
        accepted(opt.set_stopval(f64::MIN), "set the stopping value")?;
        accepted(opt.set_maxeval(2 * max_evaluations), "set the evaluations")?;
        opt.optimize(&mut y)
    };
    search.into_inner().tally.outcome(result, StopReason::FTolerance)
}

/// The variable `x` brought within [lower, 1], and onto a bound that it misses by a rounding error.
fn within(x: f64, lower: f64) -> f64 {
    // SLSQP misses bounds by some ε; a value that stays exactly on its bound lets evaluations of one
    // value of the background share their work.
    const ROUNDING: f64 = 1e-12;
    if x < lower + ROUNDING {
        lower
    } else if x > 1.0 - ROUNDING {
        1.0
    } else {
        x
    }
}

/// Objective and constraints as NLopt calls them, with the state of the search.
struct Callbacks<'a, F> {
    f: F,
    lower: &'a [f64],
    weights: &'a [f64],
    errors: &'a [f64],
    /// Indices of the residuals of positive weight, whose moduli are bounded by a variable t_i each;
    /// those of weight 0 would only dilute SLSQP's model of the curvature.
    bounded: Vec<usize>,
    max_evaluations: u32,
    /// Point at which `values` were evaluated.
    at: Vec<f64>,
    values: Moduli,
    tally: Tally,
}

impl<F> Callbacks<'_, F>
where
    F: FnMut(&[f64], &mut Moduli) -> ControlFlow<Interrupt>,
{
    /// Evaluates at `x`, unless it did so last; does nothing once the search is over.
    fn move_to(&mut self, x: &[f64]) {
        if self.tally.end.is_some() || self.at == x {
            return;
        }
        if self.tally.evaluations >= self.max_evaluations {
            self.tally.end = Some(End::Stop(StopReason::Evaluations));
            return;
        }
        let inside: Vec<f64> = x.iter().zip(self.lower).map(|(&v, &lower)| within(v, lower)).collect();
        // C must not be unwound.
        match catch_unwind(AssertUnwindSafe(|| (self.f)(&inside, &mut self.values))) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(Interrupt)) => {
                self.tally.end = Some(End::Stop(StopReason::Interrupted));
                return;
            }
            Err(payload) => {
                self.tally.end = Some(End::Panic(payload));
                return;
            }
        }
        self.tally.evaluations += 1;
        self.at = x.to_vec();
        let value = self.values.value(self.weights, self.errors);
        if !self.values.is_finite() {
            let evaluation = self.tally.evaluations;
            self.tally.end =
                Some(End::Error(OptimError::NotFinite { evaluation, component: None, value, x: inside }));
            return;
        }
        self.tally.record(&inside, value);
    }

    fn objective(&mut self, y: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let (x, t) = y.split_at(y.len() - self.bounded.len());
        self.move_to(x);
        if self.tally.end.is_some() {
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
            }
            return f64::NEG_INFINITY;
        }
        if let Some(gradient) = gradient {
            let (by_x, by_t) = gradient.split_at_mut(x.len());
            by_x.copy_from_slice(&self.values.rest_gradient);
            for ((&i, t), by_t) in self.bounded.iter().zip(t).zip(by_t) {
                *by_t = self.weights[i] * expected_modulus(*t, self.errors[i])[1];
            }
        }
        let moduli = self.bounded.iter().zip(t);
        let expected = moduli.map(|(&i, t)| self.weights[i] * expected_modulus(*t, self.errors[i])[0]);
        self.values.rest + expected.sum::<f64>()
    }

    /// Constraints r_i − t_i ≤ 0 and −r_i − t_i ≤ 0, and their Jacobian.
    fn bounds(&mut self, out: &mut [f64], y: &[f64], jacobian: Option<&mut [f64]>) {
        let (x, t) = y.split_at(y.len() - self.bounded.len());
        self.move_to(x);
        if self.tally.end.is_some() {
            out.fill(-1.0);
            if let Some(jacobian) = jacobian {
                jacobian.fill(0.0);
            }
            return;
        }
        let n = x.len();
        for (k, (&i, t)) in self.bounded.iter().zip(t).enumerate() {
            let r = self.values.residuals[i];
            out[2 * k] = r - t;
            out[2 * k + 1] = -r - t;
        }
        let Some(jacobian) = jacobian else { return };
        for (k, row) in jacobian.chunks_exact_mut(y.len()).enumerate() {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            row.fill(0.0);
            let of_residual = &self.values.jacobian[self.bounded[k / 2] * n..][..n];
            for (out, d) in row.iter_mut().zip(of_residual) {
                *out = sign * d;
            }
            row[n + k / 2] = -1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `(x − 1)²/10 + |10 (y − x²)|` on the unit square, of which the minimum lies in a curved kink.
    fn curved_kink(x: &[f64], out: &mut Moduli) -> ControlFlow<Interrupt> {
        out.rest = 0.1 * (x[0] - 1.0).powi(2);
        out.rest_gradient.copy_from_slice(&[0.2 * (x[0] - 1.0), 0.0]);
        out.residuals[0] = 10.0 * (x[1] - x[0] * x[0]);
        out.jacobian[..2].copy_from_slice(&[-20.0 * x[0], 10.0]);
        ControlFlow::Continue(())
    }

    #[test]
    fn the_minimum_along_a_kink_is_found() {
        for start in [[0.1, 0.9], [0.0, 0.0], [0.7, 0.2]] {
            let out = minimize_moduli(&start, &[0.0; 2], &[1.0], &[0.0], 1e-12, 200, curved_kink).unwrap();
            assert!(out.f < 1e-6, "{start:?}: {out:?}");
            assert!((out.x[0] - 1.0).abs() < 1e-2 && (out.x[1] - 1.0).abs() < 2e-2, "{out:?}");
        }
    }

    #[test]
    fn bounds_hold() {
        let lower = [0.3, 0.5];
        let out = minimize_moduli(&[0.4, 0.9], &lower, &[1.0], &[0.0], 1e-12, 200, |x, out| {
            assert!(x[0] >= lower[0] && x[1] >= lower[1], "{x:?}");
            out.rest = x[0] + x[1];
            out.rest_gradient.fill(1.0);
            out.residuals[0] = 0.0;
            out.jacobian[..2].fill(0.0);
            ControlFlow::Continue(())
        });
        assert_eq!(out.unwrap().x, lower);
    }

    #[test]
    fn more_moduli_than_variables_meet_in_a_corner() {
        // Weighted median: |x − 0.2| + |x − 0.5| + 3 |x − 0.6| is least at 0.6.
        let at = [0.2, 0.5, 0.6];
        let out = minimize_moduli(&[0.05], &[0.0], &[1.0, 1.0, 3.0], &[0.0; 3], 1e-12, 50, |x, out| {
            out.rest = 0.0;
            out.rest_gradient[0] = 0.0;
            for (i, at) in at.into_iter().enumerate() {
                out.residuals[i] = x[0] - at;
                out.jacobian[i] = 1.0;
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!((out.x[0] - 0.6).abs() < 1e-6 && (out.f - 0.5).abs() < 1e-6, "{out:?}");
    }

    #[test]
    fn residuals_without_weight_leave_the_search_as_it_is_without_them() {
        let alone = |x: &[f64], out: &mut Moduli| {
            (out.rest, out.rest_gradient[0]) = ((x[0] - 0.3).powi(4), 4.0 * (x[0] - 0.3).powi(3));
            ControlFlow::Continue(())
        };
        let without = minimize_moduli(&[0.9], &[0.0], &[], &[], 1e-10, 50, alone).unwrap();
        let with = minimize_moduli(&[0.9], &[0.0], &[0.0, 0.0], &[0.0, 0.1], 1e-10, 50, |x, out| {
            (out.residuals[0], out.jacobian[0]) = ((9.0 * x[0]).sin(), 9.0 * (9.0 * x[0]).cos());
            (out.residuals[1], out.jacobian[1]) = (5.0 * (x[0] - 0.8), 5.0);
            alone(x, out)
        });
        assert_eq!(with.unwrap(), without);
    }

    #[test]
    fn the_expected_modulus_is_the_mean_of_moduli() {
        for (r, e) in [(0.0, 0.1), (0.05, 0.1), (-0.3, 0.1), (2.0, 0.1)] {
            // Over the quantiles of the normal distribution, by the midpoint rule in its density.
            let (mut sum, mut mass) = (0.0, 0.0);
            for i in 0..8000 {
                let z = (f64::from(i) + 0.5) / 500.0 - 8.0;
                let density = (-0.5 * z * z).exp();
                sum += density * (r + e * z).abs();
                mass += density;
            }
            let [value, slope] = expected_modulus(r, e);
            assert!((value - sum / mass).abs() < 1e-6, "{r} {e}: {value} {}", sum / mass);
            let difference = (expected_modulus(r + 1e-6, e)[0] - expected_modulus(r - 1e-6, e)[0]) / 2e-6;
            assert!((slope - difference).abs() < 1e-6, "{r} {e}: {slope} {difference}");
        }
        assert_eq!(expected_modulus(-0.3, 0.0), [0.3, -1.0]);
    }

    /// `|x − 0.5| + 0.9 x` is least in the kink; if that may lie 0.05 away, where erf(z/√2) = −0.9.
    #[test]
    fn a_kink_that_may_be_elsewhere_is_left_to_the_side_where_less_is_lost() {
        let f = |x: &[f64], out: &mut Moduli| {
            (out.rest, out.rest_gradient[0]) = (0.9 * x[0], 0.9);
            (out.residuals[0], out.jacobian[0]) = (x[0] - 0.5, 1.0);
            ControlFlow::Continue(())
        };
        for (error, x) in [(0.0, 0.5), (0.05, 0.5 - 0.05 * 1.644_854)] {
            let out = minimize_moduli(&[0.9], &[0.0], &[1.0], &[error], 1e-12, 50, f).unwrap();
            assert!((out.x[0] - x).abs() < 1e-5, "{error}: {out:?}");
        }
        let mut at = Moduli::new(1, 1);
        let _ = f(&[0.5 - 0.05 * 1.644_854], &mut at);
        let slopes = [0.0, 0.05].map(|error| at.slope(&[1.0], &[error]));
        assert!((slopes[0] - 0.1).abs() < 1e-12 && slopes[1] < 1e-5, "{slopes:?}");
    }

    #[test]
    fn limits_interrupts_and_nonsense_end_it() {
        let out = minimize_moduli(&[0.1, 0.9], &[0.0; 2], &[1.0], &[0.0], 0.0, 3, curved_kink).unwrap();
        assert!(out.evaluations == 3 && out.stop == StopReason::Evaluations, "{out:?}");
        let mut left = 2;
        let out = minimize_moduli(&[0.1, 0.9], &[0.0; 2], &[1.0], &[0.0], 0.0, 99, |x, out| {
            left -= 1;
            if left < 0 { ControlFlow::Break(Interrupt) } else { curved_kink(x, out) }
        })
        .unwrap();
        assert_eq!(out.stop, StopReason::Interrupted);
        let never = minimize_moduli(&[0.1], &[0.0], &[], &[], 0.0, 9, |_, _| ControlFlow::Break(Interrupt));
        assert_eq!(never.unwrap_err(), OptimError::NothingEvaluated);
        let nonsense =
            minimize_moduli(&[0.1, 0.9], &[0.0; 2], &[1.0], &[0.0], 0.0, 9, |_, _| ControlFlow::Continue(()));
        assert!(matches!(nonsense, Err(OptimError::NotFinite { evaluation: 1, .. })));
        let caught = catch_unwind(AssertUnwindSafe(|| {
            minimize_moduli(&[0.1, 0.9], &[0.0; 2], &[1.0], &[0.0], 0.0, 9, |_, _| panic!("of the caller"))
        }));
        assert!(caught.is_err());
    }
}
