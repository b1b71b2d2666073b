//! Radiance HDR: the header and what it says of the numbers, pixels in every order of rows, run-length
//! encoded by either method or not at all.
//!
//! # References
//! \[Radiance\] *Radiance File Formats*: RGBE and XYZE, the resolution string, EXPOSURE and COLORCORR,
//! which are what pixels have been multiplied with, all lines together.

use std::io::{BufRead, ErrorKind, Read};

use image::metadata::Orientation;

use super::budget;
use super::primaries::{self, Chromaticities};
use super::{Colour, Fault, Format, Note, Picture, Reading, Samples, Source, Transfer, array};

/// Bytes of a pixel as decoded.
const PIXEL: u64 = 12;
/// Longest header, bytes: the history of a picture that went through a thousand commands fits.
const MAX_HEADER: u64 = 1 << 20;
/// Lengths of rows that the newer method can encode; it writes others as they are.
const RUN_LENGTHS: std::ops::RangeInclusive<usize> = 8..=0x7fff;

/// Reads a picture.
pub(super) fn read(mut source: Box<dyn Source + '_>, reading: &Reading) -> Result<Picture, Fault> {
    let header = Header::read(&mut source)?;
    let turning = if header.turn == Orientation::NoTransforms { 0 } else { PIXEL };
    budget::check(header.size.map(|n| n as u64), PIXEL + turning + reading.kept as u64)?;
    let mut notes = Vec::new();
    let mut colour = Colour::rec709(Transfer::Linear);
    if header.is_xyz {
        colour.matrix = primaries::xyz_to_rec709();
    }
    if reading.purpose.honours_metadata() {
        colour.gain = header.gain()?;
        if let Some(stated) = header.primaries()?.filter(|_| !header.is_xyz) {
            match colour.with_primaries(stated) {
                Some(stated) => colour = stated,
                None => notes.push(Note::ChromaticitiesIgnored),
            }
        }
        notes.extend(Note::of_aspect(header.aspect()?));
    }
    let samples = Samples::F32(pixels(&mut source, header.size)?);
    let mut picture = Picture::new(header.size, 3, samples, colour, header.turn);
    picture.notes = notes;
    Ok(picture)
}

/// What stands before the pixels.
struct Header {
    /// Keys and values in order.
    lines: Vec<(String, String)>,
    /// Whether the numbers are X, Y, Z.
    is_xyz: bool,
    /// Length and number of the rows as they are stored.
    size: [usize; 2],
    /// What brings them upright.
    turn: Orientation,
}

impl Header {
    fn read(source: &mut (impl BufRead + ?Sized)) -> Result<Self, Fault> {
        let mut source = source.take(MAX_HEADER);
        let mut lines = Vec::new();
        let mut is_marked = false;
        for i in 0.. {
            let line = text_line(&mut source)?;
            if line.is_empty() {
                break;
            }
            is_marked |= i == 0 && line.starts_with("#?");
            // What earlier pictures said is indented.
            if let Some((key, value)) = line.split_once('=') {
                lines.push((key.to_owned(), value.to_owned()));
            }
        }
        let format = lines.iter().rfind(|(key, _)| key == "FORMAT").map(|(_, value)| value.trim());
        let is_xyz = match format {
            Some("32-bit_rle_rgbe") => false,
            Some("32-bit_rle_xyze") => true,
            None if is_marked => false,
            None => return Err(Fault::UnknownFormat),
            Some(other) => return Err(wrong("FORMAT", other)),
        };
        let (size, turn) = resolution(&text_line(&mut source)?)?;
        Ok(Self { lines, is_xyz, size, turn })
    }

    /// Factor that undoes all EXPOSURE and COLORCORR lines.
    fn gain(&self) -> Result<[f64; 3], Fault> {
        let mut product = [1.0; 3];
        for (key, value) in &self.lines {
            let factors = match key.as_str() {
                "EXPOSURE" => numbers::<1>(key, value)?.repeat(3),
                "COLORCORR" => numbers::<3>(key, value)?.to_vec(),
                _ => continue,
            };
            for (p, f) in product.iter_mut().zip(factors) {
                if f <= 0.0 {
                    return Err(wrong(key, value));
                }
                *p *= f;
            }
        }
        let gain = product.map(f64::recip);
        if gain.iter().any(|g| !g.is_normal()) {
            return Err(wrong("EXPOSURE", &format!("{:e}", product[0])));
        }
        Ok(gain)
    }

