//! Target files: what a picture should look like, as TOML (or the same structure as JSON).
//!
//! ```toml
//! schema = 1
//! name = "high-key"
//! signature = "high"         # a built-in one; or "FILE.toml#CLASS", of a signature library
//!                            # (a path beginning at this file); or a table [signature] with
//!                            #   betas = [{ fraction = 1.0, mean = 0.5, sigma = 0.2 }]
//!                            # or cumulated = [256 rising values, the last 1]
//! t_meanObj = 0.47           # display luminance, 0 to 1; likewise t_meanBack,
//!                            # t_varObj, t_varBack (standard deviations); t_grad, 0 to 4.47
//! [weights]                  # >= 0; those left out keep the published value
//! hist = 1.0
//! ```
//!
//! Unknown keys are refused: a misspelt one would silently keep a default.

mod error;
mod parse;

use std::fs;
use std::path::Path;

use serde::{Serialize, Serializer};
use serde_json::Value;

pub use error::{TargetError, TargetProblem, TargetProblemReason};

use super::Term;
use super::signature::Signature;
use crate::files::nearest;
use parse::{line_at, line_of_key};

/// The only version of target files so far.
pub const SCHEMA: i64 = 1;

/// Built-in targets as the text of their files.
pub const BUILTIN: [(&str, &str); 2] = [
    ("high-key", include_str!("../../scenes/targets/high-key.toml")),
    ("low-key", include_str!("../../scenes/targets/low-key.toml")),
];

/// Weights of the terms as published, in the order of [`Term::ALL`]. \[PG14\] table 1
pub const PUBLISHED_WEIGHTS: [f64; 6] = [0.5, 0.5, 0.4, 0.4, 0.2, 1.0];

/// √20, the largest gradient of the plain Sobel pair on values in [0, 1].
pub const MAX_GRADIENT: f64 = 4.472_135_954_999_58;

/// Keys of the five scalar targets, in the order of [`Term::ALL`].
const TARGET_KEYS: [&str; 5] = ["t_meanObj", "t_meanBack", "t_varObj", "t_varBack", "t_grad"];

const WEIGHT_KEYS: [&str; 6] = ["meanObj", "meanBack", "varObj", "varBack", "grad", "hist"];

const TOP_KEYS: [&str; 9] =
    ["schema", "name", "signature", "t_meanObj", "t_meanBack", "t_varObj", "t_varBack", "t_grad", "weights"];

/// Target values and weights of the terms with the signature of the histogram term.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    pub(super) name: String,
    pub(super) targets: [f64; 5],
    pub(super) weights: [f64; 6],
    pub(super) signature: Signature,
}

impl Target {
    /// A target of measured `values`, in the order of [`Term::ALL`].
    #[must_use]
    pub fn new(name: impl Into<String>, values: [f64; 5], weights: [f64; 6], signature: Signature) -> Self {
        // Rounding may bring a value just beyond what a file may say.
        let mut targets = values.map(|v| v.clamp(0.0, 1.0));
        targets[Term::Grad as usize] = values[Term::Grad as usize].clamp(0.0, MAX_GRADIENT);
        Self { name: name.into(), targets, weights, signature }
    }

    /// A built-in target by name, else the target file at that path.
    ///
    /// # Errors
    /// When it is neither, or the file is no valid target.
    pub fn resolve(spec: &str) -> Result<Self, TargetError> {
        if let Some((name, text)) = BUILTIN.iter().find(|(name, _)| *name == spec) {
            return Self::from_toml(text, Path::new(name));
        }
        let path = Path::new(spec);
        let meant_as_path = path.components().count() > 1 || path.extension().is_some();
        if !meant_as_path && !path.exists() {
            let nearest = nearest(spec, BUILTIN.iter().map(|(name, _)| *name));
            return Err(TargetError::Unknown { name: spec.to_owned(), nearest });
        }
        let text =
            fs::read_to_string(path).map_err(|source| TargetError::Read { path: path.to_owned(), source })?;
        Self::from_toml(&text, path)
    }

