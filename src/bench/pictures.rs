//! Errors of pictures from pairs of seeds, and whether the means of two programs agree.

use crate::math::stats::{Moments, normal_deviate, sidak_z};

/// What is added to the square of a pixel before its error is divided by it, so that black pixels do not
/// decide: a tenth of white, squared.
const FLOOR: f64 = 0.01;
/// Level at which all means of one table together are found to differ by chance.
const ALPHA: f64 = 0.01;

/// Pictures of one renderer, two seeds a round.
#[derive(Clone, Debug, Default)]
pub struct Pairs {
    /// Sum of all pictures, linear.
    sum: Vec<f64>,
    /// Half the squared difference of the two pictures of each round: an estimate of a picture's variance.
    variances: Vec<Vec<f32>>,
    /// Mean of each picture over its pixels and channels.
    means: Moments,
}

impl Pairs {
    /// Adds the pictures of a round, channels of pixels in any order that is the same each time.
    pub fn add(&mut self, a: &[f32], b: &[f32]) {
        self.sum.resize(a.len(), 0.0);
        self.sum.iter_mut().zip(a.iter().zip(b)).for_each(|(s, (a, b))| *s += f64::from(*a) + f64::from(*b));
        self.variances.push(a.iter().zip(b).map(|(a, b)| 0.5 * (a - b) * (a - b)).collect());
        for picture in [a, b] {
            let sum: f64 = picture.iter().map(|v| f64::from(*v)).sum();
            self.means.push(sum / picture.len() as f64);
        }
    }

    /// Mean over pixels, channels and pictures.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.means.mean()
    }

    /// Relative mean squared error of a picture of each round: its variance in a pixel over the square of the
    /// reference there, which a floor keeps from 0.
    #[must_use]
    pub fn relative_errors(&self, reference: &[f64]) -> Vec<f64> {
        let of_round = |variances: &Vec<f32>| {
            let ratios = variances.iter().zip(reference).map(|(v, r)| f64::from(*v) / (r * r + FLOOR));
            ratios.sum::<f64>() / reference.len() as f64
        };
        self.variances.iter().map(of_round).collect()
    }

    /// How the mean over all pictures compares with that of other ones.
    #[must_use]
    pub fn compared(&self, other: &Self, n_comparisons: usize) -> Agreement {
        let (mine, theirs) = (&self.means, &other.means);
        let variances = [mine.variance_of_mean(), theirs.variance_of_mean()];
        let variance: f64 = variances.iter().sum();
        // [Welch47]
        let of = |v: f64, m: &Moments| v * v / (m.n() as f64 - 1.0);
        let freedom = variance * variance / (of(variances[0], mine) + of(variances[1], theirs));
        let difference = mine.mean() - theirs.mean();
        let z = if variance > 0.0 { normal_deviate(difference / variance.sqrt(), freedom) } else { 0.0 };
        Agreement {
            difference: difference / theirs.mean(),
            error: variance.sqrt() / theirs.mean(),
            agrees: z.abs() <= sidak_z(ALPHA, n_comparisons),
        }
    }
}

/// The mean picture of several renderers, in which each counts alike: what their errors are relative to.
#[must_use]
pub fn reference(all: &[&Pairs]) -> Vec<f64> {
    let n = all.first().map_or(0, |pairs| pairs.sum.len());
    let mean = |i: usize| all.iter().map(|p| p.sum[i] / p.means.n() as f64).sum::<f64>() / all.len() as f64;
    (0..n).map(mean).collect()
}

/// Comparison of two means.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Agreement {
    /// Relative difference.
    pub difference: f64,
    /// Standard error of the difference, relative.
    pub error: f64,
    /// Whether the difference is within what chance explains.
    pub agrees: bool,
}

impl Agreement {
    /// In words: `-0.03 %`, or `+4.10 %, differs`.
    #[must_use]
    pub fn words(&self) -> String {
        let differs = if self.agrees { "" } else { ", differs" };
        format!("{:+.2} ± {:.2} %{differs}", 100.0 * self.difference, 200.0 * self.error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::hash_words;

    /// Pictures of a constant with noise of a standard deviation.
    fn pairs(seed: u64, value: f64, deviation: f64, rounds: u64) -> Pairs {
        let picture = |round: u64, which: u64| -> Vec<f32> {
            let uniform = |i: u64| hash_words(&[seed, round, which, i]) as f64 / u64::MAX as f64;
            (0..3000).map(|i| (value + deviation * (uniform(i) - 0.5) * 12.0_f64.sqrt()) as f32).collect()
        };
        let mut pairs = Pairs::default();
        (0..rounds).for_each(|r| pairs.add(&picture(r, 0), &picture(r, 1)));
        pairs
    }

    #[test]
    fn the_error_of_pairs_is_the_variance_over_the_square() {
        let pairs = pairs(1, 0.5, 0.1, 8);
        let reference = reference(&[&pairs]);
        assert!(reference.iter().all(|r| (r - 0.5).abs() < 0.2));
        let errors = pairs.relative_errors(&vec![0.5; 3000]);
        assert_eq!(errors.len(), 8);
        let wanted = 0.01 / (0.25 + FLOOR);
        let mean = errors.iter().sum::<f64>() / 8.0;
        assert!((mean / wanted - 1.0).abs() < 0.05, "{mean} {wanted}");
    }

    #[test]
    fn equal_means_agree_and_others_do_not() {
        let base = pairs(1, 0.5, 0.1, 5);
        let same = base.compared(&pairs(2, 0.5, 0.2, 5), 10);
        assert!(same.agrees && same.difference.abs() < 4.0 * same.error, "{same:?}");
        let other = pairs(3, 0.55, 0.2, 5).compared(&base, 10);
        assert!(!other.agrees && (other.difference - 0.1).abs() < 4.0 * other.error, "{other:?}");
        assert!(other.words().starts_with('+') && other.words().ends_with("differs"));
    }
}
