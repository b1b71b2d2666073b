//! The scene for other renderers, so that ours can be checked against them.

pub mod mitsuba;
mod ply;

use std::path::PathBuf;

use crate::{files::atomic::AtomicWriteError, film::exr::ExrError};

/// A scene could not be exported.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ExportError {
    #[error("light `{light}`: a rectangle with a cone has no counterpart in Mitsuba")]
    Cone { light: String },
    #[error(
        "light `{light}` is hidden from the camera and others are not: Mitsuba hides all lights or none; \
         give all the same `camera_visible`"
    )]
    Visibility { light: String },
    #[error("{path}: cannot make the directory", path = path.display())]
    Directory { path: PathBuf, source: std::io::Error },
    #[error("{path}: cannot write", path = path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error(transparent)]
    Place(#[from] AtomicWriteError),
    #[error(transparent)]
    Texture(#[from] ExrError),
}
