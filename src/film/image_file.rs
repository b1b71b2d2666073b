//! Pictures and masks as plain arrays: read by [`crate::picture`], written as PNG and EXR.

use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use thiserror::Error;

use super::exr::{ExrError, ExrImage, ExrPart, write_exr};
use crate::files::atomic::{AtomicWriteError, write_atomically};
use crate::files::number::Number;
use crate::lighting::MAX_RADIANCE;
use crate::math::{ViewTransform, display::LUMINANCE_WEIGHTS};
use crate::picture::{Picture, PictureError, Purpose, Reading};

/// A picture in linear Rec.709 RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Colour of each pixel, row-major from the top left.
    pub rgb: Vec<[f32; 3]>,
}

/// A picture that tells which pixels show the main object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskImage {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Whether each pixel shows the main object, row-major from the top left.
    pub object: Vec<bool>,
}

/// Why a picture file cannot be written.
#[derive(Debug, Error)]
pub enum ImageFileError {
    /// The encoder refuses the picture.
    #[error("{path}: cannot write the picture", path = .path.display())]
    Encode {
        /// Path of the file.
        path: PathBuf,
        /// Error of the encoder.
        #[source]
        source: image::ImageError,
    },
    /// A finished file cannot be brought to its place.
    #[error(transparent)]
    File(#[from] AtomicWriteError),
    /// An EXR file cannot be written.
    #[error(transparent)]
    Exr(#[from] ExrError),
    /// The number of pixels does not fit the size, or the format cannot hold the size.
    #[error("{path}: {pixels} pixels for a picture of {width} x {height}", path = .path.display())]
    Size {
        /// Path of the file.
        path: PathBuf,
        /// Number of pixels given.
        pixels: usize,
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
}

impl LinearImage {
    /// The light of a picture that has been read, before black.
    #[must_use]
    pub fn of(picture: &Picture) -> Self {
        let rgb = (0..picture.n_pixels()).map(|i| picture.over_black(i)).collect();
        Self { width: picture.width, height: picture.height, rgb }
    }

    /// Bytes that are kept of a pixel.
    pub const PIXEL: usize = 12;
}

/// A pixel that is no radiance.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "the pixel at column {x}, row {y} is {}; a radiance is finite and at most {MAX_RADIANCE:e}",
    Number(*value)
)]
pub struct NoRadiance {
    /// Column, from 0.
    pub x: usize,
    /// Row, from 0.
    pub y: usize,
    /// The first of its channels that is not finite or larger than [`MAX_RADIANCE`].
    pub value: f32,
}

impl LinearImage {
    /// Puts 0 in the place of negative values, which resampling leaves beside bright pixels, and
    /// says how many there were and the least of them.
    ///
    /// # Errors
    /// With the first pixel that is not finite or larger than [`MAX_RADIANCE`].
    pub fn make_radiance(&mut self) -> Result<Option<String>, NoRadiance> {
        let place = |i: usize| (i / 3 % self.width, i / 3 / self.width);
        let (mut count, mut least) = (0, (0, 0.0));
        for (i, v) in self.rgb.as_flattened_mut().iter_mut().enumerate() {
            if !(f32::MIN..=MAX_RADIANCE).contains(v) {
                let (x, y) = place(i);
                return Err(NoRadiance { x, y, value: *v });
            }
            if *v < 0.0 {
                count += 1;
                if *v < least.1 {
                    least = (i, *v);
                }
                *v = 0.0;
            }
        }
        let ((x, y), value) = (place(least.0), least.1);
        let are = if count == 1 { "value is" } else { "values are" };
        Ok((count > 0).then(|| {
            format!("{count} {are} negative and read as 0; the least, {value}, is at column {x}, row {y}")
        }))
    }
}

impl MaskImage {
    /// The object in a picture that has been read as a mask.
    ///
    /// Where the picture is transparent in places, the object is where it is opaque (alpha at
    /// least one half), whatever its colours; else it is where the picture is bright (its numbers
    /// at least half of white).
    #[must_use]
    pub fn of(picture: &Picture) -> Self {
        let pixels = 0..picture.n_pixels();
        let is_cutout = picture.has_alpha() && pixels.clone().any(|i| picture.stored(i)[3] < 0.5);
        let is_object = |i: usize| {
            let [r, g, b, a] = picture.stored(i);
            let bright: f64 = LUMINANCE_WEIGHTS.iter().zip([r, g, b]).map(|(w, v)| w * v).sum();
            if is_cutout { a >= 0.5 } else { bright >= 0.5 }
        };
        let object = pixels.map(is_object).collect();
        Self { width: picture.width, height: picture.height, object }
    }

