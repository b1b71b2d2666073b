//! Sums over rows of the tables, the inner loops of an evaluation.
//!
//! Compiled for several instruction sets; the order of the sums is the same in all of
//! them, and so are the bytes.

use multiversion::multiversion;

/// Pixels of [`combine_thrice`] handled at a time: three sums of them stay in the first cache
/// level, and memory delivers as much of a row at once.
const BLOCK: usize = 512;

/// Numbers handled at a time: few enough for the registers and the first cache level, so
/// many that the inner loops become vector instructions.
const LANES: usize = 64;

/// `out[p] = Σ_i weights[i] · rows[i][p]`.
#[multiversion(targets = "simd")]
pub(super) fn combine(rows: &[&[f32]], weights: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    let mut groups = rows.chunks_exact(4).zip(weights.chunks_exact(4));
    for (rows, w) in &mut groups {
        let n = out.len();
        let [a, b, c, d] = [&rows[0][..n], &rows[1][..n], &rows[2][..n], &rows[3][..n]];
        let out = &mut out[..n];
        for p in 0..n {
            let first = w[0] * f64::from(a[p]) + w[1] * f64::from(b[p]);
            let second = w[2] * f64::from(c[p]) + w[3] * f64::from(d[p]);
            out[p] += first + second;
        }
    }
    let rest = rows.len() / 4 * 4;
    for (row, w) in rows[rest..].iter().zip(&weights[rest..]) {
        for (o, &v) in out.iter_mut().zip(*row) {
            *o += w * f64::from(v);
        }
    }
}

/// `out[k][p] = Σ_i weights[i][k] · rows[i][p]`, the rows read once; the last of the three is
/// added to what is there.
#[multiversion(targets = "simd")]
pub(super) fn combine_thrice(rows: &[&[f32]], weights: &[[f64; 3]], out: [&mut [f64]; 3]) {
    let [a, b, c] = out;
    a.fill(0.0);
    b.fill(0.0);
    let parts = a.chunks_mut(BLOCK).zip(b.chunks_mut(BLOCK)).zip(c.chunks_mut(BLOCK));
    for (i, ((a, b), c)) in parts.enumerate() {
        let n = a.len();
        for (rows, w) in rows.chunks(2).zip(weights.chunks(2)) {
            let (first, second) = (rows[0], rows[rows.len() - 1]);
            let (u, v) = (w[0], if w.len() > 1 { w[1] } else { [0.0; 3] });
            let (first, second) = (&first[i * BLOCK..][..n], &second[i * BLOCK..][..n]);
            let (a, b, c) = (&mut a[..n], &mut b[..n], &mut c[..n]);
            for p in 0..n {
                let (x, y) = (f64::from(first[p]), f64::from(second[p]));
                a[p] += u[0] * x + v[0] * y;
                b[p] += u[1] * x + v[1] * y;
                c[p] += u[2] * x + v[2] * y;
            }
        }
    }
}

/// `Σ_p a[p] · b[p]`.
#[multiversion(targets = "simd")]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0_f64; LANES];
    for (a, b) in a.chunks(LANES).zip(b.chunks(LANES)) {
        for ((a, b), sum) in a.iter().zip(b).zip(&mut sums) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}
