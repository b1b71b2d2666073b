//! Errors of exports.

use std::path::PathBuf;

use crate::{files::atomic::AtomicWriteError, film::exr::ExrError};

/// Why a scene could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A part of the scene that the format cannot express.
    #[error("{thing}: {format} has no counterpart to {what}")]
    NoCounterpart {
        /// Name of the format, as a user knows it.
        format: &'static str,
        /// Kind and name of the scene's part, such as ``light `key` ``.
        thing: String,
        /// The property that the format lacks, and what the user can do instead.
        what: &'static str,
    },
    /// The file to write has another ending than the format's files.
    #[error("{path}: {format} is written to a file that ends in .{ending}", path = path.display())]
    Ending {
        /// Path that was given.
        path: PathBuf,
        /// Name of the format, as a user knows it.
        format: &'static str,
        /// What the name must end in, without the dot.
        ending: &'static str,
    },
    /// The directory to export to does not exist and cannot be made.
    #[error("{path}: cannot make the directory", path = path.display())]
    Directory {
        /// Path of the directory.
        path: PathBuf,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// The content of a file cannot be written.
    #[error("{path}: cannot write", path = path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// A finished file cannot be brought to its place.
    #[error(transparent)]
    Place(#[from] AtomicWriteError),
    /// A texture cannot be written as an EXR picture.
    #[error(transparent)]
    Texture(#[from] ExrError),
}
