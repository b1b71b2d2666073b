//! Many numbers, written a part at a time.

use std::io::{self, Write};

/// Bytes that are written at a time: far from the size of a film, so that no second copy of one is held.
const PART: usize = 1 << 16;

/// Writes the bytes of numbers one after the other.
///
/// # Errors
/// When `out` cannot be written to.
pub fn write_numbers<const N: usize>(
    out: &mut dyn Write,
    numbers: impl Iterator<Item = [u8; N]>,
) -> io::Result<()> {
    let mut part = Vec::with_capacity(PART + N);
    for number in numbers {
        part.extend_from_slice(&number);
        if part.len() >= PART {
            out.write_all(&part)?;
            part.clear();
        }
    }
    out.write_all(&part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_several_parts_are_written_in_order() {
        let numbers: Vec<u32> = (0..40_000).collect();
        let mut bytes = Vec::new();
        write_numbers(&mut bytes, numbers.iter().map(|n| n.to_le_bytes())).unwrap();
        let read: Vec<u32> = bytes.as_chunks().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
        assert_eq!(read, numbers);
        assert_eq!(bytes.len(), 160_000);
    }
}
