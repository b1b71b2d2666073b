//! Numbers that were measured several times.

use serde::Serialize;

use crate::math::stats::median;

/// Median of some measurements, with the least and the largest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// Least.
    pub least: f64,
    /// Largest.
    pub largest: f64,
}

impl Spread {
    /// The spread of some measurements; NaN without any.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        Self {
            median: median(values).unwrap_or(f64::NAN),
            least: values.iter().copied().fold(f64::NAN, f64::min),
            largest: values.iter().copied().fold(f64::NAN, f64::max),
        }
    }

    /// In words, with some decimals: `1.31 (1.25 to 1.40)`; the median alone where all are equal.
    #[must_use]
    pub fn words(&self, decimals: usize) -> String {
        let Self { median, least, largest } = self;
        if least == largest {
            return format!("{median:.decimals$}");
        }
        format!("{median:.decimals$} ({least:.decimals$} to {largest:.decimals$})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_median_and_extremes() {
        let spread = Spread::of(&[3.0, 1.0, 2.5]);
        assert_eq!(spread, Spread { median: 2.5, least: 1.0, largest: 3.0 });
        assert_eq!(spread.words(1), "2.5 (1.0 to 3.0)");
        assert_eq!(Spread::of(&[2.0, 2.0]).words(0), "2");
        assert!(Spread::of(&[]).median.is_nan());
    }
}
