//! Export of lit scenes to the formats of other renderers and modelling programs.
//!
//! Every format is one [`Exporter`] in a module of its own, and a line in
//! [`EXPORTERS`]. The command line takes names and help texts from that table, so a
//! new format touches no other file. A format reads the scene through an
//! [`ExportJob`], which says how bright and how large each light is.

pub mod blender;
mod directory;
mod error;
pub mod gltf;
mod job;
pub mod mitsuba;
pub mod pbrt;
mod ply;
mod sheet;
pub mod usd;

use std::{
    fmt,
    path::{Path, PathBuf},
};

pub use error::ExportError;
pub use job::{ExportJob, ExportOptions, LitLight};

/// All exporters, in the order in which the help lists them.
pub const EXPORTERS: [&dyn Exporter; 5] =
    [&mitsuba::Mitsuba, &blender::Blender, &usd::Usd, &pbrt::Pbrt, &gltf::Gltf];

/// An option that only some formats have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Offer {
    /// Lights that stop rays, for a path tracer that knows no others.
    Blocking,
    /// Luminances in the place of radiances.
    Photometric,
    /// The whole scene in the place of what is laid over it.
    Whole,
}

/// A format that a lit scene can be written in.
pub trait Exporter: fmt::Debug + Send + Sync {
    /// Unique lower-case name, which `--format` selects the exporter by.
    fn name(&self) -> &'static str;

    /// The program that reads the format and how to start it, as a phrase for the help.
    fn help(&self) -> &'static str;

    /// The kinds of files that [`write`](Self::write) makes, as a phrase for the help.
    fn files(&self) -> &'static str;

    /// The file to open in the other program after an export to `out`.
    fn entry_point(&self, out: &Path) -> PathBuf;

    /// Whether the format has an option.
    fn offers(&self, _option: Offer) -> bool {
        false
    }

    /// Writes the scene to `out`: a directory, made if it is not there, or a file, as the
    /// format needs. The entry point comes last, so that an export cut short has none.
    ///
    /// # Errors
    /// When something in the scene has no counterpart in the format (before anything is
    /// written), or a file cannot be written.
    fn write(&self, job: &ExportJob, out: &Path) -> Result<Exported, ExportError>;
}

/// The outcome of a finished export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// Paths of the files written, in the order of writing.
    pub files: Vec<PathBuf>,
    /// Sentences about what the other program shows differently, for the user.
    pub warnings: Vec<String>,
}

/// The exporter of this [name](Exporter::name).
#[must_use]
pub fn by_name(name: &str) -> Option<&'static dyn Exporter> {
    EXPORTERS.into_iter().find(|e| e.name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_exporter_is_found_by_its_own_name() {
        for exporter in EXPORTERS {
            let found = by_name(exporter.name()).expect("it is listed");
            assert_eq!(found.files(), exporter.files(), "two exporters are named {}", exporter.name());
        }
        assert!(by_name("povray").is_none());
    }
}
