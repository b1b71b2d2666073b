//! Bounded minimisation of a smooth function.
//!
//! [`minimize`] runs NLopt's `LD_LBFGS`, or `GN_DIRECT_L`, and [`minimize_moduli`] its
//! `LD_SLSQP` for sums of moduli; both keep the best point themselves, because NLopt often
//! ends in a bare `FAILURE` after real progress. Why it ended is a [`StopReason`], which
//! displays in plain words.
//!
//! # References
//! \[Gablonsky01\] locally biased division of the box; \[Nocedal80\] limited-memory BFGS (NLopt's
//! is Lukšan's, with an active set for the bounds); \[Kraft88\] sequential quadratic programming.

pub mod difference;
mod moduli;
mod nlopt;
mod tally;

use std::fmt;
use std::time::Duration;

pub use self::{
    moduli::{Moduli, minimize_moduli},
    nlopt::minimize,
};

/// How to search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Down the gradient from the start. \[Nocedal80\]
    #[default]
    Lbfgs,
    /// Over the whole box, which must be finite, by dividing it: without gradient, start or
    /// chance. It stops at a limit. \[Gablonsky01\]
    DirectL,
}

/// When to stop, and how much to remember.
///
/// The tolerances suit variables scaled to [0, 1] and a function of order 1. NLopt also stops
/// when the projected gradient is below 1e-8 in every variable; that cannot be changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How to search.
    pub method: Method,
    /// Stop as soon as `f` is no larger.
    pub target: Option<f64>,
    /// Stop when two iterations running change `f` by less than this; 0: never.
    pub f_tol_abs: f64,
    /// The same, relative to `|f|`.
    pub f_tol_rel: f64,
    /// Stop when two iterations running change every variable by less than this; 0: never.
    pub x_tol_abs: f64,
    /// The same, the sum of the changes relative to the sum of `|x_i|`.
    pub x_tol_rel: f64,
    /// The function is never called more often; at least 1.
    pub max_evaluations: Option<u32>,
    /// No evaluation starts later than this, the first excepted. One under way is not cut short.
    pub time_limit: Option<Duration>,
    /// Number of past steps that model the curvature, at least 1.
    pub memory: u32,
    /// Largest component of the first trial step, which for [`Method::Lbfgs`] is `−∇f(x0)`: the
    /// function that NLopt sees is scaled down where that is longer. Tolerances are those of the
    /// function itself, whatever the scale.
    pub first_step: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            method: Method::Lbfgs,
            target: None,
            f_tol_abs: 1e-6,
            f_tol_rel: 0.0,
            x_tol_abs: 1e-5,
            x_tol_rel: 0.0,
            max_evaluations: None,
            time_limit: None,
            memory: 10, // [Nocedal80]: 3 to 20 do, and ours are few variables
            first_step: None,
        }
    }
}

/// What an objective returns, by `ControlFlow::Break`, to end the search.
///
/// An objective that fails keeps its error to itself and breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupt;

/// The best point that was evaluated, and why the search ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The point with the least `f`; the first of them on a tie.
    pub x: Vec<f64>,
    /// The function there.
    pub f: f64,
    /// How often the function returned a value.
    pub evaluations: u32,
    /// Why the search ended.
    pub stop: StopReason,
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum StopReason {
    /// `f` reached [`Options::target`].
    Target,
    /// The gradient vanished, bounds considered: a stationary point.
    Stationary,
    /// [`Options::f_tol_abs`] or [`Options::f_tol_rel`].
    FTolerance,
    /// [`Options::x_tol_abs`] or [`Options::x_tol_rel`].
    XTolerance,
    /// [`Options::max_evaluations`].
    Evaluations,
    /// [`Options::time_limit`].
    TimeLimit,
    /// The objective returned [`Interrupt`].
    Interrupted,
    /// The line search found nothing better, but there had been progress before: a kink,
    /// noise, or the limit of rounding.
    LineSearch,
    /// No point was better than the first.
    NoProgress,
}

impl StopReason {
    /// Whether a condition for an optimum was met, not a limit or a failure.
    #[must_use]
    pub fn converged(self) -> bool {
        matches!(self, Self::Target | Self::Stationary | Self::FTolerance | Self::XTolerance)
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Target => "the wanted value was reached",
            Self::Stationary => "no small change of any variable improves the result",
            Self::FTolerance => "further steps hardly improve the result",
            Self::XTolerance => "further steps hardly change the variables",
            Self::Evaluations => "the allowed number of evaluations was used up",
            Self::TimeLimit => "the time limit was reached",
            Self::Interrupted => "it was interrupted",
            Self::LineSearch => {
                "the last step found nothing better, after earlier steps had improved the result"
            }
            Self::NoProgress => "no step improved on the starting point",
        })
    }
}

/// Why a search could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OptimError {
    /// There is nothing to vary.
    #[error("there are no variables to optimise")]
    NoVariables,

    /// A slice has not one element a variable.
    #[error("{what}: {got} values for {expected} variables")]
    Length {
        /// Which slice.
        what: &'static str,
        /// Length of the starting point.
        expected: usize,
        /// Length of the slice.
        got: usize,
    },

    /// A bound is NaN, or the lower is above the upper.
    #[error("variable {index}: bounds must satisfy lower <= upper, got [{lower}, {upper}]")]
    Bounds {
        /// Which variable.
        index: usize,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },

    /// The search cannot start there.
    #[error("variable {index}: the start must be finite and within [{lower}, {upper}], got {value}")]
    Start {
        /// Which variable.
        index: usize,
        /// The value given.
        value: f64,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },

    /// An option is out of its range.
    #[error("option {name}: must be {allowed}, got {got}")]
    Option {
        /// The field of [`Options`].
        name: &'static str,
        /// What is allowed.
        allowed: &'static str,
        /// The value given.
        got: f64,
    },

    /// The objective returned NaN or an infinity, or put one into the gradient.
    #[error("evaluation {evaluation}: {} is {value} at x = {x:?}", match .component {
        Some(i) => format!("the derivative by variable {i}"),
        None => "the function".to_owned(),
    })]
    NotFinite {
        /// Which evaluation, from 1.
        evaluation: u32,
        /// The variable whose derivative it is; `None`: the function itself.
        component: Option<usize>,
        /// The offending number.
        value: f64,
        /// Where.
        x: Vec<f64>,
    },

    /// The objective broke off before it returned any value.
    #[error("interrupted before the first evaluation was complete")]
    NothingEvaluated,

    /// NLopt did not accept the problem (in practice: out of memory).
    #[error("NLopt could not {0}")]
    Nlopt(&'static str),
}
