//! From the content of a target file to a [`Target`], checked key by key.

use std::error::Error;
use std::fmt;
use std::path::Path;

use serde_json::{Map, Value};

use super::{
    MAX_GRADIENT, PUBLISHED_WEIGHTS, SCHEMA, TARGET_KEYS, TOP_KEYS, Target, TargetProblem,
    TargetProblemReason, WEIGHT_KEYS,
};
use crate::files::nearest;
use crate::objective::signature::library::{Library, split_reference};
use crate::objective::signature::{self, BetaComponent, Shape, Signature};

fn problem(key: &[&str], reason: impl Into<TargetProblemReason>) -> TargetProblem {
    TargetProblem { key: key.iter().map(|&k| k.to_owned()).collect(), reason: reason.into() }
}

fn expected(key: &[&str], expected: &'static str, found: impl fmt::Display) -> TargetProblem {
    let found = found.to_string();
    problem(key, TargetProblemReason::Expected { expected, found })
}

impl Target {
    /// Reads a target from JSON, as [`serde::Serialize`] writes it.
    ///
    /// # Errors
    /// With the key, when it is no valid target.
    pub fn from_value(value: &Value) -> Result<Self, TargetProblem> {
        Self::from_value_at(value, Path::new(""))
    }

    /// [`Target::from_value`] where the paths of signature libraries begin at `base`.
    pub(super) fn from_value_at(value: &Value, base: &Path) -> Result<Self, TargetProblem> {
        let top = table(value, &[])?;
        check_keys(top, &[], &TOP_KEYS)?;
        let schema = require(top, &[], "schema")?;
        if schema.as_i64() != Some(SCHEMA) {
            return Err(expected(&["schema"], "1", schema));
        }
        let name = require(top, &[], "name")?;
        let Some(name) = name.as_str().filter(|s| !s.is_empty()) else {
            return Err(expected(&["name"], "a name in quotes", name));
        };
        let mut targets = [0.0; 5];
        for (t, key) in targets.iter_mut().zip(TARGET_KEYS) {
            let (most, allowed) = range_of(key);
            *t = number(require(top, &[], key)?, &[key], allowed, |v| (0.0..=most).contains(&v))?;
        }
        let mut weights = PUBLISHED_WEIGHTS;
        if let Some(value) = top.get("weights") {
            let given = table(value, &["weights"])?;
            check_keys(given, &["weights"], &WEIGHT_KEYS)?;
            for (weight, key) in weights.iter_mut().zip(WEIGHT_KEYS) {
                if let Some(value) = given.get(key) {
                    *weight = number(value, &["weights", key], "a number >= 0", |v| v >= 0.0)?;
                }
            }
            if weights.iter().all(|&w| w == 0.0) {
                return Err(expected(&["weights"], "above 0 for at least one term", "zeros"));
            }
        }
        let signature = parse_signature(require(top, &[], "signature")?, base)?;
        Ok(Self { name: name.to_owned(), targets, weights, signature })
    }
}

/// The largest value of a scalar target, and the range in words.
fn range_of(key: &str) -> (f64, &'static str) {
    match key {
        "t_grad" => (MAX_GRADIENT, "a number from 0 to 4.47, the largest gradient of a picture"),
        _ => (1.0, "a number from 0 to 1"),
    }
}

