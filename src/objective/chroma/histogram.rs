//! The joint histogram of a and b of a picture, and the distance between two.
//!
//! A pixel enters the nine bins around it with the weights of a quadratic B-spline in each direction, which are
//! C¹ in its colour; what lies beyond the outermost bins counts for these.

/// Bins along each of a and b. More would leave the few pixels of a working picture in bins of their own; set by
/// reasoning.
pub const SIDE: usize = 16;
/// Number of bins.
pub const CHROMA_BINS: usize = SIDE * SIDE;
/// Values of a and b at which the outermost bins end: beyond, photographs have a few saturated pixels.
pub const EXTENT: f64 = 0.16;

/// First of three bins along a direction, and the weights of all three with their derivatives.
fn spline(value: f64) -> ([usize; 3], [f64; 3], [f64; 3]) {
    let per_unit = SIDE as f64 / (2.0 * EXTENT);
    // Half a bin from the end all weight is in the last bin.
    let u = ((value + EXTENT) * per_unit).clamp(-0.5, SIDE as f64 + 0.5 - 1e-9);
    let is_inside = u > -0.5 && u < SIDE as f64 + 0.5 - 1e-9;
    let cell = u.floor();
    let t = u - cell;
    let bin = |step: i64| (cell as i64 + step).clamp(0, SIDE as i64 - 1) as usize;
    let slope = if is_inside { per_unit } else { 0.0 };
    (
        [bin(-1), bin(0), bin(1)],
        [0.5 * (1.0 - t) * (1.0 - t), 0.75 - (t - 0.5) * (t - 0.5), 0.5 * t * t],
        [(t - 1.0) * slope, (1.0 - 2.0 * t) * slope, t * slope],
    )
}

/// Shares of the pixels with chroma `a` and `b` in the bins; those of one value of b stand together.
pub(in crate::objective) fn measure([a, b]: [&[f64]; 2], out: &mut [f64]) {
    out.fill(0.0);
    let share = 1.0 / a.len() as f64;
    for (&a, &b) in a.iter().zip(b) {
        let (columns, across, _) = spline(a);
        let (rows, along, _) = spline(b);
        for (row, v) in rows.iter().zip(along) {
            for (column, w) in columns.iter().zip(across) {
                out[row * SIDE + column] += share * v * w;
            }
        }
    }
}

/// Adds `Σ_i adjoint_i · ∂share_i/∂(a, b)` to `out`.
pub(in crate::objective) fn add_adjoint([a, b]: [&[f64]; 2], adjoint: &[f64], [by_a, by_b]: [&mut [f64]; 2]) {
    let share = 1.0 / a.len() as f64;
    for (p, (&a, &b)) in a.iter().zip(b).enumerate() {
        let (columns, across, across_slope) = spline(a);
        let (rows, along, along_slope) = spline(b);
        for i in 0..3 {
            for j in 0..3 {
                let d = share * adjoint[rows[i] * SIDE + columns[j]];
                by_a[p] += d * along[i] * across_slope[j];
                by_b[p] += d * along_slope[i] * across[j];
            }
        }
    }
}

/// Hellinger's distance of the shares `q` from `p`, in [0, 1], with its derivatives; what is below 0 counts as 0 and
/// has none. `epsilon` > 0 smooths: `√q` becomes `√(q+ε)`.
pub(in crate::objective) fn distance(p: &[f64], q: &[f64], epsilon: f64, derivative: &mut [f64]) -> f64 {
    let root = |q: f64| (q.max(0.0) + epsilon).sqrt();
    let square: f64 = p.iter().zip(q).map(|(&p, &q)| 0.5 * (p.sqrt() - root(q)).powi(2)).sum();
    let f = square.sqrt();
    if f > 0.0 {
        for ((out, &p), &q) in derivative.iter_mut().zip(p).zip(q) {
            let root = root(q);
            *out = if q < 0.0 || root == 0.0 { 0.0 } else { (1.0 - p.sqrt() / root) / (4.0 * f) };
        }
    }
    f
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::testing::Rng;

    fn pixels(n: usize) -> [Vec<f64>; 2] {
        let mut rng = Rng::new(7);
        [0.09, 0.12].map(|s| (0..n).map(|_| s * rng.normal()).collect())
    }

    #[test]
    fn shares_add_up_to_one_and_their_means_are_those_of_the_pixels() {
        let mut rng = Rng::new(3);
        // Away from the ends: there a quadratic spline keeps the mean exactly.
        let [a, b] =
            [(); 2].map(|()| (0..200).map(|_| 0.12 * (2.0 * rng.uniform() - 1.0)).collect::<Vec<_>>());
        let mut q = [0.0; CHROMA_BINS];
        measure([&a, &b], &mut q);
        assert!((q.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let center = |i: usize| (i as f64 + 0.5) * 2.0 * EXTENT / SIDE as f64 - EXTENT;
        let mean =
            |of: &dyn Fn(usize) -> usize| q.iter().enumerate().map(|(i, q)| q * center(of(i))).sum::<f64>();
        let of = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        assert!((mean(&|i| i % SIDE) - of(&a)).abs() < 1e-12);
        assert!((mean(&|i| i / SIDE) - of(&b)).abs() < 1e-12);
    }

    /// Of Σ w·share, also for pixels beyond the bins.
    #[test]
    fn adjoints_agree_with_central_differences() {
        let [a, b] = pixels(60);
        let mut rng = Rng::new(2);
        let weights = rng.image(CHROMA_BINS);
        let value = |a: &[f64], b: &[f64]| {
            let mut q = [0.0; CHROMA_BINS];
            measure([a, b], &mut q);
            q.iter().zip(&weights).map(|(q, w)| q * w).sum::<f64>()
        };
        let [mut by_a, mut by_b] = [(); 2].map(|()| vec![0.0; 60]);
        add_adjoint([&a, &b], &weights, [&mut by_a, &mut by_b]);
        for p in 0..60 {
            for (k, found) in [by_a[p], by_b[p]].into_iter().enumerate() {
                let at = |h: f64| {
                    let mut moved = [a.clone(), b.clone()];
                    moved[k][p] += h;
                    value(&moved[0], &moved[1])
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!(
                    (found - difference).abs() < 1e-6 * difference.abs().max(0.1),
                    "{p} {k}: {found} {difference}"
                );
            }
        }
    }

    #[test]
    fn the_distance_is_that_of_hellinger_by_hand() {
        let mut d = [0.0; 2];
        assert_eq!(distance(&[1.0, 0.0], &[0.0, 1.0], 0.0, &mut d), 1.0);
        assert_eq!(distance(&[0.5, 0.5], &[0.5, 0.5], 0.0, &mut d), 0.0);
        let f = distance(&[0.25, 0.75], &[0.64, 0.36], 0.0, &mut d);
        let want = (0.5 * ((0.5 - 0.8_f64).powi(2) + (0.75_f64.sqrt() - 0.6).powi(2))).sqrt();
        assert!((f - want).abs() < 1e-15);
        for i in 0..2 {
            let at = |h: f64| {
                let mut q = [0.64, 0.36];
                q[i] += h;
                distance(&[0.25, 0.75], &q, 1e-3, &mut [0.0; 2])
            };
            let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
            distance(&[0.25, 0.75], &[0.64, 0.36], 1e-3, &mut d);
            assert!((d[i] - difference).abs() < 1e-8, "{i}: {} {difference}", d[i]);
        }
    }
}
