//! Accumulation of t = 1 contributions, independent of their order.

use std::{
    io::{self, Write},
    sync::{
        OnceLock,
        atomic::{AtomicU64, Ordering},
    },
};

use rayon::prelude::*;

use crate::{files::parts::write_numbers, math::Rgb};

/// Value of 1 in fixed point, 2³²: 32 fractional bits resolve 2.3·10⁻¹⁰ of display white, far
/// below the noise of any picture. 32 integer bits hold 4·10⁹ times white; where that is not enough, at
/// exposures or radiances far beyond white, 96 hold 7·10²⁸ times white.
const ONE: f64 = 4_294_967_296.0;
/// Value of the lowest bit of an upper word, 2⁶⁴.
const UPPER: f64 = 18_446_744_073_709_551_616.0;
/// Least value in fixed point that is refused, 2¹²⁶: smaller ones leave room in the upper word for a carry.
const TOO_LARGE: f64 = 8.507_059_173_023_462e37;

/// Fixed-point sums (32.32 bits, 96.32 where needed) of RGB values, shared by all threads.
///
/// Values are stored in units chosen by the caller, so that 1 is about display
/// white. A value that does not fit is counted and fails the render; it is
/// never clamped silently.
#[derive(Debug)]
pub struct SplatBuffer {
    /// Lower words of the sums in fixed point, as `[cell][rgb]`.
    cells: Vec<AtomicU64>,
    /// Upper words of the sums, once one of them is not 0.
    upper: OnceLock<Vec<AtomicU64>>,
    /// Number of values that did not fit.
    overflows: AtomicU64,
}

impl Clone for SplatBuffer {
    fn clone(&self) -> Self {
        let copy = |value: &AtomicU64| AtomicU64::new(value.load(Ordering::Relaxed));
        let copies = |words: &Vec<AtomicU64>| words.iter().map(copy).collect::<Vec<_>>();
        Self {
            cells: copies(&self.cells),
            upper: self.upper.get().map(copies).map_or_else(OnceLock::new, OnceLock::from),
            overflows: copy(&self.overflows),
        }
    }
}

/// Words of value 0.
fn zeros(n: usize) -> Vec<AtomicU64> {
    (0..n).map(|_| AtomicU64::new(0)).collect()
}

