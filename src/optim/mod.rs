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

/// Method of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Descent along the gradient from the start. \[Nocedal80\]
    #[default]
    Lbfgs,
    /// Division of the whole box, which must be finite, without gradient, start or chance; it ends at a
    /// limit only. \[Gablonsky01\]
    DirectL,
}

/// Method, tolerances and limits of a search.
///
/// The tolerances suit variables scaled to [0, 1] and a function of order 1. NLopt also stops
/// when the projected gradient is below 1e-8 in every variable; that cannot be changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Method of the search.
    pub method: Method,
    /// Value of f at or below which the search stops.
    pub target: Option<f64>,
    /// Change of f per iteration below which, twice in succession, the search stops; 0: never.
    pub f_tol_abs: f64,
    /// Change of f per iteration, relative to |f|, below which, twice in succession, the search stops; 0:
    /// never.
    pub f_tol_rel: f64,
    /// Change of every variable per iteration below which, twice in succession, the search stops; 0:
    /// never.
    pub x_tol_abs: f64,
    /// Sum of the changes of the variables per iteration, relative to the sum of |x_i|, below which, twice
    /// in succession, the search stops; 0: never.
    pub x_tol_rel: f64,
    /// Upper bound of the number of evaluations, at least 1.
    pub max_evaluations: Option<u32>,
    /// Time after which no evaluation begins, except for the first; one under way is not cut short.
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
            memory: 10, // between the 3 and 20 of [Nocedal80]: the problems have few variables
            first_step: None,
        }
    }
}

/// Request of an objective, by `ControlFlow::Break`, to end the search. An objective that fails keeps
/// its error to itself and breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupt;

/// The best point that was evaluated, and why the search ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Point with the least f of all that were evaluated; the first of them on a tie.
    pub x: Vec<f64>,
    /// Value of the function at `x`.
    pub f: f64,
    /// Number of evaluations that returned a value.
    pub evaluations: u32,
    /// Reason why the search ended.
    pub stop: StopReason,
}

/// Reason why a search ended; displayed as a clause in plain words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum StopReason {
    /// `f` reached [`Options::target`].
    Target,
    /// The gradient vanished, bounds considered: a stationary point.
    Stationary,
    /// f changed by less than [`Options::f_tol_abs`] or [`Options::f_tol_rel`].
    FTolerance,
    /// The variables changed by less than [`Options::x_tol_abs`] or [`Options::x_tol_rel`].
    XTolerance,
    /// The number of evaluations reached [`Options::max_evaluations`].
    Evaluations,
    /// [`Options::time_limit`] passed.
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

/// Reason why a search could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OptimError {
    /// There is nothing to vary.
    #[error("there are no variables to optimise")]
    NoVariables,

    /// A slice does not have one element for each variable.
    #[error("{what}: {got} values for {expected} variables")]
    Length {
        /// Name of the slice.
        what: &'static str,
        /// Length of the starting point.
        expected: usize,
        /// Length of the slice.
        got: usize,
    },

    /// A bound is NaN, or the lower is above the upper.
    #[error("variable {index}: bounds must satisfy lower <= upper, got [{lower}, {upper}]")]
    Bounds {
        /// Index of the variable.
        index: usize,
        /// Lower bound of the variable.
        lower: f64,
        /// Upper bound of the variable.
        upper: f64,
    },

    /// The search cannot start there.
    #[error("variable {index}: the start must be finite and within [{lower}, {upper}], got {value}")]
    Start {
        /// Index of the variable.
        index: usize,
        /// Value of the variable at the start.
        value: f64,
        /// Lower bound of the variable.
        lower: f64,
        /// Upper bound of the variable.
        upper: f64,
    },

    /// An option is out of its range.
    #[error("option {name}: must be {allowed}, got {got}")]
    Option {
        /// Field of [`Options`].
        name: &'static str,
        /// Values that are allowed, in words.
        allowed: &'static str,
        /// Value given.
        got: f64,
    },

    /// The objective returned NaN or an infinity, or put one into the gradient.
    #[error("evaluation {evaluation}: {} is {value} at x = {x:?}", match .component {
        Some(i) => format!("the derivative by variable {i}"),
        None => "the function".to_owned(),
    })]
    NotFinite {
        /// Number of the evaluation, from 1.
        evaluation: u32,
        /// Index of the variable whose derivative is not finite; `None` for the function itself.
        component: Option<usize>,
        /// Value that is not finite.
        value: f64,
        /// Point of the evaluation.
        x: Vec<f64>,
    },

    /// The objective broke off before it returned any value.
    #[error("interrupted before the first evaluation was complete")]
    NothingEvaluated,

    /// NLopt did not accept the problem (in practice: out of memory).
    #[error("NLopt could not {0}")]
    Nlopt(&'static str),
}
