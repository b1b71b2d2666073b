//! Targets: what a picture should look like, as a TOML file (or the same structure as JSON).
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
//! Every term of the [table](super::terms) has its key here; a term that is not the paper's may be left
//! out, unless it has a weight. Unknown keys are refused: a misspelt one would silently keep a default.

mod error;
mod parse;

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Serialize, Serializer};
use serde_json::Value;

pub use super::problem::{TargetProblem, TargetProblemReason};
pub use error::TargetError;

use super::palette::Palette;
use super::signature::Signature;
use super::terms::{Goal, Kind, N_TERMS, Term, Values};
use crate::files::{nearest, text};
use parse::{line_at, line_of_key};

/// Version of the format of target files, the only one so far.
pub const SCHEMA: i64 = 1;

/// Built-in targets: their names, and the text of their files.
pub const BUILTIN: [(&str, &str); 5] = [
    ("high-key", include_str!("../../scenes/targets/high-key.toml")),
    ("low-key", include_str!("../../scenes/targets/low-key.toml")),
    ("golden-hour", include_str!("../../scenes/targets/golden-hour.toml")),
    ("moonlight", include_str!("../../scenes/targets/moonlight.toml")),
    ("neon", include_str!("../../scenes/targets/neon.toml")),
];

/// Weights where a target names none, in the order of [`Term::ALL`], see [`Term::default_weight`].
pub const DEFAULT_WEIGHTS: [f64; N_TERMS] = {
    let mut weights = [0.0; N_TERMS];
    let mut i = 0;
    while i < N_TERMS {
        weights[i] = Term::ALL[i].default_weight();
        i += 1;
    }
    weights
};

/// Weights of a target that asks for a histogram and nothing else, in the order of [`Term::ALL`].
pub const HISTOGRAM_ONLY: [f64; N_TERMS] = {
    let mut weights = [0.0; N_TERMS];
    weights[Term::Hist as usize] = Term::Hist.default_weight();
    weights
};

/// A look in numbers: what is wanted of each term, and how much the term counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    pub(super) name: String,
    /// Goals of the terms; one without a goal is neither measured nor listed, and has weight 0.
    pub(super) goals: BTreeMap<Term, Goal>,
    /// Weights in f_q, in the order of [`Term::ALL`].
    pub(super) weights: [f64; N_TERMS],
}

