//! Wasserstein barycentres of cumulated histograms.
//!
//! On a line the barycentre is the distribution whose quantile function is the mean of the
//! quantile functions (\[Peyre19\] §9.2). A cumulated histogram is read as the distribution
//! function that is linear within every bin; its quantile function is then piecewise linear
//! with jumps over empty bins, and so is the mean, whose knots are all the knots together.

use crate::objective::histogram::{BINS, Cumulated};

/// Quantile functions of several histograms, evaluated at their common knots.
#[derive(Debug)]
pub struct Quantiles<'a> {
    /// Cumulated histograms whose barycentre is wanted.
    histograms: &'a [Cumulated],
    /// Values of all cumulated histograms, sorted, without repetition; from 0 to 1.
    knots: Vec<f64>,
    /// Sums over the histograms of the quantile functions just below and just above each
    /// knot.
    sums: Vec<[f64; 2]>,
}

impl<'a> Quantiles<'a> {
    /// Evaluates the quantile functions of these histograms.
    #[must_use]
    pub fn new(histograms: &'a [Cumulated]) -> Self {
        let mut knots: Vec<f64> = histograms.iter().flatten().copied().chain([0.0]).collect();
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        let mut sums = vec![[0.0; 2]; knots.len()];
        for histogram in histograms {
            for_each_quantile(histogram, &knots, |i, [below, above]| {
                sums[i][0] += below;
                sums[i][1] += above;
            });
        }
        Self { histograms, knots, sums }
    }

    /// The barycentre of all histograms.
    #[must_use]
    pub fn barycentre(&self) -> Cumulated {
        invert(&self.knots, &self.sums, self.histograms.len() as f64)
    }

    /// The barycentre of all histograms but the one at `index`.
    #[must_use]
    pub fn without(&self, index: usize) -> Cumulated {
        let mut sums = self.sums.clone();
        for_each_quantile(&self.histograms[index], &self.knots, |i, [below, above]| {
            sums[i][0] -= below;
            sums[i][1] -= above;
        });
        invert(&self.knots, &sums, (self.histograms.len() - 1) as f64)
    }
}

/// Calls `visit` with the index of every knot and the quantile function of the histogram
/// just below and just above the knot.
///
/// `knots` must hold all values of the histogram, and 0.
fn for_each_quantile(histogram: &Cumulated, knots: &[f64], mut visit: impl FnMut(usize, [f64; 2])) {
    let edge = |i: usize| i as f64 / BINS as f64;
    // The distribution function at the left edge of bin i.
    let left = |i: usize| if i == 0 { 0.0 } else { histogram[i - 1] };
    let within = |i: usize, u: f64| edge(i) + (u - left(i)) / (histogram[i] - left(i)) / BINS as f64;
    let mut below = 0; // first bin whose right edge reaches u
    let mut above = 0; // first bin whose right edge exceeds u
    for (i, &u) in knots.iter().enumerate() {
        while below < BINS - 1 && (histogram[below] < u || histogram[below] <= 0.0) {
            below += 1;
        }
        while above < BINS - 1 && histogram[above] <= u {
            above += 1;
        }
        // Outside (0, 1) the function has one side only.
        let low = within(below, u);
        let high = if u < 1.0 { within(above, u) } else { low };
        visit(i, if u > 0.0 { [low, high] } else { [high; 2] });
    }
}

/// The distribution function at the upper edges of the bins, from `n` times its quantile
/// function at the knots.
fn invert(knots: &[f64], sums: &[[f64; 2]], n: f64) -> Cumulated {
    let mut out = [1.0; BINS];
    let mut points = knots.iter().zip(sums).flat_map(|(&u, s)| s.map(|x| (x / n, u)));
    let (mut from, mut to) = ((0.0, 0.0), (0.0, 0.0));
    let mut before: f64 = 0.0;
    'edges: for (i, out) in out.iter_mut().enumerate().take(BINS - 1) {
        let edge = (i + 1) as f64 / BINS as f64;
        while to.0 <= edge {
            let Some(next) = points.next() else { break 'edges };
            (from, to) = (to, next);
        }
        let u = from.1 + (to.1 - from.1) * (edge - from.0) / (to.0 - from.0);
        // A distribution function does not fall, not even by rounding.
        before = u.clamp(before, 1.0);
        *out = before;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::special::beta_cdf;

    fn close(a: &Cumulated, b: &Cumulated, tolerance: f64) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
    }

    fn beta(a: f64, b: f64) -> Cumulated {
        std::array::from_fn(|i| beta_cdf((i + 1) as f64 / BINS as f64, a, b))
    }

    /// All pixels within bin `bin`.
    fn step(bin: usize) -> Cumulated {
        std::array::from_fn(|i| if i < bin { 0.0 } else { 1.0 })
    }

    #[test]
    fn the_barycentre_of_equal_histograms_is_that_histogram() {
        for histogram in [beta(2.0, 5.0), beta(0.4, 0.4), step(0), step(100), step(255)] {
            let three = [histogram; 3];
            let quantiles = Quantiles::new(&three);
            assert!(close(&quantiles.barycentre(), &histogram, 1e-13));
            assert!(close(&quantiles.without(1), &histogram, 1e-13));
        }
    }

    #[test]
    fn the_barycentre_of_two_steps_lies_between_them_where_the_mean_would_keep_both() {
        let steps = [step(40), step(100)];
        assert!(close(&Quantiles::new(&steps).barycentre(), &step(70), 1e-13));
        assert!(close(&Quantiles::new(&steps).without(0), &step(100), 1e-12));
        // 40 and 41 meet at the middle of an edge: bins 40 and 41 by halves.
        let neighbours = [step(40), step(41)];
        let half: Cumulated = std::array::from_fn(|i| match i {
            0..40 => 0.0,
            40 => 0.5,
            _ => 1.0,
        });
        assert!(close(&Quantiles::new(&neighbours).barycentre(), &half, 1e-13));
    }

    #[test]
    fn uniform_distributions_average_their_ends() {
        // Uniform on [0, 1/4] and on [1/2, 1]: the mean quantile function is u·3/8 + 1/4.
        let uniform = |lo: f64, hi: f64| -> Cumulated {
            std::array::from_fn(|i| (((i + 1) as f64 / BINS as f64 - lo) / (hi - lo)).clamp(0.0, 1.0))
        };
        let ends = [uniform(0.0, 0.25), uniform(0.5, 1.0)];
        assert!(close(&Quantiles::new(&ends).barycentre(), &uniform(0.25, 0.625), 1e-13));
    }

    #[test]
    fn two_halves_of_which_one_is_empty_between_jump_together() {
        // Half in bin 10, half in bin 200; and all in bin 100: halves in bins 55 and 150.
        let split: Cumulated = std::array::from_fn(|i| match i {
            0..10 => 0.0,
            10..200 => 0.5,
            _ => 1.0,
        });
        let got = Quantiles::new(&[split, step(100)]).barycentre();
        // u < 1/2: (10 + 2u + 100 + u)/2 bins, from 55 to 55.75; above: from 150.25 to 151.
        let want: Cumulated = std::array::from_fn(|i| match i {
            0..55 => 0.0,
            55..150 => 0.5,
            _ => 1.0,
        });
        assert!(close(&got, &want, 1e-13), "{got:?}");
    }
}
