//! Error and seconds of pictures, ours and theirs.
//!
//! Efficiency is one over the product of a picture's relative mean squared error and the seconds that it took: of
//! two renderers, the one of twice the efficiency shows the same noise in half the time. The scene is loaded, and
//! kernels are compiled, before what is timed.

use std::path::{Path, PathBuf};

use glam::UVec2;
use serde::Serialize;
use serde_json::json;

use super::{
    BenchError,
    peers::{Mitsuba, VARIANTS},
    pictures::{Agreement, Pairs, reference},
    plots::{Bar, bars, grouped},
    report::Section,
    spread::Spread,
    subject::{Rendered, Subject},
};
use crate::{
    canvas::Canvas,
    design::Reporter,
    figures::table::{Entry, Table},
    integrator::IntegratorKind,
};

/// What is measured, and how often.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Sizes of pictures, pixels, with the number of rounds at each.
    pub sizes: Vec<(UVec2, usize)>,
    /// Samples per pixel that are asked for.
    pub spp: u32,
    /// Threads, which must be those of the current rayon pool.
    pub threads: usize,
    /// Seed of the first picture.
    pub seed: u64,
    /// Whether Mitsuba's scalar variant is measured at the smallest size: it is several times as slow.
    pub scalar: bool,
}

/// A renderer with its options.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "program")]
enum Entrant {
    Ours { integrator: IntegratorKind },
    Mitsuba { variant: &'static str, integrator: &'static str, sampler: &'static str },
}

impl Entrant {
    fn words(&self) -> String {
        match self {
            Self::Ours { integrator } => format!("ours, {}", integrator.name()),
            Self::Mitsuba { variant, integrator, sampler } => {
                format!("Mitsuba {variant}, {integrator}, {sampler}")
            }
        }
    }

    fn is_ours(&self) -> bool {
        matches!(self, Self::Ours { .. })
    }
}

/// Samplers of Mitsuba.
const SAMPLERS: [&str; 3] = ["independent", "multijitter", "orthogonal"];

/// A scene in one of its forms, exported at a size.
struct Form<'a> {
    /// Name of the scene.
    name: &'a str,
    /// The scene with these lights.
    subject: &'a Subject,
    /// `passed` where rays go through lights, `solid` where they end there.
    lights: &'static str,
    /// Integrator of Mitsuba that shows such lights.
    integrator: &'static str,
    size: UVec2,
    /// Description of the scene for Mitsuba; `None` without it.
    exported: Option<PathBuf>,
}

/// What one renderer has done for a scene at a size.
struct Results {
    entrant: Entrant,
    pairs: Pairs,
    /// Mean seconds of a picture, of each round.
    seconds: Vec<f64>,
    /// Samples per pixel that it took.
    spp: u32,
}

/// A row of the table.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    lights: &'static str,
    size: UVec2,
    #[serde(flatten)]
    entrant: Entrant,
    spp: u32,
    seconds: Spread,
    megasamples_per_second: f64,
    relative_error: Spread,
    efficiency: Spread,
    /// Efficiency over that of Mitsuba's best, round by round.
    ratio: Option<Spread>,
    /// Mean compared with that of ours, `bdpt`.
    mean: Agreement,
}

/// Measures efficiency on some scenes, each with lights that rays pass and with lights that stop them; exported
/// scenes go below `work`.
///
/// # Errors
/// When a scene cannot be rendered or exported, or a peer fails.
pub fn measure(
    subjects: &[Subject],
    settings: &Settings,
    mitsuba: &mut Option<Mitsuba>,
    work: &Path,
    reporter: &impl Reporter,
) -> Result<Section, BenchError> {
    let (mut rows, mut notes) = (Vec::new(), Vec::new());
    for subject in subjects {
        let solid = subject.with_bodies()?;
        let forms = [(Some(subject), "passed", "volpath"), (solid.as_ref(), "solid", "path")];
        let forms = forms.into_iter().filter_map(|(of, lights, integrator)| Some((of?, lights, integrator)));
        for (of, lights, integrator) in forms {
            for (i, &(size, rounds)) in settings.sizes.iter().enumerate() {
                let mut form =
                    Form { name: &subject.name, subject: of, lights, integrator, size, exported: None };
                if mitsuba.is_some() {
                    let place = work.join(format!("{}-{lights}-{}x{}", subject.name, size.x, size.y));
                    let (path, warnings) = of.export(size, &place)?;
                    form.exported = Some(path);
                    for warning in warnings.iter().map(|w| format!("{}: {w}", subject.name)) {
                        notes.extend((!notes.contains(&warning)).then_some(warning));
                    }
                }
                let with_scalar = settings.scalar && i == 0;
                rows.extend(of_form(&form, rounds, with_scalar, settings, mitsuba, reporter)?);
            }
        }
    }
    section(&rows, notes, settings)
}

