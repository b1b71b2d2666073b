//! The two regions of a picture: the main object and everything else.

use super::ObjectiveError;

/// Which pixels belong to the object, with the counts. Row-major, top row first.
#[derive(Clone, Debug)]
pub(super) struct Regions {
    width: usize,
    height: usize,
    mask: Vec<bool>,
    n_object: usize,
}

impl Regions {
    /// `mask.len()` must be `width · height`.
    pub(super) fn new(width: usize, height: usize, mask: &[bool]) -> Self {
        let n_object = mask.iter().filter(|&&object| object).count();
        Self { width, height, mask: mask.to_vec(), n_object }
    }

    /// Regions that both have pixels, of a mask that fits the size.
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

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn height(&self) -> usize {
        self.height
    }

    pub(super) fn mask(&self) -> &[bool] {
        &self.mask
    }

    pub(super) fn n_pixels(&self) -> f64 {
        self.mask.len() as f64
    }

    pub(super) fn n_object(&self) -> f64 {
        self.n_object as f64
    }

    pub(super) fn n_background(&self) -> f64 {
        (self.mask.len() - self.n_object) as f64
    }
}
