//! What a page shows of a look, from its run directory.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Map, Value, json};

use super::{ReportError, picture};
use crate::{
    audit::{ENVIRONMENTS, MANIFEST, PLAN, RESULT, TIMING, pick_stem, stored::About},
    lighting::Lighting,
    objective::{Goal, Target, Term},
    variables::{ParamVector, Variable},
};

/// Everything that a page shows of a look.
#[derive(Clone, Debug)]
pub struct Look {
    /// Name of the scene.
    pub scene: String,
    /// Name of the look.
    pub name: String,
    /// Index of the small copy of its basis; `None` where there is none.
    pub basis: Option<usize>,
    /// What the page's script reads.
    pub data: Value,
}

/// Names of all looks of the run to which a run directory belongs; none where it has one alone.
///
/// # Errors
/// When the manifest cannot be read.
pub fn targets(run: &Path) -> Result<Vec<String>, ReportError> {
    let names = manifest(run)?["options"]["targets"].take();
    Ok(serde_json::from_value(names).unwrap_or_default())
}

/// The looks that the command line of a run names, in their order.
///
/// # Errors
/// When the log of times cannot be read.
pub fn asked(run: &Path) -> Result<Vec<String>, ReportError> {
    let timing = lines(&run.join(TIMING))?;
    let words: Vec<String> =
        timing.iter().find_map(|line| line["command"].as_array()).into_iter().flatten().map(text).collect();
    let value = words.iter().enumerate().find_map(|(i, word)| match word.strip_prefix("--targets") {
        Some("") => words.get(i + 1).map(String::as_str),
        Some(value) => value.strip_prefix('='),
        None => None,
    });
    let name = |spec: &str| Path::new(spec).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    Ok(value.unwrap_or_default().split(',').filter_map(name).collect())
}

/// What a page shows of the look of a run directory; `about` is the description in the small copy of its basis,
/// where there is one.
///
/// # Errors
/// When a file of it cannot be read.
pub fn look(run: &Path, about: Option<&About>) -> Result<Look, ReportError> {
    let mut manifest = manifest(run)?;
    let path = run.join(RESULT);
    if !path.is_file() {
        return Err(ReportError::Unfinished { path: run.into() });
    }
    let result: Value = serde_json::from_str(&read(&path)?)
        .map_err(|e| ReportError::Record { path, message: e.to_string() })?;
    let target = target(&manifest["target"], run)?;
    let evaluations = lines(&run.join("evaluations.jsonl"))?;
    let timing = lines(&run.join(TIMING))?;
    let found: Option<Lighting> = serde_json::from_value(result["found"].clone()).ok();
    let names: Vec<String> = result["lights"]
        .as_array()
        .map_or_else(Vec::new, |all| all.iter().map(|l| text(&l["name"])).collect());
    let is_whole = |x: &Lighting| [x.radiance.len(), x.size.len()] == [names.len(); 2];
    let found = found.filter(is_whole);
    let variables = about.filter(|about| about.lights == names).map(About::variables);
    let iterations = iterations(run, found.as_ref().zip(variables.as_ref()), is_fd(&manifest))?;
    let scene = Path::new(manifest["scene"]["path"].as_str().unwrap_or_default());
    let scene_name = scene.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let data = json!({
        "name": target.name(),
        "directory": run.display().to_string(),
        "picks": picks(run, &result)?,
        "result": result,
        "terms": Term::ALL.iter().filter_map(|&term| wish(&target, term)).collect::<Vec<_>>(),
        "signature": signature(&target),
        "palette": palette(&target),
        "environments": environments(run)?,
        "fronts": fronts(run)?,
        "evaluations": columns(&evaluations, &target),
        "iterations": iterations,
        "starts": starts(run)?,
        "timing": seconds(&timing),
        "command": command(&timing),
        "pictures": {
            "initial": picture::embedded(&run.join("initial.png"))?,
            "final": picture::embedded(&run.join("final.png"))?,
            "found": picture::embedded(&run.join("found.png"))?,
        },
        "plan": plan(run)?,
        "lights_toml": read(&run.join("lights.toml"))?,
        // With a basis the page measures them itself.
        "histogram": if is_fd(&manifest) { picture::histograms(run)? } else { Value::Null },
        "program": manifest["program"].take(),
        "scene": manifest["scene"].take(),
        "options": manifest["options"].take(),
    });
    Ok(Look { scene: scene_name, name: target.name().to_owned(), basis: None, data })
}

