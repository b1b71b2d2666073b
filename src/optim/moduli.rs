//! Sums of moduli: down into the kinks and along them.
//!
//! `f(x) = g(x) + Σ w_i |r_i(x)|` has its minima where residuals vanish. There a method for
//! smooth functions stalls, for no step along its gradient helps. With a bound t_i on every
//! modulus the problem is smooth,
//!
//! ```text
//! min g(x) + Σ w_i t_i   with  −t_i ≤ r_i(x) ≤ t_i,
//! ```
//!
//! and NLopt's `LD_SLSQP` solves it. Where residuals are known but to an error, moduli below it
//! tell nothing: t_i ≥ e_i makes every modulus `max(|r_i|, e_i)`.
//!
//! # References
//! \[Kraft88\].

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

use nlopt::{Algorithm, Nlopt, Target};

use super::{
    Interrupt, OptimError, Outcome, StopReason,
    tally::{End, Tally, accepted},
};

/// Values of g and of every r_i at a point, with their derivatives by the n variables.
#[derive(Clone, Debug, Default)]
pub struct Moduli {
    /// g.
    pub rest: f64,
    /// ∂g/∂x.
    pub rest_gradient: Vec<f64>,
    /// r.
    pub residuals: Vec<f64>,
    /// ∂r_i/∂x, one after the other.
    jacobian: Vec<f64>,
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

    /// ∂r_i/∂x.
    pub fn gradient_of(&mut self, i: usize) -> &mut [f64] {
        let n = self.rest_gradient.len();
        &mut self.jacobian[i * n..][..n]
    }

    /// All gradients: of g and of every r_i.
    pub fn gradients(&mut self) -> impl Iterator<Item = &mut [f64]> {
        let n = self.rest_gradient.len();
        std::iter::once(self.rest_gradient.as_mut_slice()).chain(self.jacobian.chunks_exact_mut(n))
    }

    /// f, with moduli that are no less than `floors`.
    #[must_use]
    pub fn value(&self, weights: &[f64], floors: &[f64]) -> f64 {
        let moduli = weights.iter().zip(&self.residuals).zip(floors);
        self.rest + moduli.map(|((w, r), floor)| w * r.abs().max(*floor)).sum::<f64>()
    }

    /// Length of a gradient of f, in which |r| has the slope of r's sign, and none below its floor.
    #[must_use]
    pub fn slope(&self, weights: &[f64], floors: &[f64]) -> f64 {
        let n = self.rest_gradient.len();
        let by = |j: usize| {
            let of_moduli = weights.iter().zip(&self.residuals).zip(floors).enumerate();
            let rising = of_moduli.filter(|(_, ((_, r), floor))| r.abs() >= **floor);
            let sum = rising.map(|(i, ((w, r), _))| w * r.signum() * self.jacobian[i * n + j]).sum::<f64>();
            self.rest_gradient[j] + sum
        };
        (0..n).map(|j| by(j).powi(2)).sum::<f64>().sqrt()
    }

    fn is_finite(&self) -> bool {
        let slopes = self.rest_gradient.iter().chain(&self.jacobian);
        self.rest.is_finite() && self.residuals.iter().chain(slopes).all(|v| v.is_finite())
    }
}

