//! f_q of a picture of which there are independent replicates.
//!
//! Every pixel has its own scramble, so its noise is independent of the other pixels', and
//! which of its R values is called the first is of no account: replicates whose values are
//! exchanged, pixel by pixel, are as good as the rendered ones. The error is the mean over several
//! such labellings. The error from a single one scatters by a factor of two for R = 4, and with it the
//! number of samples that a tolerance seems to need. (A light subpath that contributes to several
//! pixels correlates their noise. Its share of a picture is small but for caustics, and there it
//! reaches few pixels.)
//!
//! The interval still is Student's for R−1 degrees of freedom. The noise of renders has long
//! tails: with the narrower interval for the degrees of freedom of all labellings, the bar covered
//! 89 % of 200 renders, where 95 % are meant.

use super::{JackknifeEstimate, Objective, ObjectiveError, Ramp, Smoothing, Statistics, jackknife};
use crate::math::{Measure, hash::hash_words};

/// Labellings from which the error of a reported f_q is estimated. Of 400 estimates from four
/// replicates, the standard error scattered by 40 % with one labelling, 28 % with two, 20 % with four
/// and 14 % with eight; each costs as many measurements of a picture as there are replicates.
pub const LABELLINGS: usize = 4;

/// Independent replicates of a picture: renders of one scene that differ by their noise alone.
#[derive(Clone, Copy, Debug)]
pub struct Replicates<'a> {
    /// [Planes](Measure::planes) of each replicate, row-major, in units of display white at exposure 1.
    pub linear: &'a [Vec<f64>],
    /// How linear light becomes display luminance.
    pub measure: Measure,
    /// Factor on linear light before it is encoded for the display.
    pub exposure: f64,
}

impl Replicates<'_> {
    /// f_q of the mean picture, unsmoothed and freed of noise bias, with its error from as many
    /// labellings; a single one takes the replicates as they are.
    ///
    /// # Errors
    /// With fewer than two replicates.
    ///
    /// # Panics
    /// When a replicate has another size than the objective.
    pub fn measure(
        &self,
        objective: &Objective,
        labellings: usize,
    ) -> Result<JackknifeEstimate, ObjectiveError> {
        let replicates = self.linear.len();
        if replicates < 2 {
            return Err(ObjectiveError::TooFewReplicates { replicates });
        }
        let n = objective.n_pixels();
        let n_linear = n * self.measure.n_planes();
        let mut mean = vec![0.0; n_linear];
        for y in self.linear {
            mean.iter_mut().zip(y).for_each(|(m, y)| *m += y / replicates as f64);
        }
        let mut slopes = vec![0.0; n_linear * self.measure.n_shown()];
        let n_shown = n * self.measure.n_shown();
        let mut display = |y: &[f64]| {
            let mut display = vec![0.0; n_shown];
            self.measure.encode_all(y, self.exposure, &mut display, &mut slopes);
            display
        };
        let full = objective.statistics(&display(&mean), Ramp::Linear);
        let (all, rest) = (replicates as f64, 1.0 / (replicates as f64 - 1.0));
        let mut left = vec![0.0; n_linear];
        let one_out = self.linear.iter().map(|left_out| {
            for ((left, m), y) in left.iter_mut().zip(&mean).zip(left_out) {
                *left = (all * m - y) * rest;
            }
            display(&left)
        });
        let one_out: Vec<Vec<f64>> = one_out.collect();
        let first = one_out.iter().map(|display| objective.statistics(display, Ramp::Linear)).collect();
        left.resize(n_shown, 0.0);
        let relabelled = (1..labellings).map(|labelling| {
            let shifts: Vec<usize> = (0..n).map(|p| shift(labelling, p, replicates)).collect();
            (0..replicates)
                .map(|r| {
                    for (p, left) in left.iter_mut().enumerate() {
                        *left = one_out[(r + shifts[p % n]) % replicates][p];
                    }
                    objective.statistics(&left, Ramp::Linear)
                })
                .collect()
        });
        let labelled: Vec<Vec<Statistics>> = std::iter::once(first).chain(relabelled).collect();
        objective.jackknife(&full, &labelled, &Smoothing::NONE)
    }
}

