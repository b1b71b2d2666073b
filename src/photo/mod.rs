//! Photographs as looks: their statistics, and signatures learned from them.
//!
//! A photograph is measured as a rendered picture is. It is turned upright, reduced in linear
//! light by a box filter to at most a stated number of pixels a side, and encoded as display
//! luminance, of which statistics and cumulated histogram are taken as
//! [`objective`](crate::objective) defines them. The gradient g, and a little the standard
//! deviations and the histogram, depend on that number of pixels; only pictures of about equal
//! size compare.

pub mod barycentre;
pub mod folder;
pub mod learn;
pub mod look;
pub mod reduce;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::film::exr::{ExrError, ExrImage, read_exr};
use crate::film::image_file::{
    ImageFileError, LinearImage, MaskImage, exr_beauty, exr_mask, is_exr, read_image, read_mask, stored_mask,
};
use crate::math::display::luminance;
use crate::objective::histogram::Cumulated;
use crate::objective::{LuminanceMode, ObjectiveError, Statistics};
use reduce::{box_filter, reduced_size};

pub use look::Look;

/// Why a photograph cannot be measured.
#[derive(Debug, Error)]
pub enum PhotoError {
    /// A photograph or a mask cannot be read.
    #[error(transparent)]
    File(#[from] ImageFileError),
    /// An EXR file cannot be read.
    #[error(transparent)]
    Exr(#[from] ExrError),
    /// A pixel is not a number.
    #[error("{path}: the pixel at column {x}, row {y} is not a number", path = path.display())]
    NotANumber {
        /// Path of the photograph.
        path: PathBuf,
        /// Column of the pixel, from 0.
        x: usize,
        /// Row of the pixel, from 0.
        y: usize,
    },
    /// A mask has another size than its photograph.
    #[error(
        "{mask}: the mask has {} x {} pixels, {photo} {} x {} (upright); they must be of one size",
        mask_size[0], mask_size[1], photo_size[0], photo_size[1],
        mask = mask.display(), photo = photo.display()
    )]
    MaskSize {
        /// Path of the mask.
        mask: PathBuf,
        /// Width and height of the mask, pixels.
        mask_size: [usize; 2],
        /// Path of the photograph.
        photo: PathBuf,
        /// Width and height of the upright photograph, pixels.
        photo_size: [usize; 2],
    },
    /// A reduced mask leaves no pixel to the object or none to the background.
    #[error("{mask}: reduced to {} x {} pixels", size[0], size[1], mask = mask.display())]
    Mask {
        /// Path of the mask, or of the EXR file that stores it.
        mask: PathBuf,
        /// Width and height after reduction, pixels.
        size: [usize; 2],
        /// Condition that the mask violates.
        #[source]
        source: ObjectiveError,
    },
}

/// The mask of a photograph's main object.
#[derive(Clone, Debug)]
struct Mask {
    /// Path of the mask, or of the EXR file that stores it.
    path: PathBuf,
    /// Share of each pixel that the object covers, in [0, 1], row-major.
    coverage: Vec<f64>,
}

/// The luminance of a photograph and the mask of its main object.
#[derive(Clone, Debug)]
pub struct Photo {
    /// Width and height of the upright photograph, pixels.
    size: [usize; 2],
    /// Linear luminance times exposure of each pixel, row-major.
    luminance: Vec<f64>,
    /// Mask of the main object, when it is known.
    mask: Option<Mask>,
}

impl Photo {
    /// Reads a photograph and, if given, the mask of its main object: a picture of the size of
    /// the upright photograph that is white on the object.
    ///
    /// Pictures of 8 and 16 bits a channel are taken as sRGB-encoded, floating point as linear.
    /// An EXR file of this program brings its exposure and, without `mask`, its mask.
    ///
    /// # Errors
    /// When a file is not a picture, the sizes differ, or a pixel is not a number.
    pub fn read(path: &Path, mask: Option<&Path>) -> Result<Self, PhotoError> {
        let exr = if is_exr(path)? { Some(read_exr(path)?) } else { None };
        let LinearImage { width, height, rgb } = match &exr {
            Some(exr) => exr_beauty(path, exr)?,
            None => read_image(path)?,
        };
        let exposure = exr.as_ref().and_then(stored_exposure).unwrap_or(1.0);
        let luminance: Vec<f64> = rgb.iter().map(|&c| exposure * luminance(c)).collect();
        if let Some(i) = luminance.iter().position(|y| y.is_nan()) {
            return Err(PhotoError::NotANumber { path: path.to_owned(), x: i % width, y: i / width });
        }
        let mask = match (mask, &exr) {
            (Some(mask), _) => Some((mask, read_mask(mask)?)),
            (None, Some(exr)) if stored_mask(exr).is_some() => Some((path, exr_mask(path, exr)?)),
            (None, _) => None,
        };
        let mask =
            mask.map(|(mask_path, mask)| fitting(mask_path, &mask, path, [width, height])).transpose()?;
        Ok(Self { size: [width, height], luminance, mask })
    }