/// Minimises `g(x) + Σ weights[i] max(|r_i(x)|, floors[i])` over the unit cube from `x0`;
/// `f(x, out)` fills in all values and derivatives. It stops when a step changes the sum by less
/// than `f_tolerance`, and after `max_evaluations`.
///
/// # Errors
/// As [`super::minimize`].
///
/// # Panics
/// With the panic of `f`, if it panics.
pub fn minimize_moduli<F>(
    x0: &[f64],
    weights: &[f64],
    floors: &[f64],
    f_tolerance: f64,
    max_evaluations: u32,
    f: F,
) -> Result<Outcome, OptimError>
where
    F: FnMut(&[f64], &mut Moduli) -> ControlFlow<Interrupt>,
{
    let (n, m) = (x0.len(), weights.len());
    if n == 0 {
        return Err(OptimError::NoVariables);
    }
    let search = RefCell::new(Search {
        f,
        weights,
        floors,
        max_evaluations,
        at: Vec::new(),
        values: Moduli::new(n, m),
        tally: Tally::default(),
    });
    search.borrow_mut().move_to(x0);
    let mut y: Vec<f64> = x0.to_vec();
    y.extend(search.borrow().values.residuals.iter().zip(floors).map(|(r, floor)| r.abs().max(*floor)));
    let result = {
        let objective =
            |y: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| search.borrow_mut().objective(y, gradient);
        let bounds = |out: &mut [f64], y: &[f64], jacobian: Option<&mut [f64]>, _: &mut ()| {
            search.borrow_mut().bounds(out, y, jacobian);
        };
        let mut opt = Nlopt::new(Algorithm::Slsqp, n + m, objective, Target::Minimize, ());
        let lower = [&vec![0.0; n], floors].concat();
        accepted(opt.set_lower_bounds(&lower), "set the lower bounds")?;
        let upper: Vec<f64> = (0..n + m).map(|i| if i < n { 1.0 } else { f64::INFINITY }).collect();
        accepted(opt.set_upper_bounds(&upper), "set the upper bounds")?;
        accepted(opt.add_inequality_mconstraint(2 * m, bounds, (), &vec![1e-8; 2 * m]), "bound the moduli")?;
        accepted(opt.set_ftol_abs(f_tolerance), "set f_tol_abs")?;
        accepted(opt.set_stopval(f64::MIN), "set the stopping value")?;
        accepted(opt.set_maxeval(2 * max_evaluations), "set the evaluations")?;
        opt.optimize(&mut y)
    };
    search.into_inner().tally.outcome(result, StopReason::FTolerance)
}

struct Search<'a, F> {
    f: F,
    weights: &'a [f64],
    floors: &'a [f64],
    max_evaluations: u32,
    /// Where `values` were taken.
    at: Vec<f64>,
    values: Moduli,
    tally: Tally,
}