    /// The object of a channel that is 1 there.
    #[must_use]
    pub fn of_samples([width, height]: [usize; 2], samples: &[f32]) -> Self {
        Self { width, height, object: samples.iter().map(|&v| v >= 0.5).collect() }
    }
}

/// Reads any known picture as linear RGB.
///
/// # Errors
/// When the file is missing, no picture, or larger than a picture may be.
pub fn read_image(path: &Path) -> Result<LinearImage, PictureError> {
    let reading = Reading { kept: LinearImage::PIXEL, ..Reading::of(Purpose::Light) };
    Ok(LinearImage::of(&Picture::read(path, &reading)?))
}

/// Reads a mask; of an EXR the channel `mask` or the only one, where it has such a channel.
///
/// # Errors
/// When the file is missing, no picture, or larger than a picture may be.
pub fn read_mask(path: &Path) -> Result<MaskImage, PictureError> {
    let reading = Reading { kept: 1, ..Reading::of(Purpose::Mask) };
    Ok(MaskImage::of(&Picture::read(path, &reading)?))
}

/// Writes linear RGB as 8-bit sRGB PNG: `round(255 · oetf_srgb(clamp(e·v, 0, 1)))`.
///
/// # Errors
/// When the size is wrong or the destination impossible.
pub fn write_png(path: &Path, picture: &LinearImage, exposure: f64) -> Result<(), ImageFileError> {
    write_view_png(path, picture, exposure, ViewTransform::Srgb)
}

/// Writes linear RGB as 8-bit PNG, as a view shows it: `round(255 · code)` of [`ViewTransform::encode`].
///
/// # Errors
/// When the size is wrong or the destination impossible.
pub fn write_view_png(
    path: &Path,
    picture: &LinearImage,
    exposure: f64,
    view: ViewTransform,
) -> Result<(), ImageFileError> {
    check_size(path, picture.width, picture.height, picture.rgb.len())?;
    // NaN becomes 0.
    let encode = |&v: &[f32; 3]| view.encode(v, exposure).map(|code| (code * 255.0).round() as u8);
    let bytes: Vec<u8> = picture.rgb.iter().flat_map(encode).collect();
    encode_png(path, picture.width, picture.height, &bytes, ExtendedColorType::Rgb8)
}

/// Writes a mask as 8-bit grey PNG: white on the object.
///
/// # Errors
/// When the size is wrong or the destination impossible.
pub fn write_mask_png(path: &Path, mask: &MaskImage) -> Result<(), ImageFileError> {
    check_size(path, mask.width, mask.height, mask.object.len())?;
    let bytes: Vec<u8> = mask.object.iter().map(|&o| if o { 255 } else { 0 }).collect();
    encode_png(path, mask.width, mask.height, &bytes, ExtendedColorType::L8)
}

/// Writes a mask as EXR: part `mask`, channel `mask`, 1 on the object.
///
/// # Errors
/// When the size is wrong or the destination impossible.
pub fn write_mask_exr(path: &Path, mask: &MaskImage) -> Result<(), ImageFileError> {
    check_size(path, mask.width, mask.height, mask.object.len())?;
    let parts = vec![mask_part(&mask.object)];
    let image = ExrImage { width: mask.width, height: mask.height, parts, lightopt: None };
    Ok(write_exr(path, &image)?)
}

/// The part in which our EXR files carry the object mask.
#[must_use]
pub fn mask_part(object: &[bool]) -> ExrPart {
    let samples = object.iter().map(|&o| f32::from(u8::from(o))).collect();
    ExrPart::single("mask", "mask", samples)
}

/// Checks that `pixels` fill a picture of this size, and that a PNG can have it.
fn check_size(path: &Path, width: usize, height: usize, pixels: usize) -> Result<(), ImageFileError> {
    // PNG counts in u32 and refuses 0; EXR checks itself.
    let fits = u32::try_from(width).is_ok() && u32::try_from(height).is_ok();
    if fits && pixels > 0 && width.checked_mul(height) == Some(pixels) {
        Ok(())
    } else {
        Err(ImageFileError::Size { path: path.to_owned(), pixels, width, height })
    }
}

fn encode_png(
    path: &Path,
    width: usize,
    height: usize,
    bytes: &[u8],
    color: ExtendedColorType,
) -> Result<(), ImageFileError> {
    write_atomically(path, |file| {
        PngEncoder::new_with_quality(file, CompressionType::Default, FilterType::Adaptive)
            .write_image(bytes, width as u32, height as u32, color)
            .map_err(|source| ImageFileError::Encode { path: path.to_owned(), source })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::display::{eotf_srgb, oetf_srgb};
    use crate::picture::Fault;
    use image::{ImageBuffer, Luma, Rgb, Rgba};

    fn ramp(width: usize, height: usize) -> LinearImage {
        let n = width * height;
        let rgb = (0..n).map(|i| i as f32 / n as f32).map(|v| [v, v * v, 1.0 - v]).collect();
        LinearImage { width, height, rgb }
    }

    #[test]
    fn a_png_decodes_to_within_half_a_code_and_encodes_again_to_the_same_bytes() {
        let directory = tempfile::tempdir().unwrap();
        let (a, b) = (directory.path().join("a.png"), directory.path().join("b.png"));
        let picture = ramp(31, 17);
        write_png(&a, &picture, 1.0).unwrap();
        let read = read_image(&a).unwrap();
        assert_eq!((read.width, read.height), (31, 17));
        for (got, want) in read.rgb.iter().flatten().zip(picture.rgb.iter().flatten()) {
            let codes = |v: f32| 255.0 * oetf_srgb(f64::from(v));
            assert!((codes(*got) - codes(*want)).abs() < 0.501, "{got} {want}");
        }
        write_png(&b, &read, 1.0).unwrap();
        assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
    }

    #[test]
    fn exposure_scales_and_the_range_is_clamped() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let rgb = vec![[0.107_020_57, -1.0, 9.0], [f32::NAN, f32::INFINITY, 0.0]];
        write_png(&path, &LinearImage { width: 2, height: 1, rgb }, 2.0).unwrap();
        let bytes = image::open(&path).unwrap().into_rgb8().into_raw();
        assert_eq!(bytes, [128, 0, 255, 0, 255, 0]); // 2 · 0.107… is middle grey
    }

    #[test]
    fn sixteen_bits_are_used_and_transparency_lies_over_black() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let code = 0x1234_u16;
        let deep: ImageBuffer<Rgb<u16>, _> = ImageBuffer::from_pixel(1, 1, Rgb([code, 65_535, 0]));
        deep.save(&path).unwrap();
        let want = eotf_srgb(f64::from(code) / 65_535.0) as f32;
        assert_eq!(read_image(&path).unwrap().rgb, [[want, 1.0, 0.0]]);

        let tiff = directory.path().join("a.tiff");
        deep.save(&tiff).unwrap();
        assert_eq!(read_image(&tiff).unwrap().rgb, [[want, 1.0, 0.0]]);

        let clear: ImageBuffer<Rgba<u8>, _> = ImageBuffer::from_pixel(1, 1, Rgba([255, 255, 255, 51]));
        clear.save(&path).unwrap();
        assert_eq!(read_image(&path).unwrap().rgb, [[0.2; 3]]);
    }

    #[test]
    fn jpeg_is_read_and_the_content_decides_on_the_format() {
        let directory = tempfile::tempdir().unwrap();
        let jpeg = directory.path().join("a.jpg");
        ImageBuffer::from_pixel(8, 8, Luma([188_u8])).save(&jpeg).unwrap();
        let disguised = directory.path().join("b.png");
        std::fs::rename(&jpeg, &disguised).unwrap();
        let grey = read_image(&disguised).unwrap().rgb[0];
        assert!(grey.iter().all(|v| (v - 0.5).abs() < 0.01), "{grey:?}");
    }

    #[test]
    fn masks_survive_png_and_exr() {
        let directory = tempfile::tempdir().unwrap();
        let object = (0..35).map(|i| i % 3 == 0).collect();
        let mask = MaskImage { width: 7, height: 5, object };
        let path = directory.path().join("m.png");
        write_mask_png(&path, &mask).unwrap();
        assert_eq!(read_mask(&path).unwrap(), mask);
        let path = directory.path().join("m.exr");
        write_mask_exr(&path, &mask).unwrap();
        assert_eq!(read_mask(&path).unwrap(), mask);
    }

    #[test]
    fn an_exr_picture_is_read_as_it_is_and_a_mask_by_its_channel() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let picture = ramp(5, 4);
        let mut exr = ExrImage {
            width: 5,
            height: 4,
            parts: vec![ExrPart::rgb("beauty", &picture.rgb)],
            lightopt: None,
        };
        write_exr(&path, &exr).unwrap();
        assert_eq!(read_image(&path).unwrap(), picture);
        // Bright is the object, as in a picture of any other format.
        let bright: Vec<bool> =
            picture.rgb.iter().map(|&c| crate::math::display::luminance(c) >= 0.5).collect();
        assert!(bright.contains(&true) && bright.contains(&false));
        assert_eq!(read_mask(&path).unwrap().object, bright);

        exr.parts.push(mask_part(&[false; 20]));
        write_exr(&path, &exr).unwrap();
        assert_eq!(read_mask(&path).unwrap().object, [false; 20]);

        exr.parts = vec![ExrPart::triple("normal", ["X", "Y", "Z"], &picture.rgb)];
        write_exr(&path, &exr).unwrap();
        let names = "`normal/X`, `normal/Y`, `normal/Z`";
        for error in [read_image(&path).unwrap_err(), read_mask(&path).unwrap_err()] {
            assert!(error.fault.to_string().contains(names), "{error:?}");
        }
    }

