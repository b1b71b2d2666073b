//! Who follows a run.

use crate::integrator::Observer;

/// Follows a run.
pub trait Reporter: Observer {
    /// A fact worth a line.
    fn note(&self, text: &str);
    /// A stage begins; it will render `rows` rows of pixels, when known.
    fn stage(&self, name: &str, rows: Option<u64>);
    /// An evaluation of the optimiser is done.
    fn evaluated(&self, progress: &Progress);
}

/// State of the optimisation.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Evaluations so far.
    pub evaluation: u32,
    /// The most there will be.
    pub max_evaluations: u32,
    /// Improvements so far.
    pub iterations: u32,
    /// f_q of this evaluation.
    pub f_q: f64,
    /// Best f_q so far.
    pub best: f64,
    /// Renders so far.
    pub renders: u64,
}

/// Passes progress on but not an interrupt: that ends the optimisation, and what was found is
/// still rendered.
pub(super) struct Unstoppable<'a, R>(pub &'a R);

impl<R: Reporter> Observer for Unstoppable<'_, R> {
    fn advance(&self, rows: u64) {
        self.0.advance(rows);
    }
}