impl<F> Search<'_, F>
where
    F: FnMut(&[f64], &mut Moduli) -> ControlFlow<Interrupt>,
{
    /// Evaluates at `x`, unless that is where it was last. Once `end` is set it does nothing.
    fn move_to(&mut self, x: &[f64]) {
        if self.tally.end.is_some() || self.at == x {
            return;
        }
        if self.tally.evaluations >= self.max_evaluations {
            self.tally.end = Some(End::Stop(StopReason::Evaluations));
            return;
        }
        let inside: Vec<f64> = x.iter().map(|v| v.clamp(0.0, 1.0)).collect();
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
        let value = self.values.value(self.weights, self.floors);
        if !self.values.is_finite() {
            let evaluation = self.tally.evaluations;
            self.tally.end =
                Some(End::Error(OptimError::NotFinite { evaluation, component: None, value, x: inside }));
            return;
        }
        self.tally.record(&inside, value);
    }

    fn objective(&mut self, y: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let (x, t) = y.split_at(y.len() - self.weights.len());
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
            by_t.copy_from_slice(self.weights);
        }
        self.values.rest + self.weights.iter().zip(t).map(|(w, t)| w * t).sum::<f64>()
    }

    /// r_i − t_i and −r_i − t_i, wanted below 0.
    fn bounds(&mut self, out: &mut [f64], y: &[f64], jacobian: Option<&mut [f64]>) {
        let (x, t) = y.split_at(y.len() - self.weights.len());
        self.move_to(x);
        if self.tally.end.is_some() {
            out.fill(-1.0);
            if let Some(jacobian) = jacobian {
                jacobian.fill(0.0);
            }
            return;
        }
        let n = x.len();
        for (i, (r, t)) in self.values.residuals.iter().zip(t).enumerate() {
            out[2 * i] = r - t;
            out[2 * i + 1] = -r - t;
        }
        let Some(jacobian) = jacobian else { return };
        for (k, row) in jacobian.chunks_exact_mut(y.len()).enumerate() {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            row.fill(0.0);
            for (out, d) in row.iter_mut().zip(&self.values.jacobian[k / 2 * n..][..n]) {
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
        out.gradient_of(0).copy_from_slice(&[-20.0 * x[0], 10.0]);
        ControlFlow::Continue(())
    }

    #[test]
    fn the_minimum_along_a_kink_is_found() {
        for start in [[0.1, 0.9], [0.0, 0.0], [0.7, 0.2]] {
            let out = minimize_moduli(&start, &[1.0], &[0.0], 1e-12, 200, curved_kink).unwrap();
            assert!(out.f < 1e-6, "{start:?}: {out:?}");
            assert!((out.x[0] - 1.0).abs() < 1e-2 && (out.x[1] - 1.0).abs() < 2e-2, "{out:?}");
        }
    }

    #[test]
    fn more_moduli_than_variables_meet_in_a_corner() {
        // Weighted median: |x − 0.2| + |x − 0.5| + 3 |x − 0.6| is least at 0.6.
        let at = [0.2, 0.5, 0.6];
        let out = minimize_moduli(&[0.05], &[1.0, 1.0, 3.0], &[0.0; 3], 1e-12, 50, |x, out| {
            out.rest = 0.0;
            out.rest_gradient[0] = 0.0;
            for (i, at) in at.into_iter().enumerate() {
                out.residuals[i] = x[0] - at;
                out.gradient_of(i)[0] = 1.0;
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!((out.x[0] - 0.6).abs() < 1e-6 && (out.f - 0.5).abs() < 1e-6, "{out:?}");
    }

    /// `|x − 0.5| + 0.1 x` is least in the kink; nothing is lost down to 0.45 if that may lie 0.05
    /// away.
    #[test]
    fn moduli_below_their_floor_are_left_for_what_gains_by_it() {
        let f = |x: &[f64], out: &mut Moduli| {
            (out.rest, out.rest_gradient[0]) = (0.1 * x[0], 0.1);
            (out.residuals[0], out.gradient_of(0)[0]) = (x[0] - 0.5, 1.0);
            ControlFlow::Continue(())
        };
        for (floor, x, value) in [(0.0, 0.5, 0.05), (0.05, 0.45, 0.095)] {
            let out = minimize_moduli(&[0.9], &[1.0], &[floor], 1e-12, 50, f).unwrap();
            assert!((out.x[0] - x).abs() < 1e-6 && (out.f - value).abs() < 1e-6, "{floor}: {out:?}");
        }
        let mut at = Moduli::new(1, 1);
        let _ = f(&[0.47], &mut at);
        let slopes = [0.0, 0.05].map(|floor| at.slope(&[1.0], &[floor]));
        assert!((slopes[0] - 0.9).abs() < 1e-12 && (slopes[1] - 0.1).abs() < 1e-12, "{slopes:?}");
    }

    #[test]
    fn limits_interrupts_and_nonsense_end_it() {
        let out = minimize_moduli(&[0.1, 0.9], &[1.0], &[0.0], 0.0, 3, curved_kink).unwrap();
        assert!(out.evaluations == 3 && out.stop == StopReason::Evaluations, "{out:?}");
        let mut left = 2;
        let out = minimize_moduli(&[0.1, 0.9], &[1.0], &[0.0], 0.0, 99, |x, out| {
            left -= 1;
            if left < 0 { ControlFlow::Break(Interrupt) } else { curved_kink(x, out) }
        })
        .unwrap();
        assert_eq!(out.stop, StopReason::Interrupted);
        let never = minimize_moduli(&[0.1], &[], &[], 0.0, 9, |_, _| ControlFlow::Break(Interrupt));
        assert_eq!(never.unwrap_err(), OptimError::NothingEvaluated);
        let nonsense = minimize_moduli(&[0.1, 0.9], &[1.0], &[0.0], 0.0, 9, |_, _| ControlFlow::Continue(()));
        assert!(matches!(nonsense, Err(OptimError::NotFinite { evaluation: 1, .. })));
        let caught = catch_unwind(AssertUnwindSafe(|| {
            minimize_moduli(&[0.1, 0.9], &[1.0], &[0.0], 0.0, 9, |_, _| panic!("of the caller"))
        }));
        assert!(caught.is_err());
    }
}
