//! PNG, JPEG, WebP, BMP and TGA: the decoders of the crate `image`, and what it does not tell of
//! their colours.

use std::io::{BufRead, Seek, SeekFrom};

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::budget::{self, METADATA_BUDGET};
use super::{
    Alpha, Colour, Fault, Format, Note, Picture, Purpose, Reading, Samples, Source, Transfer, icc, jpeg, png,
    tga,
};

/// Reads a picture in one of the formats above.
pub(super) fn read(
    mut source: Box<dyn Source + '_>,
    format: Format,
    reading: &Reading,
) -> Result<Picture, Fault> {
    let about = About::read(&mut source, format, reading.purpose)?;
    source.seek(SeekFrom::Start(0))?;
    // The crate's message holds that of its cause.
    let decode = |e: image::ImageError| Fault::decode(format, e.to_string());
    let mut reader = ImageReader::with_format(source, image_format(format));
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(METADATA_BUDGET);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(decode)?;
    let (width, height) = decoder.dimensions();
    let turn = match reading.purpose.is_upright() {
        true => decoder.orientation().map_err(decode)?,
        false => Orientation::NoTransforms,
    };
    let pixel = u64::from(decoder.color_type().bytes_per_pixel());
    let turning = if turn == Orientation::NoTransforms { 0 } else { pixel };
    let needed = pixel + turning.max(about.working) + reading.kept as u64;
    budget::check([u64::from(width), u64::from(height)], needed)?;

    let profile = match reading.purpose.honours_metadata() && about.asks_profile {
        true => decoder.icc_profile().ok().flatten(),
        false => None,
    };
    let image = DynamicImage::from_decoder(decoder).map_err(decode)?;
    let (mut channels, mut samples) = samples(image, format)?;
    if about.alpha.is_none() {
        (channels, samples) = opaque(channels, samples);
    }
    let size = [width as usize, height as usize];
    let profiled = Profiled::of(profile, &about.colour, channels);
    let mut picture = Picture::new(size, channels, samples, about.colour, turn);
    (picture.notes, picture.alpha) = (about.notes, about.alpha.unwrap_or(Alpha::Straight));
    Ok(profiled.apply(picture))
}

/// What a file says that its decoder does not.
pub(super) struct About {
    /// What its numbers mean.
    pub colour: Colour,
    /// Whether a profile that the decoder finds counts.
    pub asks_profile: bool,
    /// What its alpha means; `None` when it means nothing.
    pub alpha: Option<Alpha>,
    /// Bytes of each pixel that the decoder needs beside the result.
    pub working: u64,
    /// What people should hear of.
    pub notes: Vec<Note>,
}

impl About {
    fn read(
        source: &mut (impl BufRead + Seek + ?Sized),
        format: Format,
        purpose: Purpose,
    ) -> Result<Self, Fault> {
        let plain = Self {
            colour: Colour::rec709(Transfer::Srgb),
            asks_profile: true,
            alpha: Some(Alpha::Straight),
            working: 0,
            notes: Vec::new(),
        };
        Ok(match format {
            Format::Png if purpose.honours_metadata() => png::about(source, plain)?,
            Format::Tga => Self { alpha: tga::alpha(source)?, ..plain },
            Format::Jpeg => {
                budget::check_file(source.seek(SeekFrom::End(0))?)?;
                source.seek(SeekFrom::Start(0))?;
                let scans = jpeg::Scans::read(source);
                let is_cmyk = scans.components == 4;
                if is_cmyk && purpose == Purpose::Light {
                    return Err(Fault::print());
                }
                let mut notes = if is_cmyk { vec![Note::Cmyk] } else { Vec::new() };
                notes.extend(scans.has_gain_map.then_some(Note::GainMap));
                Self { working: scans.working(), notes, asks_profile: !is_cmyk, ..plain }
            }
            Format::WebP => {
                let notes = if is_animated_webp(source) { vec![Note::FurtherPages] } else { Vec::new() };
                // RGBA beside what is asked for.
                Self { working: 4, notes, ..plain }
            }
            _ => plain,
        })
    }
}

/// Whether a WebP is an animation: \[WebP\] a flag of the header `VP8X`.
fn is_animated_webp(source: &mut (impl BufRead + Seek + ?Sized)) -> bool {
    let mut start = [0; 21];
    let is_read = source.seek(SeekFrom::Start(0)).is_ok() && source.read_exact(&mut start).is_ok();
    is_read && start[12..16] == *b"VP8X" && start[20] & 0x02 != 0
}