impl Target {
    /// A target of measured `values` and a histogram; `weights` are in the order of [`Term::ALL`].
    /// Values that rounding has brought just beyond what a target file may say are clamped.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        values: &Values,
        weights: [f64; N_TERMS],
        signature: Signature,
    ) -> Self {
        let mut goals = BTreeMap::from([(Term::Hist, Goal::Signature(signature))]);
        for term in Term::ALL {
            if let (Kind::Scalar(scalar), Some(value)) = (term.kind(), values[term as usize]) {
                goals.insert(term, Goal::Value(value.clamp(scalar.targets.low, scalar.targets.high)));
            }
        }
        Self { name: name.into(), goals, weights }
    }

    /// A target that asks for a histogram and nothing else. The other standing terms have weight 0
    /// and, for comparison, the signature's moments as goals.
    #[must_use]
    pub fn of_histogram(name: impl Into<String>, signature: Signature) -> Self {
        let (mean, sigma) = signature.moments();
        let mut values = [None; N_TERMS];
        for (term, value) in [
            (Term::MeanObj, mean),
            (Term::MeanBack, mean),
            (Term::VarObj, sigma),
            (Term::VarBack, sigma),
            (Term::Grad, 0.0), // A histogram says nothing of gradients.
        ] {
            values[term as usize] = Some(value);
        }
        Self::new(name, &values, HISTOGRAM_ONLY, signature)
    }

    /// The same target with a palette, and with the weights of [`Term::matched_weight`] for all terms of colour
    /// that it has goals for; others keep none.
    #[must_use]
    pub fn with_palette(mut self, palette: Palette) -> Self {
        self.goals.insert(Term::Chroma, Goal::Palette(palette));
        for term in Term::ALL.into_iter().filter(|term| term.is_of_color() && self.goals.contains_key(term)) {
            self.weights[term as usize] = term.matched_weight();
        }
        self
    }

    /// The same target without goals of colour.
    #[must_use]
    pub fn without_color(mut self) -> Self {
        self.goals.retain(|term, _| !term.is_of_color());
        self
    }

    /// Whether the target asks for colour.
    #[must_use]
    pub fn needs_color(&self) -> bool {
        self.goals.keys().any(|term| term.is_of_color())
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
        let text = text::read(path).map_err(|source| TargetError::Read { path: path.to_owned(), source })?;
        Self::from_toml(&text, path)
    }

    /// Parses the text of a target file at `path`, where signature libraries begin.
    ///
    /// ```
    /// use lightopt_embree::objective::{Target, Term};
    ///
    /// let text = r#"
    ///     schema = 1
    ///     name = "dusk"
    ///     signature = { betas = [{ fraction = 1.0, mean = 0.2, sigma = 0.1 }] }
    ///     t_meanObj = 0.3
    ///     t_meanBack = 0.1
    ///     t_varObj = 0.2
    ///     t_varBack = 0.05
    ///     t_grad = 0.3
    ///     [weights]
    ///     grad = 0.0
    /// "#;
    /// let dusk = Target::from_toml(text, "dusk.toml".as_ref())?;
    /// assert_eq!(dusk.target(Term::MeanObj), 0.3);
    /// assert_eq!((dusk.weight(Term::Grad), dusk.weight(Term::Hist)), (0.0, 1.0));
    /// # Ok::<(), lightopt_embree::objective::target::TargetError>(())
    /// ```
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

    /// Name of the look, of which default names of run directories are made.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Goals of the terms that have one, in the order of [`Term::ALL`].
    pub fn goals(&self) -> impl Iterator<Item = (Term, &Goal)> {
        self.goals.iter().map(|(&term, goal)| (term, goal))
    }

    /// Goal of a term; `None` if the target has none for it.
    #[must_use]
    pub fn goal(&self, term: Term) -> Option<&Goal> {
        self.goals.get(&term)
    }

    /// The value t that is wanted of a scalar term; 0 of a distance, and of a term without a goal.
    #[must_use]
    pub fn target(&self, term: Term) -> f64 {
        match self.goal(term) {
            Some(Goal::Value(value)) => *value,
            Some(Goal::Signature(_) | Goal::Palette(_)) | None => 0.0,
        }
    }

    /// Weight of a term in f_q.
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
        let goals =
            |are_distances: bool| self.goals().filter(move |(term, _)| term.is_distance() == are_distances);
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("schema", &SCHEMA)?;
        map.serialize_entry("name", &self.name)?;
        for (term, goal) in goals(false) {
            map.serialize_entry(&term.goal_key(), goal)?;
        }
        // In TOML, tables stand last.
        let weight = |(term, _): (Term, &Goal)| (term.name(), self.weight(term));
        let weights: BTreeMap<&str, f64> = self.goals().map(weight).collect();
        map.serialize_entry("weights", &weights)?;
        for (term, goal) in goals(true) {
            map.serialize_entry(&term.goal_key(), goal)?;
        }
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

    fn weights(target: &Target) -> Vec<f64> {
        Term::standing().map(|term| target.weight(term)).collect()
    }

    #[test]
    fn builtin_targets_are_those_of_the_table() {
        let high = Target::resolve("high-key").unwrap();
        let scalars = |target: &Target| -> Vec<f64> {
            target.goals().filter(|(t, _)| !t.is_distance()).map(|(t, _)| target.target(t)).collect()
        };
        let signature = |name| Some(Goal::Signature(Signature::builtin(name).unwrap()));
        assert_eq!(scalars(&high), [0.47, 0.78, 0.24, 0.17, 0.39]);
        assert_eq!(weights(&high), [0.5, 0.5, 0.4, 0.4, 0.2, 1.0]);
        assert_eq!(high.goal(Term::Hist).cloned(), signature("high"));
        let low = Target::resolve("low-key").unwrap();
        assert_eq!(scalars(&low), [0.47, 0.04, 0.63, 0.04, 0.39]);
        assert_eq!(low.weights, high.weights);
        assert_eq!(low.goal(Term::Hist).cloned(), signature("low"));
        assert_eq!((high.name(), low.name()), ("high-key", "low-key"));
    }

    #[test]
    fn a_target_survives_toml_and_json_exactly() {
        let mut target = Target::resolve("low-key").unwrap();
        target.weights[Term::VarObj as usize] = 1.0 / 3.0;
        assert_eq!(parse(&target.to_toml().unwrap()).unwrap(), target);
        let json = serde_json::to_string(&target).unwrap();
        assert_eq!(Target::from_value(&serde_json::from_str(&json).unwrap()).unwrap(), target);

        let values = (1..=256).map(|i| (f64::from(i) / 256.0).powf(0.7)).collect();
        let signature = Signature::new("mine", Shape::Cumulated(values)).unwrap();
        target.goals.insert(Term::Hist, Goal::Signature(signature));
        assert_eq!(parse(&target.to_toml().unwrap()).unwrap(), target);
    }

    #[test]
    fn weights_left_out_keep_the_published_values() {
        let text = high_key();
        let (head, _) = text.split_once("[weights]").unwrap();
        assert_eq!(parse(head).unwrap().weights, DEFAULT_WEIGHTS);
        let one = parse(&format!("{head}[weights]\ngrad = 3")).unwrap();
        assert_eq!(weights(&one), [0.5, 0.5, 0.4, 0.4, 3.0, 1.0]);
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
