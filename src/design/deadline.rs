//! The time that a run may take.

use std::time::{Duration, Instant};

/// Beginning of a run, and the time that it may take.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deadline {
    /// Beginning of the run, when its scene was loaded.
    start: Instant,
    /// Time allowed; `None` without limit.
    limit: Option<Duration>,
}

impl Deadline {
    /// Part of the time allowed after which no better places of lamps, or surroundings, are sought.
    pub const PLACING: f64 = 0.3;
    /// Part of the time allowed after which no lights are sought any more. A search seldom takes
    /// longer, while a picture uses all the time that is left for it.
    pub const SEARCH: f64 = 0.5;
    /// Part of the time allowed after which a check takes no more samples.
    pub const CHECK: f64 = 0.6;

    /// A run that began at `start`.
    pub fn new(start: Instant, limit: Option<Duration>) -> Self {
        Self { start, limit }
    }

    /// Whether a part of the time allowed, in [0, 1], has passed.
    pub fn has_passed(&self, part: f64) -> bool {
        self.limit.is_some_and(|limit| self.start.elapsed() >= limit.mul_f64(part))
    }

    /// Time left until a part of the time allowed, in [0, 1], has passed; `None` without limit.
    pub fn left_until(&self, part: f64) -> Option<Duration> {
        Some(self.limit?.mul_f64(part).saturating_sub(self.start.elapsed()))
    }

    /// The deadline of work that may take `part` of the time that is left.
    pub fn of_part(&self, part: f64) -> Option<Instant> {
        Some(Instant::now() + self.left_until(1.0)?.mul_f64(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_time_pass_one_after_the_other() {
        let ago = |seconds| Instant::now().checked_sub(Duration::from_secs(seconds)).unwrap();
        let limited = Deadline::new(ago(55), Some(Duration::from_secs(100)));
        assert!(limited.has_passed(Deadline::SEARCH) && !limited.has_passed(Deadline::CHECK));
        let left = limited.left_until(Deadline::CHECK).unwrap();
        assert!(left > Duration::from_secs(4) && left < Duration::from_secs(6), "{left:?}");
        let half = limited.of_part(0.5).unwrap() - Instant::now();
        assert!(half > Duration::from_secs(21) && half < Duration::from_secs(23), "{half:?}");
        let late = Deadline::new(ago(200), Some(Duration::from_secs(100)));
        assert_eq!(late.left_until(1.0), Some(Duration::ZERO));
        assert!(late.has_passed(1.0) && late.of_part(1.0).unwrap() <= Instant::now());
        let unlimited = Deadline::new(ago(200), None);
        assert!(!unlimited.has_passed(0.0) && unlimited.of_part(1.0).is_none());
    }
}