/// The text of a file.
fn read(path: &Path) -> Result<String, ReportError> {
    fs::read_to_string(path).map_err(|source| ReportError::Read { path: path.into(), source })
}

/// The manifest of a run.
pub(super) fn manifest(run: &Path) -> Result<Value, ReportError> {
    let path = run.join(MANIFEST);
    let text = read(&path)?;
    toml::from_str(&text).map_err(|e| ReportError::Record { path, message: e.message().to_owned() })
}

/// The target that a manifest records.
pub(super) fn target(recorded: &Value, run: &Path) -> Result<Target, ReportError> {
    let path = run.join(MANIFEST);
    let fail = |message: String| ReportError::Record { path: path.clone(), message };
    let text = toml::to_string(recorded).map_err(|e| fail(e.to_string()))?;
    Ok(Target::from_toml(&text, &path)?)
}

/// Lines of a log; none of one that is not there.
fn lines(path: &Path) -> Result<Vec<Value>, ReportError> {
    let text = match fs::read_to_string(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(|source| ReportError::Read { path: path.into(), source })?,
    };
    let line = |(i, line): (usize, &str)| {
        serde_json::from_str(line)
            .map_err(|e| ReportError::Record { path: path.into(), message: format!("line {}: {e}", i + 1) })
    };
    text.lines().enumerate().map(line).collect()
}

/// A text of JSON; empty where there is none.
pub(super) fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

/// What is wished of a term, if anything is.
fn wish(target: &Target, term: Term) -> Option<Value> {
    target.goal(term)?;
    let wanted = target.target(term);
    let miss = term.largest_miss(wanted);
    let [least, most] = drawn(term, wanted);
    Some(json!({
        "name": term.name(),
        "label": term.label(),
        "words": term.words(),
        "target": wanted,
        "weight": target.weight(term),
        "miss": miss,
        "distance": term.is_distance(),
        "is_of_color": term.is_of_color(),
        "least": least,
        "most": most,
    }))
}

/// Where a drawing of a term's values begins and ends: gradients and deviations are small, and means of colour have
/// both signs.
fn drawn(term: Term, wanted: f64) -> [f64; 2] {
    match term {
        _ if term.is_distance() => [0.0, if term.is_of_color() { 1.0 } else { 0.5 }],
        Term::SpreadObj | Term::SpreadBack => [0.0, (2.0 * wanted).clamp(0.1, 0.32)],
        _ if term.is_of_color() => [-0.16, 0.16],
        _ => [0.0, (2.0 * wanted).clamp(0.5, 1.0)],
    }
}

/// The signature of a target, by its name and cumulated.
fn signature(target: &Target) -> Value {
    let of = |goal: &Goal| match goal {
        Goal::Signature(s) => {
            Some(json!({"name": s.name(), "cumulated": s.cumulated().map(rounded).to_vec()}))
        }
        Goal::Value(_) | Goal::Palette(_) => None,
    };
    target.goals().find_map(|(_, goal)| of(goal)).unwrap_or(Value::Null)
}

/// The palette of a target: shares of the pixels by a and b of Oklab.
fn palette(target: &Target) -> Value {
    let of = |goal: &Goal| match goal {
        Goal::Palette(p) => Some(json!({"name": p.name(), "shares": p.shares()})),
        Goal::Value(_) | Goal::Signature(_) => None,
    };
    target.goals().find_map(|(_, goal)| of(goal)).unwrap_or(Value::Null)
}

/// The surroundings that were compared, a list of texts each below the names of the columns; null where none were.
fn environments(run: &Path) -> Result<Value, ReportError> {
    let path = run.join(ENVIRONMENTS);
    if !path.is_file() {
        return Ok(Value::Null);
    }
    let fail = |e: csv::Error| ReportError::Record { path: path.clone(), message: e.to_string() };
    let bytes = fs::read(&path).map_err(|source| ReportError::Read { path: path.clone(), source })?;
    let mut table = csv::ReaderBuilder::new().has_headers(false).from_reader(bytes.as_slice());
    let rows = table.records().map(|row| row.map(|row| row.iter().map(str::to_owned).collect::<Vec<_>>()));
    Ok(json!(rows.collect::<Result<Vec<_>, _>>().map_err(fail)?))
}

