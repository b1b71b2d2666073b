//! Seeds: independent samples for every use.

use crate::math::hash::hash_words;

/// Independent uses of a run's seed. The full-size pictures use the seed
/// itself, so that `render --seed` makes them again.
#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    /// The render from which bounds and starts follow, in paper mode.
    Survey = 1,
    /// Whatever chooses lights.
    Optimise,
    /// The f_q of the start, in paper mode.
    Initial,
    /// The f_q that is reported.
    Check,
}

/// The seed of a use.
pub(super) fn seed_for(seed: u64, purpose: Purpose) -> u64 {
    hash_words(&[seed, purpose as u64])
}
