//! Distance of the whole picture's joint histogram of a and b of Oklab to a palette.

use std::path::Path;

use serde_json::Value;

use super::definition::{Definition, Distance, Goal, Kind};
use crate::objective::chroma::{Axis, CHROMA_BINS, histogram};
use crate::objective::palette::Palette;
use crate::objective::problem::{
    TargetProblem, TargetProblemReason, check_keys, expected, number, problem, require, table,
};
use crate::objective::signature::library::{Library, split_reference};

pub(super) const DEFINITION: Definition = Definition {
    name: "chroma",
    words: "the colours' distance to the palette",
    label: "palette",
    weight: 0.0,
    kind: Kind::Distance(Distance {
        n_bins: CHROMA_BINS,
        measure: |picture, q| histogram::measure(Axis::ALL.map(|axis| picture.chroma(axis)), q),
        compare: histogram::distance,
        add_adjoint: |d, adjoint| adjoint.add_chroma_histogram(d),
        key: KEY,
        read: |value, base| read(value, base).map(Goal::Palette),
    }),
};

/// Key of the palette in target files.
const KEY: &str = "palette";

/// A palette by reference to a class of a library, or written out as a table.
fn read(value: &Value, base: &Path) -> Result<Palette, TargetProblem> {
    if let Some((file, class)) = value.as_str().and_then(split_reference) {
        let failed = |message: String| problem(&[KEY], TargetProblemReason::Library { message });
        let found = Library::find_palette(&base.join(file), class);
        return found.map_err(|e| failed(super::hist::whole_message(&e)));
    }
    let given = table(value, &[KEY])?;
    check_keys(given, &[KEY], &["name", "shares"])?;
    let name = match given.get("name") {
        None => "custom",
        Some(name) => name.as_str().ok_or_else(|| expected(&[KEY, "name"], "a name in quotes", name))?,
    };
    let shares = require(given, &[KEY], "shares")?;
    let Value::Array(list) = shares else { return Err(expected(&[KEY, "shares"], "a list", shares)) };
    let shares: Result<_, _> =
        list.iter().map(|v| number(v, &[KEY, "shares"], "a list of numbers", |_| true)).collect();
    Palette::new(name, shares?)
        .map_err(|e| problem(&[KEY, "shares"], TargetProblemReason::Library { message: e.to_string() }))
}
