//! Numbers in messages.

use std::fmt;

/// A number as people write it: plain, or with an exponent where that takes fewer digits.
#[derive(Clone, Copy, Debug)]
pub struct Number<T>(pub T);

/// Magnitudes that are written without exponent, as TOML and JSON files have them.
const PLAIN: std::ops::Range<f64> = 1e-4..1e7;

impl<T: Copy + Into<f64> + fmt::Display + fmt::LowerExp> fmt::Display for Number<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = *self;
        let magnitude = value.into().abs();
        if magnitude == 0.0 || !magnitude.is_finite() || PLAIN.contains(&magnitude) {
            write!(f, "{value}")
        } else {
            write!(f, "{value:e}")
        }
    }
}

/// Several numbers, as [`Number`]s in brackets.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'a, T>(pub &'a [T]);

impl<T: Copy + Into<f64> + fmt::Display + fmt::LowerExp> fmt::Display for Numbers<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[")?;
        for (i, &value) in self.0.iter().enumerate() {
            let separator = if i > 0 { ", " } else { "" };
            write!(f, "{separator}{}", Number(value))?;
        }
        f.write_str("]")
    }
}

/// A number of bytes in the unit in which it has one to five digits, rounded up.
#[derive(Clone, Copy, Debug)]
pub struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            1 => write!(f, "1 byte"),
            bytes if bytes < 10 << 10 => write!(f, "{bytes} bytes"),
            bytes if bytes < 10 << 20 => write!(f, "{} KiB", bytes.div_ceil(1 << 10)),
            bytes => write!(f, "{} MiB", bytes.div_ceil(1 << 20)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_few_digits() {
        let all = [0.0, -0.1, 24.0, 1_000_000.0, 1e7, -1e300, 1e-5, f64::INFINITY, f64::NAN];
        assert_eq!(Numbers(&all).to_string(), "[0, -0.1, 24, 1000000, 1e7, -1e300, 1e-5, inf, NaN]");
        assert_eq!(Numbers(&[0.1_f32, 1e20]).to_string(), "[0.1, 1e20]");
        let bytes = [1, 10 << 10, 3_000_000, 1 << 31].map(|n| Bytes(n).to_string());
        assert_eq!(bytes, ["1 byte", "10 KiB", "2930 KiB", "2048 MiB"]);
    }
}
