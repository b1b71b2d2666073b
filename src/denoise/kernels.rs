//! Weights and regression of a tile, the inner loops of the denoiser.
//!
//! Compiled for several instruction sets; each lane does the same operations in the same order in all of them,
//! and so are the bytes.

use multiversion::multiversion;

use super::tile::{MARGIN, N_FEATURES, PATCH, Plane, RADIUS, ROWS, SIDE, STRIDE, WINDOW};

/// Number of pixels that are treated together.
pub const LANES: usize = 16;
/// Number of regressors: 1, column, row, and the features.
const N: usize = 3 + N_FEATURES;
/// Factor between the noise of two pixels and the difference at which their weight falls to 1/e: .5 has 11 to
/// 18 % more error than .7 at 32 samples, and 1 no other on rough glass.
const NOISE_FACTOR: f32 = 0.85;
/// Share of the mean of a picture whose square is added to each variance, against a variance that is small by
/// chance: .03 has 37 % more error on a glossy floor at 128 samples.
const LEAST_NOISE: f32 = 0.01;
/// Factor from the squared distance of two unit normals to the distance of their pixels: across a corner
/// the light changes whatever its noise hides. Between 4, which has 6 % less error than 12 on the fruit basket at
/// 8 samples, and 12, which has 5 % less on the Cornell box; 40 has 30 % more on the basket.
const NORMAL_FACTOR: f32 = 8.0;
/// Ridge of the slopes, as a share of the sum of the weights, for values in units of the window's radius, of
/// albedo, of normals and of relative disparity: slopes that the window hardly shows are not fitted. With 1e-3
/// for the place the error is 2 % larger, with 1e-3 for normals the same within .1 %.
const RIDGE: [f32; N] = [0.0, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2, 1e-2];

/// Channels of a guide in a tile.
#[derive(Debug)]
pub struct Group {
    /// Distance from which the group lowers a weight.
    pub threshold: f32,
    /// Values and variances of each channel.
    pub channels: Vec<[Plane; 2]>,
}

/// One number for each of the pixels that are treated together.
type Lanes = [f32; LANES];

/// The pixels from `i` on.
#[inline(always)]
fn lanes(plane: &[f32], i: usize) -> &Lanes {
    plane[i..].first_chunk().expect("tiles are padded to whole vectors")
}

