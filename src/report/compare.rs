//! One page over several runs: their pictures side by side, and their numbers in a table.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use serde_json::Value;

use super::{
    ReportError,
    gather::{self, Look, text},
    html::{assemble, escaped, style},
};
use crate::light::LUMENS_PER_WATT;

/// What the page needs beside the style of reports.
const STYLE: &str = ".runs{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,280px),1fr));gap:24px;\
    margin-top:28px}.runs img{display:block;width:100%;height:auto;border-radius:12px}.runs h2{font-size:19px;\
    margin-top:10px}.runs p{margin:0;color:var(--soft);font-size:14px;overflow-wrap:anywhere}\
    td.best{font-weight:700;color:var(--strong)}tr.part th{color:var(--soft);font-weight:500;font-size:13px}";

/// A row of the table: its name, and for each run a text with the number by which the least is found.
type Row = (String, Vec<(String, Option<f64>)>);

/// The page over some run directories.
///
/// # Errors
/// When one of them holds no run, or cannot be read.
pub fn page(directories: &[PathBuf]) -> Result<String, ReportError> {
    let mut looks: Vec<(PathBuf, Look)> = Vec::new();
    for directory in directories {
        for run in super::runs(directory)? {
            let look = gather::look(&run, None)?;
            looks.push((run, look));
        }
    }
    let mut content = String::from("<div class=\"runs\">");
    for (run, look) in &looks {
        content.push_str(&figure(run, look));
    }
    content.push_str("</div>\n<section aria-labelledby=\"numbers\"><h2 id=\"numbers\">In numbers</h2>");
    content.push_str(&table(&looks));
    content.push_str("</section>");
    let title = format!("{} runs compared", looks.len());
    let footer = format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    Ok(assemble(&[
        ("title", &escaped(&title)),
        ("kicker", "Lighting"),
        ("heading", &escaped(&title)),
        ("footer", &escaped(&footer)),
        ("content", &content),
        ("data", "null"),
        ("style", &[style(), STYLE].concat()),
        ("script", ""),
    ]))
}

/// A run's picture with its names.
fn figure(run: &Path, look: &Look) -> String {
    let pictures = &look.data["pictures"];
    let shown = if pictures["final"].is_null() { &pictures["found"] } else { &pictures["final"] };
    let name = format!("{}: {}", look.scene, look.name);
    let image = shown["src"].as_str().map_or_else(String::new, |src| {
        format!(
            "<img alt=\"{}\" src=\"{src}\" width=\"{}\" height=\"{}\">",
            escaped(&name),
            shown["width"],
            shown["height"]
        )
    });
    let path = escaped(&run.display().to_string());
    format!("<figure>{image}<h2>{}</h2><p>{path}</p></figure>\n", escaped(&name))
}

/// The table of all numbers, a column for each run.
fn table(looks: &[(PathBuf, Look)]) -> String {
    let mut out = String::from(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Runs in numbers\"><table><thead><tr><th scope=\"col\"></th>",
    );
    // Writing to a String does not fail.
    for (_, look) in looks {
        let _ = write!(
            out,
            "<th scope=\"col\" class=\"number\">{}: {}</th>",
            escaped(&look.scene),
            escaped(&look.name)
        );
    }
    out.push_str("</tr></thead><tbody>");
    for (part, rows) in [
        ("", results(looks)),
        ("Terms: value, and target", terms(looks)),
        ("Lights: power, W, and flux, lm", lights(looks)),
    ] {
        if !part.is_empty() {
            let _ = write!(
                out,
                "<tr class=\"part\"><th scope=\"rowgroup\" colspan=\"{}\">{part}</th></tr>",
                looks.len() + 1
            );
        }
        for (name, cells) in rows {
            let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escaped(&name));
            let least = cells.iter().filter_map(|(_, v)| *v).fold(f64::INFINITY, f64::min);
            for (text, value) in &cells {
                let class = if cells.len() > 1 && *value == Some(least) { "number best" } else { "number" };
                let _ = write!(out, "<td class=\"{class}\">{}</td>", escaped(text));
            }
            out.push_str("</tr>");
        }
    }
    out + "</tbody></table></div>"
}

