//! What can be wrong with the content of a target file, and the checks of its values.

use std::fmt;

use serde_json::{Map, Value};
use thiserror::Error;

use super::signature::{self, SignatureError};
use crate::files::{did_you_mean, nearest};

/// What is wrong with the content of a target, and at which key.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{}{reason}", in_key(key))]
pub struct TargetProblem {
    /// Names of the tables from the outermost in, then of the key; empty when the problem is of the
    /// whole file.
    pub key: Vec<String>,
    /// What is wrong with the value of that key.
    pub reason: TargetProblemReason,
}

/// What is wrong with a key of a target, or with its value.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TargetProblemReason {
    /// The key means nothing there.
    #[error("unknown key{}; known are {known}", did_you_mean(.nearest.as_deref()))]
    UnknownKey {
        /// Known key that it resembles, if there is one.
        nearest: Option<String>,
        /// All known keys, separated by commas.
        known: String,
    },
    /// The key must be there and is not.
    #[error("is missing")]
    Missing,
    /// The value has the wrong type, or is none of the allowed ones.
    #[error("must be {expected}, got {found}")]
    Expected {
        /// The allowed values in words.
        expected: &'static str,
        /// The value of the file.
        found: String,
    },
    /// There is no built-in signature of this name.
    #[error("unknown signature `{name}`{}; built in are {}, anything else is FILE.toml#CLASS of a library", did_you_mean(*.nearest), signature::BUILTIN.join(", "))]
    UnknownSignature {
        /// Name in the file.
        name: String,
        /// Built-in name that it resembles, if there is one.
        nearest: Option<&'static str>,
    },
    /// The signature library that is named cannot be used.
    #[error("{message}")]
    Library {
        /// File and key of the library, and what is wrong there.
        message: String,
    },
    /// The signature is not a distribution on [0, 1].
    #[error(transparent)]
    Signature(#[from] SignatureError),
}

fn in_key(key: &[String]) -> String {
    if key.is_empty() { String::new() } else { format!("`{}`: ", key.join(".")) }
}

/// A problem at a key, given by its path.
pub(super) fn problem(key: &[&str], reason: impl Into<TargetProblemReason>) -> TargetProblem {
    TargetProblem { key: key.iter().map(|&k| k.to_owned()).collect(), reason: reason.into() }
}

/// A value that is not as allowed.
pub(super) fn expected(key: &[&str], expected: &'static str, found: impl fmt::Display) -> TargetProblem {
    let found = found.to_string();
    problem(key, TargetProblemReason::Expected { expected, found })
}

/// The value as a table.
pub(super) fn table<'v>(value: &'v Value, key: &[&str]) -> Result<&'v Map<String, Value>, TargetProblem> {
    value.as_object().ok_or_else(|| expected(key, "a table", value))
}

/// The value of `key` in a table that stands `within` others.
pub(super) fn require<'v>(
    table: &'v Map<String, Value>,
    within: &[&str],
    key: &str,
) -> Result<&'v Value, TargetProblem> {
    table.get(key).ok_or_else(|| {
        let path: Vec<&str> = within.iter().copied().chain([key]).collect();
        problem(&path, TargetProblemReason::Missing)
    })
}

/// The value as a finite number that passes `check`; `allowed` are such numbers in words.
pub(super) fn number(
    value: &Value,
    key: &[&str],
    allowed: &'static str,
    check: impl Fn(f64) -> bool,
) -> Result<f64, TargetProblem> {
    // TOML's inf and nan have no JSON number and arrive as null.
    value.as_f64().filter(|v| v.is_finite() && check(*v)).ok_or_else(|| expected(key, allowed, value))
}

/// Refuses a table with a key that is not `known`.
pub(super) fn check_keys(
    table: &Map<String, Value>,
    within: &[&str],
    known: &[&str],
) -> Result<(), TargetProblem> {
    match table.keys().find(|key| !known.contains(&key.as_str())) {
        None => Ok(()),
        Some(key) => {
            let path: Vec<&str> = within.iter().copied().chain([key.as_str()]).collect();
            let nearest = nearest(key, known.iter().copied()).map(str::to_owned);
            let known = known.join(", ");
            Err(problem(&path, TargetProblemReason::UnknownKey { nearest, known }))
        }
    }
}
