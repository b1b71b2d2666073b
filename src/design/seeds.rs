//! Seeds of independent samples for each purpose.

use crate::math::hash::hash_words;

/// Purposes for which a run draws independent samples. The full-size pictures use the run's seed itself.
#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    /// Render from which bounds and starts follow, in paper mode.
    Survey = 1,
    /// Samples by which lights are chosen.
    Optimise,
    /// f_q of the start, in paper mode.
    Initial,
    /// f_q that is reported.
    Check,
    /// Samples by which places of lamps are chosen.
    Places,
    /// Lightings in which a small copy of the basis is compared with it.
    Copy,
    /// Small pictures of lightings to choose from.
    Choices,
}

/// Seed for a purpose, from the seed of the run.
pub(super) fn seed_for(seed: u64, purpose: Purpose) -> u64 {
    hash_words(&[seed, purpose as u64])
}