    #[test]
    fn a_mask_that_cannot_be_decoded_does_no_harm_to_light_alone() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let picture = ramp(5, 4);
        let parts = vec![ExrPart::rgb("beauty", &picture.rgb), mask_part(&[true; 20])];
        write_exr(&path, &ExrImage { width: 5, height: 4, parts, lightopt: None }).unwrap();
        // The last header is that of the mask; its codec becomes one that is not decoded.
        let mut bytes = std::fs::read(&path).unwrap();
        let name = b"compression\0compression\0";
        let at = bytes.windows(name.len()).rposition(|w| w == name).unwrap() + name.len() + 4;
        bytes[at] = 13;
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(read_image(&path).unwrap(), picture);
        let reading = Reading { own_mask: true, ..Reading::of(Purpose::Light) };
        assert!(matches!(Picture::read(&path, &reading).unwrap_err().fault, Fault::Exr(_)));
    }

    #[test]
    fn what_is_no_picture_or_does_not_fit_is_an_error() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        assert!(matches!(read_image(&path).unwrap_err().fault, Fault::Open(_)));
        std::fs::write(&path, "text").unwrap();
        assert!(matches!(read_image(&path).unwrap_err().fault, Fault::UnknownFormat));
        assert!(matches!(read_mask(&path).unwrap_err().fault, Fault::UnknownFormat));
        assert!(matches!(read_image(directory.path()).unwrap_err().fault, Fault::NoFile));
        let wrong = LinearImage { width: 3, height: 3, rgb: vec![[0.0; 3]; 8] };
        assert!(matches!(write_png(&path, &wrong, 1.0), Err(ImageFileError::Size { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"text");
    }
}
