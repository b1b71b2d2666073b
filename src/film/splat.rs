//! Accumulation of t = 1 contributions, independent of their order.

use std::{
    io::{self, Write},
    sync::atomic::{AtomicU64, Ordering},
};

use rayon::prelude::*;

use crate::math::Rgb;

/// Value of 1 in fixed point, 2³²: 32 fractional bits resolve 2.3·10⁻¹⁰ of display white, far
/// below the noise of any picture, and 32 integer bits hold 4·10⁹ times white.
const ONE: f64 = 4_294_967_296.0;

/// Numbers that are written at a time.
pub(super) const CHUNK: usize = 1 << 13;

/// Fixed-point sums (u64, 32.32 bits) of RGB values, shared by all threads.
///
/// Values are stored in units chosen by the caller, so that 1 is about display
/// white. A value that does not fit is counted and fails the render; it is
/// never clamped silently.
#[derive(Debug)]
pub struct SplatBuffer {
    /// Sums in fixed point, as `[cell][rgb]`.
    cells: Vec<AtomicU64>,
    /// Number of values that did not fit.
    overflows: AtomicU64,
}

impl Clone for SplatBuffer {
    fn clone(&self) -> Self {
        let copy = |value: &AtomicU64| AtomicU64::new(value.load(Ordering::Relaxed));
        Self { cells: self.cells.iter().map(copy).collect(), overflows: copy(&self.overflows) }
    }
}

impl SplatBuffer {
    /// A buffer of `n` RGB cells that are zero.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self { cells: (0..3 * n).map(|_| AtomicU64::new(0)).collect(), overflows: AtomicU64::new(0) }
    }

    /// Writes the sums so far, exactly.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_sums(&self, out: &mut dyn Write) -> io::Result<()> {
        for chunk in self.cells.chunks(CHUNK) {
            let bytes: Vec<u8> = chunk.iter().flat_map(|c| c.load(Ordering::Relaxed).to_le_bytes()).collect();
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Takes the sums of a buffer of as many cells from the beginning of what [`Self::write_sums`] has
    /// written, and returns the rest; `None` where that is too short.
    #[must_use]
    pub fn read_sums<'b>(&mut self, bytes: &'b [u8]) -> Option<&'b [u8]> {
        let (sums, rest) = bytes.split_at_checked(8 * self.cells.len())?;
        let numbers = sums.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b));
        self.cells.iter_mut().zip(numbers).for_each(|(cell, sum)| *cell.get_mut() = sum);
        Some(rest)
    }

    /// Adds a non-negative, finite value times `scale` to cell `i`.
    pub fn add(&self, i: usize, value: Rgb, scale: f64) {
        for (cell, v) in self.cells[3 * i..3 * i + 3].iter().zip(value.to_array()) {
            if v == 0.0 {
                continue;
            }
            let fixed = (f64::from(v) * scale * ONE).round();
            // 9.2·10¹⁸ is just below 2⁶³: what is added leaves room to detect the sum's overflow.
            if fixed >= 9.2e18 || cell.fetch_add(fixed as u64, Ordering::Relaxed) > u64::MAX - fixed as u64 {
                self.overflows.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// The sum in cell `i`, in the units it was added in.
    #[must_use]
    pub fn get(&self, i: usize, scale: f64) -> [f64; 3] {
        std::array::from_fn(|c| self.cells[3 * i + c].load(Ordering::Relaxed) as f64 / (ONE * scale))
    }

    /// The buffer in parts of `length` numbers, three for each cell.
    pub(super) fn par_chunks_mut(&mut self, length: usize) -> impl IndexedParallelIterator<Item = Part<'_>> {
        self.cells.par_chunks_mut(length).map(Part)
    }

    /// Sets every cell to zero.
    pub fn clear(&mut self) {
        self.cells.par_iter_mut().for_each(|cell| *cell.get_mut() = 0);
    }

    /// Number of values that did not fit.
    #[must_use]
    pub fn overflows(&self) -> u64 {
        self.overflows.load(Ordering::Relaxed)
    }
}

/// Cells of a buffer that are taken out.
pub(super) struct Part<'a>(&'a mut [AtomicU64]);

impl Part<'_> {
    /// The i-th number, in the units it was added in; the buffer then has 0 in its place.
    pub fn take(&mut self, i: usize, scale: f64) -> f64 {
        std::mem::take(self.0[i].get_mut()) as f64 / (ONE * scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_depend_on_the_order() {
        let values: Vec<f32> = (1..200).map(|i| 1.0e-3 * (i * i % 97) as f32).collect();
        let (a, b) = (SplatBuffer::new(1), SplatBuffer::new(1));
        for v in &values {
            a.add(0, Rgb::splat(*v), 0.25);
        }
        for v in values.iter().rev() {
            b.add(0, Rgb::splat(*v), 0.25);
        }
        assert_eq!(a.get(0, 0.25), b.get(0, 0.25));
        let exact: f64 = values.iter().map(|&v| f64::from(v)).sum();
        assert!((a.get(0, 0.25)[0] - exact).abs() < 1e-6);
    }

    #[test]
    fn sums_are_written_and_read_exactly() {
        let mut bytes = Vec::new();
        let (a, mut b) = (SplatBuffer::new(3000), SplatBuffer::new(3000));
        (0..3000).for_each(|i| a.add(i, Rgb::new(1.0, 0.1 * i as f32, 1e-9), 0.5));
        a.write_sums(&mut bytes).unwrap();
        bytes.push(7);
        assert_eq!(b.read_sums(&bytes), Some(&[7][..]));
        assert!((0..3000).all(|i| a.get(i, 0.5) == b.get(i, 0.5)));
        assert_eq!(b.read_sums(&bytes[2..]), None);
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let b = SplatBuffer::new(1);
        b.add(0, Rgb::splat(1.0e30), 1.0);
        assert_eq!(b.overflows(), 3);
        for _ in 0..5 {
            b.add(0, Rgb::new(1.0e9, 0.0, 0.0), 1.0);
        }
        assert!(b.overflows() > 3);
    }
}