/// Renderers that a form of a scene is given to.
fn entrants(form: &Form, with_scalar: bool) -> Vec<Entrant> {
    let ours = IntegratorKind::ALL.map(|integrator| Entrant::Ours { integrator });
    let variants = &VARIANTS[..if with_scalar { 2 } else { 1 }];
    let integrator = form.integrator;
    let theirs = variants
        .iter()
        .flat_map(|&variant| SAMPLERS.map(|sampler| Entrant::Mitsuba { variant, integrator, sampler }));
    ours.into_iter().chain(theirs.filter(|_| form.exported.is_some())).collect()
}

/// Measures a form of a scene at one size: the renderers take turns, two pictures each a round.
fn of_form(
    form: &Form,
    rounds: usize,
    with_scalar: bool,
    settings: &Settings,
    mitsuba: &mut Option<Mitsuba>,
    reporter: &impl Reporter,
) -> Result<Vec<Row>, BenchError> {
    let name = format!("{}, lights {}, {}x{}", form.name, form.lights, form.size.x, form.size.y);
    let mut field: Vec<Results> = entrants(form, with_scalar)
        .into_iter()
        .map(|entrant| Results { entrant, pairs: Pairs::default(), seconds: Vec::new(), spp: 0 })
        .collect();
    reporter.stage(&format!("efficiency: {name}, warming up"), None);
    for results in &field {
        render(form, &results.entrant, settings, mitsuba, settings.seed + 999_983)?;
    }
    for round in 0..rounds {
        reporter.stage(&format!("efficiency: {name}, round {} of {rounds}", round + 1), None);
        for results in &mut field {
            if reporter.cancelled() {
                return Err(BenchError::Interrupted);
            }
            let seed = settings.seed + 2 * round as u64;
            let a = render(form, &results.entrant, settings, mitsuba, seed)?;
            let b = render(form, &results.entrant, settings, mitsuba, seed + 1)?;
            results.pairs.add(&a.rgb, &b.rgb);
            results.seconds.push(0.5 * (a.seconds + b.seconds));
            results.spp = a.spp;
        }
    }
    Ok(rows_of(form, &field))
}

/// A picture of a form of a scene.
fn render(
    form: &Form,
    entrant: &Entrant,
    settings: &Settings,
    mitsuba: &mut Option<Mitsuba>,
    seed: u64,
) -> Result<Rendered, BenchError> {
    match (entrant, mitsuba, &form.exported) {
        (Entrant::Mitsuba { variant, integrator, sampler }, Some(mitsuba), Some(path)) => {
            mitsuba.variant(variant)?.render(path, [sampler, integrator], settings.spp, seed)
        }
        (Entrant::Ours { integrator }, ..) => form.subject.render(*integrator, form.size, settings.spp, seed),
        // There are no entrants of Mitsuba without it.
        _ => Err(BenchError::Interrupted),
    }
}

