//! Sums over rows of the tables, the inner loops of an evaluation.
//!
//! Compiled for several instruction sets; the order of the sums is the same in all of
//! them, and so are the bytes.

use multiversion::multiversion;

/// Independent sums of a dot product: so many that adding to them is a loop over
/// memory, which compilers turn into vector instructions.
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

/// `out[i] += scale · Σ_p adjoint[p] · rows[i][p]`.
#[multiversion(targets = "simd")]
pub(super) fn dots(rows: &[&[f32]], adjoint: &[f64], scale: f64, out: &mut [f64]) {
    for (rows, out) in rows.chunks(2).zip(out.chunks_mut(2)) {
        // Two rows at a time: memory delivers both at once.
        let (first, second) = (rows[0], rows[rows.len() - 1]);
        let mut lanes = [[0.0_f64; LANES]; 2];
        let [x, y] = &mut lanes;
        for ((a, b), c) in adjoint.chunks(LANES).zip(first.chunks(LANES)).zip(second.chunks(LANES)) {
            let terms = a.iter().zip(b).zip(c).zip(x.iter_mut()).zip(y.iter_mut());
            for ((((&a, &b), &c), x), y) in terms {
                *x += a * f64::from(b);
                *y += a * f64::from(c);
            }
        }
        for (out, lanes) in out.iter_mut().zip(&lanes) {
            *out += scale * lanes.iter().sum::<f64>();
        }
    }
}