/// A number with so many digits; a dash for none.
fn number(value: &Value, digits: usize) -> String {
    value.as_f64().map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}"))
}

/// Rows of what runs came to. f_q of different looks does not compare, so that the least is marked among equal ones.
fn results(looks: &[(PathBuf, Look)]) -> Vec<Row> {
    let alike = looks.windows(2).all(|pair| pair[0].1.data["terms"] == pair[1].1.data["terms"]);
    let of = |name: &str, key: &str, error: Option<&str>, digits: usize, compares: bool| -> Row {
        let cell = |(_, look): &(PathBuf, Look)| {
            let result = &look.data["result"];
            let error = error.map(|key| &result[key]).filter(|v| v.is_number());
            let bar = error.map_or_else(String::new, |e| format!(" ± {}", number(e, digits)));
            (number(&result[key], digits) + &bar, result[key].as_f64().filter(|_| compares))
        };
        (name.to_owned(), looks.iter().map(cell).collect())
    };
    let seconds = |(_, look): &(PathBuf, Look)| {
        let all = look.data["timing"].as_array().into_iter().flatten().find(|stage| stage[0] == "all");
        let value = all.and_then(|stage| stage[1].as_f64());
        (value.map_or_else(|| "–".to_owned(), |s| format!("{s:.1}")), None)
    };
    vec![
        of("f_q at the start", "f_q_initial", Some("f_q_initial_error"), 4, false),
        of("f_q found", "f_q", Some("f_q_error"), 4, alike),
        of("f_q of the final picture", "f_q_final", Some("f_q_final_error"), 4, alike),
        of("noise of the final picture", "final_noise", None, 4, false),
        of("samples a pixel", "final_spp", None, 0, false),
        of("evaluations", "evaluations", None, 0, false),
        ("seconds".to_owned(), looks.iter().map(seconds).collect()),
    ]
}

/// Rows of the terms that any of the looks has.
fn terms(looks: &[(PathBuf, Look)]) -> Vec<Row> {
    let names = union(looks, |look| {
        look.data["terms"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|t| (text(&t["name"]), text(&t["label"])))
            .collect()
    });
    let row = |(name, label): (String, String)| {
        let cell = |(_, look): &(PathBuf, Look)| {
            let term = &look.data["result"]["terms"][&name];
            let cell = if term.is_null() {
                "–".to_owned()
            } else {
                format!("{} → {}", number(&term["value"], 3), number(&term["target"], 2))
            };
            (cell, None)
        };
        (label, looks.iter().map(cell).collect())
    };
    names.into_iter().map(row).collect()
}

/// Rows of the lights that any of the runs has.
fn lights(looks: &[(PathBuf, Look)]) -> Vec<Row> {
    let of =
        |look: &Look| -> Vec<Value> { look.data["result"]["lights"].as_array().cloned().unwrap_or_default() };
    let names = union(looks, |look| of(look).iter().map(|l| (text(&l["name"]), text(&l["name"]))).collect());
    let row = |(name, label): (String, String)| {
        let cell = |(_, look): &(PathBuf, Look)| {
            let (all, found) = (of(look), &look.data["result"]["found"]);
            let watts = all.iter().position(|l| l["name"] == name).and_then(|l| {
                let size = if all[l]["has_size"] == true { found["size"][l].as_f64()? } else { 1.0 };
                Some(all[l]["power"].as_f64()? * found["radiance"][l].as_f64()? * size * size)
            });
            let words = |w: f64| format!("{w:.3} W, {:.0} lm", w * f64::from(LUMENS_PER_WATT));
            (watts.map_or_else(|| "–".to_owned(), words), None)
        };
        (label, looks.iter().map(cell).collect())
    };
    names.into_iter().map(row).collect()
}

/// Names with their labels that any of the looks has, each once.
fn union(looks: &[(PathBuf, Look)], of: impl Fn(&Look) -> Vec<(String, String)>) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for named in looks.iter().flat_map(|(_, look)| of(look)) {
        if !all.contains(&named) {
            all.push(named);
        }
    }
    all
}
