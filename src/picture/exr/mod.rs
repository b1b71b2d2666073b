//! Reading EXR files: any number of parts and layers, flat ones beside deep ones, scan lines or
//! tiles, half, float or integer samples, luminance with coarser chroma.
//!
//! The container is read here, so that only what is wanted is decoded and a part that cannot
//! be does no harm; the codecs are those of the crate `exr`.

mod header;
mod layers;
mod pixels;
mod stream;

use std::io::{self, Read, Seek};

use thiserror::Error;

pub use header::{Channel, MAGIC, Part};
pub use layers::{Colours, Layer, listed, quoted};

use super::budget::SizeError;
use crate::math::measure::PLANES;
use header::Headers;
use stream::Stream;

/// Name of the attribute in which our files keep what they show.
pub const ATTRIBUTE: &str = "lightopt";

/// Why an EXR file cannot be read.
#[derive(Debug, Error)]
pub enum ExrFault {
    /// The file system fails.
    #[error("cannot read on")]
    Io(#[from] io::Error),
    /// The file ends before its last chunk.
    #[error("the EXR file is incomplete; was its writing broken off?")]
    Incomplete,
    /// Something is not as the format wants it.
    #[error("the EXR file is damaged: {0}")]
    Damaged(String),
    /// Too large, or empty.
    #[error(transparent)]
    Size(#[from] SizeError),
    /// A codec that is not known.
    #[error(
        "its EXR compression is {0}, which this program does not decode; save it again with ZIP or \
         PIZ compression"
    )]
    Codec(String),
    /// Only deep data.
    #[error("it holds deep EXR data only; flatten it, or save the flat picture beside it")]
    Deep,
    /// Coarser channels that cannot be decoded.
    #[error(
        "it holds luminance and coarser chroma in a way that is not read; save it again as R, G, B, or with \
         ZIP or PIZ compression"
    )]
    Sampling,
    /// No layer is a picture.
    #[error("needs channels R, G, B (or Y, or V), the file has {0}")]
    NoPicture(String),
    /// No channel that can be a mask.
    #[error("needs a channel `mask` (or R, G, B, or a single channel, Y or A), the file has {0}")]
    NoMask(String),
    /// No such layer, or several.
    #[error("no single layer is called `{name}`; choose {choices}")]
    Layer {
        /// What was asked for.
        name: String,
        /// What there is.
        choices: String,
    },
}

/// An EXR file whose headers have been read.
#[derive(Debug)]
pub struct ExrFile<R> {
    stream: Stream<R>,
    headers: Headers,
    layers: Vec<Layer>,
}

impl<R: Read + Seek> ExrFile<R> {
    /// Reads the headers.
    ///
    /// # Errors
    /// When they are damaged.
    pub fn open(source: R) -> Result<Self, ExrFault> {
        let mut stream = Stream::new(source)?;
        let headers = Headers::read(&mut stream)?;
        let layers = layers::layers(&headers);
        Ok(Self { stream, headers, layers })
    }

    /// The parts, at least one.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.headers.parts
    }

    /// The layers that are pictures.
    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Our attribute, where the file has it.
    #[must_use]
    pub fn attribute(&self) -> Option<&str> {
        self.headers.parts.iter().find_map(|part| part.attribute.as_deref())
    }

    /// The layer of the given name, by default the one that is the picture.
    ///
    /// # Errors
    /// When there is none.
    pub fn layer(&self, name: Option<&str>) -> Result<Layer, ExrFault> {
        layers::choose(&self.headers, &self.layers, name).cloned()
    }

    /// Part and index of the channel of a mask: the channel `mask`, best in a part of that name,
    /// of a file that has one.
    #[must_use]
    pub fn mask_channel(&self) -> Option<[usize; 2]> {
        self.channel("mask", |part| part.name == "mask").or_else(|| self.channel("mask", |_| true))
    }

    /// Part and indices of the channels of the replicates of a picture of this program, by replicate: of Y0,
    /// Y1 and so on in the part `replicates`, of which there are two at least, or of Y0, R0, B0, Y1 and so on
    /// where all have colour.
    #[must_use]
    pub fn replicates(&self) -> Option<(usize, Vec<Vec<usize>>)> {
        let mut parts = self.headers.parts.iter();
        let part = parts.position(|part| !part.is_deep && part.name == "replicates")?;
        let channels = &self.headers.parts[part].channels;
        let index = |plane: char, r: usize| channels.iter().position(|c| c.name == format!("{plane}{r}"));
        let all = |planes: &[char]| -> Vec<Vec<usize>> {
            let of = |r: usize| planes.iter().map(|&plane| index(plane, r)).collect();
            (0..channels.len()).map_while(of).collect()
        };
        let (luminance, colour) = (all(&PLANES[..1]), all(&PLANES));
        let all = if colour.len() == luminance.len() { colour } else { luminance };
        (all.len() >= 2).then_some((part, all))
    }

    /// Part and index of the channel of a file that has a single one.
    #[must_use]
    pub fn only_channel(&self) -> Option<[usize; 2]> {
        matches!(self.headers.parts.as_slice(), [part] if part.channels.len() == 1).then_some([0, 0])
    }

    /// Part and index of the first channel A.
    #[must_use]
    pub fn alpha_channel(&self) -> Option<[usize; 2]> {
        self.channel("A", |_| true)
    }

    /// Part and index of the first channel of this name in the flat parts for which `is_of` holds.
    fn channel(&self, name: &str, is_of: impl Fn(&Part) -> bool) -> Option<[usize; 2]> {
        let parts = self.headers.parts.iter().enumerate();
        let mut fitting = parts.filter(|(_, part)| !part.is_deep && is_of(part));
        fitting.find_map(|(i, part)| Some([i, part.channels.iter().position(|c| c.name == name)?]))
    }

    /// Samples of channels of a part, interleaved, over the display window.
    ///
    /// * `kept`: bytes that the caller keeps of each pixel beside the result
    ///
    /// # Errors
    /// When they are damaged, cannot be decoded, or would take too much memory.
    pub fn read(&mut self, part: usize, channels: &[usize], kept: usize) -> Result<Vec<f32>, ExrFault> {
        let number = self.headers.is_multipart.then_some(part);
        pixels::read(&mut self.stream, &self.headers.parts[part], number, channels, kept)
    }
}

#[cfg(test)]
mod tests;
