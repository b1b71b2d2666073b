//! The samples of a picture as its decoder gives them.

use image::metadata::Orientation;

/// One to four interleaved channels, row by row from the top left: grey, grey and alpha, RGB, or
/// RGB and alpha.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Samples of 8 bits, of which 255 stands for 1.
    U8(Vec<u8>),
    /// Samples of 16 bits, of which 65535 stands for 1.
    U16(Vec<u16>),
    /// Floating point.
    F32(Vec<f32>),
}

impl Samples {
    /// Bytes of a sample.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::U8(_) => 1,
            Self::U16(_) => 2,
            Self::F32(_) => 4,
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(s) => s.len(),
            Self::U16(s) => s.len(),
            Self::F32(s) => s.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Turns a picture of the given size and channels upright; the new size beside it.
    #[must_use]
    pub fn upright(self, size: [usize; 2], channels: usize, turn: Orientation) -> (Self, [usize; 2]) {
        if turn == Orientation::NoTransforms {
            return (self, size);
        }
        let to = if swaps(turn) { [size[1], size[0]] } else { size };
        let samples = match self {
            Self::U8(s) => Self::U8(turned(&s, size, to, channels, turn)),
            Self::U16(s) => Self::U16(turned(&s, size, to, channels, turn)),
            Self::F32(s) => Self::F32(turned(&s, size, to, channels, turn)),
        };
        (samples, to)
    }
}

fn swaps(turn: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(turn, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

fn turned<T: Copy>(
    from: &[T],
    [width, height]: [usize; 2],
    to: [usize; 2],
    channels: usize,
    turn: Orientation,
) -> Vec<T> {
    use Orientation::{
        FlipHorizontal, FlipVertical, NoTransforms, Rotate90, Rotate90FlipH, Rotate180, Rotate270,
        Rotate270FlipH,
    };
    let (right, bottom) = (width - 1, height - 1);
    // Where a pixel of the result comes from.
    let source = |x: usize, y: usize| match turn {
        NoTransforms => [x, y],
        FlipHorizontal => [right - x, y],
        Rotate180 => [right - x, bottom - y],
        FlipVertical => [x, bottom - y],
        Rotate90FlipH => [y, x],
        Rotate90 => [y, bottom - x],
        Rotate270FlipH => [right - y, bottom - x],
        Rotate270 => [right - y, x],
    };
    let mut out = Vec::with_capacity(from.len());
    for y in 0..to[1] {
        for x in 0..to[0] {
            let [i, j] = source(x, y);
            out.extend_from_slice(&from[(j * width + i) * channels..][..channels]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, GrayAlphaImage};

    #[test]
    fn pictures_turn_as_exif_means_it() {
        let pixels: Vec<u8> = (0..24).collect();
        for exif in 1..=8 {
            let turn = Orientation::from_exif(exif).unwrap();
            let picture = GrayAlphaImage::from_raw(4, 3, pixels.clone()).unwrap();
            let mut want = DynamicImage::ImageLumaA8(picture);
            want.apply_orientation(turn);
            let (got, size) = Samples::U8(pixels.clone()).upright([4, 3], 2, turn);
            assert_eq!(size, [want.width() as usize, want.height() as usize], "{exif}");
            assert_eq!(got, Samples::U8(want.into_bytes()), "{exif}");
        }
    }
}
