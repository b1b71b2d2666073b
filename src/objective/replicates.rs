//! f_q of a picture of which there are independent replicates.
//!
//! Every pixel has its own scramble, so its noise is independent of the other pixels', and
//! which of its R values is called the first is of no account: replicates whose values are
//! exchanged, pixel by pixel, are replicates as good as the rendered ones. The error is taken
//! over several such labellings. From R replicates alone it would be known to R−1 degrees of
//! freedom only, and the interval be wider by a half for R = 4.
//!
//! (A light subpath that lands in several pixels makes their noise depend. Its share of a
//! picture is small but for caustics, and there it lands in few pixels.)

use super::{JackknifeEstimate, LuminanceMode, Objective, ObjectiveError, Ramp, Smoothing, Statistics};
use crate::math::hash::hash_words;

/// Labellings from which the error of a reported f_q is told.
pub const LABELLINGS: usize = 8;

/// Independent replicates of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Replicates<'a> {
    /// Linear luminance of each.
    pub linear: &'a [Vec<f64>],
    /// Measure of luminance.
    pub luminance: LuminanceMode,
    /// Factor on luminance.
    pub exposure: f64,
}

impl Replicates<'_> {
    /// f_q of their mean, unsmoothed and freed of noise bias, with its error from as many
    /// labellings; with one of them it is that of the replicates as they are.
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
        let mut mean = vec![0.0; n];
        for y in self.linear {
            mean.iter_mut().zip(y).for_each(|(m, y)| *m += y / replicates as f64);
        }
        let (mut display, mut slopes) = (vec![0.0; n], vec![0.0; n]);
        let mut statistics = |y: &[f64]| -> Statistics {
            self.luminance.encode_all(y, self.exposure, &mut display, &mut slopes);
            objective.statistics(&display, Ramp::Linear)
        };
        let full = statistics(&mean);
        let mut one_out = vec![0.0; n];
        let (all, rest) = (replicates as f64, 1.0 / (replicates as f64 - 1.0));
        let labelled: Vec<Vec<Statistics>> = (0..labellings)
            .map(|labelling| {
                let shifts: Vec<usize> = (0..n).map(|p| shift(labelling, p, replicates)).collect();
                (0..replicates)
                    .map(|r| {
                        for (p, (left, shift)) in one_out.iter_mut().zip(&shifts).enumerate() {
                            *left = (all * mean[p] - self.linear[(r + shift) % replicates][p]) * rest;
                        }
                        statistics(&one_out)
                    })
                    .collect()
            })
            .collect();
        objective.jackknife(&full, &labelled, &Smoothing::NONE)
    }
}

/// By how much a labelling moves the labels of a pixel round: none in the first.
fn shift(labelling: usize, pixel: usize, replicates: usize) -> usize {
    match labelling {
        0 => 0,
        _ => (hash_words(&[labelling as u64, pixel as u64]) % replicates as u64) as usize,
    }
}
