//! Special functions behind the signatures and the error bars.
//!
//! # References
//! \[DLMF\] 8.17.20 and 8.17.22 (the continued fraction of the incomplete beta
//! function), evaluated by the modified Lentz algorithm \[Thompson86\].

/// Largest number of terms of the continued fraction, of which it needs O(√max(a, b)). The narrowest
/// component that a signature may have has parameters of 1.5·10⁵, the root of which is 390.
const MAX_TERMS: usize = 2_000;

/// Replacement of a vanishing denominator in Lentz's algorithm: far below any partial
/// numerator that occurs, far above underflow.
const TINY: f64 = 1e-300;

/// Relative change by a term of the continued fraction below which it has converged: a few roundings.
const CONVERGED: f64 = 1e-15;

/// Regularised incomplete beta function `I_x(a, b)`: the distribution function at `x`
/// of Beta(a, b), for a, b > 0.
#[must_use]
pub fn beta_cdf(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // The fraction converges fast below the mean; above it, I_x(a,b) = 1 − I_{1−x}(b,a).
    // [DLMF] 8.17.4
    if x < (a + 1.0) / (a + b + 2.0) { lower_tail(x, a, b) } else { 1.0 - lower_tail(1.0 - x, b, a) }
}

/// `I_x(a, b)` by \[DLMF\] 8.17.22.
fn lower_tail(x: f64, a: f64, b: f64) -> f64 {
    let ln_beta = libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    let front = (a * x.ln() + b * (-x).ln_1p() - ln_beta).exp() / a;
    let guard = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / guard(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..MAX_TERMS {
        let k = m as f64;
        // [DLMF] 8.17.20
        let even = k * (b - k) * x / ((a + 2.0 * k - 1.0) * (a + 2.0 * k));
        let odd = -(a + k) * (a + b + k) * x / ((a + 2.0 * k) * (a + 2.0 * k + 1.0));
        let mut step = 1.0;
        for numerator in [even, odd] {
            d = 1.0 / guard(1.0 + numerator * d);
            c = guard(1.0 + numerator / c);
            step = c * d;
            fraction *= step;
        }
        if (step - 1.0).abs() < CONVERGED {
            break;
        }
    }
    front * fraction
}

/// The 97.5 % quantile of Student's t: half width, in standard errors, of a two-sided
/// 95 % interval with `dof` ≥ 1 degrees of freedom.
#[must_use]
pub fn student_t_95(dof: usize) -> f64 {
    let nu = dof.max(1) as f64;
    // P(|T| > t) = I_{ν/(ν+t²)}(ν/2, 1/2), decreasing in t.
    let outside = |t: f64| beta_cdf(nu / (nu + t * t), 0.5 * nu, 0.5);
    // ν = 1 needs 12.706; 80 halvings leave nothing of the interval.
    let (mut low, mut high) = (0.0, 16.0);
    for _ in 0..80 {
        let mid = 0.5 * (low + high);
        if outside(mid) > 0.05 {
            low = mid;
        } else {
            high = mid;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beta_cdf_agrees_with_closed_forms() {
        for x in [1e-9, 1.0 / 256.0, 0.03, 0.3, 0.5, 0.77, 0.97, 255.0 / 256.0] {
            for p in [0.4, 0.96, 1.0, 2.5, 11.6, 47.0] {
                let near = |got: f64, want: f64| {
                    assert!((got - want).abs() < 2e-13, "x {x} p {p}: {got} {want}");
                };
                near(beta_cdf(x, p, 1.0), x.powf(p));
                near(beta_cdf(x, 1.0, p), 1.0 - (1.0 - x).powf(p));
                near(beta_cdf(0.5, p, p), 0.5);
            }
            let arcsine = 2.0 / std::f64::consts::PI * x.sqrt().asin();
            assert!((beta_cdf(x, 0.5, 0.5) - arcsine).abs() < 1e-13);
            // I_x(2, 3) = 6x² − 8x³ + 3x⁴
            let polynomial = x * x * (6.0 + x * (-8.0 + 3.0 * x));
            assert!((beta_cdf(x, 2.0, 3.0) - polynomial).abs() < 1e-13);
        }
    }

    #[test]
    fn beta_cdf_is_a_distribution_function_at_its_ends() {
        assert_eq!(beta_cdf(0.0, 0.5, 3.0), 0.0);
        assert_eq!(beta_cdf(1.0, 0.5, 3.0), 1.0);
    }

    #[test]
    fn student_quantiles_are_those_of_the_tables() {
        for (dof, want) in [(1, 12.706_205), (3, 3.182_446), (7, 2.364_624), (30, 2.042_272)] {
            let got = student_t_95(dof);
            assert!((got - want).abs() < 1e-6, "{dof}: {got}");
        }
    }
}