fn parse_signature(value: &Value, base: &Path) -> Result<Signature, TargetProblem> {
    const KEY: &str = "signature";
    if let Some((file, class)) = value.as_str().and_then(split_reference) {
        return Library::find(&base.join(file), class)
            .map_err(|e| problem(&[KEY], TargetProblemReason::Library { message: whole_message(&e) }));
    }
    if let Some(name) = value.as_str() {
        return Signature::builtin(name).ok_or_else(|| {
            let nearest = nearest(name, signature::BUILTIN);
            let name = name.to_owned();
            problem(&[KEY], TargetProblemReason::UnknownSignature { name, nearest })
        });
    }
    let given = table(value, &[KEY])?;
    check_keys(given, &[KEY], &["name", "betas", "cumulated"])?;
    let name = match given.get("name") {
        None => "custom",
        Some(name) => name.as_str().ok_or_else(|| expected(&[KEY, "name"], "a name in quotes", name))?,
    };
    let list = |key| match given.get(key) {
        None => Ok(None),
        Some(Value::Array(list)) => Ok(Some(list)),
        Some(other) => Err(expected(&[KEY, key], "a list", other)),
    };
    let (shape, key) = match (list("betas")?, list("cumulated")?) {
        (Some(betas), None) => (Shape::Betas(parse_betas(betas)?), "betas"),
        (None, Some(values)) => {
            let values: Result<_, _> = values
                .iter()
                .map(|v| number(v, &[KEY, "cumulated"], "a list of numbers", |_| true))
                .collect();
            (Shape::Cumulated(values?), "cumulated")
        }
        (None, None) => {
            return Err(expected(&[KEY], "a table with `betas` or `cumulated`", "neither"));
        }
        (Some(_), Some(_)) => {
            return Err(expected(&[KEY], "a table with `betas` or `cumulated`", "both"));
        }
    };
    Signature::new(name, shape).map_err(|e| problem(&[KEY, key], e))
}

/// The message of an error with those of its causes.
fn whole_message(error: &dyn Error) -> String {
    match error.source() {
        None => error.to_string(),
        Some(source) => format!("{error}: {}", whole_message(source)),
    }
}

fn parse_betas(list: &[Value]) -> Result<Vec<BetaComponent>, TargetProblem> {
    const KEY: [&str; 2] = ["signature", "betas"];
    const FIELDS: [&str; 3] = ["fraction", "mean", "sigma"];
    list.iter()
        .map(|value| {
            let given = table(value, &KEY)?;
            check_keys(given, &KEY, &FIELDS)?;
            let field =
                |key| number(require(given, &KEY, key)?, &[KEY[0], KEY[1], key], "a number", |_| true);
            Ok(BetaComponent {
                fraction: field(FIELDS[0])?,
                mean: field(FIELDS[1])?,
                sigma: field(FIELDS[2])?,
            })
        })
        .collect()
}

fn table<'v>(value: &'v Value, key: &[&str]) -> Result<&'v Map<String, Value>, TargetProblem> {
    value.as_object().ok_or_else(|| expected(key, "a table", value))
}

fn require<'v>(
    table: &'v Map<String, Value>,
    within: &[&str],
    key: &str,
) -> Result<&'v Value, TargetProblem> {
    table.get(key).ok_or_else(|| {
        let path: Vec<&str> = within.iter().copied().chain([key]).collect();
        problem(&path, TargetProblemReason::Missing)
    })
}

fn number(
    value: &Value,
    key: &[&str],
    allowed: &'static str,
    check: impl Fn(f64) -> bool,
) -> Result<f64, TargetProblem> {
    // TOML's inf and nan have no JSON number and arrive as null.
    value.as_f64().filter(|v| v.is_finite() && check(*v)).ok_or_else(|| expected(key, allowed, value))
}

fn check_keys(table: &Map<String, Value>, within: &[&str], known: &[&str]) -> Result<(), TargetProblem> {
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

pub(super) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&b| b == b'\n').count()
}

/// Line of the key at `path`, or of the longest prefix of it that exists (1: none does).
pub(super) fn line_of_key(text: &str, path: &[String]) -> usize {
    use toml::de::{DeTable, DeValue};
    let (document, _) = DeTable::parse_recoverable(text);
    let mut tables = vec![document.get_ref()];
    let mut line = 1;
    for name in path {
        // A list of tables offers several; the last with the key is as good as any.
        let found = tables.iter().flat_map(|t| t.iter()).rfind(|(key, _)| key.get_ref().as_ref() == name);
        let Some((key, value)) = found else { break };
        line = line_at(text, key.span().start);
        tables = match value.get_ref() {
            DeValue::Table(table) => vec![table],
            DeValue::Array(list) => list.iter().filter_map(|item| item.get_ref().as_table()).collect(),
            _ => break,
        };
    }
    line
}
