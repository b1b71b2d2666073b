//! Knots of a light's size.
//!
//! Contributions of a light are kept by their size coordinate ρ in u = ρ². The
//! knots u_0 = 0 < u_1 < … < u_n carry hat functions B_i; a contribution goes
//! linearly into the two knots around it, which gives masses m_i, and
//!
//! ```text
//! C'(u) = Σ m_i B_i(u) / ∫B_i,    C(u) = Σ m_i G_i(u),    G_i(u) = ∫_0^u B_i / ∫B_i
//! ```
//!
//! C is linear in the data, monotone, once continuously differentiable, zero at 0
//! and exact at the largest size: it is the light whose edge is feathered by one
//! bin, `H_s(ρ)` ([`Knots::feather`]). Since all hats below a bin count in full, C
//! is a sum of three prefix sums of the masses.

use serde::{Deserialize, Serialize};

/// Knots of the size of one light, in u = s².
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Knots {
    /// Squared sizes, ascending from 0.
    u: Vec<f64>,
}

/// C(s) as a linear combination of three prefix sums Q_i = m_0 + … + m_i of the masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnotWeights {
    /// Index of the first knot whose prefix sum counts; the others are the next two.
    pub first: usize,
    /// Weights of Q_first, Q_first+1 and Q_first+2.
    pub value: [f64; 3],
    /// Derivatives of those weights by the size s.
    pub slope: [f64; 3],
}

impl Knots {
    /// `n` knots, at least 3, for sizes in `[smallest, largest]`: at 0, and from `smallest` to `largest`
    /// in even ratios.
    #[must_use]
    pub fn geometric(smallest: f64, largest: f64, n: usize) -> Self {
        let steps = n.saturating_sub(2).max(1);
        let ratio = largest / smallest;
        let size = |i: usize| smallest * ratio.powf(i as f64 / steps as f64);
        Self::new((0..=steps).map(size).collect())
    }

    /// Half of `n` knots as by [`Self::geometric`], and as many around each of the sizes `at`, evenly
    /// spaced within a factor of 1 ± `spread` of it.
    #[must_use]
    pub fn around(smallest: f64, largest: f64, at: &[f64], spread: f64, n: usize) -> Self {
        let n_fine = n / 2;
        let is_near = |s: f64, at: &[f64]| at.iter().any(|at| (s / at - 1.0).abs() <= spread);
        let Self { u } = Self::geometric(smallest, largest, n - n_fine);
        let coarse = u[1..].iter().map(|u| u.sqrt()).filter(|s| !is_near(*s, at));
        let step = 2.0 * spread / (n_fine - 1).max(1) as f64;
        // Where the neighbourhoods of two sizes overlap, the knots of one are fine enough.
        let fine = at.iter().enumerate().flat_map(|(i, center)| {
            let sizes = (0..n_fine).map(move |k| center * (1.0 - spread + step * k as f64));
            sizes.filter(move |s| (smallest..largest).contains(s) && !is_near(*s, &at[..i]))
        });
        Self::new(coarse.chain(fine).chain([smallest, largest]).collect())
    }

    /// Knots at 0 and at the given sizes.
    fn new(mut sizes: Vec<f64>) -> Self {
        sizes.sort_by(f64::total_cmp);
        // Bins thinner than a millionth of a size only cost memory.
        sizes.dedup_by(|b, a| *b <= *a * (1.0 + 1e-6));
        Self { u: std::iter::once(0.0).chain(sizes.into_iter().map(|s| s * s)).collect() }
    }

