//! The R2 low-discrepancy sequence \[Roberts18\].

/// Inverse of the plastic number; its multiples spread evenly over [0, 1), and together with those of
/// its square over the unit square.
pub const PLASTIC: f64 = 0.754_877_666_246_692_8;

/// Point `i` of the sequence in [0, 1)²; point 0 is the middle.
#[must_use]
pub fn r2(i: u32) -> [f64; 2] {
    [PLASTIC, PLASTIC * PLASTIC].map(|step| (0.5 + f64::from(i) * step).fract())
}
