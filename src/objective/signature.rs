//! Signatures: the cumulated histogram `p` that the histogram term steers towards.
//!
//! A signature is a mixture of Beta distributions on [0, 1] or 256 given values, as learned
//! from photographs (see [`library`]).
//!
//! The built-in ones are neither learned nor the paper's, which were never published: they are
//! mixtures of Betas with chosen moments. `low` was chosen so that f_hist of images modelled
//! after the paper's tables is .269, .178, .186 and .115, where the paper reports .278,
//! .184, .197 and .125. `high` is \[PG14\] table 1 itself, its means and deviations of object
//! and background as two Betas, and fits the published values less well.

pub mod library;

use serde::Serialize;
use thiserror::Error;

use super::histogram::BINS;
use super::special::beta_cdf;

/// A Beta distribution of display luminance, one component of a mixture, given by its moments.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BetaComponent {
    /// Share of the picture's pixels that the component describes, ≥ 0; those of a mixture add up to 1.
    pub fraction: f64,
    /// Mean display luminance, in (0, 1).
    pub mean: f64,
    /// Standard deviation of display luminance, in [0.001, √(mean·(1−mean))).
    pub sigma: f64,
}

impl BetaComponent {
    /// Beta parameters (α, β) by the method of moments.
    fn shape(&self) -> (f64, f64) {
        let precision = self.mean * (1.0 - self.mean) / (self.sigma * self.sigma) - 1.0;
        (self.mean * precision, (1.0 - self.mean) * precision)
    }
}

/// Why a signature is refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SignatureError {
    /// The mixture has no components.
    #[error("a mixture needs at least one Beta")]
    Empty,
    /// No Beta distribution has the moments of a component.
    #[error(
        "Beta {index}: no distribution on [0, 1] has mean {mean} and sigma {sigma}; \
         need 0 < mean < 1 and 0.001 <= sigma < sqrt(mean (1 - mean))"
    )]
    Moments {
        /// Position of the component in the mixture, counted from 1.
        index: usize,
        /// Mean that was given.
        mean: f64,
        /// Standard deviation that was given.
        sigma: f64,
    },
    /// A share of the mixture is negative or not finite, or the shares do not add up to 1.
    #[error("the fractions of a mixture must be >= 0 and add up to 1, got {sum}")]
    Fractions {
        /// Sum of the shares.
        sum: f64,
    },
    /// The number of cumulated values is not that of the bins.
    #[error("need {BINS} cumulated values, got {count}")]
    Count {
        /// Number of values that were given.
        count: usize,
    },
    /// The cumulated values are no distribution function.
    #[error("cumulated value {index} is {value}; values must rise from >= 0 and end at 1")]
    NotCumulated {
        /// Position of the first value that is wrong, counted from 0.
        index: usize,
        /// Value at that position.
        value: f64,
    },
}

/// Description of the distribution of display luminance that a signature stands for.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Mixture of Beta distributions, at least one.
    Betas(Vec<BetaComponent>),
    /// Cumulated histogram: for each bin the share of pixels below its upper edge.
    Cumulated(Vec<f64>),
}

/// A named cumulated histogram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Signature {
    name: String,
    #[serde(flatten)]
    shape: Shape,
}

/// Lowest standard deviation of a component: four of it are one of the 256 bins, so that a narrower
/// component would be a step, and its distribution function takes ever more terms to evaluate.
const MIN_SIGMA: f64 = 0.001;

/// Slack on "adds up to 1" and "ends at 1": decimal fractions that people write down with nine digits
/// or more count as exact, and no term notices.
const UNIT_SLACK: f64 = 1e-9;

/// Names of the built-in signatures: mixtures of Betas, see the [module](self).
pub const BUILTIN: [&str; 4] = ["high", "low", "high-photo", "medium"];

impl Signature {
    /// A built-in signature by its name: a mixture `c·Beta(object) + (1−c)·Beta(background)`.
    #[must_use]
    pub fn builtin(name: &str) -> Option<Self> {
        let betas: &[(f64, f64, f64)] = match name {
            "high" => &[(0.30, 0.47, 0.24), (0.70, 0.78, 0.17)],
            "low" => &[(0.15, 0.45, 0.33), (0.85, 0.02, 0.02)],
            "high-photo" => &[(0.30, 0.55, 0.26), (0.70, 0.95, 0.06)],
            "medium" => &[(1.0, 0.47, 0.23)],
            _ => return None,
        };
        let betas =
            betas.iter().map(|&(fraction, mean, sigma)| BetaComponent { fraction, mean, sigma }).collect();
        Some(Self { name: name.to_owned(), shape: Shape::Betas(betas) })
    }

    /// A signature of any shape under a name for people.
    ///
    /// # Errors
    /// When `shape` is not a distribution on [0, 1].
    pub fn new(name: impl Into<String>, shape: Shape) -> Result<Self, SignatureError> {
        match &shape {
            Shape::Betas(betas) => check_betas(betas)?,
            Shape::Cumulated(values) => check_cumulated(values)?,
        }
        Ok(Self { name: name.into(), shape })
    }

