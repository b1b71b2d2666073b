//! Pictures of other programs: the one reader for photographs, masks, textures, environments
//! and whatever is measured.
//!
//! A picture is kept as its samples were decoded, with what they mean, and becomes linear
//! Rec.709 where it is used. Integer samples are sRGB-encoded and floating point is linear,
//! unless the file says otherwise; transparency is straight, but for EXR and for TIFF that says
//! so. What is honoured of each format is listed in `docs/formats-pictures.md`.
//!
//! # References
//! \[IEC61966\] (sRGB), \[PNG3\] (gAMA, cHRM, sRGB, cICP), \[TIFF6\] (SampleFormat, ExtraSamples),
//! \[OpenEXR\] (chromaticities, premultiplication), \[Radiance\] (EXPOSURE, COLORCORR, PRIMARIES).

pub mod budget;
mod colour;
pub mod exr;
mod fault;
mod format;
mod icc;
mod jpeg;
mod light;
mod note;
mod png;

mod radiance;
mod raster;
mod samples;
mod tga;
mod tiff;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek};
use std::path::Path;

use image::metadata::Orientation;

pub use colour::{Colour, Transfer};
pub use fault::{Fault, PictureError};
pub use format::Format;
pub use note::Note;
pub use samples::Samples;

use crate::math::{display::luminance, primaries};

/// What a picture is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Light of the picture, over black.
    Light,
    /// Colours and transparency of a surface.
    Texture,
    /// Numbers of a texture, for which what the file says about its colours does not count: every
    /// texture of glTF, and maps of roughness, normals and heights.
    RawTexture,
    /// Where the object is.
    Mask,
}

impl Purpose {
    /// Whether what the file says about its colours counts.
    #[must_use]
    pub fn honours_metadata(self) -> bool {
        matches!(self, Self::Light | Self::Texture)
    }

    /// Whether the picture is turned as its metadata say; textures lie as their file has them.
    #[must_use]
    pub fn is_upright(self) -> bool {
        matches!(self, Self::Light | Self::Mask)
    }
}

/// How to read a picture.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// What the picture is read for.
    pub purpose: Purpose,
    /// The layer of an EXR by name; by default the one that is the picture.
    pub layer: Option<&'a str>,
    /// Bytes that the caller keeps of each pixel beside the decoded samples.
    pub kept: usize,
    /// Whether a picture that is read for its light brings the channel `mask` of an EXR that has one.
    pub own_mask: bool,
    /// Whether a picture that is read for its light brings the replicates of an EXR of this program that has
    /// them.
    pub own_replicates: bool,
}

impl Reading<'_> {
    /// A reading for a purpose: of the default layer, with nothing kept beside the samples.
    #[must_use]
    pub const fn of(purpose: Purpose) -> Self {
        Self { purpose, layer: None, kept: 0, own_mask: false, own_replicates: false }
    }
}

/// Whether the alpha of a picture has been multiplied into its colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alpha {
    /// The colours are those of opaque surfaces.
    Straight,
    /// The colours are the light that is seen before black.
    Premultiplied,
}

/// A picture as decoded: upright, but for textures, which lie as their file has them.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Interleaved channels, 1 to 4.
    pub channels: usize,
    /// The channels.
    pub samples: Samples,
    /// What an alpha channel means.
    pub alpha: Alpha,
    /// What the numbers mean.
    pub colour: Colour,
    /// What people should hear of.
    pub notes: Vec<Note>,
    /// The attribute of our EXR files, JSON.
    pub attribute: Option<String>,
    /// The channel `mask` of an EXR that has one, where [`Reading::own_mask`] asks for it; row by
    /// row, 1 on the object.
    pub mask: Option<Vec<f32>>,
    /// Planes of the replicates of an EXR of this program, where [`Reading::own_replicates`] asks for them:
    /// linear luminance and, where the file has it, colour, see [`Measure::planes`](crate::math::Measure::planes).
    /// Empty where there are none.
    pub replicates: Vec<Vec<f32>>,
    /// The profile that decodes the samples; `None` where `colour` does alone.
    profile: Option<icc::Profile>,
    /// Linear light by sample, of every channel of colours or of all; none for floating point.
    tables: Vec<Vec<f64>>,
}

/// A file or bytes in memory.
trait Source: BufRead + Seek {}
impl<T: BufRead + Seek> Source for T {}

impl Picture {
    /// Reads a file. Its content decides on the format, and its name where the content has no
    /// mark.
    ///
    /// # Errors
    /// When it is no regular file, no picture, damaged, or larger than [`budget`] allows.
    pub fn read(path: &Path, reading: &Reading) -> Result<Self, PictureError> {
        let read = || {
            // Opening a pipe would wait for its writer.
            if !path.metadata().map_err(Fault::Open)?.is_file() {
                return Err(Fault::NoFile);
            }
            let file = File::open(path).map_err(Fault::Open)?;
            Self::decode_from(Box::new(BufReader::new(file)), Some(path), reading)
        };
        read().map_err(|fault| PictureError { path: path.to_owned(), fault })
    }

