//! Why a scene cannot be loaded.

use std::path::{Path, PathBuf};

use super::wavefront::LineError;
use crate::{embree::EmbreeError, files::toml_file::TomlError, scene::texture::TextureError};

/// A scene could not be loaded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ImportError {
    #[error("{path}: no such scene{hint}", path = path.display())]
    NotFound { path: PathBuf, hint: String },
    #[error("{path}: is a directory; a scene is a Wavefront .obj or a glTF .glb/.gltf file", path = path.display())]
    Directory { path: PathBuf },
    #[error("{path}: a scene is a Wavefront .obj or a glTF .glb/.gltf file", path = path.display())]
    NotScene { path: PathBuf },
    #[error("{path}: cannot read the sidecar, which gives camera, main object and lights", path = path.display())]
    Sidecar { path: PathBuf, source: std::io::Error },
    #[error("{path}: cannot read the scene", path = path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path}: cannot read OBJ or MTL", path = path.display())]
    Obj { path: PathBuf, source: tobj::LoadError },
    #[error("{path}:{line}: {message}", path = path.display())]
    Line { path: PathBuf, line: usize, message: String },
    #[error("{path}: {message}", path = path.display())]
    Gltf { path: PathBuf, message: String },
    #[error(
        "{path}: no triangle in this file{degenerate}", path = path.display(),
        degenerate = match n_degenerate { 0 => String::new(), n => format!(" but for {n} that are degenerate") }
    )]
    NoTriangles { path: PathBuf, n_degenerate: usize },
    #[error("{path}: `{key}`: {message}", path = path.display())]
    Key { path: PathBuf, key: String, message: String },
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error(transparent)]
    Texture(#[from] TextureError),
    #[error("{path}: `{key}`", path = path.display())]
    Picture { path: PathBuf, key: String, source: Box<crate::film::image_file::ImageFileError> },
    #[error("{path}: cannot build the ray-tracing structure", path = path.display())]
    Embree { path: PathBuf, source: EmbreeError },
}

impl ImportError {
    /// What is wrong with a line of a file.
    #[must_use]
    pub fn at(path: &Path, LineError { line, message }: LineError) -> Self {
        Self::Line { path: path.into(), line, message }
    }
}
