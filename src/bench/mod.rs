//! How fast this program is, beside others that do the same.
//!
//! Every part measures side by side: the programs take turns, on the same threads, and what is told is the median
//! over rounds with the least and the largest. Other renderers run in a Python environment, by small programs of
//! ours that are part of this one ([`python`]).
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`python`], [`peers`] | the Python environment of other renderers, and these as processes in it |
//! | [`scenes`] | scenes that are generated |
//! | [`subject`] | a scene as it is rendered here and exported there |
//! | [`pictures`] | errors of pictures from pairs of seeds, and whether means agree |
//! | [`efficiency`] | error and seconds of pictures, ours and theirs |
//! | [`rays`] | rays a second inside our integrators, beside those of a bare loop of Embree |
//! | [`spread`] | numbers that were measured several times |
//! | [`machine`] | what all was measured on |
//! | [`plots`], [`report`] | bars, tables, pages and records of all parts |

pub mod efficiency;
pub mod machine;
pub mod peers;
pub mod pictures;
pub mod plots;
pub mod python;
pub mod rays;
pub mod report;
pub mod scenes;
pub mod spread;
pub mod subject;

use std::{io, path::PathBuf};

use crate::{
    audit::AuditError, canvas::FigureError, embree::EmbreeError, export::ExportError, import::ImportError,
    integrator::RenderError,
};

/// A part of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// Error and seconds of pictures.
    Efficiency,
    /// Rays a second, beside a bare loop of Embree.
    Rays,
}

impl Part {
    /// All parts, in the order in which they are measured.
    pub const ALL: [Self; 2] = [Self::Efficiency, Self::Rays];

    /// The word for the part.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Efficiency => "efficiency",
            Self::Rays => "rays",
        }
    }
}

/// Another renderer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Peer {
    /// Mitsuba 3.
    Mitsuba,
}

impl Peer {
    /// All peers.
    pub const ALL: [Self; 1] = [Self::Mitsuba];

    /// The word for the peer.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Mitsuba => "mitsuba",
        }
    }

    /// Packages of Python that it needs.
    #[must_use]
    pub fn packages(self) -> &'static [&'static str] {
        match self {
            Self::Mitsuba => &["mitsuba", "numpy"],
        }
    }

    /// Whether an environment has it.
    #[must_use]
    pub fn is_in(self, environment: &python::Environment) -> bool {
        self.packages().iter().all(|package| environment.has(package))
    }
}

/// Why something could not be measured.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum BenchError {
    #[error(transparent)]
    Python(#[from] python::PythonError),
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Embree(#[from] EmbreeError),
    #[error(transparent)]
    Figure(#[from] FigureError),
    #[error(transparent)]
    Table(#[from] csv::Error),
    #[error(transparent)]
    Audit(#[from] AuditError),
    #[error("{path}: cannot {action}", path = path.display())]
    File { path: PathBuf, action: &'static str, source: io::Error },
    #[error("{path}: {fault}", path = path.display())]
    Answer { path: PathBuf, fault: String },
    #[error("interrupted")]
    Interrupted,
}
