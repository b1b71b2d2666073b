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
    /// Share in [0, 1] with which each pixel belongs to the object; `None` where that is what the mask says.
    weights: Option<Vec<f64>>,
    /// Sums of the shares of the object and of the background.
    counts: [f64; 2],
}

impl Regions {
    /// Regions of a picture of `width` × `height` pixels; `mask` is true on the object and has a
    /// value for every pixel. Either region may be empty.
    pub(super) fn new(width: usize, height: usize, mask: &[bool]) -> Self {
        let n_object = mask.iter().filter(|&&object| object).count();
        let counts = [n_object, mask.len() - n_object].map(|n| n as f64);
        Self { width, height, mask: mask.to_vec(), weights: None, counts }
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

    /// Regions to which every pixel belongs with a share in [0, 1], which both have some of.
    ///
    /// # Errors
    /// When the picture is empty, there is not a share for every pixel, or a region has none.
    pub(super) fn weighted(width: usize, height: usize, weights: &[f64]) -> Result<Self, ObjectiveError> {
        if width == 0 || height == 0 {
            return Err(ObjectiveError::EmptyPicture { width, height });
        }
        if width.checked_mul(height) != Some(weights.len()) {
            return Err(ObjectiveError::MaskSize { mask: weights.len(), width, height });
        }
        let object = weights.iter().sum::<f64>();
        let background = weights.iter().map(|w| 1.0 - w).sum::<f64>();
        // Less than a pixel is nothing to measure.
        if object < 1.0 {
            return Err(ObjectiveError::EmptyObject);
        }
        if background < 1.0 {
            return Err(ObjectiveError::EmptyBackground);
        }
        let mask = weights.iter().map(|&w| w >= 0.5).collect();
        Ok(Self { width, height, mask, weights: Some(weights.to_vec()), counts: [object, background] })
    }

    /// Share with which each pixel belongs to the object; `None` where that is what the mask says.
    pub(super) fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
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

    /// Number of pixels of a region, or the sum of their shares.
    pub(super) fn count(&self, region: Region) -> f64 {
        self.counts[region as usize]
    }
}