impl Replicates<'_> {
    /// Statistics of the mean picture, freed of noise bias to the second order of the jackknife.
    ///
    /// # Panics
    /// With fewer than three replicates, or when one has another size than the objective.
    #[must_use]
    pub fn second_order(&self, objective: &Objective, ramp: Ramp) -> Statistics {
        let (count, n) = (self.linear.len(), objective.n_pixels());
        let n_linear = n * self.measure.n_planes();
        let n_shown = self.measure.n_shown();
        let (mut mean, mut display) = (vec![0.0; n_linear], vec![0.0; n * n_shown]);
        let mut slopes = vec![0.0; n_linear * n_shown];
        let mut without = |left_out: &[usize]| {
            let share = 1.0 / (count - left_out.len()) as f64;
            mean.fill(0.0);
            for y in (0..count).filter(|r| !left_out.contains(r)).map(|r| &self.linear[r]) {
                mean.iter_mut().zip(y).for_each(|(m, y)| *m += share * y);
            }
            self.measure.encode_all(&mean, self.exposure, &mut display, &mut slopes);
            objective.statistics(&display, ramp)
        };
        let one_out: Vec<Statistics> = (0..count).map(|r| without(&[r])).collect();
        let pairs = (0..count).flat_map(|a| (0..a).map(move |b| [a, b]));
        let two_out: Vec<Statistics> = pairs.map(|pair| without(&pair)).collect();
        jackknife::second_order(&without(&[]), &one_out, &two_out)
    }
}

