//! The driver of a run: survey, optimisation and check of all looks, and then their final pictures.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use rayon::prelude::*;
use serde_json::json;

use super::{
    FinalPicture, Gradient, Job, Reporter, RunError, RunOptions, RunReport, Subject, attainable,
    basis_search,
    deadline::Deadline,
    differences, manifest, outcome,
    pictures::{self, FoundLook, Pictures},
    precision::Precision,
    setup::{Found, Setup, Stage, Task},
    working_basis::{BasisPlan, MAX_TOGETHER, REDUCTION, WorkingBasis},
};
use crate::{
    audit::{AuditError, RunDir, products::Products},
    files::atomic::{probe, sweep},
    integrator::{
        View,
        aov::{self, Features},
    },
    objective::{JackknifeEstimate, LABELLINGS, Objective, Term},
    photo::weights::Weights,
    scene::Scene,
    variables::{Fitted, Survey},
};

/// Finds the lights of all looks that are asked for and records how; returns a report for each job.
///
/// # Errors
/// When the scene cannot be optimised, rendered or recorded. What was recorded
/// until then stays.
pub fn run(
    subject: Subject,
    options: &RunOptions,
    reporter: &impl Reporter,
) -> Result<Vec<RunReport>, RunError> {
    let start = Instant::now();
    let Subject { scene, constraints, rig, .. } = subject;
    check_outputs(options, scene)?;
    let camera = scene.camera.resized(options.work_size);
    let view = View { scene, camera: &camera };
    let mut aovs = aov::trace(view, 1.0);
    if let Some(weights) = &options.weights {
        let mask: Vec<bool> = weights.at(aovs.width, aovs.height).into_iter().map(|w| w >= 0.5).collect();
        // What has no pixel of its own is no start to match.
        if mask.contains(&true) && mask.contains(&false) {
            aovs.mask = mask;
        }
    }
    let objectives = options
        .jobs
        .iter()
        .map(|job| {
            Weights::objective(options.weights.as_ref(), &job.target, [aovs.width, aovs.height], &aovs.mask)
        })
        .collect::<Result<Vec<_>, _>>()?;

    reporter.stage("survey", Some(u64::from(options.work_size.y)));
    let ((content, fingerprint), fitted) = rayon::join(
        || (manifest::content(subject.path), scene.fingerprint()),
        || Fitted::new(view, subject.authored, constraints),
    );
    let fitted = fitted?;
    fitted.notes.iter().for_each(|n| reporter.note(n));
    let deadline = Deadline::new(start, subject.time_left.or(options.time_limit));
    let (fitted, aovs, products) = (&fitted, &aovs, &Products::new(options.products.as_deref()));
    let camera = &camera;
    let features = options.denoise.then(|| Features::trace(view));
    let features = features.as_ref();
    let stage = Stage {
        scene,
        camera,
        fitted,
        constraints,
        rig,
        aovs,
        features,
        options,
        deadline,
        fingerprint,
        products,
    };
    let mut basis = match options.gradient {
        Gradient::Fd => None,
        Gradient::Basis => {
            let plan = BasisPlan::new(&stage, reporter)?;
            Some(WorkingBasis::new(plan, &stage, reporter)?)
        }
    };
    let unit = match &basis {
        None => differences::unit_picture(&stage, reporter)?,
        Some(basis) => basis.unit_picture(),
    };
    let survey = Survey::new(scene, fitted, constraints, &options.free, options.measure, (&unit, &aovs.mask));
    let survey = match &basis {
        Some(basis) if !constraints.bonds.is_empty() => {
            survey.with_brought(basis.brought(&aovs.mask, fitted.lighting.value))
        }
        _ => survey,
    };
    let variables = survey.variables()?;
    let setup = Setup { stage, variables: &variables };
    let record = Record { subject, content: &content, surveyed: start.elapsed() };

    let mut renders = 1;
    let mut lit = Vec::new();
    let jobs: Vec<(&Job, &Objective)> = options.jobs.iter().zip(&objectives).collect();
    let together = if basis.is_some() { MAX_TOGETHER } else { 1 };
    for jobs in jobs.chunks(together) {
        let begun = jobs.par_iter().map(|&(job, objective)| begin(job, objective, &record, &survey, setup));
        let tasks = begun.collect::<Result<Vec<_>, _>>()?;
        let found = find_together(tasks, setup, basis.as_mut(), &mut renders, reporter)?;
        for lit in &found {
            outcome::write(&lit.report(None, 0, start, setup), lit.task.job, setup)?;
        }
        lit.extend(found);
        if !reporter.cancelled() {
            reporter.recorded(&directories(&lit), false);
        }
        if reporter.cancelled() {
            break;
        }
    }
    // Room for the pictures.
    drop(basis);
    finish(lit, start, setup, reporter)
}

