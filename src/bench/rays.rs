//! Rays a second inside our integrators, beside those of a bare loop of Embree.
//!
//! The rays of a picture are recorded once, and made again by a loop in C that does nothing with what they hit.
//! The rays a second of that loop are the limit of a renderer that asks for one ray at a time; the share of it
//! that a picture reaches says how much of the seconds is Embree's.

use std::time::Instant;

use glam::UVec2;
use serde::Serialize;
use serde_json::json;

use super::{
    BenchError,
    plots::{Bar, bars, grouped},
    report::Section,
    spread::Spread,
    subject::Subject,
};
use crate::{
    design::Reporter,
    embree::Tape,
    figures::table::{Entry, Table},
    integrator::IntegratorKind,
};

/// What is measured, and how often.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Size of the pictures, pixels.
    pub size: UVec2,
    /// Samples per pixel: the rays of all of them are kept in memory, 36 bytes each.
    pub spp: u32,
    /// Number of rounds.
    pub rounds: usize,
    /// Threads, which must be those of the current rayon pool.
    pub threads: usize,
    /// Seed of the picture.
    pub seed: u64,
}

/// A row of the table.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    integrator: IntegratorKind,
    rays: usize,
    rays_per_sample: f64,
    /// Share of the rays that ask for any hit.
    any_hit: f64,
    megarays_per_second: Spread,
    bare_megarays_per_second: Spread,
    /// Rays a second over those of the bare loop, round by round.
    share: Spread,
}

/// Measures rays a second on some scenes.
///
/// # Errors
/// When a scene cannot be rendered.
pub fn measure(
    subjects: &mut [Subject],
    settings: &Settings,
    reporter: &impl Reporter,
) -> Result<Section, BenchError> {
    let mut rows = Vec::new();
    for subject in subjects {
        for integrator in IntegratorKind::ALL {
            reporter.stage(&format!("rays: {}, {}", subject.name, integrator.name()), None);
            rows.push(row(subject, integrator, settings, reporter)?);
        }
    }
    section(&rows, settings)
}

/// Rays of a picture, recorded on one thread so that they come in the order in which they are asked for.
fn recorded(subject: &mut Subject, integrator: IntegratorKind, s: &Settings) -> Result<Tape, BenchError> {
    subject.scene.accel_mut().record();
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(std::io::Error::other);
    let rendered = alone
        .map_err(|source| BenchError::File { path: subject.path.clone(), action: "render", source })
        .and_then(|pool| pool.install(|| subject.render(integrator, s.size, s.spp, s.seed)));
    let tape = subject.scene.accel_mut().recorded();
    rendered.map(|_| tape)
}

fn row(
    subject: &mut Subject,
    integrator: IntegratorKind,
    s: &Settings,
    reporter: &impl Reporter,
) -> Result<Row, BenchError> {
    let tape = recorded(subject, integrator, s)?;
    let accel = subject.scene.accel();
    let (mut inside, mut bare) = (Vec::new(), Vec::new());
    let rate = |seconds: f64| tape.len() as f64 / seconds / 1e6;
    // The first of each reaches memory that the others find in the caches.
    let _ = (subject.render(integrator, s.size, s.spp, s.seed)?, accel.replay(&tape));
    for _ in 0..s.rounds {
        if reporter.cancelled() {
            return Err(BenchError::Interrupted);
        }
        inside.push(rate(subject.render(integrator, s.size, s.spp, s.seed)?.seconds));
        let clock = Instant::now();
        std::hint::black_box(accel.replay(&tape));
        bare.push(rate(clock.elapsed().as_secs_f64()));
    }
    let samples = s.size.as_dvec2().element_product() * f64::from(s.spp);
    let shares: Vec<f64> = inside.iter().zip(&bare).map(|(inside, bare)| inside / bare).collect();
    Ok(Row {
        scene: subject.name.clone(),
        integrator,
        rays: tape.len(),
        rays_per_sample: tape.len() as f64 / samples,
        any_hit: tape.n_any_hit() as f64 / tape.len().max(1) as f64,
        megarays_per_second: Spread::of(&inside),
        bare_megarays_per_second: Spread::of(&bare),
        share: Spread::of(&shares),
    })
}

fn section(rows: &[Row], settings: &Settings) -> Result<Section, BenchError> {
    let entry = |row: &Row| {
        vec![
            row.scene.as_str().into(),
            row.integrator.name().into(),
            Entry::Number(row.rays_per_sample, 1),
            Entry::Number(100.0 * row.any_hit, 0),
            Entry::Number(row.megarays_per_second.median, 2),
            Entry::Number(row.bare_megarays_per_second.median, 2),
            Entry::Number(100.0 * row.share.median, 1),
            Entry::Number(100.0 * row.share.least, 1),
            Entry::Number(100.0 * row.share.largest, 1),
        ]
    };
    let table = Table {
        caption: format!(
            "Rays a second inside our integrators, and of a bare loop of Embree over the same rays, on {} threads; \
             medians of {} rounds, and the range of the share.",
            settings.threads, settings.rounds
        ),
        header: vec![
            "scene",
            "integrator",
            "rays/sample",
            "any hit %",
            "Mrays/s",
            "bare Mrays/s",
            "share %",
            "least",
            "most",
        ],
        rows: rows.iter().map(entry).collect(),
        grouped: 1,
    };
    let bar = |row: &Row| {
        let bar = Bar { name: row.integrator.name().to_owned(), value: row.share, ours: true };
        (row.scene.clone(), bar)
    };
    let groups = grouped(rows.iter().map(bar));
    let plot = bars(&groups, "rays a second over those of a bare loop of Embree")?;
    Ok(Section {
        name: "rays",
        heading: "Rays",
        tables: vec![("rays".to_owned(), table)],
        plots: vec![("rays".to_owned(), plot)],
        notes: Vec::new(),
        record: json!({"settings": settings, "rows": rows}),
    })
}
