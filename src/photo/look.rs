//! Looks as users name them: a target, a signature of a library, or a photograph.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::{Photo, PhotoError};
use crate::objective::palette::{Palette, PaletteError};
use crate::objective::signature::library::{Library, LibraryError, split_reference};
use crate::objective::signature::{Shape, Signature, SignatureError};
use crate::objective::target::{DEFAULT_WEIGHTS, HISTOGRAM_ONLY, TargetError};
use crate::objective::{LuminanceMode, Target};
use crate::picture::Format;

/// Why a look cannot be resolved.
#[derive(Debug, Error)]
pub enum LookError {
    /// A target cannot be read.
    #[error(transparent)]
    Target(#[from] TargetError),
    /// A signature library cannot be read, or does not have the class.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// A photograph cannot be read or measured.
    #[error(transparent)]
    Photo(#[from] PhotoError),
    /// A whole signature library is named where one of its classes is wanted.
    #[error(
        "{path}: a signature library holds several looks; choose one: {choices}",
        path = path.display()
    )]
    WholeLibrary {
        /// Path of the library.
        path: PathBuf,
        /// References to the classes of the library, of which one is wanted.
        choices: String,
    },
    /// A mask is given with a look that is not a photograph.
    #[error("{mask}: a mask of a target needs a photograph as target, and `{target}` is none", mask = mask.display())]
    MaskWithoutPhoto {
        /// Path of the mask.
        mask: PathBuf,
        /// Look as the user named it.
        target: String,
    },
    /// The measured colours of a photograph are not valid as a palette.
    #[error("{photo}: no palette", photo = photo.display())]
    Palette {
        /// Path of the photograph.
        photo: PathBuf,
        /// Condition that they violate.
        #[source]
        source: PaletteError,
    },
    /// The measured histogram of a photograph is not valid as a signature.
    #[error("{photo}: no signature", photo = photo.display())]
    Signature {
        /// Path of the photograph.
        photo: PathBuf,
        /// Condition that the histogram violates.
        #[source]
        source: SignatureError,
    },
}

/// What of a photograph, or of a class of photographs, is matched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Matched {
    /// Brightness alone, as f_q is defined.
    #[default]
    Luminance,
    /// Colour too: its means, its spread and its joint histogram.
    Colour,
}

/// A look that has been resolved from its name.
#[derive(Clone, Debug)]
pub enum Look {
    /// Target values and weights.
    Target(Target),
    /// The histogram of a class of a library.
    Class {
        /// Target of the histogram alone.
        target: Target,
        /// Colours of the class; `None` in libraries of earlier versions.
        palette: Option<Palette>,
    },
    /// A photograph, in full size until the size of the pictures to compare is known.
    Photo {
        /// Path of the photograph's file.
        path: PathBuf,
        /// The photograph and its mask.
        photo: Box<Photo>,
    },
}

impl Look {
    /// The look that `spec` names: a built-in target, a photograph (by its ending), a class of
    /// a signature library (`FILE.toml#CLASS`: its histogram alone), or else a target file.
    /// `mask` is the file of the mask of the photograph's main object.
    ///
    /// # Errors
    /// When there is no such look, it is not valid, or a mask is given with another kind of look.
    pub fn resolve(spec: &str, mask: Option<&Path>) -> Result<Self, LookError> {
        let path = Path::new(spec);
        if Format::is_picture_ending(path) {
            let photo = Box::new(Photo::read(path, mask, None)?);
            return Ok(Self::Photo { path: path.to_owned(), photo });
        }
        if let Some(mask) = mask {
            return Err(LookError::MaskWithoutPhoto { mask: mask.to_owned(), target: spec.to_owned() });
        }
        if let Some((file, class)) = split_reference(spec) {
            let signature = Library::find(file, class)?;
            let palette = Library::find_palette(file, class).ok();
            let name = format!("{}-{class}", stem(file));
            return Ok(Self::Class { target: Target::of_histogram(name, signature), palette });
        }
        match (Target::resolve(spec), Library::read(path)) {
            (Ok(target), _) => Ok(Self::Target(target)),
            (Err(_), Ok(library)) => {
                let choices = library.classes.iter().map(|c| format!("{spec}#{}", c.name));
                let choices = choices.collect::<Vec<_>>().join(", ");
                Err(LookError::WholeLibrary { path: path.to_owned(), choices })
            }
            (Err(error), Err(_)) => Err(error.into()),
        }
    }

    /// Name of the look: that of the target, or the stem of the photograph's file name.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Target(target) | Self::Class { target, .. } => target.name().to_owned(),
            Self::Photo { path, .. } => stem(path),
        }
    }

    /// The target for pictures whose longer side has `longest` pixels, measured by `mode`.
    ///
    /// With [`Matched::Colour`] its colours are matched too.
    /// A photograph is reduced to that size if it is larger, since g depends on it. With a mask
    /// all terms count, with the published weights; without, the histogram alone.
    ///
    /// # Errors
    /// When the reduced mask leaves nothing to measure.
    ///
    /// # Panics
    /// When `longest` is 0.
    pub fn into_target(
        self,
        mode: LuminanceMode,
        longest: usize,
        matched: Matched,
    ) -> Result<Target, LookError> {
        let name = self.name();
        match self {
            Self::Target(target) => Ok(target),
            Self::Class { target, palette } => Ok(match palette {
                Some(palette) if matched == Matched::Colour => target.with_palette(palette),
                _ => target,
            }),
            Self::Photo { path, photo } => {
                let z = photo.reduced(longest).measure(mode)?;
                let shape = Shape::Cumulated(z.cumulated().to_vec());
                let signature = Signature::new(&name, shape)
                    .map_err(|source| LookError::Signature { photo: path.clone(), source })?;
                let weights = if photo.has_mask() { DEFAULT_WEIGHTS } else { HISTOGRAM_ONLY };
                if matched == Matched::Luminance {
                    return Ok(Target::new(name, &z.values(), weights, signature));
                }
                let values = if photo.has_mask() { z.values_with_color() } else { z.values() };
                let palette = Palette::new(&name, z.palette())
                    .map_err(|source| LookError::Palette { photo: path.clone(), source })?;
                Ok(Target::new(name, &values, weights, signature).with_palette(palette))
            }
        }
    }
}

/// Name of a file without its directory and ending.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