/// Checks that the run can be recorded in its directories and in its cache.
fn check_outputs(options: &RunOptions, scene: &Scene) -> Result<(), RunError> {
    for job in &options.jobs {
        RunDir::check(&job.out, options.force)?;
    }
    if let Some(path) = &options.cache {
        std::fs::create_dir_all(path).map_err(|source| RunError::Cache { path: path.clone(), source })?;
        sweep(path, |name| name.ends_with(".basis"));
        probe(&path.join(BasisPlan::any_file_name(scene))).map_err(AuditError::from)?;
    }
    Ok(())
}

/// Facts about a run with which the record of every look begins.
struct Record<'a> {
    /// Scene with its file.
    subject: Subject<'a>,
    /// Hash of the scene file and its sidecar.
    content: &'a str,
    /// Time that the survey took, with the first samples of the basis.
    surveyed: Duration,
}

/// Opens the run directory of a job and makes the starts of its search.
fn begin<'a>(
    job: &'a Job,
    objective: &Objective,
    record: &Record,
    survey: &Survey,
    setup: Setup,
) -> Result<Task<'a>, RunError> {
    let source = (record.subject.path, record.content);
    let manifest = manifest::text(setup, source, &job.target)?;
    let mut dir = RunDir::create(&job.out, setup.options.force, &manifest)?;
    if let Some(rig) = setup.rig {
        rig.write_maps(job.target.name(), &job.out)?;
    }
    dir.log_timing(&json!({"command": setup.options.command}))?;
    dir.log_timing(&json!({"stage": "survey", "seconds": record.surveyed.as_secs_f64()}))?;
    let means = [Term::MeanObj, Term::MeanBack].map(|t| job.target.target(t));
    let starts = survey.starts(&setup.aovs.mask, setup.variables, means);
    let reduced = setup.reduced_objective(&job.target, REDUCTION);
    Ok(Task { job, objective: objective.clone(), reduced, starts, dir })
}

/// A look whose lights are found.
struct Lit<'a> {
    task: Task<'a>,
    found: Found,
    /// f_q at the neutral start.
    initial: JackknifeEstimate,
    /// Number of renders of the run until the lights were found.
    renders: u64,
    /// Shares of the samples that each light is to be chosen for in a picture of the start, and of those found.
    lights: [Vec<f32>; 2],
}

impl Lit<'_> {
    /// What the look has come to, with its final picture and the renders that the pictures took.
    fn report(
        &self,
        last: Option<FinalPicture>,
        of_pictures: u64,
        start: Instant,
        setup: Setup,
    ) -> RunReport {
        let Found { u, check, evaluations, stop, reach, alternatives } = &self.found;
        let x = setup.variables.decode(u);
        let degenerate = attainable::degenerate(&check.evaluation, setup.variables, &x);
        let caution: Vec<String> =
            degenerate.into_iter().chain(lacking(check, last.as_ref(), setup)).collect();
        let lighting = setup.lighting(u);
        let lamps = setup.rig.map_or_else(Vec::new, |rig| rig.described(setup.scene, &lighting));
        RunReport {
            surroundings: setup.rig.and_then(|rig| Some(rig.sky.as_ref()?.in_words())),
            lamps: lamps.into_iter().map(|(lamp, described)| (lamp.name.clone(), described)).collect(),
            initial: self.initial.clone(),
            check: check.clone(),
            last,
            variables: setup.variables.clone(),
            x,
            renders: self.renders + of_pictures,
            evaluations: *evaluations,
            stop: *stop,
            reach: reach.clone(),
            alternatives: alternatives.clone(),
            caution: (!caution.is_empty()).then(|| caution.join("; ")),
            seconds: start.elapsed().as_secs_f64(),
        }
    }
}

/// Run directories of some looks.
fn directories<'l>(lit: &'l [Lit]) -> Vec<&'l Path> {
    lit.iter().map(|lit| lit.task.job.out.as_path()).collect()
}