    /// Whether there are at least two knots that ascend from 0 and are finite: knots read from a file may
    /// be anything.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let ascend = self.u.windows(2).all(|w| w[0] < w[1]);
        self.u.len() >= 2 && self.u[0] == 0.0 && ascend && self.u.iter().all(|u| u.is_finite())
    }

    /// Number of knots, including that at 0.
    #[must_use]
    pub fn len(&self) -> usize {
        self.u.len()
    }

    /// Whether there are no knots, which is never so.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.u.is_empty()
    }

    /// Sizes at the knots, ascending from 0.
    #[must_use]
    pub fn sizes(&self) -> Vec<f64> {
        self.u.iter().map(|u| u.sqrt()).collect()
    }

    /// Index of the bin that contains `u`, and the position in it, in [0, 1].
    fn locate(&self, u: f64) -> (usize, f64) {
        let last = self.u.len() - 2;
        let j = self.u.partition_point(|&k| k <= u).saturating_sub(1).min(last);
        (j, ((u - self.u[j]) / (self.u[j + 1] - self.u[j])).clamp(0.0, 1.0))
    }

    /// Index of the knot below a size coordinate, and the share of a contribution that goes to the knot
    /// above it.
    #[must_use]
    pub fn deposit(&self, rho: f32) -> (usize, f32) {
        let (j, t) = self.locate(f64::from(rho) * f64::from(rho));
        (j, t as f32)
    }

    /// Integral of the hat function B_i.
    fn area(&self, i: usize) -> f64 {
        let below = if i == 0 { 0.0 } else { self.u[i] - self.u[i - 1] };
        let above = self.u.get(i + 1).map_or(0.0, |next| next - self.u[i]);
        0.5 * (below + above)
    }

    /// G_j, G_j+1 and their derivatives by u, for u in bin j at `t`.
    fn shares(&self, j: usize, t: f64) -> ([f64; 2], [f64; 2]) {
        let width = self.u[j + 1] - self.u[j];
        let below = if j == 0 { 0.0 } else { 0.5 * (self.u[j] - self.u[j - 1]) };
        let (a, b) = (self.area(j), self.area(j + 1));
        let g = [(below + width * (t - 0.5 * t * t)) / a, 0.5 * width * t * t / b];
        (g, [(1.0 - t) / a, t / b])
    }

    /// C at the size `s` as a combination of prefix sums; beyond the largest size it is that of the
    /// largest.
    #[must_use]
    pub fn weights(&self, s: f64) -> KnotWeights {
        let (j, t) = self.locate(s * s);
        let ([g0, g1], [d0, d1]) = self.shares(j, t);
        let by_size = 2.0 * s;
        // Q_j−1 (1 − G_j) + Q_j (G_j − G_j+1) + Q_j+1 G_j+1, and Q_−1 = 0.
        let value = [1.0 - g0, g0 - g1, g1];
        let slope = [-d0, d0 - d1, d1].map(|d| d * by_size);
        if j == 0 {
            return KnotWeights {
                first: 0,
                value: [value[1], value[2], 0.0],
                slope: [slope[1], slope[2], 0.0],
            };
        }
        KnotWeights { first: j - 1, value, slope }
    }

    /// H_s(ρ): share of a contribution with size coordinate ρ that the feathered light of size `s` emits,
    /// in [0, 1].
    #[must_use]
    pub fn feather(&self, s: f64, rho: f32) -> f64 {
        let (i, t) = self.deposit(rho);
        let (j, at) = self.locate(s * s);
        let (g, _) = self.shares(j, at);
        let share = |i: usize| match i {
            _ if i < j => 1.0,
            _ if i <= j + 1 => g[i - j],
            _ => 0.0,
        };
        let t = f64::from(t);
        (1.0 - t) * share(i) + t * share(i + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knots() -> Knots {
        Knots::geometric(0.05, 1.4, 24)
    }

    #[test]
    fn they_begin_at_zero_and_end_at_the_largest_size() {
        for k in
            [knots(), Knots::around(0.05, 1.4, &[0.4], 0.2, 24), Knots::around(0.05, 1.4, &[1.4], 0.2, 24)]
        {
            let s = k.sizes();
            assert_eq!(s[0], 0.0);
            assert!((s[1] - 0.05).abs() < 1e-12 && (s[k.len() - 1] - 1.4).abs() < 1e-12);
            assert!(s.windows(2).all(|w| w[0] < w[1]));
            assert!((14..=27).contains(&k.len()), "{}", k.len());
        }
        let near = |at: &[f64], s: f64| {
            let sizes = Knots::around(0.05, 1.4, at, 0.2, 24).sizes();
            sizes.iter().filter(|k| (*k / s - 1.0).abs() < 0.21).count()
        };
        assert!(near(&[0.4], 0.4) >= 11);
        assert!(near(&[0.4, 0.1], 0.4) >= 11 && near(&[0.4, 0.1], 0.1) >= 11);
        assert!(near(&[0.4, 0.41], 0.4) <= 14, "fine enough already");
    }

    #[test]
    fn the_feather_is_one_inside_zero_outside_and_exact_in_total() {
        let k = knots();
        let sizes = k.sizes();
        for s in [0.02, 0.05, 0.3, 0.31, 1.0, 1.4] {
            let bin = sizes.iter().position(|b| *b >= s - 1e-12).unwrap();
            for i in 0..200 {
                let rho = 1.4 * (i as f32 + 0.5) / 200.0;
                let h = k.feather(s, rho);
                assert!((0.0..=1.0 + 1e-12).contains(&h), "{s} {rho}: {h}");
                if bin >= 2 && f64::from(rho) < sizes[bin - 2] {
                    assert!((h - 1.0).abs() < 1e-12);
                }
                if bin + 2 < sizes.len() && f64::from(rho) > sizes[bin + 2] {
                    assert_eq!(h, 0.0);
                }
                if s == 1.4 {
                    assert!((h - 1.0).abs() < 1e-9, "the largest size is exact");
                }
            }
        }
        assert_eq!(k.feather(0.0, 0.3), 0.0);
    }

    #[test]
    fn prefix_sums_weighted_are_the_feathered_contributions() {
        let k = knots();
        let mut masses = vec![0.0; k.len()];
        let data: Vec<(f32, f64)> =
            (0..500).map(|i| (1.4 * ((i * 37 % 500) as f32 + 0.5) / 500.0, 1.0 + f64::from(i % 7))).collect();
        for (rho, value) in &data {
            let (i, t) = k.deposit(*rho);
            masses[i] += value * (1.0 - f64::from(t));
            masses[i + 1] += value * f64::from(t);
        }
        let prefix: Vec<f64> = masses
            .iter()
            .scan(0.0, |a, m| {
                *a += m;
                Some(*a)
            })
            .collect();
        for s in [0.01, 0.05, 0.2, 0.77, 1.39, 1.4] {
            let w = k.weights(s);
            let at = |w: &KnotWeights, f: [f64; 3]| -> f64 {
                (0..3).map(|i| f[i] * prefix.get(w.first + i).copied().unwrap_or(0.0)).sum()
            };
            let direct: f64 = data.iter().map(|(rho, v)| v * k.feather(s, *rho)).sum();
            assert!((at(&w, w.value) - direct).abs() < 1e-9 * direct, "{s}");
            let h = 1e-6;
            let (lo, hi) = (k.weights(s - h), k.weights(s + h));
            let difference = (at(&hi, hi.value) - at(&lo, lo.value)) / (2.0 * h);
            if s < 1.4 {
                let slope = at(&w, w.slope);
                assert!(
                    (slope - difference).abs() < 1e-5 * slope.abs().max(1.0),
                    "{s}: {slope} {difference}"
                );
            }
        }
    }
}
