//! Mean squared luminance gradient over the object: eq. (6).
//!
//! The plain Sobel pair (not normalised) on the whole image with replicated borders, so
//! the object's outline counts. The statistic is g², which combines over replicates
//! before the root is taken.

use super::region::Regions;

/// `(pixel, [above-left, above, above-right, left, right, below-left, below, below-right])`
/// for every object pixel, in row-major order; border pixels repeat themselves.
fn for_each_object_pixel(regions: &Regions, mut visit: impl FnMut([usize; 8])) {
    let (w, h) = (regions.width(), regions.height());
    for y in 0..h {
        let above = y.saturating_sub(1) * w;
        let row = y * w;
        let below = (y + 1).min(h - 1) * w;
        for (x, _) in regions.mask()[row..row + w].iter().enumerate().filter(|&(_, &object)| object) {
            let left = x.saturating_sub(1);
            let right = (x + 1).min(w - 1);
            visit([
                above + left,
                above + x,
                above + right,
                row + left,
                row + right,
                below + left,
                below + x,
                below + right,
            ]);
        }
    }
}

/// `(∂l/∂x, ∂l/∂y)` by the Sobel pair: [-1 0 1; -2 0 2; -1 0 1] and its transpose.
fn sobel(l: &[f64], n: [usize; 8]) -> (f64, f64) {
    let [al, a, ar, le, ri, bl, b, br] = n.map(|i| l[i]);
    ((ar - al) + 2.0 * (ri - le) + (br - bl), (bl - al) + 2.0 * (b - a) + (br - ar))
}

/// `g² = 1/N_obj Σ_{p ∈ obj} |∇l_p|²`.
pub(super) fn mean_squared(l: &[f64], regions: &Regions) -> f64 {
    let mut sum = 0.0;
    for_each_object_pixel(regions, |n| {
        let (gx, gy) = sobel(l, n);
        sum += gx * gx + gy * gy;
    });
    sum / regions.n_object()
}

/// Adds `adjoint · ∂g²/∂l` to `out`.
pub(super) fn add_adjoint(l: &[f64], regions: &Regions, adjoint: f64, out: &mut [f64]) {
    let step = 2.0 * adjoint / regions.n_object();
    for_each_object_pixel(regions, |n| {
        let (gx, gy) = sobel(l, n);
        let (gx, gy) = (step * gx, step * gy);
        let [al, a, ar, le, ri, bl, b, br] = n;
        out[al] -= gx + gy;
        out[a] -= 2.0 * gy;
        out[ar] += gx - gy;
        out[le] -= 2.0 * gx;
        out[ri] += 2.0 * gx;
        out[bl] += gy - gx;
        out[b] += 2.0 * gy;
        out[br] += gx + gy;
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// g² of a picture whose object is the single pixel (x, y).
    fn at(l: &[f64], w: usize, h: usize, x: usize, y: usize) -> f64 {
        let mut mask = vec![false; w * h];
        mask[y * w + x] = true;
        mean_squared(l, &Regions::new(w, h, &mask))
    }

    #[test]
    fn three_by_three_agrees_with_the_hand() {
        #[rustfmt::skip]
        let l = [
            0.1, 0.5, 0.9,
            0.2, 0.7, 0.3,
            0.4, 0.0, 0.8,
        ];
        // gx = (0.9-0.1) + 2(0.3-0.2) + (0.8-0.4) = 1.4
        // gy = (0.4-0.1) + 2(0.0-0.5) + (0.8-0.9) = -0.8
        assert!((at(&l, 3, 3, 1, 1) - (1.4 * 1.4 + 0.8 * 0.8)).abs() < 1e-14);
        // Top-left corner, borders replicated: rows and columns 0, 0, 1.
        // gx = (0.5-0.1) + 2(0.5-0.1) + (0.7-0.2) = 1.7
        // gy = (0.2-0.1) + 2(0.2-0.1) + (0.7-0.5) = 0.5
        assert!((at(&l, 3, 3, 0, 0) - (1.7 * 1.7 + 0.5 * 0.5)).abs() < 1e-14);
        // Right edge, middle row: columns 1, 2, 2.
        // gx = (0.9-0.5) + 2(0.3-0.7) + (0.8-0.0) = 0.4
        // gy = (0.0-0.5) + 2(0.8-0.9) + (0.8-0.9) = -0.8
        assert!((at(&l, 3, 3, 2, 1) - (0.4 * 0.4 + 0.8 * 0.8)).abs() < 1e-14);
    }

    #[test]
    fn no_gradient_exceeds_the_largest_that_targets_take() {
        // g² is convex, so that its maximum is where all neighbours are black or white.
        let of = |bits: u32| at(&std::array::from_fn::<f64, 9, _>(|i| f64::from(bits >> i & 1)), 3, 3, 1, 1);
        let most = (0..512).map(of).fold(0.0, f64::max);
        assert_eq!(most.sqrt(), crate::objective::target::MAX_GRADIENT);
    }

    #[test]
    fn a_step_edge_on_five_by_five_is_plain_not_normalised_sobel() {
        let l: Vec<f64> = (0..25).map(|i| if i % 5 < 2 { 0.0 } else { 0.5 }).collect();
        // gx = 4 · 0.5 beside the step, 0 elsewhere, on every row including the borders.
        for y in 0..5 {
            for (x, want) in [(0, 0.0), (1, 4.0), (2, 4.0), (3, 0.0), (4, 0.0)] {
                assert_eq!(at(&l, 5, 5, x, y), want, "({x}, {y})");
            }
        }
        let all = Regions::new(5, 5, &[true; 25]);
        assert!((mean_squared(&l, &all) - 10.0 * 4.0 / 25.0).abs() < 1e-14);
    }
}
