//! Cumulated histograms of display luminance, and the distance between two: \[PG14\] eq. (8).
//!
//! A pixel enters the value `q_i` of bin i as a ramp one bin wide centred on the bin's upper edge, from
//! 1 below to 0 above; the ramps of neighbouring bins abut, so a pixel lies in one of them and the
//! histogram of N pixels costs O(N). The last `q` is 1 by definition.

use super::smoothing::{Ramp, modulus};

/// Number of bins: one for each code of an 8-bit picture, as in \[PG14\] eq. (8).
pub const BINS: usize = 256;

/// Pixels that are counted side by side, each in counts of its own: neighbours often fall into the same
/// bin, and need not wait for each other then. A dark picture of 128 × 96 pixels takes 29 µs, with one
/// set of counts 35, with eight 28 but 16 kB.
const LANES: usize = 4;

/// A cumulated histogram: for each bin the share of pixels below its upper edge.
pub type Cumulated = [f64; BINS];

/// Where a pixel lies on the ramps: index of the bin whose ramp holds it (−1: below all of
/// them) and the position within that ramp, in [0, 1).
fn locate(l: f64) -> (isize, f64) {
    let u = l.clamp(0.0, 1.0) * BINS as f64 - 0.5;
    // ⌊u⌋ for u ≥ −1 by truncation; `floor` is a library call on baseline x86-64.
    let cell = (u + 1.0) as isize - 1;
    (cell, u - cell as f64)
}

/// Cumulated histogram of a picture's display luminance: `q_i = 1/N Σ_p ramp`, `q_255 = 1`.
pub(super) fn cumulated(l: &[f64], ramp: Ramp) -> Cumulated {
    // masses[_][j] is what bins j and above gain over bin j − 1.
    let mut masses = [[0.0; BINS + 1]; LANES];
    for l in l.chunks(LANES) {
        for (&l, mass) in l.iter().zip(&mut masses) {
            let (cell, t) = locate(l);
            let passed = ramp.value(t);
            if cell < 0 {
                mass[0] += 1.0;
            } else {
                mass[cell as usize] += 1.0 - passed;
                mass[cell as usize + 1] += passed;
            }
        }
    }
    let mass: [f64; BINS + 1] = std::array::from_fn(|j| masses.iter().map(|mass| mass[j]).sum());
    let mut q = [0.0; BINS];
    let mut sum = 0.0;
    for (q, mass) in q.iter_mut().zip(mass) {
        sum += mass;
        *q = (sum / l.len() as f64).min(1.0);
    }
    q[BINS - 1] = 1.0;
    q
}

/// Adds `Σ_i adjoint_i · ∂q_i/∂l` to `out`; `adjoint` has a value for each bin.
pub(super) fn add_adjoint(l: &[f64], ramp: Ramp, adjoint: &[f64], out: &mut [f64]) {
    assert_eq!(adjoint.len(), BINS, "one derivative a bin");
    let step = -(BINS as f64) / l.len() as f64;
    for (out, &l) in out.iter_mut().zip(l) {
        let (cell, t) = locate(l);
        if (0..BINS as isize - 1).contains(&cell) {
            *out += step * adjoint[cell as usize] * ramp.derivative(t);
        }
    }
}

/// `f_hist` of \[PG14\] eq. (8): distance of the cumulated histogram `q` of a picture to `p` of a
/// signature. Not symmetric: `q` alone normalises.
#[must_use]
pub fn f_hist(p: &Cumulated, q: &Cumulated) -> f64 {
    distance(p, q, 0.0, &mut [0.0; BINS])
}

/// `f_hist` of \[PG14\] eq. (8), and its derivative in every `q_i` into `derivative`, where zeros are.
///
/// `epsilon` > 0 smooths: `√q` becomes `√(q+ε)`, and `max(q, 1−q)` = ½ + |q−½| becomes
/// ½ + √((q−½)²+ε²). With ε = 0 an infinite derivative (q = 0) is reported as 0.
pub(super) fn distance(p: &[f64], q: &[f64], epsilon: f64, derivative: &mut [f64]) -> f64 {
    let mut numerator = 0.0;
    let mut denominator = 0.0;
    for (&p, &q) in p.iter().zip(q) {
        let d = p.sqrt() - (q + epsilon).sqrt();
        numerator += d * d;
        denominator += 0.5 + modulus(q - 0.5, epsilon);
    }
    let f = (numerator / denominator).sqrt(); // [PG14] eq. (8)
    if f > 0.0 {
        for ((out, &p), &q) in derivative.iter_mut().zip(p).zip(q) {
            let root = (q + epsilon).sqrt();
            let d_numerator = if root > 0.0 { 1.0 - p.sqrt() / root } else { 0.0 };
            let spread = modulus(q - 0.5, epsilon);
            let d_denominator = if spread > 0.0 { (q - 0.5) / spread } else { 0.0 };
            *out = (d_numerator - f * f * d_denominator) / (2.0 * f * denominator);
        }
        derivative[BINS - 1] = 0.0; // the last q is 1, whatever the picture
    }
    f
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::testing::Rng;

    /// The definition, O(N·256).
    fn by_definition(l: &[f64]) -> Cumulated {
        let mut q = [1.0; BINS];
        for (i, q) in q.iter_mut().enumerate().take(BINS - 1) {
            let edge = (i + 1) as f64 / BINS as f64;
            let ramp = |l: &f64| ((edge - l) * BINS as f64 + 0.5).clamp(0.0, 1.0);
            *q = l.iter().map(ramp).sum::<f64>() / l.len() as f64;
        }
        q
    }

    #[test]
    fn the_fast_histogram_is_the_definition() {
        let mut rng = Rng::new(1);
        let mut l: Vec<f64> = (0..500).map(|_| rng.uniform()).collect();
        l.extend([0.0, 1.0, 0.5 / 256.0, 255.5 / 256.0, 0.25, 1.0 / 512.0, 1.0 - 1e-16]);
        let fast = cumulated(&l, Ramp::Linear);
        for (i, (a, b)) in fast.iter().zip(by_definition(&l)).enumerate() {
            assert!((a - b).abs() < 1e-13, "bin {i}: {a} {b}");
        }
    }

    #[test]
    fn black_and_white_pictures_fill_the_ends() {
        assert_eq!(cumulated(&[0.0; 9], Ramp::Linear), [1.0; BINS]);
        let mut white = [0.0; BINS];
        white[BINS - 1] = 1.0;
        assert_eq!(cumulated(&[1.0; 9], Ramp::Linear), white);
    }

    #[test]
    fn the_distance_is_that_of_equation_8_by_hand() {
        // p = 0 but for the last, q = 1: numerator 255, denominator 256.
        let mut p = [0.0; BINS];
        p[BINS - 1] = 1.0;
        let f = f_hist(&p, &[1.0; BINS]);
        assert!((f - (255.0_f64 / 256.0).sqrt()).abs() < 1e-15);
        // p = 1, q = 1/4 in every bin: (1 − ½)² against max(¼, ¾).
        let mut q = [0.25; BINS];
        q[BINS - 1] = 1.0;
        let f = f_hist(&[1.0; BINS], &q);
        let want = (255.0_f64 * 0.25 / (255.0 * 0.75 + 1.0)).sqrt();
        assert!((f - want).abs() < 1e-15);
    }
}
