//! Export of lit scenes to the formats of other programs.
//!
//! Every format is one [`Exporter`] in a module of its own, and a line in
//! [`EXPORTERS`]. The command line takes names and help texts from that table, so a
//! new format touches no other file. A format reads the scene through an
//! [`ExportJob`], which says how bright and how large each light is.

mod directory;
mod error;
mod job;
pub mod mitsuba;
mod ply;

use std::{
    fmt,
    path::{Path, PathBuf},
};

pub use error::ExportError;
pub use job::{ExportJob, LitLight};

/// All exporters, in the order in which the help lists them.
pub const EXPORTERS: [&dyn Exporter; 1] = [&mitsuba::Mitsuba];

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
