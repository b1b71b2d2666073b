//! Statistics for tests and error bars.

/// Running mean and variance of a series of observations. \[Welford62\]
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    n: u64,
    mean: f64,
    m2: f64,
}

impl Moments {
    /// Adds an observation.
    pub fn push(&mut self, x: f64) {
        self.n += 1;
        let d = x - self.mean;
        self.mean += d / self.n as f64;
        self.m2 += d * (x - self.mean);
    }

    /// Number of observations.
    #[must_use]
    pub fn n(&self) -> u64 {
        self.n
    }

    /// Sample mean; zero without observations.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased sample variance; zero below two observations.
    #[must_use]
    pub fn variance(&self) -> f64 {
        if self.n < 2 { 0.0 } else { self.m2 / (self.n - 1) as f64 }
    }

    /// Variance of the sample mean: the sample variance over the number of observations.
    #[must_use]
    pub fn variance_of_mean(&self) -> f64 {
        if self.n == 0 { 0.0 } else { self.variance() / self.n as f64 }
    }
}

/// Median of `values`, the mean of the two middle ones where their number is even; `None` without
/// values.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    let lower = *sorted.get(sorted.len().saturating_sub(1) / 2)?;
    Some(0.5 * (lower + upper))
}

/// The normal deviate that is as probable as Student's `t` with `dof` degrees
/// of freedom, to within 0.02 for `dof` ≥ 5: \[Wallace59\] eq. 4.3.
#[must_use]
pub fn normal_deviate(t: f64, dof: f64) -> f64 {
    t.signum() * (8.0 * dof + 1.0) / (8.0 * dof + 3.0) * (dof * (t * t / dof).ln_1p()).sqrt()
}

/// Standard normal quantile, \[Acklam03\]; relative error below 1.2e-9.
///
/// # Panics
/// When `p` is outside (0, 1).
#[must_use]
pub fn normal_quantile(p: f64) -> f64 {
    assert!(p > 0.0 && p < 1.0, "probability {p} is outside (0, 1)");
    const A: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const B: [f64; 5] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
    ];
    const C: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const D: [f64; 4] =
        [7.784_695_709_041_462e-3, 3.224_671_290_700_398e-1, 2.445_134_137_142_996, 3.754_408_661_907_416];
    let tail = |q: f64| {
        (((((C[0] * q + C[1]) * q + C[2]) * q + C[3]) * q + C[4]) * q + C[5])
            / ((((D[0] * q + D[1]) * q + D[2]) * q + D[3]) * q + 1.0)
    };
    if p < 0.02425 {
        tail((-2.0 * p.ln()).sqrt())
    } else if p > 1.0 - 0.02425 {
        -tail((-2.0 * (1.0 - p).ln()).sqrt())
    } else {
        let q = p - 0.5;
        let r = q * q;
        (((((A[0] * r + A[1]) * r + A[2]) * r + A[3]) * r + A[4]) * r + A[5]) * q
            / (((((B[0] * r + B[1]) * r + B[2]) * r + B[3]) * r + B[4]) * r + 1.0)
    }
}

/// Two-sided z threshold at family-wise level `alpha` over `n` tests with the
/// Šidák correction.
#[must_use]
pub fn sidak_z(alpha: f64, n: usize) -> f64 {
    let per_test = -f64::exp_m1(f64::ln_1p(-alpha) / n.max(1) as f64);
    -normal_quantile(per_test / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviate_is_as_probable_as_the_t_it_stands_for() {
        // Two-sided quantiles of Student's t from tables, and the normal's.
        for (t, dof, z) in
            [(2.776, 4.0, 1.960), (4.032, 5.0, 2.576), (2.042, 30.0, 1.960), (3.646, 30.0, 3.291)]
        {
            assert!((normal_deviate(t, dof) - z).abs() < 0.03, "{t} {dof}: {}", normal_deviate(t, dof));
            assert!((normal_deviate(-t, dof) + z).abs() < 0.03);
        }
    }

    #[test]
    fn quantiles_match_tables() {
        for (p, z) in [(0.5, 0.0), (0.975, 1.959_963_985), (0.001, -3.090_232_306), (1e-7, -5.199_337_582)] {
            assert!((normal_quantile(p) - z).abs() < 1e-8, "{p}");
        }
        assert!((sidak_z(0.05, 1) - 1.959_963_985).abs() < 1e-8);
        assert!(sidak_z(0.01, 1000) > sidak_z(0.01, 1));
    }

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(median(&[9.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[9.0, 1.0, 2.0, 4.0]), Some(3.0));
    }

    #[test]
    fn moments_match_the_two_pass_formula() {
        let xs = [1.0e6, 1.0e6 + 1.0, 1.0e6 + 3.0];
        let mut m = Moments::default();
        for x in xs {
            m.push(x);
        }
        assert!((m.mean() - (1.0e6 + 4.0 / 3.0)).abs() < 1e-9);
        assert!((m.variance() - 7.0 / 3.0).abs() < 1e-9);
    }
}
