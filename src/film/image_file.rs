//! Reading and writing of pictures and masks as PNG, EXR and, reading only, JPEG, TIFF and others.
//!
//! In memory a picture is linear Rec.709 RGB, f32. Files of 8 or 16 bits a channel are
//! taken as sRGB-encoded, float files as linear; transparent pixels are laid over black.
//! Pictures are turned upright as their EXIF orientation says.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{
    DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader, ImageResult,
    Limits,
};
use thiserror::Error;

use super::exr::{ExrError, ExrImage, ExrPart, read_exr, write_exr};
use crate::files::atomic::{AtomicWriteError, write_atomically};
use crate::math::display::{eotf_srgb, oetf_srgb};

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

/// Why a picture file cannot be read or written.
#[derive(Debug, Error)]
pub enum ImageFileError {
    /// The file cannot be opened.
    #[error("{path}: cannot open the picture", path = .path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Error of the file system.
        #[source]
        source: std::io::Error,
    },
    /// The file is not a picture in a known format.
    #[error(
        "{path}: cannot read it as a picture (PNG, JPEG, TIFF, EXR and some others are known)",
        path = .path.display()
    )]
    Decode {
        /// Path of the file.
        path: PathBuf,
        /// Error of the decoder or encoder.
        #[source]
        source: image::ImageError,
    },
    /// The encoder refuses the picture.
    #[error("{path}: cannot write the picture", path = .path.display())]
    Encode {
        /// Path of the file.
        path: PathBuf,
        /// Error of the decoder or encoder.
        #[source]
        source: image::ImageError,
    },
    /// A finished file cannot be brought to its place.
    #[error(transparent)]
    File(#[from] AtomicWriteError),
    /// An EXR file cannot be read or written.
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
    /// An EXR file lacks the channels that are needed.
    #[error("{path}: needs {wanted}, the file has {}", found.join(", "), path = .path.display())]
    MissingChannel {
        /// Path of the file.
        path: PathBuf,
        /// Channels that are needed, as a phrase.
        wanted: &'static str,
        /// Names of the channels in the file, with their parts.
        found: Vec<String>,
    },
}

/// First four bytes of every EXR file, its magic number 20000630.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Whether the content of the file, whatever its name, begins as an EXR file does.
///
/// # Errors
/// When the file cannot be opened.
pub fn is_exr(path: &Path) -> Result<bool, ImageFileError> {
    let open = |source| ImageFileError::Open { path: path.to_owned(), source };
    let mut start = Vec::with_capacity(4);
    File::open(path).map_err(open)?.take(4).read_to_end(&mut start).map_err(open)?;
    Ok(start == EXR_MAGIC)
}

/// Whether the ending of the file's name is that of a picture format that can be read.
#[must_use]
pub fn has_picture_ending(path: &Path) -> bool {
    let format = path.extension().and_then(ImageFormat::from_extension);
    format.is_some_and(|format| format.reading_enabled())
}

/// Decodes a picture other than an EXR, turned upright.
fn decode(path: &Path) -> Result<DynamicImage, ImageFileError> {
    let open = |source| ImageFileError::Open { path: path.to_owned(), source };
    let file = BufReader::new(File::open(path).map_err(open)?);
    let reader = ImageReader::new(file).with_guessed_format().map_err(open)?;
    upright(reader).map_err(|source| ImageFileError::Decode { path: path.to_owned(), source })
}

/// Decodes a picture and turns it as its EXIF orientation says.
fn upright(reader: ImageReader<BufReader<File>>) -> ImageResult<DynamicImage> {
    let mut decoder = reader.into_decoder()?;
    Limits::default().reserve(decoder.total_bytes())?;
    let orientation = decoder.orientation()?;
    let mut picture = DynamicImage::from_decoder(decoder)?;
    picture.apply_orientation(orientation);
    Ok(picture)
}

