//! OpenEXR containers: several named parts of f32 channels and one attribute.
//!
//! Part 0 of the files of this program is the beauty with plain channels R, G, B (linear
//! Rec.709 radiance); further parts carry `luminance` (`l`), `mask` (`mask`), the share of
//! each light and auxiliary channels. Part 0 has one custom attribute, `lightopt`, a JSON
//! text with sorted keys: the `exr` crate keeps custom attributes in a hash map and would
//! write several in random order. Compression is lossless (ZIP) or none, so that a picture
//! reads back bit for bit, and equal pictures make equal files.
//!
//! Reading also takes the flat parts of files of other programs, as [`crate::picture::exr`] reads
//! them.

mod error;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds,
    Layer, LayerAttributes, Layers, Text, Vec2, WritableImage,
};
use serde_json::Value;

pub use error::ExrError;

use crate::files::atomic::write_atomically;
use crate::picture::budget::MAX_PIXELS;
use crate::picture::exr::{ATTRIBUTE, ExrFault, ExrFile, Part};

/// Largest number of samples of a file, pixels times channels over all parts, 2³¹: 8 GiB as
/// f32. A picture of 7680 x 4320 pixels with the shares of 17 lights fits.
pub const MAX_SAMPLES: u64 = 1 << 31;

/// A part of an EXR file: a named group of channels, all of the picture's size.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrPart {
    /// Name of the part, unique in the file; may be empty in files of other programs.
    pub name: String,
    /// Name and samples of each channel, the samples row-major from the top left. Files keep
    /// channels sorted by name.
    pub channels: Vec<(String, Vec<f32>)>,
}

/// An EXR picture of one or more parts.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Width of the display window, pixels.
    pub width: usize,
    /// Height of the display window, pixels.
    pub height: usize,
    /// Parts of the picture, at least one; part 0 is the beauty.
    pub parts: Vec<ExrPart>,
    /// Value of the attribute `lightopt` of part 0: the scene, the settings and the results
    /// that the picture belongs to.
    pub lightopt: Option<Value>,
}

impl ExrPart {
    /// A colour part with channels R, G, B.
    #[must_use]
    pub fn rgb(name: impl Into<String>, rgb: &[[f32; 3]]) -> Self {
        Self::triple(name, ["R", "G", "B"], rgb)
    }

    /// A part of three channels, for instance X, Y, Z of a normal.
    #[must_use]
    pub fn triple(name: impl Into<String>, channels: [&str; 3], values: &[[f32; 3]]) -> Self {
        let channels =
            (0..3).map(|c| (channels[c].to_owned(), values.iter().map(|v| v[c]).collect())).collect();
        Self { name: name.into(), channels }
    }

    /// A part of one channel.
    #[must_use]
    pub fn single(name: impl Into<String>, channel: &str, values: Vec<f32>) -> Self {
        Self { name: name.into(), channels: vec![(channel.to_owned(), values)] }
    }

    /// Samples of the channel of this name, row-major from the top left.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, samples)| samples.as_slice())
    }

    /// Colours of the pixels from the channels R, G, B; `None` where one is missing.
    #[must_use]
    pub fn colours(&self) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = ["R", "G", "B"].map(|c| self.channel(c));
        let (r, g, b) = (r?, g?, b?);
        Some(r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect())
    }
}

impl ExrImage {
    /// The part of this name.
    #[must_use]
    pub fn part(&self, name: &str) -> Option<&ExrPart> {
        self.parts.iter().find(|p| p.name == name)
    }

    /// Colours of the pixels: R, G, B of the first part that has them, in the files of this program
    /// the beauty. `None` when no part has them.
    #[must_use]
    pub fn beauty(&self) -> Option<Vec<[f32; 3]>> {
        self.parts.iter().find_map(ExrPart::colours)
    }
}

/// Writes `image` with lossless compression, whole or not at all.
///
/// # Errors
/// When names, sizes or the destination are not possible.
pub fn write_exr(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    write_encoded(path, image, Encoding::SMALL_LOSSLESS)
}

/// Writes `image` without compression, whole or not at all: much faster than [`write_exr`],
/// and a quarter larger, since noisy floats hardly compress.
///
/// # Errors
/// As [`write_exr`].
pub fn write_exr_plain(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    write_encoded(path, image, Encoding::UNCOMPRESSED)
}

fn write_encoded(path: &Path, image: &ExrImage, encoding: Encoding) -> Result<(), ExrError> {
    check(path, image)?;
    let size = Vec2(image.width, image.height);
    let text = |kind, name: &str| {
        Text::new_or_none(name).ok_or_else(|| ExrError::Name {
            path: path.to_owned(),
            kind,
            name: name.to_owned(),
        })
    };
    let mut layers = Layers::new();
    for (i, part) in image.parts.iter().enumerate() {
        let mut attributes = LayerAttributes::named(text("part", &part.name)?);
        if let (0, Some(value)) = (i, &image.lightopt) {
            let json = text("attribute", &ascii_json(value))?;
            attributes.other.insert(Text::from(ATTRIBUTE), AttributeValue::Text(json));
        }
        let mut channels = Vec::with_capacity(part.channels.len());
        for (name, samples) in &part.channels {
            channels.push(AnyChannel::new(text("channel", name)?, FlatSamples::F32(samples.clone())));
        }
        let channels = AnyChannels::sort(channels.into());
        layers.push(Layer::new(size, attributes, encoding, channels));
    }
    let exr =
        Image { attributes: ImageAttributes::new(IntegerBounds::from_dimensions(size)), layer_data: layers };
    write_atomically(path, |file| {
        // One thread: pictures are small, and the order of chunks is then beyond doubt.
        exr.write()
            .non_parallel()
            .to_buffered(file)
            .map_err(|source| ExrError::Write { path: path.to_owned(), source })
    })
}

