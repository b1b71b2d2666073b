//! Observers of a run.

use std::path::Path;

use super::deadline::Deadline;
use crate::integrator::Observer;

/// An observer of a run.
pub trait Reporter: Observer {
    /// Called with a fact about the run that is worth a line.
    fn note(&self, text: &str);
    /// Called when a stage begins, with the number of rows of pixels that it will render, if known.
    fn stage(&self, name: &str, rows: Option<u64>);
    /// Called with the name of the present stage and how far it has got.
    fn progress(&self, text: &str) {
        self.note(text);
    }
    /// Called after each evaluation of f_q in paper mode.
    fn evaluated(&self, progress: &Progress);
    /// Called when the record of looks in these run directories has something new to show: the lights found,
    /// and later the pictures, when it is done.
    fn recorded(&self, directories: &[&Path], is_done: bool) {
        let _ = (directories, is_done);
    }
}

/// State of an optimisation in paper mode.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Number of evaluations so far.
    pub evaluation: u32,
    /// Upper bound of the number of evaluations.
    pub max_evaluations: u32,
    /// Number of evaluations so far that improved on the best.
    pub iterations: u32,
    /// f_q of the last evaluation.
    pub f_q: f64,
    /// Best f_q so far.
    pub best: f64,
    /// Number of renders so far.
    pub renders: u64,
}

/// An observer that passes progress on and stops a render when the search's part of the time is over, or
/// where the reporter does.
pub(super) struct InTime<'a, R> {
    /// Observer of the run.
    pub reporter: &'a R,
    /// Time that the run may take.
    pub deadline: Deadline,
}

impl<R: Reporter> Observer for InTime<'_, R> {
    fn advance(&self, rows: u64) {
        self.reporter.advance(rows);
    }
    fn cancelled(&self) -> bool {
        self.reporter.cancelled() || self.deadline.has_passed(Deadline::SEARCH)
    }
}

/// An observer that passes progress on but never stops a render: an interrupt ends the optimisation
/// between renders, so that their results are whole.
pub(super) struct Unstoppable<'a, R>(pub &'a R);

impl<R: Reporter> Observer for Unstoppable<'_, R> {
    fn advance(&self, rows: u64) {
        self.0.advance(rows);
    }
}