    /// Name of the signature, for people.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The distribution as it was described.
    #[must_use]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Mean and standard deviation of display luminance, as far as 256 bins resolve them.
    #[must_use]
    pub fn moments(&self) -> (f64, f64) {
        // E[l] = ∫ (1 − P) dl and E[l²] = ∫ 2l (1 − P) dl by the trapezium rule on the bin edges.
        let (mut mean, mut second) = (0.5 / BINS as f64, 0.0);
        for (i, p) in self.cumulated().iter().enumerate() {
            let above = (1.0 - p) / BINS as f64;
            mean += above;
            second += 2.0 * (i + 1) as f64 / BINS as f64 * above;
        }
        (mean, (second - mean * mean).max(0.0).sqrt())
    }

    /// Cumulated histogram `p`: in bin i the share of pixels below its upper edge `(i+1)/256`. The
    /// last value is 1.
    #[must_use]
    pub fn cumulated(&self) -> [f64; BINS] {
        let mut p = [0.0; BINS];
        match &self.shape {
            Shape::Betas(betas) => {
                for beta in betas {
                    let (a, b) = beta.shape();
                    for (i, p) in p.iter_mut().enumerate() {
                        *p += beta.fraction * beta_cdf((i + 1) as f64 / BINS as f64, a, b);
                    }
                }
            }
            Shape::Cumulated(values) => {
                for (p, value) in p.iter_mut().zip(values) {
                    *p = *value;
                }
            }
        }
        for p in &mut p {
            *p = p.clamp(0.0, 1.0);
        }
        p[BINS - 1] = 1.0;
        p
    }
}

fn check_betas(betas: &[BetaComponent]) -> Result<(), SignatureError> {
    if betas.is_empty() {
        return Err(SignatureError::Empty);
    }
    for (i, &BetaComponent { mean, sigma, .. }) in betas.iter().enumerate() {
        let possible = mean > 0.0 && mean < 1.0 && sigma >= MIN_SIGMA && sigma * sigma < mean * (1.0 - mean);
        if !possible {
            return Err(SignatureError::Moments { index: i + 1, mean, sigma });
        }
    }
    let sum: f64 = betas.iter().map(|b| b.fraction).sum();
    let shares = betas.iter().all(|b| b.fraction >= 0.0) && (sum - 1.0).abs() <= UNIT_SLACK;
    if shares { Ok(()) } else { Err(SignatureError::Fractions { sum }) }
}

fn check_cumulated(values: &[f64]) -> Result<(), SignatureError> {
    if values.len() != BINS {
        return Err(SignatureError::Count { count: values.len() });
    }
    let mut before = 0.0;
    for (index, &value) in values.iter().enumerate() {
        let last = index == BINS - 1;
        let rises = value >= before && value <= 1.0 + UNIT_SLACK;
        if !rises || (last && (value - 1.0).abs() > UNIT_SLACK) {
            return Err(SignatureError::NotCumulated { index, value });
        }
        before = value;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builtin_signatures_have_the_moments_they_are_given_by() {
        for (name, mean) in [
            ("high", 0.30 * 0.47 + 0.70 * 0.78),
            ("low", 0.15 * 0.45 + 0.85 * 0.02),
            ("high-photo", 0.30 * 0.55 + 0.70 * 0.95),
            ("medium", 0.47),
        ] {
            let p = Signature::builtin(name).unwrap().cumulated();
            // The Betas with an infinite density at an end limit the accuracy.
            let (got, _) = Signature::builtin(name).unwrap().moments();
            assert!((got - mean).abs() < 2e-4, "{name}: {got} {mean}");
            assert!(p.windows(2).all(|w| w[0] <= w[1]) && p[BINS - 1] == 1.0);
        }
    }

    #[test]
    fn medium_has_the_spread_it_is_given_by() {
        let (_, sigma) = Signature::builtin("medium").unwrap().moments();
        assert!((sigma - 0.23).abs() < 1e-4);
    }

    #[test]
    fn impossible_signatures_are_refused() {
        let beta = |fraction, mean, sigma| BetaComponent { fraction, mean, sigma };
        let betas = |list: &[BetaComponent]| Signature::new("x", Shape::Betas(list.to_vec()));
        assert_eq!(betas(&[]), Err(SignatureError::Empty));
        for (mean, sigma) in [(0.0, 0.1), (1.0, 0.1), (0.5, 0.5), (0.5, 0.0), (f64::NAN, 0.1)] {
            assert!(matches!(
                betas(&[beta(1.0, mean, sigma)]),
                Err(SignatureError::Moments { index: 1, .. })
            ));
        }
        assert!(matches!(
            betas(&[beta(0.5, 0.5, 0.1), beta(0.4, 0.5, 0.1)]),
            Err(SignatureError::Fractions { .. })
        ));
        assert!(matches!(
            betas(&[beta(1.5, 0.5, 0.1), beta(-0.5, 0.5, 0.1)]),
            Err(SignatureError::Fractions { .. })
        ));
        let cumulated = |v: Vec<f64>| Signature::new("x", Shape::Cumulated(v));
        assert_eq!(cumulated(vec![1.0; 3]), Err(SignatureError::Count { count: 3 }));
        let mut falling = vec![1.0; BINS];
        falling[7] = 0.5;
        assert!(matches!(cumulated(falling), Err(SignatureError::NotCumulated { index: 7, .. })));
        assert!(matches!(cumulated(vec![0.5; BINS]), Err(SignatureError::NotCumulated { index: 255, .. })));
        assert!(cumulated(vec![1.0; BINS]).is_ok());
    }
}