    fn primaries(&self) -> Result<Option<Chromaticities>, Fault> {
        let line = self.lines.iter().rfind(|(key, _)| key == "PRIMARIES");
        let Some((key, value)) = line else { return Ok(None) };
        Ok(Some(Chromaticities::from_list(numbers(key, value)?)))
    }

    /// Height over width of a pixel, all PIXASPECT lines together.
    fn aspect(&self) -> Result<f64, Fault> {
        let mut product = 1.0;
        for (key, value) in self.lines.iter().filter(|(key, _)| key == "PIXASPECT") {
            product *= numbers::<1>(key, value)?[0];
        }
        Ok(product)
    }
}

/// A line without its end.
fn text_line(source: &mut impl BufRead) -> Result<String, Fault> {
    let mut line = Vec::new();
    source.read_until(b'\n', &mut line)?;
    if line.pop() != Some(b'\n') {
        return Err(Fault::decode(Format::Hdr, "its header does not end"));
    }
    line.pop_if(|c| *c == b'\r');
    Ok(String::from_utf8_lossy(&line).into_owned())
}

/// Length and number of the rows by a resolution string such as `-Y 480 +X 640`, and what brings them
/// upright. The axis that comes first is that of the rows.
fn resolution(line: &str) -> Result<([usize; 2], Orientation), Fault> {
    let damaged = || {
        let shown: String = line.chars().filter(|c| !c.is_control()).take(40).collect();
        Fault::decode(Format::Hdr, format!("its size `{shown}` makes no sense"))
    };
    let words: Vec<&str> = line.split_whitespace().collect();
    let [first, n_rows, second, length] = words[..] else { return Err(damaged()) };
    let turn = match (first, second) {
        ("-Y", "+X") => Orientation::NoTransforms,
        ("+Y", "+X") => Orientation::FlipVertical,
        ("-Y", "-X") => Orientation::FlipHorizontal,
        ("+Y", "-X") => Orientation::Rotate180,
        ("+X", "-Y") => Orientation::Rotate90FlipH,
        ("-X", "-Y") => Orientation::Rotate90,
        ("+X", "+Y") => Orientation::Rotate270,
        ("-X", "+Y") => Orientation::Rotate270FlipH,
        _ => return Err(damaged()),
    };
    let number = |text: &str| text.parse::<u32>().map_err(|_| damaged());
    Ok(([number(length)?, number(n_rows)?].map(|n| n as usize), turn))
}

/// The pixels in the order of the file.
fn pixels(source: &mut (impl Read + ?Sized), [length, n_rows]: [usize; 2]) -> Result<Vec<f32>, Fault> {
    let mut row = vec![[0; 4]; length];
    // No more is written to than the file has.
    let mut out = Vec::with_capacity(length * n_rows * 3);
    for y in 0..n_rows {
        decode_row(source, &mut row).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => Fault::decode(Format::Hdr, format!("it ends in row {y} of {n_rows}")),
            ErrorKind::InvalidData => Fault::decode(Format::Hdr, format!("row {y} of {n_rows}: {e}")),
            _ => Fault::Io(e),
        })?;
        out.extend(row.iter().flat_map(|&pixel| decoded(pixel)));
    }
    Ok(out)
}

/// Red, green and blue of three mantissas and their exponent.
fn decoded([r, g, b, exponent]: [u8; 4]) -> [f32; 3] {
    if exponent == 0 {
        return [0.0; 3];
    }
    // [Radiance] v = mantissa / 256 · 2^(exponent - 128)
    let scale = f64::exp2(f64::from(exponent) - 136.0);
    [r, g, b].map(|v| (f64::from(v) * scale) as f32)
}

fn decode_row(source: &mut (impl Read + ?Sized), row: &mut [[u8; 4]]) -> std::io::Result<()> {
    let first = array::<4>(source)?;
    let [a, b, high, low] = first;
    let is_new = [a, b] == [2, 2] && high < 128 && RUN_LENGTHS.contains(&row.len());
    if !is_new {
        return decode_old(source, first, row);
    }
    if usize::from(high) << 8 | usize::from(low) != row.len() {
        return Err(damaged("its length is not that of the picture"));
    }
    for component in 0..4 {
        let mut x = 0;
        while x < row.len() {
            let [count] = array(source)?;
            // [Radiance] over 128: a run of one value; else so many values
            let (n, is_run) = if count > 128 { (count - 128, true) } else { (count, false) };
            let end = x + usize::from(n);
            if n == 0 || end > row.len() {
                return Err(damaged("a run does not fit"));
            }
            let mut value = if is_run { array::<1>(source)?[0] } else { 0 };
            for pixel in &mut row[x..end] {
                if !is_run {
                    [value] = array(source)?;
                }
                pixel[component] = value;
            }
            x = end;
        }
    }
    Ok(())
}

