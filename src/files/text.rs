//! Reading of text files, and decoding of those that do not state their encoding.

use std::{
    borrow::Cow,
    fs::File,
    io::{self, ErrorKind, Read as _},
    path::Path,
};

use super::reach::MAX_TEXT_BYTES;

/// Reads a text file that the user names, which may be a pipe: UTF-8 of at most [`MAX_TEXT_BYTES`].
///
/// # Errors
/// When it cannot be read, is larger, or not UTF-8.
pub fn read(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    File::open(path)?.take(MAX_TEXT_BYTES + 1).read_to_string(&mut text)?;
    if text.len() as u64 > MAX_TEXT_BYTES {
        let message = format!("is larger than {MAX_TEXT_BYTES} bytes, the most that is read");
        return Err(io::Error::new(ErrorKind::FileTooLarge, message));
    }
    Ok(text)
}

/// Decodes text as UTF-16 when it begins with a byte order mark, else as UTF-8, else as
/// Latin-1, in which every byte is a character.
#[must_use]
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let utf16 = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = rest.chunks(2).map(|pair| unit([pair[0], pair.get(1).copied().unwrap_or(0)]));
        let chars = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(chars.collect())
    };
    match bytes {
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect()),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_an_error() {
        let error = read(Path::new("/dev/zero")).unwrap_err();
        assert!(error.to_string().contains("larger than 67108864 bytes"), "{error}");
    }

    #[test]
    fn encodings_are_told_apart() {
        for bytes in [&b"\xfe\xff\0f\0\xfc"[..], b"\xff\xfef\0\xfc\0", "fü".as_bytes(), b"f\xfc"] {
            assert_eq!(decode(bytes), "fü", "{bytes:?}");
        }
        assert_eq!(decode(b"\xfe\xff\0f\0"), "f\0");
    }
}
