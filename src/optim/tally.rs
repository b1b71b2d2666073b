//! Best point and end of a search, kept apart from what NLopt reports.

use std::any::Any;
use std::panic::resume_unwind;

use nlopt::{FailState, SuccessState};

use super::{OptimError, Outcome, StopReason};

/// Reason why no further evaluation is made.
pub(super) enum End {
    Stop(StopReason),
    Error(OptimError),
    Panic(Box<dyn Any + Send>),
}

/// Evaluations so far and the best of them.
#[derive(Default)]
pub(super) struct Tally {
    /// Number of evaluations that returned a value.
    pub evaluations: u32,
    /// f(x0).
    first: Option<f64>,
    /// Point with the least value so far, and that value.
    best: Option<(Vec<f64>, f64)>,
    /// Reason why no further evaluation is made; `None` while the search goes on.
    pub end: Option<End>,
}

impl Tally {
    /// Keeps a value at a point if it is better than those before.
    pub fn record(&mut self, x: &[f64], value: f64) {
        self.first.get_or_insert(value);
        if self.best.as_ref().is_none_or(|(_, best)| value < *best) {
            self.best = Some((x.to_vec(), value));
        }
    }

    /// Outcome of the search that NLopt ended with `result`, where `success` is the meaning of a success
    /// that NLopt does not explain.
    ///
    /// # Errors
    /// That of the search, or that there was no evaluation.
    ///
    /// # Panics
    /// With the panic of the function.
    pub fn outcome(
        self,
        result: Result<(SuccessState, f64), (FailState, f64)>,
        success: StopReason,
    ) -> Result<Outcome, OptimError> {
        let forced = match self.end {
            Some(End::Panic(payload)) => resume_unwind(payload),
            Some(End::Error(error)) => return Err(error),
            Some(End::Stop(stop)) => Some(stop),
            None => None,
        };
        let (x, f) = self.best.ok_or(match result {
            Err((FailState::OutOfMemory, _)) => OptimError::Nlopt("allocate its memory"),
            Err((FailState::InvalidArgs, _)) => OptimError::Nlopt("accept the problem"),
            _ => OptimError::NothingEvaluated,
        })?;
        let progress = self.first.is_some_and(|first| f < first);
        let stop = forced.unwrap_or(match result {
            Ok((SuccessState::FtolReached, _)) => StopReason::FTolerance,
            Ok((SuccessState::XtolReached, _)) => StopReason::XTolerance,
            Ok((SuccessState::MaxEvalReached, _)) => StopReason::Evaluations,
            Ok(_) => success,
            Err(_) if progress => StopReason::LineSearch,
            Err(_) => StopReason::NoProgress,
        });
        Ok(Outcome { x, f, evaluations: self.evaluations, stop })
    }
}

/// Turns NLopt's refusal of a setting into an error that says what it was.
pub(super) fn accepted(result: nlopt::OptResult, what: &'static str) -> Result<(), OptimError> {
    result.map(|_| ()).map_err(|_| OptimError::Nlopt(what))
}