    /// Parses the text of a target file at `path`, where signature libraries begin.
    ///
    /// # Errors
    /// With file and line, when it is no valid target.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, TargetError> {
        let syntax = |e: &toml::de::Error| TargetError::Syntax {
            path: path.to_owned(),
            line: e.span().map_or(1, |span| line_at(text, span.start)),
            message: e.message().to_owned(),
        };
        let value: Value = toml::from_str(text).map_err(|e| syntax(&e))?;
        let base = path.parent().unwrap_or(Path::new(""));
        Self::from_value_at(&value, base).map_err(|source| TargetError::Invalid {
            path: path.to_owned(),
            line: line_of_key(text, &source.key),
            source,
        })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Signature of the histogram term.
    #[must_use]
    pub fn signature(&self) -> &Signature {
        &self.signature
    }

    /// The target value t of a term; 0 for the histogram, whose target is the signature.
    #[must_use]
    pub fn target(&self, term: Term) -> f64 {
        self.targets.get(term as usize).copied().unwrap_or(0.0)
    }

    /// The weight of a term.
    #[must_use]
    pub fn weight(&self, term: Term) -> f64 {
        self.weights[term as usize]
    }

    /// The text of a target file that gives this target again. The signature is written
    /// out, so the file does not depend on what a version has built in.
    ///
    /// # Errors
    /// Never for a target that was read; the serialiser's signature has them.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

impl Serialize for Target {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeMap;
        let mut map = serializer.serialize_map(Some(TOP_KEYS.len()))?;
        map.serialize_entry("schema", &SCHEMA)?;
        map.serialize_entry("name", &self.name)?;
        for (key, t) in TARGET_KEYS.iter().zip(&self.targets) {
            map.serialize_entry(key, t)?;
        }
        let weights: std::collections::BTreeMap<_, _> = WEIGHT_KEYS.iter().zip(&self.weights).collect();
        map.serialize_entry("weights", &weights)?;
        map.serialize_entry("signature", &self.signature)?;
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objective::signature::Shape;

    fn parse(text: &str) -> Result<Target, TargetError> {
        Target::from_toml(text, Path::new("t.toml"))
    }

    /// The whole message as a user sees it.
    fn message(text: &str) -> String {
        format!("{:#}", anyhow::Error::new(parse(text).unwrap_err()))
    }

    fn high_key() -> String {
        BUILTIN[0].1.to_owned()
    }

    #[test]
    fn builtin_targets_are_those_of_the_table() {
        let high = Target::resolve("high-key").unwrap();
        assert_eq!(high.targets, [0.47, 0.78, 0.24, 0.17, 0.39]);
        assert_eq!(high.weights, [0.5, 0.5, 0.4, 0.4, 0.2, 1.0]);
        assert_eq!(high.signature, Signature::builtin("high").unwrap());
        let low = Target::resolve("low-key").unwrap();
        assert_eq!(low.targets, [0.47, 0.04, 0.63, 0.04, 0.39]);
        assert_eq!(low.weights, high.weights);
        assert_eq!(low.signature, Signature::builtin("low").unwrap());
        assert_eq!((high.name(), low.name()), ("high-key", "low-key"));
    }

    #[test]
    fn the_key_lists_follow_the_terms() {
        assert_eq!(WEIGHT_KEYS, Term::ALL.map(Term::name));
        for (key, term) in TARGET_KEYS.iter().zip(Term::ALL) {
            assert_eq!(*key, format!("t_{}", term.name()));
            assert!(TOP_KEYS.contains(key));
        }
    }

