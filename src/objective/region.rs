//! The two regions of a picture: the main object and everything else.

use super::ObjectiveError;

/// A part of the picture over which a term is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Region {
    /// The pixels of the main object.
    Object,
    /// All other pixels.
    Background,
}

/// Mask of the main object, row-major with the top row first, and the number of its pixels.
#[derive(Clone, Debug)]
pub(super) struct Regions {
    width: usize,
    height: usize,
    mask: Vec<bool>,
    n_object: usize,
}

impl Regions {
    /// Regions of a picture of `width` × `height` pixels; `mask` is true on the object and has a
    /// value for every pixel. Either region may be empty.
    pub(super) fn new(width: usize, height: usize, mask: &[bool]) -> Self {
        let n_object = mask.iter().filter(|&&object| object).count();
        Self { width, height, mask: mask.to_vec(), n_object }
    }

    /// Regions that both have pixels, of a mask that fits the size.
    ///
    /// # Errors
    /// When the picture is empty, the mask has another size, or a region has no pixel.
    pub(super) fn checked(width: usize, height: usize, mask: &[bool]) -> Result<Self, ObjectiveError> {
        if width == 0 || height == 0 {
            return Err(ObjectiveError::EmptyPicture { width, height });
        }
        if width.checked_mul(height) != Some(mask.len()) {
            return Err(ObjectiveError::MaskSize { mask: mask.len(), width, height });
        }
        if !mask.contains(&true) {
            return Err(ObjectiveError::EmptyObject);
        }
        if !mask.contains(&false) {
            return Err(ObjectiveError::EmptyBackground);
        }
        Ok(Self::new(width, height, mask))
    }

    /// Width of the picture, pixels.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Height of the picture, pixels.
    pub(super) fn height(&self) -> usize {
        self.height
    }

    /// Whether each pixel belongs to the object, row-major.
    pub(super) fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Number of pixels of the picture.
    pub(super) fn n_pixels(&self) -> f64 {
        self.mask.len() as f64
    }

    /// Number of pixels of a region.
    pub(super) fn count(&self, region: Region) -> f64 {
        match region {
            Region::Object => self.n_object as f64,
            Region::Background => (self.mask.len() - self.n_object) as f64,
        }
    }
}
