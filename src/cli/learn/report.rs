//! What `learn-signature` says.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::{LearnArgs, Outcome};
use crate::objective::{Goal, Target};

/// What a reader of the result should know.
pub(super) fn notes(outcomes: &[Outcome]) -> Vec<String> {
    let mut notes = Vec::new();
    if let [only] = outcomes {
        notes.push(format!(
            "`{}` is the only class, so there is none to tell it from; give another --class",
            only.class.name
        ));
    }
    for Outcome { class, .. } in outcomes {
        if class.count == 1 {
            notes.push(format!(
                "class `{}` has one photograph, so leaving it out leaves nothing to judge it by",
                class.name
            ));
        }
    }
    notes
}

/// That files of a folder were passed over, naming the first.
pub(super) fn passed_over(folder: &Path, others: &[String]) -> Option<String> {
    let first = others.first()?;
    let more = match others.len() - 1 {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    Some(format!("{}: passed over what is no picture of a known format: {first}{more}", folder.display()))
}

fn names(outcomes: &[Outcome]) -> Vec<&str> {
    outcomes.iter().map(|o| o.class.name.as_str()).collect()
}

pub(super) fn to_json(
    args: &LearnArgs,
    outcomes: &[Outcome],
    confusion: &[Vec<usize>],
    notes: &[String],
) -> Value {
    let by_name = |counts: &Vec<usize>| -> Map<String, Value> {
        names(outcomes).iter().zip(counts).map(|(name, n)| ((*name).to_owned(), json!(n))).collect()
    };
    let matrix: Map<String, Value> = names(outcomes)
        .iter()
        .zip(confusion)
        .map(|(name, row)| ((*name).to_owned(), by_name(row).into()))
        .collect();
    let (right, judged) = score(confusion);
    json!({
        "output": args.output(),
        "method": super::method(args),
        "longest_side": args.longest_side,
        "classes": outcomes.iter().map(|o| class_json(o, &names(outcomes))).collect::<Value>(),
        "confusion": matrix,
        "judged": judged,
        "right": right,
        "notes": notes,
    })
}

fn class_json(outcome: &Outcome, names: &[&str]) -> Value {
    let Outcome { class, learned, target } = outcome;
    let photos: Value = class
        .photos
        .iter()
        .zip(&learned.photos)
        .map(|(record, judged)| {
            let distances: Map<String, Value> =
                names.iter().zip(&judged.distances).map(|(n, d)| ((*n).to_owned(), json!(d))).collect();
            json!({
                "file": record.file,
                "sha256": record.sha256,
                "distances": distances,
                "nearest": judged.nearest.map(|i| names[i]),
                "outlier": judged.outlier,
            })
        })
        .collect();
    let mut value = json!({
        "name": class.name,
        "count": class.count,
        "photos": photos,
        "outliers": class.outliers,
        "outlier_above": learned.outlier_above,
    });
    if let Some((path, target)) = target {
        let values: Map<String, Value> =
            scalars(target).map(|(name, value)| (name.to_owned(), json!(value))).collect();
        value["target_file"] = json!(path);
        value["targets"] = values.into();
    }
    value
}

/// How many were nearest to their own class, of how many that could be judged.
fn score(confusion: &[Vec<usize>]) -> (usize, usize) {
    let right = confusion.iter().enumerate().map(|(i, row)| row[i]).sum();
    (right, confusion.iter().flatten().sum())
}

pub(super) fn to_table(args: &LearnArgs, outcomes: &[Outcome], confusion: &[Vec<usize>]) -> String {
    let mut text = String::new();
    for outcome in outcomes {
        photos_table(&mut text, outcome, &names(outcomes));
    }
    if outcomes.len() > 1 {
        confusion_table(&mut text, outcomes, confusion);
    }
    if args.masks.is_some() {
        targets_table(&mut text, outcomes);
    }
    // Writing to a String does not fail.
    let _ = writeln!(text, "{}", args.output().display());
    for (path, _) in outcomes.iter().filter_map(|o| o.target.as_ref()) {
        let _ = writeln!(text, "{}", path.display());
    }
    text
}

fn width<'a>(words: impl IntoIterator<Item = &'a str>, least: usize) -> usize {
    words.into_iter().map(|w| w.chars().count()).max().unwrap_or(0).max(least)
}

fn photos_table(text: &mut String, Outcome { class, learned, .. }: &Outcome, names: &[&str]) {
    let plural = if class.count == 1 { "" } else { "s" };
    let _ = writeln!(text, "class {}: {} photograph{plural}", class.name, class.count);
    let first = width(class.photos.iter().map(|p| p.file.as_str()), 8);
    let wide = width(names.iter().copied(), 6);
    let _ = write!(text, "  {:<first$}", "distance");
    for name in names {
        let _ = write!(text, "  {name:>wide$}");
    }
    let _ = writeln!(text, "  nearest");
    for (record, judged) in class.photos.iter().zip(&learned.photos) {
        let _ = write!(text, "  {:<first$}", record.file);
        for distance in &judged.distances {
            let shown = distance.map_or_else(|| "-".to_owned(), |d| format!("{d:.4}"));
            let _ = write!(text, "  {shown:>wide$}");
        }
        let nearest = judged.nearest.map_or("-", |i| names[i]);
        let _ = writeln!(text, "  {nearest}{}", if judged.outlier { ", outlier" } else { "" });
    }
    let _ = match learned.outlier_above {
        Some(above) => writeln!(
            text,
            "  outliers (own distance above median + 3 * 1.4826 * MAD = {above:.4}): {}\n",
            if class.outliers.is_empty() { "none".to_owned() } else { class.outliers.join(", ") }
        ),
        None => writeln!(text),
    };
}

fn confusion_table(text: &mut String, outcomes: &[Outcome], confusion: &[Vec<usize>]) {
    let names = names(outcomes);
    let wide = width(names.iter().copied(), 6);
    let _ =
        writeln!(text, "nearest signature (columns) by class (rows), each photograph left out of its own");
    let _ = write!(text, "  {:<wide$}", "");
    for name in &names {
        let _ = write!(text, "  {name:>wide$}");
    }
    let _ = writeln!(text);
    for (name, row) in names.iter().zip(confusion) {
        let _ = write!(text, "  {name:<wide$}");
        for n in row {
            let _ = write!(text, "  {n:>wide$}");
        }
        let _ = writeln!(text);
    }
    let (right, judged) = score(confusion);
    let _ = writeln!(text, "  {right} of {judged} are nearest to their own class\n");
}

/// Name and target of every scalar term.
fn scalars(target: &Target) -> impl Iterator<Item = (&'static str, f64)> {
    target.goals().filter_map(|(term, goal)| match goal {
        Goal::Value(value) => Some((term.name(), *value)),
        Goal::Signature(_) | Goal::Palette(_) => None,
    })
}

fn targets_table(text: &mut String, outcomes: &[Outcome]) {
    let wide = width(names(outcomes), 8);
    let _ = write!(text, "{:<wide$}", "targets");
    let first = outcomes.iter().find_map(|o| o.target.as_ref());
    for (name, _) in first.iter().flat_map(|(_, target)| scalars(target)) {
        let _ = write!(text, "  {name:>8}");
    }
    let _ = writeln!(text);
    for Outcome { class, target, .. } in outcomes {
        let Some((_, target)) = target else { continue };
        let _ = write!(text, "{:<wide$}", class.name);
        for (_, value) in scalars(target) {
            let _ = write!(text, "  {value:>8.4}");
        }
        let _ = writeln!(text);
    }
    let _ = writeln!(text);
}
