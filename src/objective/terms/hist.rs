//! Distance of the whole picture's cumulated histogram to a signature: \[PG14\] eq. (8).

use std::error::Error;
use std::path::Path;

use serde_json::Value;

use super::definition::{Definition, Distance, Goal, Kind};
use crate::files::nearest;
use crate::objective::histogram::{self, BINS, Cumulated};
use crate::objective::problem::{
    TargetProblem, TargetProblemReason, check_keys, expected, number, problem, require, table,
};
use crate::objective::signature::library::{Library, split_reference};
use crate::objective::signature::{self, BetaComponent, Shape, Signature};

pub(super) const DEFINITION: Definition = Definition {
    name: "hist",
    words: "the histogram's distance to the signature",
    label: "histogram",
    weight: 1.0, // [PG14] table 1
    kind: Kind::Distance(Distance {
        n_bins: BINS,
        measure: |picture, q| q.copy_from_slice(&histogram::cumulated(picture.l, picture.ramp)),
        compare,
        add_adjoint: |d, adjoint| {
            let picture = adjoint.picture;
            histogram::add_adjoint(picture.l, picture.ramp, d, adjoint.pixels());
        },
        key: KEY,
        read: |value, base| read(value, base).map(Goal::Signature),
    }),
};

/// Key of the signature in target files.
const KEY: &str = "signature";

/// The distance of `q`, clipped to [0, 1], from `p`; a value that was clipped has no derivative.
fn compare(p: &[f64], q: &[f64], epsilon: f64, derivative: &mut [f64]) -> f64 {
    let clipped: Cumulated = std::array::from_fn(|bin| q[bin].clamp(0.0, 1.0));
    let f = histogram::distance(p, &clipped, epsilon, derivative);
    for (d, q) in derivative.iter_mut().zip(q) {
        if !(0.0..=1.0).contains(q) {
            *d = 0.0;
        }
    }
    f
}

/// A signature by name, by reference to a class of a library, or written out as a table.
fn read(value: &Value, base: &Path) -> Result<Signature, TargetProblem> {
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
        (Some(betas), None) => (Shape::Betas(read_betas(betas)?), "betas"),
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
pub(super) fn whole_message(error: &dyn Error) -> String {
    match error.source() {
        None => error.to_string(),
        Some(source) => format!("{error}: {}", whole_message(source)),
    }
}

/// The components of a mixture, each a table.
fn read_betas(list: &[Value]) -> Result<Vec<BetaComponent>, TargetProblem> {
    const WITHIN: [&str; 2] = [KEY, "betas"];
    list.iter()
        .map(|value| {
            let given = table(value, &WITHIN)?;
            check_keys(given, &WITHIN, &["fraction", "mean", "sigma"])?;
            let field = |key| {
                let [outer, inner] = WITHIN;
                number(require(given, &WITHIN, key)?, &[outer, inner, key], "a number", |_| true)
            };
            Ok(BetaComponent { fraction: field("fraction")?, mean: field("mean")?, sigma: field("sigma")? })
        })
        .collect()
}
