//! NLopt's `LD_LBFGS` and `GN_DIRECT_L` behind a function that neither hangs, aborts nor loses the best point.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use nlopt::{Algorithm, Nlopt, Target};

use super::{
    Interrupt, Method, OptimError, Options, Outcome, StopReason,
    tally::{End, Tally, accepted},
};

/// Minimises `f` over the box `lower <= x <= upper`, from `x0`.
///
/// `f(x, gradient)` returns the function and fills in all of its derivatives; it is never
/// called outside the box. Bounds may be infinite, and equal where a variable is fixed. The
/// first trial after `x0` is `x0 − ∇f`, cut at the first bound on the way: scale variables, and
/// set [`Options::first_step`], so that this is a sane step.
///
/// ```
/// use std::ops::ControlFlow;
/// use lightopt_embree::optim::{Options, minimize};
///
/// // The least distance from (2, 1/2) within the unit square is at (1, 1/2).
/// let found = minimize(&[0.1, 0.1], &[0.0; 2], &[1.0; 2], &Options::default(), |x, gradient| {
///     let d = [x[0] - 2.0, x[1] - 0.5];
///     gradient.copy_from_slice(&d.map(|d| 2.0 * d));
///     ControlFlow::Continue(d[0] * d[0] + d[1] * d[1])
/// })?;
/// assert!((found.x[0] - 1.0).abs() < 1e-6 && (found.x[1] - 0.5).abs() < 1e-3);
/// assert!(found.stop.converged());
/// # Ok::<(), lightopt_embree::optim::OptimError>(())
/// ```
///
/// # Errors
/// A problem that is not well posed, a value that is not finite, or an interrupt before the
/// first value. Everything else is an [`Outcome`] with a [`StopReason`].
///
/// # Panics
/// With the panic of `f`, if it panics.
pub fn minimize<F>(
    x0: &[f64],
    lower: &[f64],
    upper: &[f64],
    options: &Options,
    f: F,
) -> Result<Outcome, OptimError>
where
    F: FnMut(&[f64], &mut [f64]) -> ControlFlow<Interrupt, f64>,
{
    validate(x0, lower, upper, options)?;
    let search = RefCell::new(Callback {
        f,
        lower,
        upper,
        options,
        start: Instant::now(),
        x: x0.to_vec(),
        gradient: vec![0.0; x0.len()],
        scale: 1.0,
        start_value: None,
        tally: Tally::default(),
    });
    if let Some(longest) = options.first_step {
        search.borrow_mut().scale_first_step(x0, longest);
    }
    let f_tol_abs = options.f_tol_abs * search.borrow().scale;
    let mut x = x0.to_vec();
    let result = {
        let objective =
            |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| search.borrow_mut().call(x, gradient);
        let algorithm = match options.method {
            Method::Lbfgs => Algorithm::Lbfgs,
            Method::DirectL => Algorithm::DirectL,
        };
        let mut opt = Nlopt::new(algorithm, x0.len(), objective, Target::Minimize, ());
        accepted(opt.set_lower_bounds(lower), "set the lower bounds")?;
        accepted(opt.set_upper_bounds(upper), "set the upper bounds")?;
        // A finite value, so that −∞ is below it: how `call` stops a search. The crate's
        // `force_stop` needs the object that is busy searching.
        accepted(opt.set_stopval(f64::MIN), "set the stopping value")?;
        accepted(opt.set_ftol_abs(f_tol_abs), "set f_tol_abs")?;
        accepted(opt.set_ftol_rel(options.f_tol_rel), "set f_tol_rel")?;
        accepted(opt.set_xtol_abs1(options.x_tol_abs), "set x_tol_abs")?;
        accepted(opt.set_xtol_rel(options.x_tol_rel), "set x_tol_rel")?;
        // 0 would mean 10 MB of it. Evaluations and time are counted in `call`: NLopt looks
        // at its own limits only between line searches.
        accepted(opt.set_vector_storage(Some(options.memory as usize)), "set the memory")?;
        opt.optimize(&mut x)
    };

    // A success that is no tolerance is Lukšan's gradient test; other limits are not set.
    search.into_inner().tally.outcome(result, StopReason::Stationary)
}

/// The objective as NLopt calls it, with the state of the search.
struct Callback<'a, F> {
    f: F,
    lower: &'a [f64],
    upper: &'a [f64],
    options: &'a Options,
    start: Instant,
    x: Vec<f64>,
    gradient: Vec<f64>,
    /// Factor on the function and its gradient as NLopt sees them.
    scale: f64,
    /// Value of the function at x0, whose gradient is in `gradient`, until NLopt asks for it.
    start_value: Option<f64>,
    tally: Tally,
}

