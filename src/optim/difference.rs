//! Forward differences of a noisy function on the unit cube.
//!
//! # References
//! \[More11\] (the noise of a computed function), \[More12\] (the step).

/// Least and largest step of a difference, in the unit cube, to which the step by the noise is cut:
/// smaller ones would magnify rounding, larger ones straddle the bends of f_q.
const STEP_RANGE: [f64; 2] = [2e-3, 5e-2];

/// Gradient of `f` at `u` from its value `f0` there, one more evaluation a
/// variable: `(f(u + h e_i) − f0) / h`, backward where the cube ends.
///
/// # Errors
/// Those of `f`.
pub fn gradient<E>(
    u: &[f64],
    f0: f64,
    h: f64,
    mut f: impl FnMut(&[f64]) -> Result<f64, E>,
) -> Result<Vec<f64>, E> {
    let mut moved = u.to_vec();
    (0..u.len())
        .map(|i| {
            let step = if u[i] + h <= 1.0 { h } else { -h };
            moved[i] = u[i] + step;
            let slope = (f(&moved)? - f0) / step;
            moved[i] = u[i];
            Ok(slope)
        })
        .collect()
}

/// Standard deviation of the noise of a function sampled at evenly spaced
/// points: the k-th differences of a smooth function vanish, those of noise
/// grow as a binomial sum.
///
/// \[More11\] eq. 3.2 and section 4: the first order from which three estimates
/// agree within a factor of four and the differences change sign; else the
/// least estimate.
#[must_use]
pub fn noise(values: &[f64]) -> f64 {
    let mut table = values.to_vec();
    let mut gamma = 1.0;
    let mut levels = Vec::new();
    for k in 1..values.len() {
        table = table.windows(2).map(|w| w[1] - w[0]).collect();
        let k = k as f64;
        gamma *= 0.5 * k / (2.0 * k - 1.0);
        let mean_square = table.iter().map(|d| d * d).sum::<f64>() / table.len() as f64;
        let changes_sign = table.iter().any(|&d| d > 0.0) && table.iter().any(|&d| d < 0.0);
        levels.push(((gamma * mean_square).sqrt(), changes_sign));
    }
    levels
        .windows(3)
        .find(|w| {
            let least = w.iter().map(|l| l.0).fold(f64::INFINITY, f64::min);
            let most = w.iter().map(|l| l.0).fold(0.0, f64::max);
            most <= 4.0 * least && w[0].1
        })
        .map_or_else(|| levels.iter().map(|l| l.0).fold(f64::INFINITY, f64::min), |w| w[0].0)
}

/// The step at which truncation and noise of a forward difference balance for
/// a function with |f''| about 1. \[More12\] eq. 2.4.
#[must_use]
pub fn step(noise: f64) -> f64 {
    (8.0_f64.powf(0.25) * noise.sqrt()).clamp(STEP_RANGE[0], STEP_RANGE[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::mix64;

    fn uniform(i: u64) -> f64 {
        mix64(i) as f64 / u64::MAX as f64 - 0.5
    }

    #[test]
    fn noise_is_told_from_curvature() {
        for sigma in [1e-5, 1e-3] {
            let mean = (0..50)
                .map(|seed| {
                    let values: Vec<f64> = (0..8)
                        .map(|i| {
                            let x = 0.3 + 1e-2 * f64::from(i);
                            x.sin()
                                + x * x
                                + sigma * 12.0_f64.sqrt() * uniform(seed * 100 + u64::from(i as u32))
                        })
                        .collect();
                    noise(&values).ln()
                })
                .sum::<f64>()
                / 50.0;
            let found = mean.exp();
            assert!(found > sigma / 2.0 && found < sigma * 2.0, "{sigma}: {found}");
        }
    }

    #[test]
    fn gradients_stay_inside_the_cube() {
        let f = |u: &[f64]| -> Result<f64, ()> {
            assert!(u.iter().all(|v| (0.0..=1.0).contains(v)));
            Ok(3.0 * u[0] - 2.0 * u[1])
        };
        let g = gradient(&[1.0, 0.0], 3.0, 0.05, f).unwrap();
        assert!((g[0] - 3.0).abs() < 1e-12 && (g[1] + 2.0).abs() < 1e-12);
    }
}
