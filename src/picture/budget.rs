//! What reading a picture may take: the one check of all readers, made from the size that the
//! header states, before anything is reserved or decoded.

use thiserror::Error;

/// Most memory that reading one picture takes, bytes: its samples as decoded, what the decoder
/// needs beside them, and the form in which they are kept. 1 GiB holds a photograph of
/// 119 megapixels as the decoder of progressive JPEG works, a texture of 16384² pixels in 8 bits,
/// or 8192 x 4096 pixels of an environment in floating point, read and kept.
pub const PICTURE_BUDGET: u64 = 1 << 30;

/// Most pixels of a picture: 2²⁸, which decoding and measuring go through in seconds.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Most memory for what a picture file holds beside its pixels, bytes: colour profiles and
/// texts are a hundredth of it.
pub const METADATA_BUDGET: u64 = 1 << 26;

/// A picture of a size that is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SizeError {
    /// No pixels.
    #[error("the picture has no pixels, its size is {0} x {1}")]
    Empty(u64, u64),
    /// Too many pixels.
    #[error("{0} x {1} pixels are over the limit of {MAX_PIXELS}; make the picture smaller")]
    Pixels(u64, u64),
    /// Too many bytes.
    #[error(
        "{width} x {height} pixels take {needed} MiB to read, over the limit of {} MiB; make the picture \
         smaller", PICTURE_BUDGET >> 20
    )]
    Bytes {
        /// Width, pixels.
        width: u64,
        /// Height, pixels.
        height: u64,
        /// What it would take, MiB.
        needed: u64,
    },
    /// Too large a file of a format that is read as a whole.
    #[error("the file has {0} bytes, over the limit of {PICTURE_BUDGET}")]
    File(u64),
    /// Too large a piece of a file.
    #[error(
        "a block of the file takes {needed} MiB to decode, over the limit of {} MiB; save it again in \
         smaller tiles or with ZIP compression", PICTURE_BUDGET >> 20
    )]
    Block {
        /// What it would take, MiB.
        needed: u64,
    },
}

/// The number of pixels of a picture of a width and height, of which each takes so many bytes.
///
/// # Errors
/// When there are none, or more than the budget allows.
pub fn check([width, height]: [u64; 2], bytes_per_pixel: u64) -> Result<usize, SizeError> {
    let pixels = match width.checked_mul(height) {
        Some(0) => return Err(SizeError::Empty(width, height)),
        Some(n) if n <= MAX_PIXELS => n,
        _ => return Err(SizeError::Pixels(width, height)),
    };
    let bytes = pixels.saturating_mul(bytes_per_pixel);
    if bytes > PICTURE_BUDGET {
        return Err(SizeError::Bytes { width, height, needed: bytes.div_ceil(1 << 20) });
    }
    Ok(pixels as usize)
}

/// Whether a file that is read as a whole fits.
///
/// # Errors
/// When it does not.
pub fn check_file(bytes: u64) -> Result<(), SizeError> {
    if bytes > PICTURE_BUDGET { Err(SizeError::File(bytes)) } else { Ok(()) }
}

/// Whether a block that is decoded at once fits.
///
/// # Errors
/// When it does not.
pub fn check_block(bytes: u64) -> Result<(), SizeError> {
    if bytes > PICTURE_BUDGET { Err(SizeError::Block { needed: bytes.div_ceil(1 << 20) }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_bounded_without_overflow() {
        assert_eq!(check([16_384, 16_384], 4), Ok(1 << 28));
        assert_eq!(
            check([16_384, 16_384], 5),
            Err(SizeError::Bytes { width: 16_384, height: 16_384, needed: 1280 })
        );
        assert_eq!(check([0, 7], 4), Err(SizeError::Empty(0, 7)));
        assert_eq!(check([1 << 28, 2], 1), Err(SizeError::Pixels(1 << 28, 2)));
        assert_eq!(check([u64::MAX, 3], u64::MAX), Err(SizeError::Pixels(u64::MAX, 3)));
        assert!(check_block(PICTURE_BUDGET).is_ok() && check_block(PICTURE_BUDGET + 1).is_err());
    }
}