/// Number of places by which a labelling rotates the labels of a pixel's replicates.
fn shift(labelling: usize, pixel: usize, replicates: usize) -> usize {
    (hash_words(&[labelling as u64, pixel as u64]) % replicates as u64) as usize
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Rng, disk_mask};
    use super::*;
    use crate::math::stats::Moments;
    use crate::objective::{LuminanceMode, Target, Term};

    const W: usize = 32;
    const H: usize = 24;

    fn objective() -> Objective {
        let target = Target::resolve("high-key").unwrap();
        Objective::new(&target, W, H, &disk_mask(W, H)).unwrap()
    }

    fn noisy(rng: &mut Rng, replicates: usize, noise: f64) -> Vec<Vec<f64>> {
        let smooth = |i: usize| 0.3 + 0.2 * ((i % W) as f64 * 0.2).sin() * ((i / W) as f64 * 0.15).cos();
        (0..replicates)
            .map(|_| (0..W * H).map(|i| smooth(i) * (1.0 + noise * rng.normal())).collect())
            .collect()
    }

    fn measure(linear: &[Vec<f64>], labellings: usize) -> JackknifeEstimate {
        let replicates = Replicates { linear, measure: Measure::default(), exposure: 1.0 };
        replicates.measure(&objective(), labellings).unwrap()
    }

    #[test]
    fn one_labelling_is_the_jackknife_of_the_replicates_as_they_are() {
        let objective = objective();
        let linear = noisy(&mut Rng::new(3), 4, 0.2);
        let mean_without = |skip: Option<usize>| -> Vec<f64> {
            let kept: Vec<&Vec<f64>> =
                linear.iter().enumerate().filter(|(r, _)| Some(*r) != skip).map(|(_, y)| y).collect();
            let mean = |p: usize| kept.iter().map(|y| y[p]).sum::<f64>() / kept.len() as f64;
            (0..W * H).map(|p| LuminanceMode::Srgb.encode(mean(p), 1.0)).collect()
        };
        let z = |skip| objective.statistics(&mean_without(skip), Ramp::Linear);
        let ones = vec![(0..4).map(|r| z(Some(r))).collect::<Vec<_>>()];
        let wanted = objective.jackknife(&z(None), &ones, &Smoothing::NONE).unwrap();
        let found = measure(&linear, 1);
        assert!((found.evaluation.f_q - wanted.evaluation.f_q).abs() < 1e-10);
        assert!((found.half_width - wanted.half_width).abs() < 1e-10);
    }

    /// The error that is told scatters less than that of one labelling, about the same mean, and
    /// is that of the estimates.
    #[test]
    fn several_labellings_tell_the_same_error_better() {
        let mut rng = Rng::new(8);
        let (mut one, mut several, mut estimates) =
            (Moments::default(), Moments::default(), Moments::default());
        let scalars: Vec<Term> = objective().scalars().collect();
        let mut residuals = vec![Moments::default(); scalars.len()];
        let mut residual_variances = residuals.clone();
        for _ in 0..200 {
            let linear = noisy(&mut rng, 4, 0.15);
            one.push(measure(&linear, 1).standard_error.powi(2));
            let e = measure(&linear, LABELLINGS);
            several.push(e.standard_error.powi(2));
            estimates.push(e.evaluation.f_q);
            for (i, (term, error)) in scalars.iter().zip(e.residual_errors).enumerate() {
                residuals[i].push(e.evaluation[*term].residual());
                residual_variances[i].push(error * error);
            }
        }
        let spread = |m: &Moments| m.variance_of_mean().sqrt() / m.mean();
        assert!((one.mean() / several.mean() - 1.0).abs() < 4.0 * spread(&one), "{one:?} {several:?}");
        assert!(spread(&several) < 0.7 * spread(&one), "{} {}", spread(&several), spread(&one));
        // The variance of 200 estimates is known to a tenth.
        let variance = estimates.variance_of_mean() * 200.0;
        assert!((several.mean() / variance - 1.0).abs() < 0.4, "{} {variance}", several.mean());
        for (of, told) in residuals.iter().zip(&residual_variances) {
            let variance = of.variance_of_mean() * 200.0;
            assert!((told.mean() / variance - 1.0).abs() < 0.4, "{} {variance}", told.mean());
        }
    }

    /// Noise so strong that the first order leaves a bias: the second leaves less of it.
    #[test]
    fn the_second_order_leaves_less_bias() {
        let objective = objective();
        let truth = {
            let linear = noisy(&mut Rng::new(1), 1, 0.0).remove(0);
            let display: Vec<f64> = linear.iter().map(|&y| LuminanceMode::Srgb.encode(y, 1.0)).collect();
            objective.statistics(&display, Ramp::Linear).values()
        };
        let mut rng = Rng::new(5);
        let mut errors: Vec<_> = objective.scalars().map(|term| (term, [Moments::default(); 2])).collect();
        for _ in 0..1000 {
            let linear = noisy(&mut rng, 4, 0.5);
            let replicates = Replicates { linear: &linear, measure: Measure::default(), exposure: 1.0 };
            let first = measure(&linear, 1).evaluation;
            let second = replicates.second_order(&objective, Ramp::Linear).values();
            for (term, [of_first, of_second]) in &mut errors {
                let truth = truth[*term as usize].unwrap();
                of_first.push(first[*term].value - truth);
                of_second.push(second[*term as usize].unwrap() - truth);
            }
        }
        // Where the first order is off by more than chance, the second is off by half of that at most.
        let mut seen = 0;
        for [first, second] in
            errors.iter().map(|(_, of)| of.map(|m| (m.mean(), m.variance_of_mean().sqrt())))
        {
            if first.0.abs() > 8.0 * first.1 {
                seen += 1;
                assert!(second.0.abs() < 0.5 * first.0.abs() + 2.0 * second.1, "{first:?} {second:?}");
            }
        }
        assert!(seen >= 3, "the bias shows in {seen} terms only");
    }

    #[test]
    fn equal_replicates_have_no_error_and_one_is_refused() {
        let linear = vec![noisy(&mut Rng::new(1), 1, 0.2).remove(0); 3];
        let e = measure(&linear, LABELLINGS);
        assert!(e.half_width < 1e-10 && e.correction.abs() < 1e-10);
        let one = Replicates { linear: &linear[..1], measure: Measure::default(), exposure: 1.0 };
        assert_eq!(one.measure(&objective(), 2), Err(ObjectiveError::TooFewReplicates { replicates: 1 }));
    }
}