    #[test]
    fn a_target_survives_toml_and_json_exactly() {
        let mut target = Target::resolve("low-key").unwrap();
        target.weights[2] = 1.0 / 3.0;
        assert_eq!(parse(&target.to_toml().unwrap()).unwrap(), target);
        let json = serde_json::to_string(&target).unwrap();
        assert_eq!(Target::from_value(&serde_json::from_str(&json).unwrap()).unwrap(), target);

        let values = (1..=256).map(|i| (f64::from(i) / 256.0).powf(0.7)).collect();
        target.signature = Signature::new("mine", Shape::Cumulated(values)).unwrap();
        assert_eq!(parse(&target.to_toml().unwrap()).unwrap(), target);
    }

    #[test]
    fn weights_left_out_keep_the_published_values() {
        let text = high_key();
        let (head, _) = text.split_once("[weights]").unwrap();
        assert_eq!(parse(head).unwrap().weights, PUBLISHED_WEIGHTS);
        let one = parse(&format!("{head}[weights]\ngrad = 3")).unwrap();
        assert_eq!(one.weights, [0.5, 0.5, 0.4, 0.4, 3.0, 1.0]);
    }

    #[test]
    fn unknown_keys_are_refused_with_line_and_nearest_key() {
        let text = high_key().replace("t_varObj", "t_varobj");
        let message = message(&text);
        let line = text.lines().position(|l| l.starts_with("t_varobj")).unwrap() + 1;
        assert!(message.starts_with(&format!("t.toml:{line}: `t_varobj`: unknown key")), "{message}");
        assert!(message.contains("did you mean `t_varObj`?"), "{message}");

        let text = high_key().replace("varBack = 0.4\n", "varback = 0.4\n");
        let message = self::message(&text);
        let line = text.lines().position(|l| l.starts_with("varback")).unwrap() + 1;
        assert!(message.starts_with(&format!("t.toml:{line}: `weights.varback`")), "{message}");
        assert!(message.contains("did you mean `varBack`?"), "{message}");
    }

    #[test]
    fn values_out_of_range_are_refused_with_key_and_range() {
        for (from, to, want) in [
            (
                "t_grad = 0.39",
                "t_grad = 4.6",
                "`t_grad`: must be a number from 0 to 4.47, the largest gradient of a picture, got 4.6",
            ),
            ("t_grad = 0.39", "t_grad = nan", "`t_grad`: must be a number from 0 to 4.47"),
            ("t_grad = 0.39", "t_grad = \"x\"", "`t_grad`: must be a number from 0 to 4.47"),
            ("t_varObj = 0.24", "t_varObj = 1.2", "`t_varObj`: must be a number from 0 to 1, got 1.2"),
            ("t_grad = 0.39", "", "`t_grad`: is missing"),
            ("hist = 1.0", "hist = -1", "`weights.hist`: must be a number >= 0, got -1"),
            ("schema = 1", "schema = 2", "`schema`: must be 1, got 2"),
            ("schema = 1", "", "`schema`: is missing"),
            ("\"high\"", "\"hihg\"", "did you mean `high`?"),
            ("\"high\"", "{ betas = [] }", "`signature.betas`: a mixture needs"),
            ("\"high\"", "{ cumulated = [1.0] }", "need 256 cumulated values, got 1"),
            ("\"high\"", "{ }", "must be a table with `betas` or `cumulated`, got neither"),
            (
                "\"high\"",
                "{ betas = [{ fraction = 1, mean = 0.5, sgima = 0.1 }] }",
                "`signature.betas.sgima`: unknown key, did you mean `sigma`?",
            ),
        ] {
            let text = high_key().replace(from, to);
            assert_ne!(text, high_key());
            let message = message(&text);
            assert!(message.contains(want), "{message}");
        }
    }

    #[test]
    fn syntax_errors_tell_the_line() {
        assert!(message("schema = 1\nname = \n").starts_with("t.toml:2: "));
    }

    #[test]
    fn an_unknown_name_suggests_the_nearest() {
        let message = Target::resolve("higkey").unwrap_err().to_string();
        assert!(message.contains("did you mean `high-key`?"), "{message}");
        let missing = Target::resolve("no/such.toml").unwrap_err();
        assert!(matches!(missing, TargetError::Read { .. }));
    }
}