/// Finds the lights of some looks, from one basis or in paper mode one after the other.
fn find_together<'a>(
    mut tasks: Vec<Task<'a>>,
    setup: Setup,
    mut basis: Option<&mut WorkingBasis>,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<Lit<'a>>, RunError> {
    let clock = Instant::now();
    let initials = measure_starts(&tasks, setup, basis.as_deref(), reporter)?;
    for (task, initial) in tasks.iter().zip(&initials) {
        let (f_q, error) = (initial.evaluation.f_q, initial.error_bar());
        reporter.note(&format!("{}: start: f_q {f_q:.4} ± {error:.4}", task.job.target.name()));
    }
    let found: Vec<(Found, u64)> = match basis.as_deref_mut() {
        Some(basis) => {
            let found = basis_search::optimise(basis, &mut tasks, setup, renders, reporter)?;
            found.into_iter().map(|found| (found, *renders)).collect()
        }
        None => {
            let find = |task: &mut Task| Ok((differences::find(task, setup, renders, reporter)?, *renders));
            tasks.iter_mut().map(find).collect::<Result<_, RunError>>()?
        }
    };
    let n_lights = setup.scene.lights.len();
    let lights = |u: &[f64]| match basis.as_deref() {
        Some(basis) => basis.focus(setup.lighting(u), 1.0).weights,
        None => vec![1.0 / n_lights as f32; n_lights],
    };
    let lights: Vec<[Vec<f32>; 2]> =
        found.iter().map(|(found, _)| [lights(&setup.variables.start()), lights(&found.u)]).collect();
    // The lights found are on disk before the large basis.
    if let Some(basis) = basis {
        basis.store(setup, reporter)?;
    }
    let seconds = clock.elapsed().as_secs_f64();
    let each = tasks.into_iter().zip(found).zip(initials).zip(lights);
    each.map(|(((mut task, (found, renders)), initial), lights)| {
        task.dir.log_timing(&json!({"stage": "found", "seconds": seconds}))?;
        let (f_q, error) = (found.check.evaluation.f_q, found.check.error_bar());
        let picture = Some(task.job.out.join("found.png")).filter(|path| path.exists());
        let picture =
            picture.map_or_else(String::new, |path| format!("; a small picture: {}", path.display()));
        reporter.note(&format!("{}: f_q {f_q:.4} ± {error:.4}{picture}", task.job.target.name()));
        Ok(Lit { task, found, initial, renders, lights })
    })
    .collect()
}

/// f_q of every look at the neutral start, from the basis or in paper mode from a render of its own.
fn measure_starts(
    tasks: &[Task],
    setup: Setup,
    basis: Option<&WorkingBasis>,
    reporter: &impl Reporter,
) -> Result<Vec<JackknifeEstimate>, RunError> {
    let Some(basis) = basis else {
        return tasks.iter().map(|task| differences::measure_start(task, setup, reporter)).collect();
    };
    let start = setup.variables.start();
    let measure = |task: &Task| basis.evaluator(setup, &task.objective).estimate(&start, LABELLINGS);
    Ok(tasks.par_iter().map(measure).collect::<Result<_, _>>()?)
}

/// Renders the lights found for all looks at full size, and reports on each.
fn finish(
    mut lit: Vec<Lit>,
    start: Instant,
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Vec<RunReport>, RunError> {
    let looks: Vec<FoundLook> = lit
        .iter()
        .map(|lit| FoundLook { task: &lit.task, u: &lit.found.u, lights: &lit.lights[1] })
        .collect();
    let start_lights = lit.first().map_or(&[][..], |lit| &lit.lights[0]);
    let Pictures { taken, renders: of_pictures } = pictures::take(&looks, start_lights, setup, reporter)?;
    let mut reports = Vec::new();
    for (lit, last) in lit.iter_mut().zip(taken) {
        let report = lit.report(last, of_pictures, start, setup);
        let look = lit.task.job.target.name();
        report.caution.iter().for_each(|line| reporter.note(&format!("{look}: {line}")));
        lit.task.dir.log_timing(&json!({"stage": "all", "seconds": report.seconds}))?;
        outcome::write(&report, lit.task.job, setup)?;
        reports.push(report);
    }
    reporter.recorded(&directories(&lit), true);
    Ok(reports)
}

/// Sentence about the precision and the samples that a result lacks because of its deadline; `None` if it
/// lacks nothing.
fn lacking(check: &JackknifeEstimate, last: Option<&FinalPicture>, setup: Setup) -> Option<String> {
    let options = setup.options;
    let limit = options.time_limit?;
    let mut lacks = Vec::new();
    let (error, asked) = (check.error_bar(), options.tolerance);
    if !Precision::reported(asked).is_met(check) {
        lacks.push(format!("f_q is known to {error:.4} only, {asked} was asked for"));
    }
    if let Some(last) = last.filter(|last| last.is_incomplete) {
        lacks.push(format!("the picture has {} of {} samples a pixel", last.spp, options.final_spp));
    }
    let seconds = limit.as_secs_f64();
    (!lacks.is_empty()).then(|| format!("the time limit of {seconds} s was too short: {}", lacks.join(", ")))
}