/// Fronts between two aims that `scan --pareto` has written into the directory of a run, by name: of each the plot and
/// the small pictures with their lightings.
fn fronts(run: &Path) -> Result<Value, ReportError> {
    let fail = |source| ReportError::Read { path: run.into(), source };
    let entries = fs::read_dir(run).map_err(fail)?.flatten().map(|entry| entry.path());
    let mut tables: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "csv")).collect();
    tables.sort();
    let mut fronts = Vec::new();
    for table in tables {
        let stem = table.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let file = |n: usize, ending: &str| format!("{stem}-{n:02}.{ending}");
        // Tables of other kinds have no pictures of that name.
        let n = (1..).take_while(|&n| run.join(file(n, "png")).is_file()).count();
        let plot = picture::embedded(&table.with_extension("png"))?;
        if n == 0 || plot.is_null() {
            continue;
        }
        let header = read(&table)?;
        let aims: Vec<&str> = header.lines().next().unwrap_or_default().split(',').take(2).collect();
        let picture = |n: usize| {
            let image = picture::embedded(&run.join(file(n, "png")))?;
            Ok(json!({"lights": file(n, "toml"), "image": image["src"]}))
        };
        let pictures = (1..=n).map(picture).collect::<Result<Vec<_>, ReportError>>()?;
        fronts.push(json!({"aims": aims, "plot": plot, "pictures": pictures}));
    }
    Ok(fronts.into())
}

/// A number with as many digits as a drawing shows.
pub(super) fn rounded(v: f64) -> Value {
    // Of six significant digits none is seen.
    format!("{v:.5e}").parse::<f64>().map_or(Value::Null, |v| json!(v))
}

/// Columns of the evaluations: number, f_q, error, and f of each term.
fn columns(evaluations: &[Value], target: &Target) -> Value {
    let numbered: Vec<&Value> = evaluations.iter().filter(|e| e["evaluation"].is_number()).collect();
    let column = |of: &dyn Fn(&Value) -> &Value| -> Vec<Value> {
        numbered.iter().map(|e| of(e).as_f64().map_or(Value::Null, rounded)).collect()
    };
    let terms: Map<String, Value> = target
        .goals()
        .map(|(term, _)| (term.name().to_owned(), column(&|e| &e["terms"][term.name()]["f"]).into()))
        .collect();
    json!({
        "n": numbered.iter().map(|e| e["evaluation"].clone()).collect::<Vec<_>>(),
        "f_q": column(&|e| &e["f_q"]),
        "error": column(&|e| &e["f_q_error"]),
        "f": terms,
    })
}

/// Whether a run has no basis, from which a page makes pictures.
fn is_fd(manifest: &Value) -> bool {
    manifest["options"]["gradient"] == "fd"
}

/// Steps of a search, each with its lighting where `found` is known with the variables, and with its picture where
/// it is `pictured`, having no basis to make it from.
fn iterations(
    run: &Path,
    found: Option<(&Lighting, &ParamVector)>,
    pictured: bool,
) -> Result<Value, ReportError> {
    let lines = lines(&run.join("iterations.jsonl"))?;
    let each = lines.iter().enumerate().map(|(i, line)| {
        let lighting = found.map(|(found, variables)| step(found, variables, &line["x"]));
        let image = if pictured { picture::iteration(&run.join(format!("iter_{i:04}.exr")))? } else { None };
        Ok(json!({
            "evaluation": line["evaluation"],
            "f_q": line["f_q"].as_f64().map(rounded),
            "lighting": lighting,
            "image": image,
        }))
    });
    Ok(each.collect::<Result<Vec<_>, ReportError>>()?.into())
}

/// The lighting of a step: that which was found, with the variables at the values `x`, by name.
fn step(found: &Lighting, variables: &ParamVector, x: &Value) -> Lighting {
    let value = |v: &Variable| {
        // A light that has no colour of its own in `found` is given one by reading it.
        let mut of_found = found.clone();
        x[&v.name].as_f64().unwrap_or_else(|| *v.kind.value(&mut of_found, v.light))
    };
    let values: Vec<f64> = variables.variables.iter().map(value).collect();
    variables.lighting(found.clone(), &values)
}

/// How many starts there were, and how many were searched from.
fn starts(run: &Path) -> Result<Value, ReportError> {
    let lines = lines(&run.join("starts.jsonl"))?;
    let searched = lines.iter().filter(|l| l["f_q"].is_number()).count();
    Ok(if lines.is_empty() { Value::Null } else { json!({"count": lines.len(), "searched": searched}) })
}

