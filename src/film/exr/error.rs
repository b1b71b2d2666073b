//! Errors of EXR files.

use std::path::PathBuf;

use thiserror::Error;

use super::MAX_SAMPLES;
use crate::files::atomic::AtomicWriteError;
use crate::picture::budget::MAX_PIXELS;
use crate::picture::exr::ExrFault;

/// Why an EXR file cannot be read or written.
#[derive(Debug, Error)]
pub enum ExrError {
    /// The file cannot be read, or is not an EXR file.
    #[error("{path}: cannot read it as an EXR picture", path = .path.display())]
    Read {
        /// Path of the EXR file.
        path: PathBuf,
        /// What is wrong with the file.
        #[source]
        source: ExrFault,
    },
    /// The encoder refuses the picture.
    #[error("{path}: cannot write the EXR picture", path = .path.display())]
    Write {
        /// Path of the EXR file.
        path: PathBuf,
        /// Error of the decoder or encoder.
        #[source]
        source: exr::error::Error,
    },
    /// A finished file cannot be brought to its place.
    #[error(transparent)]
    File(#[from] AtomicWriteError),
    /// The picture has no pixels, or too many.
    #[error("{path}: {width} x {height} pixels; need 1 to {MAX_PIXELS}", path = .path.display())]
    Size {
        /// Path of the EXR file.
        path: PathBuf,
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
    /// All parts and channels together have too many samples.
    #[error(
        "{path}: {samples} samples in all channels of all parts; at most {MAX_SAMPLES} are possible",
        path = .path.display()
    )]
    Samples {
        /// Path of the EXR file.
        path: PathBuf,
        /// Number of samples: pixels times channels, summed over the parts.
        samples: u64,
    },
    /// A channel has another number of samples than the picture has pixels.
    #[error(
        "{path}: channel `{channel}` of part `{part}` has {samples} samples, the picture \
         {width} x {height}", path = .path.display()
    )]
    ChannelSize {
        /// Path of the EXR file.
        path: PathBuf,
        /// Name of the part.
        part: String,
        /// Name of the channel.
        channel: String,
        /// Number of samples of the channel.
        samples: usize,
        /// Width of the picture, pixels.
        width: usize,
        /// Height of the picture, pixels.
        height: usize,
    },
    /// A name is one that EXR cannot hold, or occurs twice.
    #[error(
        "{path}: {kind} `{name}`: names must be unique and of 1 to 255 ASCII characters",
        path = .path.display()
    )]
    Name {
        /// Path of the EXR file.
        path: PathBuf,
        /// Kind of thing that is named: part, channel or attribute.
        kind: &'static str,
        /// Name that is refused.
        name: String,
    },
    /// The picture has no part, or a part no channel.
    #[error("{path}: a picture needs at least one part, a part at least one channel", path = .path.display())]
    Empty {
        /// Path of the EXR file.
        path: PathBuf,
    },
    /// The attribute `lightopt` is not JSON.
    #[error("{path}: the attribute `lightopt` is not valid JSON", path = .path.display())]
    Attribute {
        /// Path of the EXR file.
        path: PathBuf,
        /// Error of the JSON parser.
        #[source]
        source: serde_json::Error,
    },
}
