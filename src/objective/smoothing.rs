//! The smoothed version of the objective that the optimiser sees.
//!
//! Kinks and infinite slopes stop a quasi-Newton method; each is rounded off by a stated
//! amount. The f_q that is reported is always unsmoothed.

/// How a pixel passes from a bin of the cumulated histogram to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// Piecewise linear: the definition.
    Linear,
    /// Cubic with zero slope at both ends: C¹ in the pixel, same support.
    Smooth,
}

impl Ramp {
    /// Share of the pixel that has left the bin at position `t` in [0, 1].
    pub(super) fn value(self, t: f64) -> f64 {
        match self {
            Self::Linear => t,
            Self::Smooth => t * t * (3.0 - 2.0 * t),
        }
    }

    /// Derivative of [`Ramp::value`] by the position.
    pub(super) fn derivative(self, t: f64) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Smooth => 6.0 * t * (1.0 - t),
        }
    }
}

/// Amounts by which the objective is smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Rounding δ of moduli: |r| of a normalised residual becomes `h(r) = √(r²+δ²) − δ`, which is
    /// below it by at most δ. The paper's weights of scalar terms add up to 2, so that f_q drops by at
    /// most 2δ with them.
    pub delta: f64,
    /// Rounding η of roots, in units of l: σ and g become `√(z+η²) − η`, which is below the plain root
    /// by at most η.
    pub eta: f64,
    /// Rounding of the histogram's roots in pixels: of N pixels, `√q` becomes `√(q + pixels/N)`.
    pub pixels: f64,
    /// How a pixel passes from a bin of the cumulated histogram to the next.
    pub ramp: Ramp,
}

impl Smoothing {
    /// No smoothing: \[PG14\] eqs. (1)–(8) to the letter.
    pub const NONE: Self = Self { delta: 0.0, eta: 0.0, pixels: 0.0, ramp: Ramp::Linear };

    /// Rounding δ with which a descent begins: kinks are as wide as a twentieth of the largest miss, so
    /// that steps lead across them, and f_q is off by at most 0.1.
    pub const DELTA_FIRST: f64 = 0.05;

    /// Rounding δ with which a descent ends: f_q is off by at most 0.001, a fifth of the tolerance
    /// that runs have by default.
    pub const DELTA_LAST: f64 = 5e-4;

    /// Rounding η: a quarter of an 8-bit step, a spread nobody can see.
    pub const ETA: f64 = 1e-3;

    /// Rounding of the histogram's roots, pixels: the slope of √q is infinite where no pixel is, and one
    /// pixel is the least that a histogram resolves.
    const PIXELS: f64 = 1.0;

    /// The optimiser's smoothing with rounding `delta` of moduli.
    #[must_use]
    pub const fn with_delta(delta: f64) -> Self {
        Self { delta, eta: Self::ETA, pixels: Self::PIXELS, ramp: Ramp::Smooth }
    }

    /// `h(r)` and `h'(r)`; with δ = 0, |r| with slope 0 at its kink.
    pub(super) fn absolute(&self, r: f64) -> (f64, f64) {
        let root = modulus(r, self.delta);
        (root - self.delta, if root > 0.0 { r / root } else { 0.0 })
    }

    /// `√(max(z,0)+η²) − η` and its derivative; with η = 0, slope 0 at z = 0.
    pub(super) fn root(&self, z: f64) -> (f64, f64) {
        let root = (z.max(0.0) + self.eta * self.eta).sqrt();
        let slope = if z >= 0.0 && root > 0.0 { 0.5 / root } else { 0.0 };
        (root - self.eta, slope)
    }
}

/// `√(x²+ε²)`; exactly |x| for ε = 0, since the root of a rounded square rounds back.
pub(super) fn modulus(x: f64, epsilon: f64) -> f64 {
    (x * x + epsilon * epsilon).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_modulus_is_at_most_delta_below_the_modulus() {
        for delta in [0.05, 5e-4] {
            let s = Smoothing::with_delta(delta);
            assert_eq!(s.absolute(0.0), (0.0, 0.0));
            for i in -100..=100 {
                let r = f64::from(i) / 50.0;
                let gap = r.abs() - s.absolute(r).0;
                assert!((-1e-15..=delta).contains(&gap), "{r}: {gap}");
            }
            // It uses up δ: a wrong δ would not.
            assert!(2.0 - s.absolute(2.0).0 > 0.95 * delta);
        }
    }

    #[test]
    fn the_smooth_ramp_has_no_corner() {
        assert_eq!((Ramp::Smooth.value(0.0), Ramp::Smooth.value(1.0)), (0.0, 1.0));
        assert_eq!((Ramp::Smooth.derivative(0.0), Ramp::Smooth.derivative(1.0)), (0.0, 0.0));
        assert_eq!(Ramp::Smooth.value(0.5), 0.5);
    }
}
