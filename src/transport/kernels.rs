//! Sums over rows of the tables, the inner loops of an evaluation.
//!
//! Compiled for several instruction sets; the order of the sums is the same in all of
//! them, and so are the bytes.

use glam::{Mat4, Vec4};
use multiversion::multiversion;

/// Partial sums of a dot product: enough for vector instructions of every width to work in parallel,
/// few enough for the registers. The order of the sums, and so the result, depends on it.
const LANES: usize = 64;
/// Length of the parts in which several dot products with one vector are taken: 4 KiB of f64, which
/// stay in the first cache level meanwhile.
const BLOCK: usize = 512;

/// `out[p] = Σ_i weights[i] · rows[i][p]`.
#[multiversion(targets = "simd")]
pub(super) fn combine(rows: &[&[f32]], weights: &[f64], out: &mut [f64]) {
    let n = out.len();
    out.fill(0.0);
    let row = |i: usize| &rows[i][..n];
    let (mut groups, mut i) = (weights.chunks_exact(4), 0);
    for w in &mut groups {
        let [a, b, c, d] = [row(i), row(i + 1), row(i + 2), row(i + 3)];
        for p in 0..n {
            let first = w[0] * f64::from(a[p]) + w[1] * f64::from(b[p]);
            let second = w[2] * f64::from(c[p]) + w[3] * f64::from(d[p]);
            out[p] += first + second;
        }
        i += 4;
    }
    for (k, w) in groups.remainder().iter().enumerate() {
        for (o, &v) in out.iter_mut().zip(row(i + k)) {
            *o += w * f64::from(v);
        }
    }
}

/// `out[k][p] = Σ_i weights[i][k] · rows[i][p]` with the rows read once, where the third sum is added to the
/// values of `out[2]`.
#[multiversion(targets = "simd")]
pub(super) fn combine_thrice(rows: &[&[f32]], weights: &[[f64; 3]], out: [&mut [f64]; 3]) {
    let [a, b, c] = out;
    a.fill(0.0);
    b.fill(0.0);
    let n = a.len();
    let (a, b, c) = (&mut a[..n], &mut b[..n], &mut c[..n]);
    for (rows, w) in rows.chunks(2).zip(weights.chunks(2)) {
        let (first, second) = (&rows[0][..n], &rows[rows.len() - 1][..n]);
        let (u, v) = (w[0], if w.len() > 1 { w[1] } else { [0.0; 3] });
        for p in 0..n {
            let (x, y) = (f64::from(first[p]), f64::from(second[p]));
            a[p] += u[0] * x + v[0] * y;
            b[p] += u[1] * x + v[1] * y;
            c[p] += u[2] * x + v[2] * y;
        }
    }
}

/// Side of the part of a matrix that is transposed at a time: the numbers (f32) of a cache line of 64
/// bytes.
const TILE: usize = 16;

/// Transposes: `to[i][x] = from[x][i]` if `is_first`, else `to[i][x] += from[x][i]`, for x below `width`.
/// Results are written in order, since their memory is mostly not in the caches.
pub(super) fn transpose(from: &[f32], width: usize, to: &mut [f32], is_first: bool) {
    let n = from.len() / width;
    let mut tile = [[0.0_f32; TILE]; TILE];
    for i in (0..n).step_by(TILE) {
        let high = TILE.min(n - i);
        for x in (0..width).step_by(TILE) {
            let wide = TILE.min(width - x);
            if wide.is_multiple_of(4) && high.is_multiple_of(4) {
                for k in (0..wide).step_by(4) {
                    let columns: [&[f32]; 4] = std::array::from_fn(|c| &from[(x + k + c) * n + i..][..high]);
                    for j in (0..high).step_by(4) {
                        let [a, b, c, d] = columns.map(|column| Vec4::from_slice(&column[j..]));
                        let rows = Mat4::from_cols(a, b, c, d).transpose();
                        for (row, values) in tile[j..].iter_mut().zip(rows.to_cols_array_2d()) {
                            row[k..k + 4].copy_from_slice(&values);
                        }
                    }
                }
            } else {
                for k in 0..wide {
                    for (row, v) in tile.iter_mut().zip(&from[(x + k) * n + i..][..high]) {
                        row[k] = *v;
                    }
                }
            }
            for (j, row) in tile[..high].iter().enumerate() {
                let to = &mut to[(i + j) * width + x..][..wide];
                if is_first {
                    to.copy_from_slice(&row[..wide]);
                } else {
                    to.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
                }
            }
        }
    }
}

/// Adds `Σ_p a[p] · b[i][p]` to `sums[i]` for every i; `a` is read from memory once.
pub(super) fn add_dots(a: &[f64], b: &[&[f64]], sums: &mut [f64]) {
    for (i, a) in a.chunks(BLOCK).enumerate() {
        for (b, sum) in b.iter().zip(&mut *sums) {
            *sum += dot(a, &b[i * BLOCK..][..a.len()]);
        }
    }
}

/// `Σ_p a[p] · b[p]`.
#[multiversion(targets = "simd")]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0_f64; LANES];
    for (a, b) in a.chunks(LANES).zip(b.chunks(LANES)) {
        for ((a, b), sum) in a.iter().zip(b).zip(&mut sums) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}

/// `Σ_p a[p]`.
#[multiversion(targets = "simd")]
pub(super) fn sum(a: &[f32]) -> f64 {
    let mut sums = [0.0_f64; LANES];
    for a in a.chunks(LANES) {
        a.iter().zip(&mut sums).for_each(|(&a, sum)| *sum += f64::from(a));
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposing_writes_or_adds_every_number_once() {
        for (width, n) in [(1, 1), (3, 5), (16, 16), (20, 36), (33, 8), (128, 72)] {
            let from: Vec<f32> = (0..width * n).map(|i| i as f32).collect();
            let mut to = vec![f32::NAN; width * n];
            transpose(&from, width, &mut to, true);
            transpose(&from, width, &mut to, false);
            for x in 0..width {
                for i in 0..n {
                    assert_eq!(to[i * width + x], 2.0 * from[x * n + i], "{width} x {n}");
                }
            }
        }
    }
}