/// The older method: a pixel of mantissas 1 repeats the one before it as often as its exponent says;
/// several of them in a row are digits to the base 256, the lowest first.
fn decode_old(source: &mut (impl Read + ?Sized), first: [u8; 4], row: &mut [[u8; 4]]) -> std::io::Result<()> {
    let (mut next, mut x, mut shift) = (first, 0_usize, 0);
    loop {
        if let [1, 1, 1, count] = next {
            let n = usize::from(count).checked_shl(shift).unwrap_or(usize::MAX);
            let (true, Some(end)) = (x > 0, x.checked_add(n).filter(|&end| end <= row.len())) else {
                return Err(damaged("a run does not fit"));
            };
            let before = row[x - 1];
            row[x..end].fill(before);
            x = end;
            shift += 8;
        } else {
            row[x] = next;
            x += 1;
            shift = 0;
        }
        if x == row.len() {
            return Ok(());
        }
        next = array(source)?;
    }
}

fn damaged(message: &'static str) -> std::io::Error {
    std::io::Error::new(ErrorKind::InvalidData, message)
}

fn numbers<const N: usize>(key: &str, value: &str) -> Result<[f64; N], Fault> {
    let parsed: Option<Vec<f64>> = value.split_whitespace().map(|v| v.parse().ok()).collect();
    let finite = parsed.filter(|list| list.iter().all(|v| v.is_finite()));
    finite.and_then(|list| list.try_into().ok()).ok_or_else(|| wrong(key, value))
}

fn wrong(key: &str, value: &str) -> Fault {
    let shown: String = value.trim().chars().filter(|c| !c.is_control()).take(40).collect();
    Fault::decode(Format::Hdr, format!("{key}={shown} makes no sense"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_decode_by_both_methods_and_as_they_are() {
        let row = |bytes: &[u8], n: usize| {
            let mut row = vec![[0; 4]; n];
            decode_row(&mut &*bytes, &mut row).map(|()| row)
        };
        let (a, b) = ([10, 20, 30, 128], [7, 7, 7, 130]);
        let flat: Vec<u8> = [a, b, b].concat();
        assert_eq!(row(&flat, 3).unwrap(), [a, b, b]);
        // A run of 2 + 256 · 1 behind the first.
        let old = [a, [1, 1, 1, 2], [1, 1, 1, 1], b].concat();
        let long = row(&old, 260).unwrap();
        assert!(long[..259].iter().all(|&p| p == a) && long[259] == b);
        // Eight of each component: a run of 7 and one value.
        let new =
            [&[2, 2, 0, 8][..], &[135, 10, 1, 7], &[135, 20, 1, 7], &[135, 30, 1, 7], &[135, 128, 1, 130]];
        let new = row(&new.concat(), 8).unwrap();
        assert!(new[..7].iter().all(|&p| p == a) && new[7] == b);
    }

    #[test]
    fn broken_rows_are_refused() {
        let row = |bytes: &[u8], n: usize| decode_row(&mut &*bytes, &mut vec![[0; 4]; n]).unwrap_err().kind();
        for (bytes, n) in [
            (&[2, 2, 0, 9, 0][..], 8),                  // another length
            (&[2, 2, 0, 8, 137, 5], 8),                 // a run of 9
            (&[2, 2, 0, 8, 0], 8),                      // a run of none
            (&[1, 1, 1, 3], 3),                         // a run of nothing
            (&[9, 9, 9, 9, 1, 1, 1, 3], 3),             // one too many
            (&[9, 9, 9, 9, 1, 1, 1, 0, 1, 1, 1, 1], 3), // 256 too many
        ] {
            assert_eq!(row(bytes, n), ErrorKind::InvalidData, "{bytes:?}");
        }
        assert_eq!(row(&[9, 9, 9, 9, 1, 1, 1], 3), ErrorKind::UnexpectedEof);
    }
}