/// Checks that a picture can be written as EXR, before the file is begun.
fn check(path: &Path, image: &ExrImage) -> Result<(), ExrError> {
    let &ExrImage { width, height, .. } = image;
    check_size(path, width, height)?;
    if image.parts.is_empty() || image.parts.iter().any(|p| p.channels.is_empty()) {
        return Err(ExrError::Empty { path: path.to_owned() });
    }
    check_samples(path, image.parts.iter().map(|p| (width * height, p.channels.len())))?;
    check_names(path, "part", image.parts.iter().map(|p| p.name.as_str()))?;
    for part in &image.parts {
        check_names(path, "channel", part.channels.iter().map(|(name, _)| name.as_str()))?;
        for (channel, samples) in &part.channels {
            if samples.len() != width * height {
                return Err(ExrError::ChannelSize {
                    path: path.to_owned(),
                    part: part.name.clone(),
                    channel: channel.clone(),
                    samples: samples.len(),
                    width,
                    height,
                });
            }
        }
    }
    Ok(())
}

/// Checks the size of a part against [`MAX_PIXELS`].
fn check_size(path: &Path, width: usize, height: usize) -> Result<(), ExrError> {
    match (width as u64).checked_mul(height as u64) {
        Some(1..=MAX_PIXELS) => Ok(()),
        _ => Err(ExrError::Size { path: path.to_owned(), width, height }),
    }
}

/// Checks the pixels and channels of all parts together against [`MAX_SAMPLES`].
fn check_samples(path: &Path, parts: impl Iterator<Item = (usize, usize)>) -> Result<(), ExrError> {
    let product = |(pixels, channels): (usize, usize)| (pixels as u64).saturating_mul(channels as u64);
    match parts.map(product).fold(0, u64::saturating_add) {
        0..=MAX_SAMPLES => Ok(()),
        samples => Err(ExrError::Samples { path: path.to_owned(), samples }),
    }
}

/// Checks that names are unique and of characters that EXR allows.
fn check_names<'a>(
    path: &Path,
    kind: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), ExrError> {
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        let printable = name.bytes().all(|b| (b' '..=b'~').contains(&b));
        if !printable || name.is_empty() || name.len() > 255 || seen.contains(&name) {
            let name = name.to_owned();
            return Err(ExrError::Name { path: path.to_owned(), kind, name });
        }
        seen.push(name);
    }
    Ok(())
}

/// `value` as JSON with sorted keys in ASCII, since EXR texts are bytes without encoding.
fn ascii_json(value: &Value) -> String {
    let mut ascii = String::new();
    for c in sorted(value).to_string().chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            // Outside ASCII only string contents occur, where escapes are allowed.
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Writing to a String does not fail.
                let _ = write!(ascii, "\\u{unit:04x}");
            }
        }
    }
    ascii
}

/// `value` with all keys sorted, even where a dependency turns on
/// `serde_json/preserve_order`.
fn sorted(value: &Value) -> Value {
    match value {
        Value::Object(map) => {
            let ordered: BTreeMap<_, _> = map.iter().map(|(k, v)| (k.clone(), sorted(v))).collect();
            Value::Object(ordered.into_iter().collect())
        }
        Value::Array(list) => Value::Array(list.iter().map(sorted).collect()),
        other => other.clone(),
    }
}

/// Reads all flat parts of an EXR file of this or another program. Samples become f32; every part
/// is laid into the display window and is 0 where it has no data.
///
/// # Errors
/// When the file is not an EXR, has only deep parts, takes more memory than
/// [`PICTURE_BUDGET`](crate::picture::budget::PICTURE_BUDGET), or its attribute is not JSON.
pub fn read_exr(path: &Path) -> Result<ExrImage, ExrError> {
    let read = |source| ExrError::Read { path: path.to_owned(), source };
    let file = File::open(path).map_err(|source| read(source.into()))?;
    let mut exr = ExrFile::open(BufReader::new(file)).map_err(read)?;
    let flat: Vec<(usize, Part)> =
        exr.parts().iter().cloned().enumerate().filter(|(_, part)| !part.is_deep).collect();
    let Some((_, first)) = flat.first() else { return Err(read(ExrFault::Deep)) };
    let [width, height] = first.display.size.map(|n| n as usize);
    let lightopt = exr.attribute().map(serde_json::from_str).transpose();
    let lightopt = lightopt.map_err(|source| ExrError::Attribute { path: path.to_owned(), source })?;
    let kept = flat.iter().map(|(_, part)| part.channels.len()).sum::<usize>() * size_of::<f32>();
    let mut parts = Vec::with_capacity(flat.len());
    for (i, part) in flat {
        let all: Vec<usize> = (0..part.channels.len()).collect();
        let samples = exr.read(i, &all, kept).map_err(read)?;
        let of = |c: usize| samples.iter().skip(c).step_by(all.len()).copied().collect();
        let channels = part.channels.into_iter().enumerate().map(|(c, channel)| (channel.name, of(c)));
        parts.push(ExrPart { name: part.name, channels: channels.collect() });
    }
    Ok(ExrImage { width, height, parts, lightopt })
}

#[cfg(test)]
mod tests;
