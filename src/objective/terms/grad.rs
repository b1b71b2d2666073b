//! Root mean squared gradient of display luminance over the main object: \[PG14\] eqs. (6) and (7).
//!
//! The gradient is that of the plain Sobel pair, which is not normalised, on the whole picture with
//! replicated borders, so that the object's outline counts.

use multiversion::multiversion;

use super::definition::{Definition, Interval, Kind, Scalar};
use crate::objective::region::{Region, Regions};

pub(super) const DEFINITION: Definition = Definition {
    name: "grad",
    words: "the object's mean gradient",
    label: "object detail",
    weight: 0.2, // [PG14] table 1
    kind: Kind::Scalar(Scalar {
        is_square: true,
        targets: Interval {
            low: 0.0,
            high: MAX_GRADIENT,
            words: "a number from 0 to 4.47, the largest gradient of a picture",
        },
        ..Scalar::unit(
            |picture| mean_squared(picture.l, picture.regions),
            |d, _, adjoint| {
                let picture = adjoint.picture;
                add_adjoint(picture.l, picture.regions, d, adjoint.pixels());
            },
        )
    }),
};

/// √20, the largest gradient of the plain Sobel pair on values in [0, 1].
const MAX_GRADIENT: f64 = 4.472_135_954_999_58;

/// `[above-left, above, above-right, left, right, below-left, below, below-right]` of
/// the pixel (x, y); border pixels repeat themselves.
fn neighbours(regions: &Regions, x: usize, y: usize) -> [usize; 8] {
    let (w, h) = (regions.width(), regions.height());
    let [above, row, below] = [y.saturating_sub(1), y, (y + 1).min(h - 1)].map(|y| y * w);
    let (left, right) = (x.saturating_sub(1), (x + 1).min(w - 1));
    [above + left, above + x, above + right, row + left, row + right, below + left, below + x, below + right]
}

/// `(∂l/∂x, ∂l/∂y)` by the Sobel pair: [-1 0 1; -2 0 2; -1 0 1] and its transpose.
#[inline]
fn sobel([al, a, ar, le, ri, bl, b, br]: [f64; 8]) -> (f64, f64) {
    ((ar - al) + 2.0 * (ri - le) + (br - bl), (bl - al) + 2.0 * (b - a) + (br - ar))
}

/// Gradient at the pixel of an index.
fn gradient(l: &[f64], regions: &Regions, i: usize) -> (f64, f64) {
    sobel(neighbours(regions, i % regions.width(), i / regions.width()).map(|i| l[i]))
}

/// Gradients of a row of pixels.
struct Row {
    /// Number of the row, from the top.
    y: usize,
    /// Columns from the object's first to its last.
    columns: std::ops::Range<usize>,
    /// Derivative to the right by column, 0 off the object.
    gx: Vec<f64>,
    /// Derivative downwards by column, 0 off the object.
    gy: Vec<f64>,
}

/// Visits the gradients of every row that holds a part of the object, from the top.
fn for_each_row(l: &[f64], regions: &Regions, mut visit: impl FnMut(&Row)) {
    let (w, h) = (regions.width(), regions.height());
    let mut row = Row { y: 0, columns: 0..0, gx: vec![0.0; w], gy: vec![0.0; w] };
    for (y, mask) in regions.mask().chunks_exact(w).enumerate() {
        let Some(first) = mask.iter().position(|&m| m) else { continue };
        let end = mask.iter().rposition(|&m| m).unwrap_or(first) + 1;
        (row.y, row.columns) = (y, first..end);
        let lines = [y.saturating_sub(1), y, (y + 1).min(h - 1)].map(|y| &l[y * w..][..w]);
        inner_gradients(lines, mask, &mut row.gx, &mut row.gy);
        for x in ends(w) {
            (row.gx[x], row.gy[x]) =
                if mask[x] { sobel(neighbours(regions, x, y).map(|i| l[i])) } else { (0.0, 0.0) };
        }
        visit(&row);
    }
}

/// Columns of a row of `w` pixels that lack a neighbour on one side or both.
fn ends(w: usize) -> impl Iterator<Item = usize> {
    (0..w).step_by((w - 1).max(1))
}

/// Gradients of the pixels of a row that have neighbours on both sides, from the lines above, at and
/// below it.
#[multiversion(targets = "simd")]
fn inner_gradients(lines: [&[f64]; 3], mask: &[bool], gx: &mut [f64], gy: &mut [f64]) {
    let Some(n) = mask.len().checked_sub(2) else { return };
    let [above, here, below] = lines.map(|line| [&line[..n], &line[1..][..n], &line[2..][..n]]);
    let (mask, gx, gy) = (&mask[1..][..n], &mut gx[1..][..n], &mut gy[1..][..n]);
    for i in 0..n {
        let at = |line: [&[f64]; 3]| line.map(|l| l[i]);
        let ([al, a, ar], [le, _, ri], [bl, b, br]) = (at(above), at(here), at(below));
        let (x, y) = sobel([al, a, ar, le, ri, bl, b, br]);
        gx[i] = if mask[i] { x } else { 0.0 };
        gy[i] = if mask[i] { y } else { 0.0 };
    }
}

