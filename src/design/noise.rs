//! The error that noise leaves in a picture as it is displayed.
//!
//! It is the root of the mean squared error of display luminance, over the whole picture and over each of its
//! sixteenths, four by four: a caustic in a corner is noticed however clean the rest is.
//!
//! # References
//! \[Efron82\] ch. 3 (standard error by the jackknife, eq. 3.1).

use rayon::prelude::*;

use crate::{
    film::tiling::Tiling,
    math::{Measure, measure::COLOUR_PLANES},
};

/// Error of a final picture at which no more samples are taken, if no other is asked for: about what 192 samples
/// per pixel of a render of its own leave on the fruit basket in high-key at 320 × 240 pixels, .0077 against a
/// reference, where .0063 was told of an error of .0066.
pub const FINAL_NOISE: f64 = 0.0073;
/// Parts of a picture in each direction, of which the noisiest counts.
const SIDE: usize = 4;
/// Number of these parts.
pub const SIXTEENTHS: usize = SIDE * SIDE;
/// Factor on the error of the noisiest of them, where that of the whole picture has 1.
pub const SIXTEENTH_WEIGHT: f64 = 0.5;

/// How linear light is displayed, and in how wide a picture.
#[derive(Clone, Copy, Debug)]
pub struct Display {
    /// Width of the picture, pixels.
    pub width: usize,
    /// How linear light becomes display luminance.
    pub measure: Measure,
    /// Factor on linear light before it is encoded.
    pub exposure: f64,
}

/// Error that noise leaves in display luminance, root mean squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Error over the whole picture.
    pub whole: f64,
    /// Error over the sixteenth of the picture where it is largest.
    pub worst: f64,
}

impl Noise {
    /// The error by which a picture is judged: of the whole, or half of that of the worst sixteenth where
    /// this is more.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.whole.max(SIXTEENTH_WEIGHT * self.worst)
    }
}

/// Estimated squared error of display luminance of each pixel, row by row; it may be negative by chance.
#[derive(Clone, Debug)]
pub struct SquaredErrors {
    /// Width of the picture, pixels.
    width: usize,
    of_pixels: Vec<f64>,
}

impl SquaredErrors {
    /// The error that the whole picture and its sixteenths have.
    #[must_use]
    pub fn noise(&self) -> Noise {
        let (width, height) = (self.width, self.of_pixels.len() / self.width.max(1));
        let (mut sums, mut counts) = ([0.0; SIXTEENTHS], [0_u32; SIXTEENTHS]);
        for (i, square) in self.of_pixels.iter().enumerate() {
            let sixteenth = sixteenth([i % width, i / width], [width, height]);
            sums[sixteenth] += square;
            counts[sixteenth] += 1;
        }
        let root = |sum: f64, n: u32| (sum / f64::from(n.max(1))).max(0.0).sqrt();
        Noise {
            whole: root(sums.iter().sum(), counts.iter().sum()),
            worst: sums.iter().zip(counts).fold(0.0, |worst, (&sum, n)| root(sum, n).max(worst)),
        }
    }

    /// Mean over each tile of a tiling of the picture.
    #[must_use]
    pub fn of_tiles(&self, tiling: &Tiling) -> Vec<f64> {
        let of_tile = |t| {
            let [columns, rows] = tiling.ranges(t);
            let row = |y: u32| &self.of_pixels[y as usize * self.width..][columns.start as usize..];
            let sum: f64 = rows.flat_map(|y| &row(y)[..columns.len()]).sum();
            sum / tiling.n_pixels(t) as f64
        };
        (0..tiling.len()).map(of_tile).collect()
    }
}

/// Index of the sixteenth, four by four, of a picture that a pixel lies in, given by its column and row.
#[must_use]
pub fn sixteenth([x, y]: [usize; 2], [width, height]: [usize; 2]) -> usize {
    y * SIDE / height * SIDE + x * SIDE / width
}

/// Error of the mean of independent replicates of a picture, each given by its [planes](Measure::planes).
///
/// The squared error of a pixel is the jackknife's, in display luminance: the spread of what the means without
/// one replicate display. A pixel that is white in all of them has none, and one that is white by a single
/// bright sample has much.
///
/// # Panics
/// With fewer than two replicates, or replicates of several sizes.
#[must_use]
pub fn estimate(replicates: &[Vec<f64>], display: Display) -> SquaredErrors {
    let Display { width, measure, exposure } = display;
    let count = replicates.len();
    assert!(count >= 2, "the error of a mean needs two replicates, not {count}");
    let n_linear = replicates[0].len();
    assert!(replicates.iter().all(|y| y.len() == n_linear), "replicates of one size");
    let n = n_linear / measure.n_planes();
    let of_pixels: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|p| {
            let sums = planes(n_linear, n, p, |i| replicates.iter().map(|y| y[i]).sum());
            let without = |y: &Vec<f64>| {
                let others = planes(n_linear, n, p, |i| (sums[i / n] - y[i]) / (count - 1) as f64);
                measure.encode_pixel(others, exposure).0
            };
            let (mut mean, mut square) = (0.0, 0.0);
            for shown in replicates.iter().map(without) {
                mean += shown / count as f64;
                square += shown * shown;
            }
            // [Efron82] eq. 3.1; not below 0 by rounding.
            (count - 1) as f64 / count as f64 * (square - count as f64 * mean * mean).max(0.0)
        })
        .collect();
    SquaredErrors { width, of_pixels }
}

