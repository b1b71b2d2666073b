//! What a Targa file says about its alpha.

use std::io::{BufRead, Read, Seek, SeekFrom};

use super::format::TGA_FOOTER;
use super::{Alpha, Fault};

/// Bytes of the footer: two offsets and the signature.
const FOOTER: i64 = 26;

/// Offset of the attributes type within the extension area.
const ATTRIBUTES_TYPE: u64 = 494;

/// The meaning of the alpha channel: the attribute bits of the header, and the attributes type of
/// version 2 (\[TGA2\] field 24). `None` when what stands there is no transparency.
pub(super) fn alpha(source: &mut (impl BufRead + Seek + ?Sized)) -> Result<Option<Alpha>, Fault> {
    let mut header = [0; 18];
    source.seek(SeekFrom::Start(0))?;
    if source.read_exact(&mut header).is_err() || header[17] & 0x0f == 0 {
        return Ok(None);
    }
    Ok(match attributes_type(source)? {
        Some(1 | 2) => None,
        Some(4) => Some(Alpha::Premultiplied),
        _ => Some(Alpha::Straight),
    })
}

fn attributes_type(source: &mut (impl Read + Seek + ?Sized)) -> Result<Option<u8>, Fault> {
    let length = source.seek(SeekFrom::End(0))?;
    if length < FOOTER.cast_unsigned() {
        return Ok(None);
    }
    let mut footer = [0; FOOTER as usize];
    source.seek(SeekFrom::End(-FOOTER))?;
    source.read_exact(&mut footer)?;
    let [a, b, c, d, ..] = footer;
    let extension = u64::from(u32::from_le_bytes([a, b, c, d]));
    let is_there = footer.ends_with(TGA_FOOTER) && extension > 0;
    if !is_there || extension + ATTRIBUTES_TYPE >= length {
        return Ok(None);
    }
    let mut kind = [0];
    source.seek(SeekFrom::Start(extension + ATTRIBUTES_TYPE))?;
    source.read_exact(&mut kind)?;
    Ok(Some(kind[0]))
}