    /// Width and height of the upright photograph, pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Whether the photograph's main object is known.
    #[must_use]
    pub fn has_mask(&self) -> bool {
        self.mask.is_some()
    }

    /// The photograph reduced to at most `longest` pixels a side, each pixel the mean of linear
    /// light over its area. A smaller photograph stays as it is.
    ///
    /// # Panics
    /// When `longest` is 0.
    #[must_use]
    pub fn reduced(&self, longest: usize) -> Self {
        let to = reduced_size(self.size, longest);
        let filter = |values: &[f64]| box_filter(values, self.size, to);
        let mask = self.mask.as_ref().map(|m| Mask { path: m.path.clone(), coverage: filter(&m.coverage) });
        Self { size: to, luminance: filter(&self.luminance), mask }
    }

    /// Display luminance of every pixel, row-major.
    #[must_use]
    pub fn display_luminance(&self, mode: LuminanceMode) -> Vec<f64> {
        // The exposure is in the luminance already.
        self.luminance.iter().map(|&y| mode.encode(y, 1.0)).collect()
    }

    /// Cumulated histogram of the display luminance.
    #[must_use]
    pub fn cumulated(&self, mode: LuminanceMode) -> Cumulated {
        let [width, height] = self.size;
        Statistics::measure_whole(&self.display_luminance(mode), width, height).cumulated()
    }

    /// Statistics of the photograph. With a mask, a pixel is object when at least half of it is
    /// covered; without, they are those of the [whole](Statistics::measure_whole) photograph.
    ///
    /// # Errors
    /// When the mask leaves no pixel to the object or to the background.
    pub fn measure(&self, mode: LuminanceMode) -> Result<Statistics, PhotoError> {
        let l = self.display_luminance(mode);
        let [width, height] = self.size;
        let Some(mask) = &self.mask else {
            return Ok(Statistics::measure_whole(&l, width, height));
        };
        let object: Vec<bool> = mask.coverage.iter().map(|&c| c >= 0.5).collect();
        Statistics::measure(&l, width, height, &object).map_err(|source| PhotoError::Mask {
            mask: mask.path.clone(),
            size: self.size,
            source,
        })
    }
}

/// Exposure that an EXR file of this program states.
fn stored_exposure(exr: &ExrImage) -> Option<f64> {
    let exposure = exr.lightopt.as_ref()?.get("exposure")?.as_f64()?;
    (exposure > 0.0).then_some(exposure)
}

/// The mask read from `path`, when it has the photograph's size.
fn fitting(path: &Path, mask: &MaskImage, photo: &Path, size: [usize; 2]) -> Result<Mask, PhotoError> {
    let mask_size = [mask.width, mask.height];
    if mask_size != size {
        let (mask, photo) = (path.to_owned(), photo.to_owned());
        return Err(PhotoError::MaskSize { mask, mask_size, photo, photo_size: size });
    }
    let coverage = mask.object.iter().map(|&object| f64::from(u8::from(object))).collect();
    Ok(Mask { path: path.to_owned(), coverage })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::image_file::{write_mask_png, write_png};
    use crate::math::display::{eotf_srgb, oetf_srgb};

    #[test]
    fn light_is_averaged_before_it_is_encoded_and_masks_are_by_majority() {
        let directory = tempfile::tempdir().unwrap();
        let (path, mask_path) = (directory.path().join("a.png"), directory.path().join("m.png"));
        // Columns black, white, white, black, …: pairs average to half the light.
        let (width, height) = (8, 4);
        let white = |i: usize| (i % width) % 4 == 1 || (i % width) % 4 == 2;
        let rgb = (0..width * height).map(|i| [f32::from(u8::from(white(i))); 3]).collect();
        write_png(&path, &LinearImage { width, height, rgb }, 1.0).unwrap();
        let object = (0..width * height).map(|i| i % width < 3 && i / width < 3).collect();
        write_mask_png(&mask_path, &MaskImage { width, height, object }).unwrap();

        let photo = Photo::read(&path, Some(&mask_path)).unwrap().reduced(4);
        assert_eq!(photo.size(), [4, 2]);
        for l in photo.display_luminance(LuminanceMode::Srgb) {
            assert!((l - oetf_srgb(0.5)).abs() < 1e-6, "{l}");
        }
        // Of 2 × 2 pixels: 4, 2, 2 and 1 are object in the four corners of the object.
        let object: Vec<bool> = photo.mask.unwrap().coverage.iter().map(|&c| c >= 0.5).collect();
        assert_eq!(object, [true, true, false, false, true, false, false, false]);
    }

    #[test]
    fn a_small_photograph_measures_as_a_picture_does_to_the_bit() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let rgb = (0..60).map(|i| [i as f32 / 60.0, 0.3, eotf_srgb(0.5) as f32]).collect();
        write_png(&path, &LinearImage { width: 10, height: 6, rgb }, 1.0).unwrap();
        let l = Photo::read(&path, None).unwrap().reduced(10).display_luminance(LuminanceMode::Srgb);
        assert_eq!(l, LuminanceMode::Srgb.encode_image(&read_image(&path).unwrap().rgb, 1.0));
    }
}