/// Lightings to choose from, each with its picture.
fn picks(run: &Path, result: &Value) -> Result<Value, ReportError> {
    let mut picks = result["picks"].clone();
    // Not by index, which would make an object of what is not there.
    let each = picks.get_mut("each").and_then(Value::as_array_mut).into_iter().flatten();
    for (i, pick) in each.enumerate() {
        pick["number"] = json!(i + 2);
        let image = picture::embedded(&run.join(format!("{}.png", pick_stem(i + 2))))?;
        pick["image"] = image["src"].clone();
    }
    Ok(picks)
}

/// Stages with their seconds.
fn seconds(timing: &[Value]) -> Value {
    let mut stages: Vec<(String, f64)> = Vec::new();
    for line in timing {
        let (Some(stage), Some(seconds)) = (line["stage"].as_str(), line["seconds"].as_f64()) else {
            continue;
        };
        match stages.iter_mut().find(|(name, _)| name == stage) {
            Some((_, sum)) => *sum += seconds,
            None => stages.push((stage.to_owned(), seconds)),
        }
    }
    json!(stages)
}

/// The command that began the run, as a shell takes it.
fn command(timing: &[Value]) -> Option<String> {
    let words = timing.iter().find_map(|line| line["command"].as_array())?;
    let quoted = |word: &Value| {
        let word = word.as_str().unwrap_or_default();
        let is_plain =
            !word.is_empty() && word.chars().all(|c| c.is_alphanumeric() || "-_./,=:+@%".contains(c));
        if is_plain { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
    };
    let words: Vec<String> = words.iter().map(quoted).collect();
    (!words.is_empty()).then(|| format!("lightopt-embree {}", words.join(" ")))
}

/// The plan of the set, where there is one.
fn plan(run: &Path) -> Result<Option<String>, ReportError> {
    let path: PathBuf = run.join(PLAN);
    if !path.is_file() {
        return Ok(None);
    }
    Ok(Some(format!("data:image/svg+xml;base64,{}", BASE64_STANDARD.encode(read(&path)?))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        light::LightColor,
        variables::{Scale, Tie, VariableKind},
    };

    #[test]
    fn a_command_is_quoted_for_a_shell() {
        let timing = [
            json!({"stage": "survey"}),
            json!({"command": ["run", "--tie", "fill=key*0.5", "my scene.obj", "it's"]}),
        ];
        let words = command(&timing).unwrap();
        assert_eq!(words, "lightopt-embree run --tie 'fill=key*0.5' 'my scene.obj' 'it'\\''s'");
        assert_eq!(command(&[json!({"command": []})]), None);
    }

    #[test]
    fn seconds_of_a_stage_add_up() {
        let line = |stage: &str, seconds: f64| json!({"stage": stage, "seconds": seconds});
        let timing = [line("basis", 1.0), line("refine", 0.5), line("basis", 2.0), json!({"command": []})];
        assert_eq!(seconds(&timing), json!([["basis", 3.0], ["refine", 0.5]]));
    }

    #[test]
    fn what_follows_a_light_follows_it_in_a_step_too() {
        let variable = |name: &str, keyword: &str, light: usize| Variable {
            name: name.into(),
            unit: "1",
            lower: 0.0,
            upper: 1e4,
            initial: 1.0,
            scale: Scale::Linear,
            kind: VariableKind::named(keyword).unwrap(),
            light,
        };
        let variables = ParamVector {
            // The radiance is that of a group, which has a name of its own.
            variables: vec![
                variable("warm.radiance", "radiance", 0),
                variable("fill.size", "size", 1),
                variable("key.color_temperature", "color", 0),
                variable("background.value", "background", 0),
            ],
            ties: vec![Tie { light: 1, leader: 0, factor: 0.25, brought: None }],
        };
        let found = Lighting {
            radiance: vec![1.0, 9.0],
            size: vec![1.0; 2],
            value: 1.0,
            exposure: 1.0,
            color: Vec::new(),
        };
        let x = json!({"warm.radiance": 8.0, "fill.size": 3.0, "background.value": 0.5,
            "key.color_temperature": 3000.0});
        let warm = LightColor::Temperature { kelvin: 3000.0, tint: 0.0 };
        assert_eq!(
            step(&found, &variables, &x),
            Lighting {
                radiance: vec![8.0, 2.0],
                size: vec![1.0, 3.0],
                value: 0.5,
                exposure: 1.0,
                color: vec![warm, LightColor::Recorded],
            }
        );
    }
}