    /// Reads a file's content.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn decode(bytes: &[u8], reading: &Reading) -> Result<Self, Fault> {
        Self::decode_from(Box::new(Cursor::new(bytes)), None, reading)
    }

    fn decode_from(
        mut source: Box<dyn Source + '_>,
        name: Option<&Path>,
        reading: &Reading,
    ) -> Result<Self, Fault> {
        match Format::of(&mut source, name)? {
            Format::Exr => light::read_exr(source, reading),
            Format::Tiff => tiff::read(source, reading),
            Format::Hdr => radiance::read(source, reading),
            format => raster::read(source, format, reading),
        }
    }

    /// A picture of decoded samples, which `turn` brings upright.
    fn new(size: [usize; 2], channels: usize, samples: Samples, colour: Colour, turn: Orientation) -> Self {
        let (samples, [width, height]) = samples.upright(size, channels, turn);
        let tables = tables(&samples, 1, |_, v| colour.transfer.decode(v));
        Self {
            width,
            height,
            channels,
            samples,
            alpha: Alpha::Straight,
            colour,
            notes: Vec::new(),
            attribute: None,
            mask: None,
            replicates: Vec::new(),
            profile: None,
            tables,
        }
    }

    /// The same picture, decoded by a profile.
    fn decoded_by(mut self, profile: icc::Profile) -> Self {
        self.tables = tables(&self.samples, profile.n_curves(), |c, v| profile.decode(c, v));
        self.colour.matrix = Some(profile.matrix);
        self.profile = Some(profile);
        self
    }

    /// What our EXR files say of themselves; `path` is that of the file.
    ///
    /// # Errors
    /// When it is no JSON.
    pub fn our_attribute(&self, path: &Path) -> Result<Option<serde_json::Value>, PictureError> {
        let value = self.attribute.as_deref().map(serde_json::from_str).transpose();
        value.map_err(|e| PictureError { path: path.to_owned(), fault: Fault::Attribute(e) })
    }

    /// Number of pixels.
    #[must_use]
    pub fn n_pixels(&self) -> usize {
        self.width * self.height
    }

    /// Whether it has an alpha channel.
    #[must_use]
    pub fn has_alpha(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// The colour of a pixel as the file has it, and alpha; integers lie in [0, 1]. Pixels count
    /// row by row from the top left.
    #[must_use]
    pub fn stored(&self, pixel: usize) -> [f64; 4] {
        let n = self.channels;
        match &self.samples {
            Samples::U8(s) => {
                rgba(&s[pixel * n..][..n], |_, v| f64::from(v) / 255.0, |v| f64::from(v) / 255.0)
            }
            Samples::U16(s) => {
                rgba(&s[pixel * n..][..n], |_, v| f64::from(v) / 65_535.0, |v| f64::from(v) / 65_535.0)
            }
            Samples::F32(s) => rgba(&s[pixel * n..][..n], |_, v| f64::from(v), f64::from),
        }
    }

    /// Linear Rec.709 of a pixel as its alpha has it, and alpha.
    #[must_use]
    pub fn decoded(&self, pixel: usize) -> [f64; 4] {
        let n = self.channels;
        let table = |channel: usize| &self.tables[channel.min(self.tables.len() - 1)];
        let float = |channel: usize, v: f32| match &self.profile {
            None => self.colour.transfer.decode(f64::from(v)),
            Some(profile) => profile.decode(channel, f64::from(v)),
        };
        let [r, g, b, a] = match &self.samples {
            Samples::U8(s) => {
                rgba(&s[pixel * n..][..n], |c, v| table(c)[usize::from(v)], |v| f64::from(v) / 255.0)
            }
            Samples::U16(s) => {
                rgba(&s[pixel * n..][..n], |c, v| table(c)[usize::from(v)], |v| f64::from(v) / 65_535.0)
            }
            Samples::F32(s) => rgba(&s[pixel * n..][..n], float, f64::from),
        };
        let [r, g, b] = self.colour.mix([r, g, b]);
        [r, g, b, a]
    }

    /// Linear Rec.709 light of a pixel before black.
    #[must_use]
    pub fn over_black(&self, pixel: usize) -> [f32; 3] {
        let [r, g, b, a] = self.decoded(pixel);
        match self.alpha {
            Alpha::Straight => [r, g, b].map(|v| (v * a) as f32),
            Alpha::Premultiplied => [r, g, b].map(|v| v as f32),
        }
    }

    /// Linear Rec.709 colour of a pixel's surface, and its alpha.
    #[must_use]
    pub fn straight(&self, pixel: usize) -> [f32; 4] {
        let [r, g, b, a] = self.decoded(pixel);
        // Where nothing is, no colour can be found.
        let share = if self.alpha == Alpha::Premultiplied && a > 0.0 { a } else { 1.0 };
        [(r / share) as f32, (g / share) as f32, (b / share) as f32, a as f32]
    }

    /// Luminance of a pixel's light before black.
    #[must_use]
    pub fn luminance(&self, pixel: usize) -> f64 {
        luminance(self.over_black(pixel))
    }
}

/// The next bytes of a file.
fn array<const N: usize>(source: &mut (impl Read + ?Sized)) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    source.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// Tables of the light of integer samples, one for each of `n` channels; none for floating point.
fn tables(samples: &Samples, n: usize, decode: impl Fn(usize, f64) -> f64) -> Vec<Vec<f64>> {
    let steps: u32 = match samples {
        Samples::U8(_) => 255,
        Samples::U16(_) => 65_535,
        Samples::F32(_) => return Vec::new(),
    };
    let of_channel = |c| (0..=steps).map(|v| decode(c, f64::from(v) / f64::from(steps))).collect();
    (0..n).map(of_channel).collect()
}

/// Colour and alpha of a pixel's samples; `colour` is told the channel.
fn rgba<T: Copy>(samples: &[T], colour: impl Fn(usize, T) -> f64, alpha: impl Fn(T) -> f64) -> [f64; 4] {
    let three = |r: T, g: T, b: T, a: f64| [colour(0, r), colour(1, g), colour(2, b), a];
    match *samples {
        [grey] => three(grey, grey, grey, 1.0),
        [grey, a] => three(grey, grey, grey, alpha(a)),
        [r, g, b] => three(r, g, b, 1.0),
        [r, g, b, a] => three(r, g, b, alpha(a)),
        _ => unreachable!("a picture has one to four channels"),
    }
}

#[cfg(test)]
mod tests;