impl<F> Callback<'_, F>
where
    F: FnMut(&[f64], &mut [f64]) -> ControlFlow<Interrupt, f64>,
{
    /// Evaluates at the start and scales the function so that no component of the first trial step
    /// is longer than `longest`.
    fn scale_first_step(&mut self, x0: &[f64], longest: f64) {
        self.start_value = self.try_evaluate(x0);
        if self.start_value.is_some() {
            let steepest = self.gradient.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
            self.scale = if steepest > longest { longest / steepest } else { 1.0 };
        }
    }

    /// Called by C: must not unwind. Once `end` is set it returns −∞ and a zero gradient,
    /// which ends the line search and then the search.
    fn call(&mut self, x: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let value = self.start_value.take().or_else(|| self.try_evaluate(x));
        let Some(value) = value else {
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
            }
            return f64::NEG_INFINITY;
        };
        if let Some(gradient) = gradient {
            gradient.iter_mut().zip(&self.gradient).for_each(|(to, g)| *to = self.scale * g);
        }
        self.scale * value
    }

    /// Value of the function at `x`; `None`, with the reason in the tally, once the search is over.
    fn try_evaluate(&mut self, x: &[f64]) -> Option<f64> {
        if self.tally.end.is_some() {
            return None;
        }
        self.tally.end = match catch_unwind(AssertUnwindSafe(|| self.evaluate(x))) {
            Ok(Ok(value)) => return Some(value),
            Ok(Err(end)) => Some(end),
            Err(payload) => Some(End::Panic(payload)),
        };
        None
    }

    fn evaluate(&mut self, x: &[f64]) -> Result<f64, End> {
        let stop = |reason| Err(End::Stop(reason));
        if self.options.max_evaluations.is_some_and(|max| self.tally.evaluations >= max) {
            return stop(StopReason::Evaluations);
        }
        let late = self.options.time_limit.is_some_and(|limit| self.start.elapsed() >= limit);
        if late && self.tally.evaluations > 0 {
            return stop(StopReason::TimeLimit);
        }
        for (i, &value) in x.iter().enumerate() {
            // A step that ends on a bound may overshoot it by a rounding error.
            self.x[i] = value.clamp(self.lower[i], self.upper[i]);
        }
        // What the objective forgets to fill in must not pass for a derivative.
        let is_needed = self.options.method == Method::Lbfgs;
        self.gradient.fill(if is_needed { f64::NAN } else { 0.0 });
        let value = match (self.f)(&self.x, &mut self.gradient) {
            ControlFlow::Continue(value) => value,
            ControlFlow::Break(Interrupt) => return stop(StopReason::Interrupted),
        };
        self.tally.evaluations += 1;

        let bad = self.gradient.iter().position(|d| !d.is_finite());
        if !value.is_finite() || bad.is_some() {
            let component = bad.filter(|_| value.is_finite());
            return Err(End::Error(OptimError::NotFinite {
                evaluation: self.tally.evaluations,
                component,
                value: component.map_or(value, |i| self.gradient[i]),
                x: self.x.clone(),
            }));
        }
        self.tally.record(&self.x, value);
        if self.options.target.is_some_and(|target| value <= target) {
            return stop(StopReason::Target);
        }
        Ok(value)
    }
}

