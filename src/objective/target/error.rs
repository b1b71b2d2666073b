//! Errors of target files.

use std::path::PathBuf;

use thiserror::Error;

use crate::files::did_you_mean;
use crate::objective::problem::TargetProblem;

/// Why a target cannot be had by its name or from its file.
#[derive(Debug, Error)]
pub enum TargetError {
    /// It is neither a built-in name nor the path of a file.
    #[error(
        "unknown target `{name}`{}; built in are high-key, low-key, golden-hour, moonlight and neon, anything else is the path \
         of a target file (TOML), of a photograph, or FILE.toml#CLASS of a signature library",
        did_you_mean(*.nearest)
    )]
    Unknown {
        /// Name that was given.
        name: String,
        /// Built-in name that it resembles, if there is one.
        nearest: Option<&'static str>,
    },
    /// The file cannot be read.
    #[error("{path}: cannot read the target file", path = path.display())]
    Read {
        /// Path of the target file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
    },
    /// The file is not TOML.
    #[error("{path}:{line}: {message}", path = path.display())]
    Syntax {
        /// Path of the target file.
        path: PathBuf,
        /// Line of the file, counted from 1.
        line: usize,
        /// Message of the parser.
        message: String,
    },
    /// The file is TOML, but not a target.
    #[error("{path}:{line}", path = path.display())]
    Invalid {
        /// Path of the target file.
        path: PathBuf,
        /// Line of the file, counted from 1.
        line: usize,
        /// What is wrong in that line.
        #[source]
        source: TargetProblem,
    },
}