/// Rows of the table about one form of a scene at one size.
fn rows_of(form: &Form, field: &[Results]) -> Vec<Row> {
    let all: Vec<&Pairs> = field.iter().map(|r| &r.pairs).collect();
    let reference = reference(&all);
    let errors: Vec<Vec<f64>> = all.iter().map(|pairs| pairs.relative_errors(&reference)).collect();
    let efficiencies: Vec<Vec<f64>> = errors
        .iter()
        .zip(field)
        .map(|(errors, r)| errors.iter().zip(&r.seconds).map(|(e, s)| 1.0 / (e * s)).collect())
        .collect();
    let median = |i: usize| Spread::of(&efficiencies[i]).median;
    let theirs = (0..field.len()).filter(|&i| !field[i].entrant.is_ours());
    let best = theirs.max_by(|&i, &j| median(i).total_cmp(&median(j)));
    let bdpt = Entrant::Ours { integrator: IntegratorKind::Bdpt };
    let judge = field.iter().position(|r| r.entrant == bdpt).unwrap_or(0);
    let row = |(i, r): (usize, &Results)| {
        let seconds = Spread::of(&r.seconds);
        let samples = f64::from(form.size.x) * f64::from(form.size.y) * f64::from(r.spp);
        let ratios = |best: usize| {
            let pairs = efficiencies[i].iter().zip(&efficiencies[best]);
            Spread::of(&pairs.map(|(mine, theirs)| mine / theirs).collect::<Vec<_>>())
        };
        Row {
            scene: form.name.to_owned(),
            lights: form.lights,
            size: form.size,
            entrant: r.entrant.clone(),
            spp: r.spp,
            seconds,
            megasamples_per_second: samples / seconds.median / 1e6,
            relative_error: Spread::of(&errors[i]),
            efficiency: Spread::of(&efficiencies[i]),
            ratio: best.map(ratios),
            mean: r.pairs.compared(&field[judge].pairs, field.len()),
        }
    };
    field.iter().enumerate().map(row).collect()
}

/// Table, plot and record of all rows.
fn section(rows: &[Row], mut notes: Vec<String>, settings: &Settings) -> Result<Section, BenchError> {
    let entry = |row: &Row| {
        vec![
            row.scene.as_str().into(),
            row.lights.into(),
            format!("{}x{}", row.size.x, row.size.y).into(),
            row.entrant.words().into(),
            Entry::Number(f64::from(row.spp), 0),
            Entry::Number(row.seconds.median, 3),
            Entry::Number(row.megasamples_per_second, 2),
            Entry::Number(row.relative_error.median, 5),
            Entry::Number(row.efficiency.median, 1),
            row.ratio.map_or(Entry::Dash, |ratio| Entry::Number(ratio.median, 2)),
            row.ratio.map_or(Entry::Dash, |ratio| Entry::Number(ratio.least, 2)),
            row.ratio.map_or(Entry::Dash, |ratio| Entry::Number(ratio.largest, 2)),
            row.mean.words().into(),
        ]
    };
    let table = Table {
        caption: format!(
            "Efficiency, 1 / (relative mean squared error × seconds), on {} threads; medians of rounds of two \
             pictures, and the range of the ratio to Mitsuba's best.",
            settings.threads
        ),
        header: vec![
            "scene",
            "lights",
            "size",
            "renderer",
            "spp",
            "seconds",
            "Msamples/s",
            "relMSE",
            "efficiency",
            "ratio",
            "least",
            "most",
            "mean to ours, bdpt",
        ],
        rows: rows.iter().map(entry).collect(),
        grouped: 3,
    };
    let differing = rows.iter().filter(|row| !row.mean.agrees).count();
    if differing > 0 {
        notes.push(format!(
            "Means of {differing} of {} rows differ from ours by more than chance explains: such renderers do not \
             show the same picture, and their errors are those of their own.",
            rows.len()
        ));
    }
    Ok(Section {
        name: "efficiency",
        heading: "Efficiency",
        tables: vec![("efficiency".to_owned(), table)],
        plots: vec![("efficiency".to_owned(), plot(rows)?)],
        notes,
        record: json!({"settings": settings, "rows": rows}),
    })
}

/// Bars of the ratios to Mitsuba's best, or of the efficiencies without Mitsuba.
fn plot(rows: &[Row]) -> Result<Canvas, BenchError> {
    let bar = |row: &Row| {
        let group = format!("{}, lights {}, {}x{}", row.scene, row.lights, row.size.x, row.size.y);
        let value = row.ratio.unwrap_or(row.efficiency);
        (group, Bar { name: row.entrant.words(), value, ours: row.entrant.is_ours() })
    };
    let groups = grouped(rows.iter().map(bar));
    let has_best = rows.iter().any(|row| row.ratio.is_some());
    let what = if has_best { "efficiency over that of Mitsuba's best" } else { "efficiency, 1/s" };
    Ok(bars(&groups, what)?)
}
