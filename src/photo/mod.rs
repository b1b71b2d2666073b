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
pub mod weights;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::film::image_file::{MaskImage, read_mask};
use crate::math::Measure;
use crate::objective::histogram::Cumulated;
use crate::objective::{LuminanceMode, ObjectiveError, Statistics};
use crate::picture::{Note, Picture, PictureError, Purpose, Reading, Samples};
use reduce::{box_filter, reduced_size};

pub use look::{Look, Matched};

/// Why a photograph cannot be measured.
#[derive(Debug, Error)]
pub enum PhotoError {
    /// A photograph cannot be read.
    #[error(transparent)]
    File(#[from] PictureError),
    /// A mask cannot be read.
    #[error(transparent)]
    MaskFile(PictureError),
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

/// A photograph as its file has it, in full size.
#[derive(Clone, Debug)]
pub struct Photo {
    picture: Picture,
    exposure: f64,
    /// The mask of its main object, and the file of that.
    mask: Option<(PathBuf, MaskImage)>,
}

impl Photo {
    /// Reads a photograph and, if given, the mask of its main object: a picture of the size of the
    /// upright photograph that is white on the object, or transparent around it. An EXR of several
    /// layers is read as `layer`, by default as the one that is the picture.
    ///
    /// An EXR of this program brings its exposure and, if `mask` is none, its mask.
    ///
    /// # Errors
    /// When a file is no picture, the sizes differ, or a pixel is not a number.
    pub fn read(path: &Path, mask: Option<&Path>, layer: Option<&str>) -> Result<Self, PhotoError> {
        let reading = Reading { layer, own_mask: mask.is_none(), ..Reading::of(Purpose::Light) };
        let mut picture = Picture::read(path, &reading)?;
        let (width, height) = (picture.width, picture.height);
        let is_float = matches!(picture.samples, Samples::F32(_));
        let strange = (0..picture.n_pixels()).find(|&i| is_float && picture.luminance(i).is_nan());
        if let Some(i) = strange {
            return Err(PhotoError::NotANumber { path: path.to_owned(), x: i % width, y: i / width });
        }
        let attribute = picture.our_attribute(path)?;
        let stored = attribute.as_ref().and_then(|a| a.get("exposure")?.as_f64());
        let exposure = stored.filter(|&e| e > 0.0).unwrap_or(1.0);
        let own = picture.mask.take().map(|m| MaskImage::of_samples([width, height], &m));
        let mask = match mask {
            Some(mask) => Some((mask.to_owned(), read_mask(mask).map_err(PhotoError::MaskFile)?)),
            None => own.map(|own| (path.to_owned(), own)),
        };
        if let Some((file, mask)) = &mask
            && [mask.width, mask.height] != [width, height]
        {
            return Err(PhotoError::MaskSize {
                mask: file.clone(),
                mask_size: [mask.width, mask.height],
                photo: path.to_owned(),
                photo_size: [width, height],
            });
        }
        Ok(Self { picture, exposure, mask })
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.picture.width, self.picture.height]
    }

    /// Whether the main object is known.
    #[must_use]
    pub fn has_mask(&self) -> bool {
        self.mask.is_some()
    }

    /// What people should hear of how it was read.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.picture.notes
    }

    /// The photograph with at most `longest` pixels a side: means of linear light over the
    /// area of each new pixel. Smaller ones stay as they are.
    ///
    /// # Panics
    /// When `longest` is 0.
    #[must_use]
    pub fn reduced(&self, longest: usize) -> Reduced {
        let (from, to) = (self.size(), reduced_size(self.size(), longest));
        let luminance = box_filter(|i| self.exposure * self.picture.luminance(i), from, to);
        let channel =
            |c: usize| box_filter(|i| self.exposure * f64::from(self.picture.over_black(i)[c]), from, to);
        let mask = self.mask.as_ref().map(|(path, mask)| Mask {
            path: path.clone(),
            coverage: box_filter(|i| f64::from(u8::from(mask.object[i])), from, to),
        });
        Reduced { size: to, luminance, channels: [0, 1, 2].map(channel), mask }
    }
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
pub struct Reduced {
    /// Width and height, pixels.
    size: [usize; 2],
    /// Linear luminance times exposure of each pixel, row-major.
    luminance: Vec<f64>,
    /// Linear red, green and blue times exposure of each pixel, row-major.
    channels: [Vec<f64>; 3],
    /// Mask of the main object, when it is known.
    mask: Option<Mask>,
}

impl Reduced {
    /// Width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Display luminance of every pixel.
    #[must_use]
    pub fn display_luminance(&self, mode: LuminanceMode) -> Vec<f64> {
        // The exposure is in the luminance already.
        self.luminance.iter().map(|&y| mode.encode(y, 1.0)).collect()
    }

    /// Display luminance of every pixel, and behind it planes of a and b of Oklab.
    fn shown(&self, mode: LuminanceMode) -> Vec<f64> {
        let mut shown = self.display_luminance(mode);
        let [red, green, blue] = &self.channels;
        let rgb = red.iter().zip(green).zip(blue).map(|((r, g), b)| [*r, *g, *b].map(|v| v as f32));
        let chroma: Vec<[f64; 2]> = rgb.map(|rgb| Measure::default().chroma(rgb, 1.0)).collect();
        [0, 1].into_iter().for_each(|k| shown.extend(chroma.iter().map(|c| c[k])));
        shown
    }

    /// Cumulated histogram of the display luminance.
    #[must_use]
    pub fn cumulated(&self, mode: LuminanceMode) -> Cumulated {
        let [width, height] = self.size;
        Statistics::measure_whole(&self.display_luminance(mode), width, height).cumulated()
    }

    /// Statistics of the whole photograph, whether it has a mask or not.
    #[must_use]
    pub fn measure_whole(&self, mode: LuminanceMode) -> Statistics {
        let [width, height] = self.size;
        Statistics::measure_whole(&self.shown(mode), width, height)
    }

    /// Statistics of the photograph. With a mask, a pixel is object when at least half of it is
    /// covered; without, they are those of the [whole](Statistics::measure_whole) photograph.
    ///
    /// # Errors
    /// When the mask leaves no pixel to the object or to the background.
    pub fn measure(&self, mode: LuminanceMode) -> Result<Statistics, PhotoError> {
        let l = self.shown(mode);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::image_file::{LinearImage, read_image, write_mask_png, write_png};
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

        let photo = Photo::read(&path, Some(&mask_path), None).unwrap().reduced(4);
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
        let l = Photo::read(&path, None, None).unwrap().reduced(10).display_luminance(LuminanceMode::Srgb);
        assert_eq!(l, LuminanceMode::Srgb.encode_image(&read_image(&path).unwrap().rgb, 1.0));
    }
}