fn validate(x0: &[f64], lower: &[f64], upper: &[f64], options: &Options) -> Result<(), OptimError> {
    if x0.is_empty() {
        return Err(OptimError::NoVariables);
    }
    for (what, slice) in [("lower bounds", lower), ("upper bounds", upper)] {
        if slice.len() != x0.len() {
            return Err(OptimError::Length { what, expected: x0.len(), got: slice.len() });
        }
    }
    for (index, ((&value, &lower), &upper)) in x0.iter().zip(lower).zip(upper).enumerate() {
        if lower.is_nan() || upper.is_nan() || lower > upper {
            return Err(OptimError::Bounds { index, lower, upper });
        }
        if !value.is_finite() || value < lower || value > upper {
            return Err(OptimError::Start { index, value, lower, upper });
        }
    }
    for (name, got) in [
        ("f_tol_abs", options.f_tol_abs),
        ("f_tol_rel", options.f_tol_rel),
        ("x_tol_abs", options.x_tol_abs),
        ("x_tol_rel", options.x_tol_rel),
        ("first_step", options.first_step.unwrap_or(0.0)),
    ] {
        if !(got.is_finite() && got >= 0.0) {
            return Err(OptimError::Option { name, allowed: "a finite number >= 0", got });
        }
    }
    for (name, got) in [("memory", Some(options.memory)), ("max_evaluations", options.max_evaluations)] {
        if got == Some(0) {
            return Err(OptimError::Option { name, allowed: "at least 1", got: 0.0 });
        }
    }
    if let Some(got) = options.target.filter(|target| target.is_nan()) {
        return Err(OptimError::Option { name: "target", allowed: "a number", got });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const FREE: [f64; 2] = [f64::INFINITY; 2];

    fn tight() -> Options {
        Options { f_tol_abs: 0.0, x_tol_abs: 0.0, max_evaluations: Some(2000), ..Options::default() }
    }

    fn rosenbrock(x: &[f64], g: &mut [f64]) -> ControlFlow<Interrupt, f64> {
        let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
        g[0] = -2.0 * a - 400.0 * x[0] * b;
        g[1] = 200.0 * b;
        ControlFlow::Continue(a * a + 100.0 * b * b)
    }

    #[test]
    fn dividing_the_box_finds_the_deeper_of_two_minima() {
        // In each variable one of depth 0.3 at 0.2 and one of 0.5 at 0.8.
        let well = |x: f64, at: f64| (-((x - at) / 0.08).powi(2)).exp();
        let f = |x: &[f64], _: &mut [f64]| {
            ControlFlow::Continue(-x.iter().map(|&x| 0.3 * well(x, 0.2) + 0.5 * well(x, 0.8)).sum::<f64>())
        };
        let options = Options { method: Method::DirectL, max_evaluations: Some(1500), ..Options::default() };
        let o = minimize(&[0.2; 3], &[0.0; 3], &[1.0; 3], &options, f).unwrap();
        assert!(o.x.iter().all(|x| (x - 0.8).abs() < 0.02), "{o:?}");
        assert!(o.evaluations <= 1500);
    }

    #[test]
    fn the_first_step_is_as_long_as_allowed_and_tolerances_are_those_of_the_function() {
        // Tried points of a steep bowl: without a limit the first trial leaves the box.
        let tried = |options: &Options, steepness: f64| {
            let mut tried = Vec::new();
            let out = minimize(&[0.5; 2], &[0.0; 2], &[1.0; 2], options, |x, g| {
                tried.push(x.to_vec());
                g.iter_mut().zip(x).for_each(|(g, x)| *g = 2.0 * steepness * (x - 0.3));
                ControlFlow::Continue(steepness * x.iter().map(|x| (x - 0.3).powi(2)).sum::<f64>())
            });
            (tried, out.unwrap())
        };
        let limited = Options { first_step: Some(0.05), ..tight() };
        let (points, out) = tried(&limited, 1e3);
        assert!((points[1][0] - 0.45).abs() < 1e-12, "{points:?}");
        assert_eq!(points.len(), out.evaluations as usize, "the start is evaluated once");
        assert!(out.x.iter().all(|x| (x - 0.3).abs() < 1e-6), "{out:?}");
        // The same problem scaled, tolerance and all, ends after the same evaluations.
        let with_tolerance = |f_tol_abs| Options { f_tol_abs, x_tol_abs: 0.0, ..limited.clone() };
        let (a, b) = (tried(&with_tolerance(1e-2), 1.0), tried(&with_tolerance(1e2), 1e4));
        assert_eq!((a.0.len(), a.1.stop), (b.0.len(), b.1.stop));
    }

    #[test]
    fn rosenbrock_is_solved_within_bounds_that_do_not_bind() {
        let out = minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &tight(), rosenbrock).unwrap();
        assert!((out.x[0] - 1.0).abs() < 1e-6 && (out.x[1] - 1.0).abs() < 1e-6, "{out:?}");
        assert!(out.stop.converged() || out.stop == StopReason::LineSearch, "{out:?}");
    }

    #[test]
    fn rosenbrock_is_solved_on_a_bound() {
        // With x0 <= 0.5 the minimum is at (0.5, 0.25), f = 0.25.
        let out = minimize(&[-1.2, 1.0], &[-2.0; 2], &[0.5, 2.0], &tight(), rosenbrock).unwrap();
        assert!((out.f - 0.25).abs() < 1e-10 && out.x[0] == 0.5, "{out:?}");
    }

    #[test]
    fn an_unbounded_problem_may_have_infinite_bounds() {
        let out = minimize(&[-1.2, 1.0], &FREE.map(|b| -b), &FREE, &tight(), rosenbrock).unwrap();
        assert!(out.f < 1e-12, "{out:?}");
    }

    /// Separable quadratics: the bounded minimum is the clamped free one. Starts are corners,
    /// edges and interior points, one variable in five is fixed.
    #[test]
    fn quadratics_are_solved_from_any_start_on_the_bounds() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..500 {
            let n = 1 + (6.0 * uniform()) as usize;
            let centre: Vec<f64> = (0..n).map(|_| 3.0 * uniform() - 1.0).collect();
            let scale: Vec<f64> = (0..n).map(|_| 0.1 + uniform()).collect();
            let upper: Vec<f64> = (0..n).map(|_| if uniform() < 0.2 { 0.0 } else { 1.0 }).collect();
            let x0: Vec<f64> =
                upper.iter().map(|&up| up * [0.0, 1.0, uniform()][(3.0 * uniform()) as usize]).collect();
            let out = minimize(&x0, &vec![0.0; n], &upper, &tight(), |x, g| {
                let mut f = 0.0;
                for i in 0..n {
                    assert!((0.0..=upper[i]).contains(&x[i]));
                    f += scale[i] * (x[i] - centre[i]).powi(2);
                    g[i] = 2.0 * scale[i] * (x[i] - centre[i]);
                }
                ControlFlow::Continue(f)
            })
            .unwrap();
            for i in 0..n {
                assert!((out.x[i] - centre[i].clamp(0.0, upper[i])).abs() < 1e-6, "{x0:?} {out:?}");
            }
        }
    }

    #[test]
    fn a_kink_keeps_the_best_point_and_says_so() {
        let mut least = f64::INFINITY;
        let out = minimize(&[0.9], &[-1.0], &[1.0], &tight(), |x, g| {
            g[0] = (x[0] - 0.3).signum();
            least = least.min((x[0] - 0.3).abs());
            ControlFlow::Continue((x[0] - 0.3).abs())
        })
        .unwrap();
        assert_eq!(out.f, least);
        assert_eq!(out.f, (out.x[0] - 0.3).abs());
        assert!(out.f < 0.6 && out.stop == StopReason::LineSearch, "{out:?}");
    }

    #[test]
    fn a_wrong_gradient_is_no_progress() {
        let out = minimize(&[0.0], &[-1.0], &[1.0], &tight(), |x, g| {
            g[0] = -2.0 * x[0] - 1.0; // the sign is wrong
            ControlFlow::Continue(x[0] * x[0] + x[0] + if x[0] < 0.0 { 1.0 } else { 0.0 })
        })
        .unwrap();
        assert_eq!((out.x[0], out.stop), (0.0, StopReason::NoProgress));
    }

    #[test]
    fn a_panic_passes_through() {
        let mut calls = 0;
        let caught = catch_unwind(AssertUnwindSafe(|| {
            minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &tight(), |x, g| {
                calls += 1;
                assert!(calls < 5, "the fifth");
                rosenbrock(x, g)
            })
        }));
        assert_eq!(*caught.unwrap_err().downcast_ref::<&str>().unwrap(), "the fifth");
        assert_eq!(calls, 5);
    }

    #[test]
    fn an_interrupt_at_any_moment_returns_the_best_so_far() {
        for last in 1..20 {
            let (mut calls, mut least) = (0, f64::INFINITY);
            let out = minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &tight(), |x, g| {
                calls += 1;
                if calls > last {
                    return ControlFlow::Break(Interrupt);
                }
                let value = rosenbrock(x, g);
                if let ControlFlow::Continue(f) = value {
                    least = least.min(f);
                }
                value
            })
            .unwrap();
            assert_eq!((out.stop, out.f, calls), (StopReason::Interrupted, least, last + 1));
            assert_eq!(out.evaluations, last);
        }
        let nothing = minimize(&[0.0], &[0.0], &[1.0], &tight(), |_, _| ControlFlow::Break(Interrupt));
        assert_eq!(nothing, Err(OptimError::NothingEvaluated));
    }

    #[test]
    fn the_budget_is_never_exceeded() {
        for budget in 1..20 {
            let options = Options { max_evaluations: Some(budget), ..tight() };
            let mut calls = 0;
            let out = minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &options, |x, g| {
                calls += 1;
                rosenbrock(x, g)
            })
            .unwrap();
            assert_eq!((out.stop, out.evaluations, calls), (StopReason::Evaluations, budget, budget));
        }
    }

    #[test]
    fn the_time_limit_leaves_one_evaluation() {
        let options = Options { time_limit: Some(Duration::ZERO), ..tight() };
        let out = minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &options, rosenbrock).unwrap();
        assert_eq!((out.stop, out.evaluations), (StopReason::TimeLimit, 1));
        assert_eq!(out.x, [-1.2, 1.0]);
    }

    #[test]
    fn the_target_stops_at_the_first_point_that_reaches_it() {
        let options = Options { target: Some(0.1), ..tight() };
        let mut values = Vec::new();
        let out = minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &options, |x, g| {
            let value = rosenbrock(x, g);
            values.extend(value.continue_value());
            value
        })
        .unwrap();
        assert_eq!(out.stop, StopReason::Target);
        assert!(values.iter().filter(|f| **f <= 0.1).eq([&out.f]), "{values:?}");
    }

    #[test]
    fn tolerances_stop_early() {
        let run = |options| minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &options, rosenbrock).unwrap();
        assert_eq!(run(Options { f_tol_abs: 0.1, ..tight() }).stop, StopReason::FTolerance);
        assert_eq!(run(Options { x_tol_abs: 0.1, ..tight() }).stop, StopReason::XTolerance);
    }

    #[test]
    fn values_that_are_not_finite_are_errors() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for (call, component) in [(1, None), (3, None), (3, Some(1))] {
                let mut calls = 0;
                let error = minimize(&[-1.2, 1.0], &[-2.0; 2], &[2.0; 2], &tight(), |x, g| {
                    calls += 1;
                    let value = rosenbrock(x, g);
                    match component {
                        _ if calls != call => value,
                        None => ControlFlow::Continue(bad),
                        Some(i) => {
                            g[i] = bad;
                            value
                        }
                    }
                })
                .unwrap_err();
                let message = error.to_string();
                assert!(message.starts_with(&format!("evaluation {call}: the ")), "{message}");
                assert_eq!(message.contains("variable 1"), component.is_some(), "{message}");
                assert_eq!(calls, call);
            }
        }
        let forgotten = minimize(&[0.5], &[0.0], &[1.0], &tight(), |x, _| ControlFlow::Continue(x[0]));
        assert!(matches!(forgotten, Err(OptimError::NotFinite { component: Some(0), .. })));
    }

    #[test]
    fn ill_posed_problems_are_errors() {
        let run = |x0: &[f64], lower: &[f64], upper: &[f64], options: &Options| {
            minimize(x0, lower, upper, options, |_, _| unreachable!()).unwrap_err().to_string()
        };
        let ok = Options::default();
        assert_eq!(run(&[], &[], &[], &ok), "there are no variables to optimise");
        assert_eq!(run(&[0.0], &[0.0; 2], &[1.0], &ok), "lower bounds: 2 values for 1 variables");
        assert_eq!(run(&[0.0], &[0.0], &[], &ok), "upper bounds: 0 values for 1 variables");
        assert!(run(&[0.0], &[1.0], &[0.0], &ok).starts_with("variable 0: bounds must"));
        assert!(run(&[0.0], &[f64::NAN], &[0.0], &ok).starts_with("variable 0: bounds must"));
        for x in [f64::NAN, f64::INFINITY, -0.1, 1.1] {
            assert!(run(&[x], &[0.0], &[1.0], &ok).starts_with("variable 0: the start must"));
        }
        let zero_memory = Options { memory: 0, ..Options::default() };
        assert_eq!(run(&[0.0], &[0.0], &[1.0], &zero_memory), "option memory: must be at least 1, got 0");
        let negative = Options { f_tol_rel: -1.0, ..Options::default() };
        assert!(run(&[0.0], &[0.0], &[1.0], &negative).starts_with("option f_tol_rel: must be"));
    }

    #[test]
    fn fixed_variables_only_are_evaluated_once() {
        let out = minimize(&[0.5, 0.1], &[0.5, 0.1], &[0.5, 0.1], &tight(), |x, g| {
            g.fill(1.0);
            ControlFlow::Continue(x[0] + x[1])
        })
        .unwrap();
        assert_eq!((out.x, out.evaluations, out.stop), (vec![0.5, 0.1], 1, StopReason::Stationary));
    }
}
