//! Errors of target files.

use std::path::PathBuf;

use thiserror::Error;

use crate::objective::signature::{self, SignatureError};

/// Why there is no target.
#[derive(Debug, Error)]
pub enum TargetError {
    /// Neither a built-in name nor a file.
    #[error(
        "unknown target `{name}`{}; built in are high-key and low-key, anything else is the path \
         of a target file (TOML), of a photograph, or FILE.toml#CLASS of a signature library",
        did_you_mean(*.nearest)
    )]
    Unknown {
        /// What was asked for.
        name: String,
        /// The built-in name it resembles.
        nearest: Option<&'static str>,
    },
    /// The file cannot be read.
    #[error("{path}: cannot read the target file", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// Not TOML.
    #[error("{path}:{line}: {message}", path = path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What the parser says.
        message: String,
    },
    /// TOML, but no target.
    #[error("{path}:{line}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong there.
        #[source]
        source: TargetProblem,
    },
}

/// What is wrong with the content of a target.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}{reason}", in_key(key))]
pub struct TargetProblem {
    /// Path of the key; empty for the whole.
    pub key: Vec<String>,
    /// What is wrong with it.
    pub reason: TargetProblemReason,
}

/// See [`TargetProblem`].
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TargetProblemReason {
    /// A key that means nothing.
    #[error("unknown key{}; known are {known}", did_you_mean(.nearest.as_deref()))]
    UnknownKey {
        /// The known key it resembles.
        nearest: Option<String>,
        /// All known keys, for the message.
        known: String,
    },
    /// A key that must be there is not.
    #[error("is missing")]
    Missing,
    /// Wrong type or outside the allowed values.
    #[error("must be {expected}, got {found}")]
    Expected {
        /// What is allowed.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// No built-in signature of this name.
    #[error("unknown signature `{name}`{}; built in are {}, anything else is FILE.toml#CLASS of a library", did_you_mean(*.nearest), signature::BUILTIN.join(", "))]
    UnknownSignature {
        /// What was asked for.
        name: String,
        /// The built-in name it resembles.
        nearest: Option<&'static str>,
    },
    /// A library that cannot be used.
    #[error("{message}")]
    Library {
        /// File, key and what is wrong.
        message: String,
    },
    /// Not a distribution.
    #[error(transparent)]
    Signature(#[from] SignatureError),
}

fn did_you_mean(nearest: Option<&str>) -> String {
    nearest.map(|n| format!(", did you mean `{n}`?")).unwrap_or_default()
}

fn in_key(key: &[String]) -> String {
    if key.is_empty() { String::new() } else { format!("`{}`: ", key.join(".")) }
}
