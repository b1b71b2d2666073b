//! Errors of EXR files.

use std::path::PathBuf;

use thiserror::Error;

use super::{MAX_PIXELS, MAX_SAMPLES};
use crate::files::atomic::AtomicWriteError;

/// Why an EXR file cannot be read or written.
#[derive(Debug, Error)]
pub enum ExrError {
    /// Unreadable or not an EXR file.
    #[error("{path}: cannot read it as an EXR picture", path = .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: exr::error::Error,
    },
    /// The encoder refuses.
    #[error("{path}: cannot write the EXR picture", path = .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: exr::error::Error,
    },
    /// The file cannot be brought to its place.
    #[error(transparent)]
    File(#[from] AtomicWriteError),
    /// A picture without pixels, or with too many.
    #[error("{path}: {width} x {height} pixels; need 1 to {MAX_PIXELS}", path = .path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
    /// Parts and channels that would take too much memory together.
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
    /// A channel of another size than the picture.
    #[error(
        "{path}: channel `{channel}` of part `{part}` has {samples} samples, the picture \
         {width} x {height}", path = .path.display()
    )]
    ChannelSize {
        /// The file.
        path: PathBuf,
        /// The part.
        part: String,
        /// The channel.
        channel: String,
        /// Its number of samples.
        samples: usize,
        /// Width of the picture.
        width: usize,
        /// Height of the picture.
        height: usize,
    },
    /// A name that EXR cannot hold, or that occurs twice.
    #[error(
        "{path}: {kind} `{name}`: names must be unique and of 1 to 255 ASCII characters",
        path = .path.display()
    )]
    Name {
        /// The file.
        path: PathBuf,
        /// Part or channel.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// Nothing to write.
    #[error("{path}: a picture needs at least one part, a part at least one channel", path = .path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Channels of reduced resolution.
    #[error("{path}: channel `{channel}` is subsampled, which is not supported", path = .path.display())]
    Subsampled {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: String,
    },
    /// The attribute is no JSON.
    #[error("{path}: the attribute `lightopt` is not valid JSON", path = .path.display())]
    Attribute {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: serde_json::Error,
    },
}
