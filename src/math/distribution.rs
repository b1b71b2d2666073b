//! Discrete distributions, sampled by inversion.

use super::ONE_MINUS_EPSILON;

/// Probabilities of a finite set, with their cumulated sums.
///
/// Probabilities are kept beside the sums: as differences of sums in f32, those of many or of unlike
/// members would round to zero.
#[derive(Clone, Debug, Default)]
pub struct Discrete {
    pmf: Vec<f32>,
    cdf: Vec<f32>,
}

impl Discrete {
    /// Probabilities proportional to `weights`, none of them negative; `None` where their sum is not
    /// positive or not finite. Sums are taken in f64.
    #[must_use]
    pub fn new(weights: &[f64]) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut sum = 0.0;
        let cumulated = weights.iter().map(|w| {
            sum += w / total;
            sum as f32
        });
        let mut cdf: Vec<f32> = cumulated.collect();
        // What follows the last member that can be drawn must not be, whatever the rounding.
        let last = weights.iter().rposition(|w| *w > 0.0)?;
        cdf[last..].fill(1.0);
        Some(Self { pmf: weights.iter().map(|w| (w / total) as f32).collect(), cdf })
    }

    /// Probability of a member.
    #[must_use]
    pub fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }

    /// Draws a member by `u` in [0, 1), and gives what is left of `u`, again uniform in [0, 1);
    /// `None` without members.
    #[must_use]
    pub fn sample(&self, u: f32) -> Option<(usize, f32)> {
        let last = self.cdf.len().checked_sub(1)?;
        let i = self.cdf.partition_point(|&c| c <= u).min(last);
        let below = i.checked_sub(1).map_or(0.0, |j| self.cdf[j]);
        Some((i, ((u - below) / self.pmf[i].max(f32::MIN_POSITIVE)).clamp(0.0, ONE_MINUS_EPSILON)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_drawn_as_often_as_their_probabilities_say() {
        let weights = [0.0, 1.0, 3.0, 0.0, 4.0, 0.0];
        let d = Discrete::new(&weights).unwrap();
        let n = 80_000;
        let mut counts = [0; 6];
        for k in 0..n {
            let (i, rest) = d.sample((k as f32 + 0.5) / n as f32).unwrap();
            assert!((0.0..1.0).contains(&rest));
            counts[i] += 1;
        }
        for (i, weight) in weights.iter().enumerate() {
            assert!((f64::from(counts[i]) - f64::from(n) * weight / 8.0).abs() <= 1.0, "{counts:?}");
            assert_eq!(d.pmf(i), (weight / 8.0) as f32);
        }
        assert_eq!(d.sample(ONE_MINUS_EPSILON).unwrap().0, 4, "nothing without weight is drawn");
    }

    #[test]
    fn what_is_dim_beside_much_that_is_bright_keeps_its_probability() {
        let mut weights = vec![1.0; 100_000];
        weights[70_000] = 1e-9;
        let d = Discrete::new(&weights).unwrap();
        assert!((f64::from(d.pmf(70_000)) / (1e-9 / 99_999.0) - 1.0).abs() < 1e-5);
        assert!(Discrete::new(&[0.0, 0.0]).is_none() && Discrete::new(&[]).is_none());
        assert!(Discrete::default().sample(0.5).is_none());
    }
}
