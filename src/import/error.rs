//! Errors of loading a scene.

use std::path::{Path, PathBuf};

use super::left_out::LeftOut;
use crate::{
    embree::EmbreeError,
    files::{reach::ReachError, toml_file::TomlError},
    picture::PictureError,
    scene::texture::TextureError,
};

/// A line of a text file that cannot be understood.
#[derive(Debug, PartialEq, Eq)]
pub struct LineError {
    /// Line number, from 1.
    pub line: usize,
    /// What is wrong with the line.
    pub message: String,
}

/// A scene could not be loaded. Every message names the file, and the line or key where there is one.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// No file of this name, with or without ending, exists beside the caller or in the library.
    #[error("{path}: no such scene{hint}", path = path.display())]
    NotFound {
        /// Path as given.
        path: PathBuf,
        /// Where else the file was sought, and the nearest name found there.
        hint: String,
    },
    /// The path is a directory.
    #[error("{path}: is a directory; a scene is a Wavefront .obj or a glTF .glb/.gltf file", path = path.display())]
    Directory {
        /// Path as given.
        path: PathBuf,
    },
    /// The file exists, but its name has none of the endings of a scene.
    #[error("{path}: a scene is a Wavefront .obj or a glTF .glb/.gltf file", path = path.display())]
    NotScene {
        /// Path of the file.
        path: PathBuf,
    },
    /// The sidecar exists but cannot be read.
    #[error("{path}: cannot read the sidecar, which gives camera, main object and lights", path = path.display())]
    Sidecar {
        /// Path of the sidecar.
        path: PathBuf,
        /// Cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The scene file cannot be read.
    #[error("{path}: cannot read the scene", path = path.display())]
    Read {
        /// Path of the scene file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The scene file or its sidecar is refused.
    #[error(transparent)]
    Refused(#[from] ReachError),
    /// `tobj` refuses an OBJ that the line checks let pass.
    #[error("{path}: cannot read OBJ or MTL", path = path.display())]
    Obj {
        /// Path of the OBJ.
        path: PathBuf,
        /// Cause.
        source: tobj::LoadError,
    },
    /// A line of an OBJ, an MTL or a sidecar is wrong.
    #[error("{path}:{line}: {message}", path = path.display())]
    Line {
        /// Path of the file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// What is wrong with the line, and what is allowed.
        message: String,
    },
    /// A glTF as a whole is broken, of another version, or requires an unsupported extension.
    #[error("{path}: {message}", path = path.display())]
    Gltf {
        /// Path of the glTF.
        path: PathBuf,
        /// What is wrong with the file.
        message: String,
    },
    /// The scene file holds no triangle of positive area.
    #[error("{path}: no triangle in this file{left_out}", path = path.display())]
    NoTriangles {
        /// Path of the scene file.
        path: PathBuf,
        /// Triangles that it has all the same, which cannot be rendered.
        left_out: LeftOut,
    },
    /// The value of a key of a sidecar or glTF is wrong.
    #[error("{path}: `{key}`: {message}", path = path.display())]
    Key {
        /// Path of the file that holds the key.
        path: PathBuf,
        /// Key with the tables above it, such as `lights.key.radius`.
        key: String,
        /// What is wrong with the value, and what is allowed.
        message: String,
    },
    /// The sidecar is not TOML, or a key of it is unknown or of another type.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// A texture cannot be read.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// A file that the scene or its sidecar names is refused.
    #[error("{path}: `{key}`", path = path.display())]
    Reach {
        /// Path of the file that names it.
        path: PathBuf,
        /// Key, or keyword, that names it.
        key: String,
        /// What is wrong with the file that is named.
        source: ReachError,
    },
    /// The picture that a key of the sidecar names cannot be read.
    #[error("{path}: `{key}`", path = path.display())]
    Picture {
        /// Path of the sidecar.
        path: PathBuf,
        /// Key that names the picture.
        key: String,
        /// Cause.
        source: Box<PictureError>,
    },
    /// Embree refuses the triangles.
    #[error("{path}: cannot build the ray-tracing structure", path = path.display())]
    Embree {
        /// Path of the scene file.
        path: PathBuf,
        /// Cause.
        source: EmbreeError,
    },
}

impl ImportError {
    /// The error of the scene file itself.
    #[must_use]
    pub fn reading(error: ReachError) -> Self {
        match error {
            ReachError::Io { path, source } => Self::Read { path, source },
            refused => Self::Refused(refused),
        }
    }

    /// The error of a line of the file `path`.
    #[must_use]
    pub fn at(path: &Path, LineError { line, message }: LineError) -> Self {
        Self::Line { path: path.into(), line, message }
    }
}