/// Weights of the neighbours in the window around each pixel, as `[neighbour][row][column]`: 0 for a
/// neighbour beside the picture, 1 for the pixel itself.
#[multiversion(targets = "simd")]
pub fn weights(groups: &[Group], inside: &Plane, features: &[Plane; N_FEATURES], out: &mut [f32]) {
    /// What is added to each variance, in units of the squared mean of the group.
    const FLOOR: f32 = LEAST_NOISE * LEAST_NOISE;
    /// Rows and columns of the tile with the margin of a patch.
    const SPAN: usize = SIDE + 2 * PATCH;
    /// Columns, filled up to whole vectors.
    const WIDE: usize = SPAN.next_multiple_of(LANES);
    let mut raw = vec![0.0_f32; SPAN * WIDE];
    let mut sums = vec![0.0_f32; SPAN * WIDE];
    let mut count = vec![0.0_f32; SIDE * SIDE];
    let mut distance = vec![0.0_f32; SIDE * SIDE];
    for (neighbour, out) in out.chunks_exact_mut(SIDE * SIDE).enumerate().take(WINDOW) {
        let (row, column) = (neighbour / (2 * RADIUS + 1), neighbour % (2 * RADIUS + 1));
        if (row, column) == (RADIUS, RADIUS) {
            out.fill(1.0);
            continue;
        }
        // First pixel of the patches around the tile's pixels, and of those around their neighbours.
        let here = RADIUS * STRIDE + RADIUS;
        let there = row * STRIDE + column;
        // Sum over patches of what `raw` has, by columns and then by rows.
        let mut add_patches = |raw: &[f32], to: &mut [f32]| {
            for y in 0..SIDE {
                for x in (0..WIDE).step_by(LANES) {
                    let [a, b, c] = [0, 1, 2].map(|k| *lanes(raw, (y + k) * WIDE + x));
                    let sum: Lanes = std::array::from_fn(|i| a[i] + b[i] + c[i]);
                    sums[y * WIDE + x..][..LANES].copy_from_slice(&sum);
                }
                for x in 0..SIDE {
                    let [a, b, c] = [0, 1, 2].map(|k| sums[y * WIDE + x + k]);
                    to[y * SIDE + x] = a + b + c;
                }
            }
        };
        for y in 0..SPAN {
            for x in (0..WIDE).step_by(LANES) {
                let p = lanes(inside, here + y * STRIDE + x);
                let q = lanes(inside, there + y * STRIDE + x);
                let both: Lanes = std::array::from_fn(|i| p[i] * q[i]);
                raw[y * WIDE + x..][..LANES].copy_from_slice(&both);
            }
        }
        add_patches(&raw, &mut count);
        out.fill(0.0);
        for group in groups {
            let share = 1.0 / group.channels.len() as f32;
            for y in 0..SPAN {
                for x in (0..WIDE).step_by(LANES) {
                    let (p, q) = (here + y * STRIDE + x, there + y * STRIDE + x);
                    let (inside_p, inside_q) = (lanes(inside, p), lanes(inside, q));
                    let mut sum: Lanes = [0.0; LANES];
                    for [value, variance] in &group.channels {
                        let (a, b) = (lanes(value, p), lanes(value, q));
                        let (va, vb) = (lanes(variance, p), lanes(variance, q));
                        for i in 0..LANES {
                            // The squared difference less what noise makes of it, in units of noise [Rousselle12].
                            let square = (a[i] - b[i]) * (a[i] - b[i]);
                            let noise = va[i] + va[i].min(vb[i]);
                            sum[i] +=
                                (square - noise) / (FLOOR + NOISE_FACTOR * NOISE_FACTOR * (va[i] + vb[i]));
                        }
                    }
                    let raw = &mut raw[y * WIDE + x..][..LANES];
                    for (i, raw) in raw.iter_mut().enumerate() {
                        *raw = sum[i] * share * inside_p[i] * inside_q[i];
                    }
                }
            }
            add_patches(&raw, &mut distance);
            for ((out, &d), &n) in out.iter_mut().zip(&distance).zip(&count) {
                *out = out.max(d / n.max(1.0) - group.threshold);
            }
        }
        for y in 0..SIDE {
            for x in (0..SIDE).step_by(LANES) {
                let p = (y + MARGIN) * STRIDE + x + MARGIN;
                let q = (y + row + PATCH) * STRIDE + x + column + PATCH;
                let mut bend: Lanes = [0.0; LANES];
                for normal in &features[3..6] {
                    let (a, b) = (lanes(normal, p), lanes(normal, q));
                    for i in 0..LANES {
                        bend[i] += (a[i] - b[i]) * (a[i] - b[i]);
                    }
                }
                let is_inside = lanes(inside, q);
                let out = &mut out[y * SIDE + x..][..LANES];
                for (i, out) in out.iter_mut().enumerate() {
                    let d = out.max(NORMAL_FACTOR * bend[i]);
                    // (1 - d/8)^8, within a few hundredths of exp(-d); 0 for what is no number.
                    let near = (1.0 - d * 0.125).max(0.0);
                    let second = near * near;
                    let fourth = second * second;
                    *out = fourth * fourth * is_inside[i];
                }
            }
        }
    }
}