/// `g² = 1/N_obj Σ_{p ∈ obj} |∇l_p|²`, \[PG14\] eq. (6) squared.
fn mean_squared(l: &[f64], regions: &Regions) -> f64 {
    let mut sum = 0.0;
    if let Some(weights) = regions.weights() {
        for (i, w) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let (x, y) = gradient(l, regions, i);
            sum += w * (x * x + y * y);
        }
        return sum / regions.count(Region::Object);
    }
    for_each_row(l, regions, |row| {
        sum += squared(&row.gx[row.columns.clone()], &row.gy[row.columns.clone()]);
    });
    sum / regions.count(Region::Object)
}

/// Partial sums of squared gradients, to which additions need not wait for each other. 64 rows of 48
/// pixels take 1.3 µs, as with 8; with one sum 1.7, with 32, half of which such a row leaves unused in
/// its second round, 1.6. The last digits of f_q depend on it.
const LANES: usize = 16;

/// `Σ x² + y²`.
#[multiversion(targets = "simd")]
fn squared(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    for (x, y) in x.chunks(LANES).zip(y.chunks(LANES)) {
        for ((x, y), sum) in x.iter().zip(y).zip(&mut sums) {
            *sum += x * x + y * y;
        }
    }
    sums.iter().sum()
}

/// Weights of the [`neighbours`] in the derivatives to the right and downwards.
const SOBEL: [(f64, f64); 8] =
    [(-1.0, -1.0), (0.0, -2.0), (1.0, -1.0), (-2.0, 0.0), (2.0, 0.0), (-1.0, 1.0), (0.0, 2.0), (1.0, 1.0)];

/// Adds `adjoint · ∂g²/∂l` to `out`, which has the picture's size.
fn add_adjoint(l: &[f64], regions: &Regions, adjoint: f64, out: &mut [f64]) {
    let step = 2.0 * adjoint / regions.count(Region::Object);
    let w = regions.width();
    if let Some(weights) = regions.weights() {
        for (i, share) in weights.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let (x, y) = gradient(l, regions, i);
            for (i, (a, b)) in neighbours(regions, i % w, i / w).into_iter().zip(SOBEL) {
                out[i] += step * share * (a * x + b * y);
            }
        }
        return;
    }
    for_each_row(l, regions, |row| {
        let inner = row.columns.start.max(1)..row.columns.end.min(w - 1);
        if !inner.is_empty() {
            let (gx, gy) = (&row.gx[inner.clone()], &row.gy[inner.clone()]);
            let first = neighbours(regions, inner.start, row.y);
            for (start, (x, y)) in first.into_iter().zip(SOBEL) {
                add_products(&mut out[start..][..inner.len()], gx, gy, [step * x, step * y]);
            }
        }
        for x in ends(w) {
            for (i, (a, b)) in neighbours(regions, x, row.y).into_iter().zip(SOBEL) {
                out[i] += step * (a * row.gx[x] + b * row.gy[x]);
            }
        }
    });
}

/// `out += weights[0] · x + weights[1] · y`.
#[multiversion(targets = "simd")]
fn add_products(out: &mut [f64], x: &[f64], y: &[f64], weights: [f64; 2]) {
    for ((out, x), y) in out.iter_mut().zip(x).zip(y) {
        *out += weights[0] * x + weights[1] * y;
    }
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
    fn the_adjoint_of_a_narrow_picture_is_its_derivative() {
        for w in [1, 2] {
            let l: Vec<f64> = (0..3 * w).map(|i| (i * i) as f64 * 0.03).collect();
            let regions = Regions::new(w, 3, &vec![true; l.len()]);
            let mut adjoint = vec![0.0; l.len()];
            add_adjoint(&l, &regions, 1.0, &mut adjoint);
            for (i, a) in adjoint.iter().enumerate() {
                // g² is quadratic in l: central differences are exact.
                let at = |h: f64| {
                    let mut l = l.clone();
                    l[i] += h;
                    mean_squared(&l, &regions)
                };
                let difference = at(0.5) - at(-0.5);
                assert!((a - difference).abs() < 1e-12, "width {w}, pixel {i}: {a} {difference}");
            }
        }
    }

    #[test]
    fn no_gradient_exceeds_the_largest_that_targets_take() {
        // g² is convex, so that its maximum is where all neighbours are black or white.
        let of = |bits: u32| at(&std::array::from_fn::<f64, 9, _>(|i| f64::from(bits >> i & 1)), 3, 3, 1, 1);
        let most = (0..512).map(of).fold(0.0, f64::max);
        assert_eq!(most.sqrt(), MAX_GRADIENT);
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
