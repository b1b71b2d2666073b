//! Chroma of a picture, as a display shows it: planes of a and b of Oklab behind that of luminance.

pub mod histogram;

pub use histogram::CHROMA_BINS;

/// An axis of chroma.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    /// a: red against green.
    A,
    /// b: yellow against blue.
    B,
}

impl Axis {
    /// Both axes.
    pub(super) const ALL: [Self; 2] = [Self::A, Self::B];

    /// Index of the axis's plane in a picture.
    pub(super) fn plane(self) -> usize {
        1 + self as usize
    }
}
