//! From the content of a target file to a [`Target`], checked key by key.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Map, Value};

use super::{DEFAULT_WEIGHTS, SCHEMA, Target};
use crate::objective::problem::{
    TargetProblem, TargetProblemReason, check_keys, expected, number, problem, require, table,
};
use crate::objective::terms::{Goal, Kind, N_TERMS, Scalar, Term};

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
        check_top_keys(top)?;
        let schema = require(top, &[], "schema")?;
        if schema.as_i64() != Some(SCHEMA) {
            return Err(expected(&["schema"], "1", schema));
        }
        let name = require(top, &[], "name")?;
        let Some(name) = name.as_str().filter(|s| !s.is_empty()) else {
            return Err(expected(&["name"], "a name in quotes", name));
        };
        let mut goals = BTreeMap::new();
        for term in Term::ALL {
            if let Some(value) = top.get(&term.goal_key()) {
                goals.insert(term, read_goal(term, value, base)?);
            }
        }
        let weights = read_weights(top)?;
        let needs_goal = |term: &Term| term.is_standing() || weights[*term as usize] > 0.0;
        let missing = |term: &Term| needs_goal(term) && !goals.contains_key(term);
        if let Some(term) = Term::ALL.into_iter().find(missing) {
            return Err(problem(&[&term.goal_key()], TargetProblemReason::Missing));
        }
        Ok(Self { name: name.to_owned(), goals, weights })
    }
}

fn check_top_keys(top: &Map<String, Value>) -> Result<(), TargetProblem> {
    let goals = |are_distances: bool| {
        Term::ALL.into_iter().filter(move |t| t.is_distance() == are_distances).map(Term::goal_key)
    };
    let goals: Vec<String> = goals(true).chain(goals(false)).collect();
    let goals = goals.iter().map(String::as_str);
    let known: Vec<&str> = ["schema", "name"].into_iter().chain(goals).chain(["weights"]).collect();
    check_keys(top, &[], &known)
}

fn read_weights(top: &Map<String, Value>) -> Result<[f64; N_TERMS], TargetProblem> {
    const KEY: &str = "weights";
    let mut weights = DEFAULT_WEIGHTS;
    let Some(value) = top.get(KEY) else { return Ok(weights) };
    let given = table(value, &[KEY])?;
    check_keys(given, &[KEY], &Term::ALL.map(Term::name))?;
    for (weight, name) in weights.iter_mut().zip(Term::ALL.map(Term::name)) {
        if let Some(value) = given.get(name) {
            *weight = number(value, &[KEY, name], "a number >= 0", |v| v >= 0.0)?;
        }
    }
    if weights.iter().all(|&w| w == 0.0) {
        return Err(expected(&[KEY], "above 0 for at least one term", "zeros"));
    }
    Ok(weights)
}

/// The goal of a term from the value of its key.
fn read_goal(term: Term, value: &Value, base: &Path) -> Result<Goal, TargetProblem> {
    match term.kind() {
        Kind::Scalar(Scalar { targets, .. }) => {
            let is_allowed = |v| (targets.low..=targets.high).contains(&v);
            number(value, &[&term.goal_key()], targets.words, is_allowed).map(Goal::Value)
        }
        Kind::Distance(distance) => (distance.read)(value, base),
    }
}

/// Line in which the byte at `offset` stands, counted from 1.
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