/// Reads any known picture as linear RGB; the content decides on the format.
///
/// # Errors
/// When the file is missing, no picture, or an EXR without colours.
pub fn read_image(path: &Path) -> Result<LinearImage, ImageFileError> {
    if is_exr(path)? {
        return exr_beauty(path, &read_exr(path)?);
    }
    let picture = decode(path)?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let float = matches!(picture, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let deep = !float && picture.color().bytes_per_pixel() > picture.color().channel_count();
    let rgb = if float {
        picture.into_rgba32f().pixels().map(|p| over_black(p.0.map(f64::from))).collect()
    } else if deep {
        let decoded = |v: u16| eotf_srgb(f64::from(v) / 65535.0);
        picture
            .into_rgba16()
            .pixels()
            .map(|p| {
                let [r, g, b, a] = p.0;
                over_black([decoded(r), decoded(g), decoded(b), f64::from(a) / 65535.0])
            })
            .collect()
    } else {
        let table: Vec<f64> = (0..=255).map(|v| eotf_srgb(f64::from(v) / 255.0)).collect();
        picture
            .into_rgba8()
            .pixels()
            .map(|p| {
                let [r, g, b, a] = p.0;
                let [r, g, b] = [r, g, b].map(|v| table[usize::from(v)]);
                over_black([r, g, b, f64::from(a) / 255.0])
            })
            .collect()
    };
    Ok(LinearImage { width, height, rgb })
}

/// A colour with its opacity laid over black.
fn over_black([r, g, b, alpha]: [f64; 4]) -> [f32; 3] {
    [r, g, b].map(|v| (v * alpha) as f32)
}

/// The colours of an EXR picture that has been read from `path`.
///
/// # Errors
/// When the picture has no channels that are colours.
pub fn exr_beauty(path: &Path, exr: &ExrImage) -> Result<LinearImage, ImageFileError> {
    let rgb = exr.beauty().ok_or_else(|| ImageFileError::MissingChannel {
        path: path.to_owned(),
        wanted: "channels R, G, B (or Y)",
        found: exr.channel_names(),
    })?;
    Ok(LinearImage { width: exr.width, height: exr.height, rgb })
}

/// Writes linear RGB as 8-bit sRGB PNG: `round(255 · oetf_srgb(clamp(e·v, 0, 1)))`.
///
/// # Errors
/// When the size is wrong or the destination impossible.
pub fn write_png(path: &Path, picture: &LinearImage, exposure: f64) -> Result<(), ImageFileError> {
    check_size(path, picture.width, picture.height, picture.rgb.len())?;
    let encode = |v: f32| {
        let l = oetf_srgb((exposure * f64::from(v)).clamp(0.0, 1.0));
        (l * 255.0).round() as u8 // NaN becomes 0
    };
    let bytes: Vec<u8> = picture.rgb.iter().flatten().map(|&v| encode(v)).collect();
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

/// Reads a mask: bright (at least half of white) is the object. Of an EXR the channel
/// `mask` counts, else its only channel, else Y, else A.
///
/// # Errors
/// When the file is missing, no picture, or an EXR without a channel that can be a mask.
pub fn read_mask(path: &Path) -> Result<MaskImage, ImageFileError> {
    if is_exr(path)? {
        return exr_mask(path, &read_exr(path)?);
    }
    let grey = decode(path)?.into_luma16();
    let (width, height) = (grey.width() as usize, grey.height() as usize);
    let object = grey.pixels().map(|p| p.0[0] >= 0x8000).collect();
    Ok(MaskImage { width, height, object })
}

/// The mask in an EXR picture that has been read from `path`; see [`read_mask`].
///
/// # Errors
/// When it has no channel that can be a mask.
pub fn exr_mask(path: &Path, exr: &ExrImage) -> Result<MaskImage, ImageFileError> {
    let named = |name: &str| exr.parts.iter().find_map(|p| p.channel(name));
    let only = || match exr.parts.as_slice() {
        [part] if part.channels.len() == 1 => Some(part.channels[0].1.as_slice()),
        _ => None,
    };
    let samples =
        stored_mask(exr).or_else(only).or_else(|| named("Y")).or_else(|| named("A")).ok_or_else(|| {
            ImageFileError::MissingChannel {
                path: path.to_owned(),
                wanted: "a channel `mask` (or a single channel, Y or A)",
                found: exr.channel_names(),
            }
        })?;
    let object = samples.iter().map(|&v| v >= 0.5).collect();
    Ok(MaskImage { width: exr.width, height: exr.height, object })
}

/// The samples of the channel `mask`, when an EXR carries one.
#[must_use]
pub fn stored_mask(exr: &ExrImage) -> Option<&[f32]> {
    exr.part("mask")
        .and_then(|p| p.channel("mask"))
        .or_else(|| exr.parts.iter().find_map(|p| p.channel("mask")))
}

#[cfg(test)]
mod tests {
    use super::*;
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
    fn an_exr_picture_is_read_as_it_is_and_wants_a_mask_channel() {
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
        let error = read_mask(&path).unwrap_err();
        assert!(error.to_string().contains("beauty/B, beauty/G, beauty/R"), "{error}");

        exr.parts = vec![ExrPart::single("depth", "Z", vec![1.0; 20]), mask_part(&[false; 20])];
        write_exr(&path, &exr).unwrap();
        assert!(matches!(read_image(&path), Err(ImageFileError::MissingChannel { .. })));
        assert_eq!(read_mask(&path).unwrap().object, [false; 20]);
    }

    #[test]
    fn what_is_no_picture_or_does_not_fit_is_an_error() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        assert!(matches!(read_image(&path), Err(ImageFileError::Open { .. })));
        std::fs::write(&path, "text").unwrap();
        assert!(matches!(read_image(&path), Err(ImageFileError::Decode { .. })));
        assert!(matches!(read_mask(&path), Err(ImageFileError::Decode { .. })));
        let wrong = LinearImage { width: 3, height: 3, rgb: vec![[0.0; 3]; 8] };
        assert!(matches!(write_png(&path, &wrong, 1.0), Err(ImageFileError::Size { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"text");
    }
}