/// Error of a denoised picture, from two denoised pictures of independent samples of which it is the mean, and
/// from two replicates of the samples of each; all are given by their [planes](Measure::planes).
///
/// A denoised picture D is biased, which no spread among its like shows. But with B₀ and B₁ independent of it
/// and of each other, and right in the mean, the mean of (D − B₀)(D − B₁) is the squared error of D, bias
/// included, whatever the noise of B₀ and B₁. Each denoised half is so judged by the replicates of the other
/// half. The picture that is shown is the mean of the two: it has their bias and half of the variance of
/// either, which is less by a quarter of their squared difference. Errors are multiplied by the slope of the
/// display's curve, up to all of its range: more is no error that could be shown, and rare bright samples would
/// decide what is told.
///
/// # Panics
/// When the pictures differ in size.
#[must_use]
pub fn of_denoised(denoised: [&[f64]; 2], replicates: [[&[f64]; 2]; 2], display: Display) -> SquaredErrors {
    let Display { width, measure, exposure } = display;
    let [a, b] = denoised;
    let n_linear = a.len();
    let fits = |picture: &[f64]| picture.len() == n_linear;
    assert!(replicates.as_flattened().iter().all(|y| fits(y)) && fits(b), "pictures of one size");
    let n = n_linear / measure.n_planes();
    let of_pixels: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|p| {
            let at = |picture: &[f64]| planes(n_linear, n, p, |i| picture[i]);
            let (a, b) = (at(a), at(b));
            // How much brighter the display is by a small change, at a colour.
            let change = |at: [f64; COLOUR_PLANES], from: [f64; COLOUR_PLANES], to: [f64; COLOUR_PLANES]| {
                let slopes = measure.encode_pixel(at, exposure).1;
                (0..n_linear / n).map(|c| slopes[c] * (to[c] - from[c])).sum::<f64>()
            };
            let shown = |d, y: &[f64]| change(d, at(y), d).clamp(-1.0, 1.0);
            let error = |d, [y, z]: [&[f64]; 2]| shown(d, y) * shown(d, z);
            let of_halves = 0.5 * (error(a, replicates[1]) + error(b, replicates[0]));
            let middle = std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
            of_halves - 0.25 * change(middle, b, a).powi(2)
        })
        .collect();
    SquaredErrors { width, of_pixels }
}