/// Adds half of the fit of the light at each pixel to `out`, planes of SIDE × SIDE pixels.
#[multiversion(targets = "simd")]
pub fn regress(weights: &[f32], features: &[Plane; N_FEATURES], light: &[Plane], out: &mut [Vec<f32>]) {
    for y in 0..SIDE {
        for x in (0..SIDE).step_by(LANES) {
            let p = (y + MARGIN) * STRIDE + x + MARGIN;
            let here: [Lanes; N_FEATURES] = std::array::from_fn(|k| *lanes(&features[k], p));
            // Disparity in units of the pixel's own; without a surface there is none to compare.
            let unit: Lanes = here[N_FEATURES - 1].map(|d| if d > 0.0 { 1.0 / d } else { 0.0 });
            let regressors = |neighbour: usize| -> ([Lanes; N], usize) {
                let (row, column) = (neighbour / (2 * RADIUS + 1), neighbour % (2 * RADIUS + 1));
                let q = (y + row + PATCH) * STRIDE + x + column + PATCH;
                let at = |i: usize| (i as f32 - RADIUS as f32) / RADIUS as f32;
                let mut v = [[1.0; LANES]; N];
                v[1] = [at(column); LANES];
                v[2] = [at(row); LANES];
                for k in 0..N_FEATURES {
                    let there = lanes(&features[k], q);
                    for i in 0..LANES {
                        v[3 + k][i] = there[i] - here[k][i];
                    }
                }
                for i in 0..LANES {
                    v[N - 1][i] *= unit[i];
                }
                (v, q)
            };
            let mut moments = [[[0.0_f32; LANES]; N]; N];
            for neighbour in 0..WINDOW {
                let w = lanes(weights, neighbour * SIDE * SIDE + y * SIDE + x);
                let (v, _) = regressors(neighbour);
                for a in 0..N {
                    let mut weighted = [0.0; LANES];
                    for i in 0..LANES {
                        weighted[i] = w[i] * v[a][i];
                    }
                    for b in 0..=a {
                        for i in 0..LANES {
                            moments[a][b][i] += weighted[i] * v[b][i];
                        }
                    }
                }
            }
            let fit = intercept(&mut moments);
            let mut sums = vec![[0.0_f32; LANES]; light.len()];
            for neighbour in 0..WINDOW {
                let w = lanes(weights, neighbour * SIDE * SIDE + y * SIDE + x);
                let (v, q) = regressors(neighbour);
                let mut kernel: Lanes = [0.0; LANES];
                for k in 0..N {
                    for i in 0..LANES {
                        kernel[i] += fit[k][i] * v[k][i];
                    }
                }
                for i in 0..LANES {
                    kernel[i] *= 0.5 * w[i];
                }
                for (sum, light) in sums.iter_mut().zip(light) {
                    let light = lanes(light, q);
                    for i in 0..LANES {
                        sum[i] += kernel[i] * light[i];
                    }
                }
            }
            for (out, sum) in out.iter_mut().zip(&sums) {
                for (out, v) in out[y * SIDE + x..][..LANES].iter_mut().zip(sum) {
                    *out += v;
                }
            }
        }
    }
}

/// The first column of the inverse of the moments with their ridge: with it as coefficients, regressors times
/// weights sum the light to the fit's value at the pixel.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "rows and columns as in the formulas")]
fn intercept(moments: &mut [[Lanes; N]; N]) -> [Lanes; N] {
    // Cholesky's factor L in the place of the lower triangle.
    let total = moments[0][0];
    for a in 0..N {
        for i in 0..LANES {
            moments[a][a][i] += RIDGE[a] * total[i];
        }
    }
    let mut inverse = [[0.0_f32; LANES]; N];
    for a in 0..N {
        for b in 0..=a {
            let mut sum = moments[a][b];
            for k in 0..b {
                for i in 0..LANES {
                    sum[i] -= moments[a][k][i] * moments[b][k][i];
                }
            }
            for i in 0..LANES {
                // The ridge keeps the diagonal above 0 but for rounding.
                moments[a][b][i] =
                    if a == b { sum[i].max(1e-6 * total[i]).sqrt() } else { sum[i] * inverse[b][i] };
            }
            if a == b {
                for i in 0..LANES {
                    inverse[a][i] = 1.0 / moments[a][a][i];
                }
            }
        }
    }
    let mut fit = [[0.0_f32; LANES]; N];
    fit[0] = [1.0; LANES];
    for a in 0..N {
        let mut sum = fit[a];
        for k in 0..a {
            for i in 0..LANES {
                sum[i] -= moments[a][k][i] * fit[k][i];
            }
        }
        for i in 0..LANES {
            fit[a][i] = sum[i] * inverse[a][i];
        }
    }
    for a in (0..N).rev() {
        let mut sum = fit[a];
        for k in a + 1..N {
            for i in 0..LANES {
                sum[i] -= moments[k][a][i] * fit[k][i];
            }
        }
        for i in 0..LANES {
            fit[a][i] = sum[i] * inverse[a][i];
        }
    }
    fit
}

const _: () = assert!(SIDE.is_multiple_of(LANES) && ROWS <= STRIDE && PATCH == 1);