/// What a picture's profile makes of it.
#[derive(Debug)]
pub(super) enum Profiled {
    /// It is decoded by the profile.
    By(icc::Profile),
    /// It is decoded as if there were none, of which this may be said.
    Not(Option<Note>),
}

impl Profiled {
    /// What `profile` makes of a picture that otherwise is taken as `colour`.
    pub fn of(profile: Option<Vec<u8>>, colour: &Colour, channels: usize) -> Self {
        match profile {
            Some(bytes) if !(is_srgb(&bytes) && is_taken_as_srgb(colour)) => {
                match icc::Profile::read(&bytes, channels <= 2) {
                    Some(profile) => Self::By(profile),
                    None => Self::Not(icc_note(&bytes, colour)),
                }
            }
            _ => Self::Not(None),
        }
    }

    /// The picture, and what is said.
    pub fn apply(self, picture: Picture) -> Picture {
        match self {
            Self::By(profile) => picture.decoded_by(profile),
            Self::Not(note) => {
                let mut picture = picture;
                picture.notes.extend(note);
                picture
            }
        }
    }
}

/// How profiles of sRGB call themselves, in lower case.
const SRGB_PROFILES: [&str; 5] =
    ["srgb iec61966", "srgb built-in", "srgb2014", "srgb color space", "iec 61966-2-1 default rgb"];

/// Whether a profile is one of sRGB, by its name.
fn is_srgb(profile: &[u8]) -> bool {
    let lower = icc::description(profile).unwrap_or_default().to_lowercase();
    lower == "srgb" || SRGB_PROFILES.iter().any(|known| lower.starts_with(known))
}

fn is_taken_as_srgb(colour: &Colour) -> bool {
    colour.is_plain() && colour.transfer == Transfer::Srgb
}

/// What to say of a profile that is not read, when `colour` is what its picture is taken as.
fn icc_note(profile: &[u8], colour: &Colour) -> Option<Note> {
    let is_taken_as_srgb = is_taken_as_srgb(colour);
    let is_right = is_srgb(profile) && is_taken_as_srgb;
    (!is_right).then(|| Note::IccIgnored { profile: icc::description(profile), is_taken_as_srgb })
}

fn image_format(format: Format) -> ImageFormat {
    match format {
        Format::Bmp => ImageFormat::Bmp,
        Format::Exr => ImageFormat::OpenExr,
        Format::Hdr => ImageFormat::Hdr,
        Format::Jpeg => ImageFormat::Jpeg,
        Format::Png => ImageFormat::Png,
        Format::Tga => ImageFormat::Tga,
        Format::Tiff => ImageFormat::Tiff,
        Format::WebP => ImageFormat::WebP,
    }
}

/// Channels and samples of a decoded image.
fn samples(image: DynamicImage, format: Format) -> Result<(usize, Samples), Fault> {
    Ok(match image {
        DynamicImage::ImageLuma8(i) => (1, Samples::U8(i.into_raw())),
        DynamicImage::ImageLumaA8(i) => (2, Samples::U8(i.into_raw())),
        DynamicImage::ImageRgb8(i) => (3, Samples::U8(i.into_raw())),
        DynamicImage::ImageRgba8(i) => (4, Samples::U8(i.into_raw())),
        DynamicImage::ImageLuma16(i) => (1, Samples::U16(i.into_raw())),
        DynamicImage::ImageLumaA16(i) => (2, Samples::U16(i.into_raw())),
        DynamicImage::ImageRgb16(i) => (3, Samples::U16(i.into_raw())),
        DynamicImage::ImageRgba16(i) => (4, Samples::U16(i.into_raw())),
        DynamicImage::ImageRgb32F(i) => (3, Samples::F32(i.into_raw())),
        DynamicImage::ImageRgba32F(i) => (4, Samples::F32(i.into_raw())),
        _ => return Err(Fault::decode(format, "its samples are of an unknown kind")),
    })
}

/// The samples without their alpha.
fn opaque(channels: usize, samples: Samples) -> (usize, Samples) {
    fn shorter<T: Copy>(mut samples: Vec<T>, channels: usize) -> Vec<T> {
        let mut i = 0;
        samples.retain(|_| {
            i += 1;
            i % channels != 0
        });
        samples
    }
    if channels % 2 == 1 {
        return (channels, samples);
    }
    let samples = match samples {
        Samples::U8(s) => Samples::U8(shorter(s, channels)),
        Samples::U16(s) => Samples::U16(shorter(s, channels)),
        Samples::F32(s) => Samples::F32(shorter(s, channels)),
    };
    (channels - 1, samples)
}