/// Values of a pixel in the planes of a picture of `n` pixels, `n_linear` values in all: `of` their indices.
fn planes(n_linear: usize, n: usize, pixel: usize, of: impl Fn(usize) -> f64) -> [f64; COLOUR_PLANES] {
    std::array::from_fn(|c| if c * n < n_linear { of(c * n + pixel) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        math::{display::LuminanceMode, stats::Moments},
        objective::testing::Rng,
    };

    const WIDTH: usize = 64;
    const HEIGHT: usize = 48;

    fn display(exposure: f64) -> Display {
        Display { width: WIDTH, measure: Measure::default(), exposure }
    }

    /// A picture with shades from nearly black to nearly white.
    fn truth() -> Vec<f64> {
        (0..WIDTH * HEIGHT).map(|i| 0.02 + 0.4 * (0.5 + 0.5 * (0.01 * i as f64).sin())).collect()
    }

    fn noisy(truth: &[f64], deviation: impl Fn(usize) -> f64, rng: &mut Rng) -> Vec<f64> {
        truth.iter().enumerate().map(|(i, y)| y + deviation(i) * rng.normal()).collect()
    }

    /// Root mean squared difference of display luminance.
    fn rmse(a: &[f64], b: &[f64], exposure: f64) -> f64 {
        let show = |y: &f64| LuminanceMode::Srgb.encode(*y, exposure);
        let squares = a.iter().zip(b).map(|(a, b)| (show(a) - show(b)).powi(2));
        (squares.sum::<f64>() / a.len() as f64).sqrt()
    }

    #[test]
    fn the_error_of_a_mean_is_that_of_means_with_known_noise() {
        let (truth, exposure) = (truth(), 2.0);
        let mut rng = Rng::new(4);
        let (mut told, mut known) = (Moments::default(), Moments::default());
        for _ in 0..40 {
            // Noise that grows with brightness, as a render's.
            let replicates: Vec<Vec<f64>> =
                (0..4).map(|_| noisy(&truth, |i| 0.1 * truth[i], &mut rng)).collect();
            let mean: Vec<f64> =
                (0..truth.len()).map(|p| replicates.iter().map(|y| y[p]).sum::<f64>() / 4.0).collect();
            told.push(estimate(&replicates, display(exposure)).noise().whole.powi(2));
            known.push(rmse(&mean, &truth, exposure).powi(2));
        }
        // Means of 40 pictures of 3072 pixels each: three deviations are less than two hundredths.
        let spread = (told.variance_of_mean() + known.variance_of_mean()).sqrt();
        assert!(spread < 0.01 * known.mean(), "{spread}");
        assert!((told.mean() - known.mean()).abs() < 3.0 * spread, "{told:?} {known:?}");
    }

    #[test]
    fn a_noisy_sixteenth_counts_by_half_and_white_has_no_error() {
        let truth = truth();
        let mut rng = Rng::new(5);
        let is_corner = |i: usize| i % WIDTH >= 48 && i / WIDTH >= 36;
        let mut make = |deviation: f64| -> Vec<Vec<f64>> {
            let at = |i: usize| if is_corner(i) { deviation } else { 0.0 };
            (0..4).map(|_| noisy(&truth, at, &mut rng)).collect()
        };
        let noise = estimate(&make(0.02), display(1.0)).noise();
        // All error lies in a sixteenth of the pixels.
        assert!((noise.worst / noise.whole - 4.0).abs() < 1e-9, "{noise:?}");
        assert!((noise.error() - 0.5 * noise.worst).abs() < 1e-15);
        let white = estimate(&make(0.001), display(1e4)).noise();
        assert_eq!(white, Noise { whole: 0.0, worst: 0.0 });
    }

    #[test]
    fn the_errors_of_tiles_are_means_over_their_pixels() {
        let of_pixels: Vec<f64> = (0..5 * 3).map(f64::from).collect();
        let errors = SquaredErrors { width: 5, of_pixels };
        let tiling = Tiling { size: glam::UVec2::new(5, 3), side: 2 };
        let wanted = [3.0, 5.0, 6.5, 10.5, 12.5, 14.0];
        assert_eq!(errors.of_tiles(&tiling), wanted);
    }

    #[test]
    fn pictures_of_few_pixels_have_an_error() {
        let display = Display { width: 3, measure: LuminanceMode::Linear.into(), exposure: 1.0 };
        let noise = estimate(&[vec![0.4; 3], vec![0.6; 3]], display).noise();
        assert!((noise.whole - 0.1).abs() < 1e-12 && (noise.worst - 0.1).abs() < 1e-12, "{noise:?}");
    }

    #[test]
    fn one_bright_sample_is_an_error_where_the_mean_is_white() {
        let replicates = [vec![0.2], vec![0.2], vec![0.2], vec![100.0]];
        let display = Display { width: 1, measure: Measure::default(), exposure: 1.0 };
        assert!(estimate(&replicates, display).noise().whole > 0.3);
    }

    #[test]
    fn the_error_of_a_denoised_picture_has_its_bias_and_its_variance() {
        // Bright enough that the display's curve is straight over bias and noise.
        let truth: Vec<f64> = truth().into_iter().map(|y| y + 0.2).collect();
        let mut rng = Rng::new(6);
        let (bias, deviation) = (0.004, 0.0032);
        let biased: Vec<f64> = truth.iter().map(|y| y + bias).collect();
        let (mut told, mut known) = (Moments::default(), Moments::default());
        for _ in 0..60 {
            let [a, b] = [0, 1].map(|_| noisy(&biased, |_| deviation, &mut rng));
            // Noisier than what they judge.
            let replicates = [0; 4].map(|_| noisy(&truth, |_| 0.008, &mut rng));
            let [first, second] = [0, 2].map(|r| [replicates[r].as_slice(), replicates[r + 1].as_slice()]);
            told.push(of_denoised([&a, &b], [first, second], display(1.0)).noise().whole.powi(2));
            let slope = |y: f64| LuminanceMode::Srgb.encode_with_derivative(y, 1.0).1;
            let mean = |p: usize| 0.5 * (a[p] + b[p]);
            let squares = (0..truth.len()).map(|p| (slope(truth[p]) * (mean(p) - truth[p])).powi(2));
            known.push(squares.sum::<f64>() / truth.len() as f64);
        }
        let spread = (told.variance_of_mean() + known.variance_of_mean()).sqrt();
        assert!(spread < 0.03 * known.mean(), "{spread} of {}", known.mean());
        // The slope where the estimate is differs from that at the truth, a little.
        let allowed = 3.0 * spread + 0.05 * known.mean();
        assert!((told.mean() - known.mean()).abs() < allowed, "{told:?} {known:?}");
        // The bias is the larger part of it, and the variance is half of that of either.
        let without_bias = known.mean() * deviation.powi(2) / (2.0 * bias.powi(2) + deviation.powi(2));
        assert!(told.mean() > 3.0 * without_bias);
    }
}