impl SplatBuffer {
    /// A buffer of `n` RGB cells that are zero.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self { cells: zeros(3 * n), upper: OnceLock::new(), overflows: AtomicU64::new(0) }
    }

    /// Writes the sums so far, exactly.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_sums(&self, out: &mut dyn Write) -> io::Result<()> {
        let upper = self.upper.get().map_or(&[][..], Vec::as_slice);
        write_numbers(out, self.cells.iter().map(|cell| cell.load(Ordering::Relaxed).to_le_bytes()))?;
        // Of the upper words only those that are not 0, each after its place.
        let upper = upper.iter().map(|c| c.load(Ordering::Relaxed)).enumerate().filter(|(_, word)| *word > 0);
        let upper: Vec<(usize, u64)> = upper.collect();
        out.write_all(&(upper.len() as u64).to_le_bytes())?;
        for (i, word) in upper {
            out.write_all(&(i as u64).to_le_bytes())?;
            out.write_all(&word.to_le_bytes())?;
        }
        Ok(())
    }

    /// Takes the sums of a buffer of as many cells from the beginning of what [`Self::write_sums`] has
    /// written, and returns the rest; `None`, and the buffer is as before, where that is too short or broken.
    #[must_use]
    pub fn read_sums<'b>(&mut self, bytes: &'b [u8]) -> Option<&'b [u8]> {
        let (sums, rest) = bytes.split_at_checked(8 * self.cells.len())?;
        let (n, rest) = rest.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(*n)).ok()?.checked_mul(16)?;
        let (places, rest) = rest.split_at_checked(length)?;
        let numbers = |bytes: &'b [u8]| bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b));
        let mut upper: Option<Vec<AtomicU64>> = None;
        for place in places.chunks_exact(16) {
            let [i, word] = [0, 1].map(|k| numbers(place).nth(k).unwrap_or_default());
            let words = upper.get_or_insert_with(|| zeros(self.cells.len()));
            *words.get_mut(usize::try_from(i).ok()?)?.get_mut() = word;
        }
        self.upper = upper.map_or_else(OnceLock::new, OnceLock::from);
        self.cells.iter_mut().zip(numbers(sums)).for_each(|(cell, sum)| *cell.get_mut() = sum);
        Some(rest)
    }

    /// Adds a non-negative, finite value times `scale` to cell `i`.
    pub fn add(&self, i: usize, value: Rgb, scale: f64) {
        for (c, v) in value.to_array().into_iter().enumerate().filter(|(_, v)| *v != 0.0) {
            let fixed = (f64::from(v) * scale * ONE).round();
            if fixed < TOO_LARGE {
                self.add_fixed(3 * i + c, fixed as u128);
            } else {
                self.overflows.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Adds to a sum word by word: the carries, and with them the sum, are the same in any order.
    fn add_fixed(&self, i: usize, fixed: u128) {
        let (lower, upper) = (fixed as u64, (fixed >> 64) as u64);
        let before = self.cells[i].fetch_add(lower, Ordering::Relaxed);
        let upper = upper + u64::from(before.checked_add(lower).is_none());
        if upper > 0 {
            let words = self.upper.get_or_init(|| zeros(self.cells.len()));
            let before = words[i].fetch_add(upper, Ordering::Relaxed);
            if before.checked_add(upper).is_none() {
                self.overflows.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// The sum in cell `i`, in the units it was added in.
    #[must_use]
    pub fn get(&self, i: usize, scale: f64) -> [f64; 3] {
        let upper = |i: usize| self.upper.get().map_or(0, |words| words[i].load(Ordering::Relaxed));
        std::array::from_fn(|c| {
            let (lower, upper) = (self.cells[3 * i + c].load(Ordering::Relaxed), upper(3 * i + c));
            (upper as f64 * UPPER + lower as f64) / (ONE * scale)
        })
    }

    /// The buffer in parts of `length` numbers, three for each cell.
    pub(super) fn par_chunks_mut(&mut self, length: usize) -> impl IndexedParallelIterator<Item = Part<'_>> {
        let n_parts = self.cells.len().div_ceil(length);
        let upper: Vec<&mut [AtomicU64]> = match self.upper.get_mut() {
            Some(words) => words.chunks_mut(length).collect(),
            None => (0..n_parts).map(|_| &mut [][..]).collect(),
        };
        self.cells.par_chunks_mut(length).zip(upper).map(|(lower, upper)| Part { lower, upper })
    }

    /// Number of values that did not fit.
    #[must_use]
    pub fn overflows(&self) -> u64 {
        self.overflows.load(Ordering::Relaxed)
    }
}

/// Cells of a buffer that are taken out.
pub(super) struct Part<'a> {
    lower: &'a mut [AtomicU64],
    /// Upper words; empty where all are 0.
    upper: &'a mut [AtomicU64],
}

impl Part<'_> {
    /// The i-th number, in the units it was added in; the buffer then has 0 in its place.
    pub fn take(&mut self, i: usize, scale: f64) -> f64 {
        let upper = self.upper.get_mut(i).map_or(0, |word| std::mem::take(word.get_mut()));
        (upper as f64 * UPPER + std::mem::take(self.lower[i].get_mut()) as f64) / (ONE * scale)
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
    fn sums_far_beyond_white_are_exact_in_any_order_and_in_a_copy() {
        // Powers of two, so that every sum is exact.
        let values: Vec<f32> = (0..64).map(|i| (i as f32).exp2()).collect();
        let exact: f64 = values.iter().map(|&v| 8.0 * f64::from(v)).sum();
        let buffer = SplatBuffer::new(2);
        std::thread::scope(|scope| {
            for k in 0..8 {
                let (buffer, values) = (&buffer, &values);
                scope.spawn(move || {
                    (0..64).for_each(|i| buffer.add(1, Rgb::splat(values[(i + 8 * k) % 64]), 1.0));
                });
            }
        });
        assert_eq!((buffer.get(1, 1.0), buffer.overflows()), ([exact; 3], 0));
        assert_eq!((buffer.get(0, 1.0), buffer.clone().get(1, 1.0)), ([0.0; 3], [exact; 3]));
        let mut taken = buffer.clone();
        let parts = taken.par_chunks_mut(2).map(|mut part| [part.take(0, 1.0), part.take(1, 1.0)]);
        assert_eq!(parts.collect::<Vec<_>>().as_flattened(), [0.0, 0.0, 0.0, exact, exact, exact]);
        assert_eq!([taken.get(0, 1.0), taken.get(1, 1.0)], [[0.0; 3]; 2]);

        let (mut bytes, mut read) = (Vec::new(), SplatBuffer::new(2));
        buffer.write_sums(&mut bytes).unwrap();
        assert_eq!(read.read_sums(&bytes), Some(&[][..]));
        assert_eq!(read.get(1, 1.0), [exact; 3]);
        assert_eq!(read.read_sums(&bytes[..bytes.len() - 1]), None);
        let place = 8 * 6 + 8;
        bytes[place] = 200;
        assert_eq!(read.read_sums(&bytes), None);
        assert_eq!(read.get(1, 1.0), [exact; 3]);
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let b = SplatBuffer::new(2);
        b.add(0, Rgb::splat(1.0e30), 1.0);
        assert_eq!(b.overflows(), 3);
        // Of almost 2⁹⁴ the fifth does not fit into 96 bits.
        (0..4).for_each(|_| b.add(1, Rgb::new(94_f32.exp2() * 0.99, 0.0, 0.0), 1.0));
        assert_eq!(b.overflows(), 3);
        b.add(1, Rgb::new(94_f32.exp2() * 0.99, 0.0, 0.0), 1.0);
        assert_eq!(b.overflows(), 4);
    }
}
