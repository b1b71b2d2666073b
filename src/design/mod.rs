//! Lighting design: from a scene and a target to the lights that meet it.
//!
//! One direction: survey (bounds and start) ─▶ optimisation at the working
//! size ─▶ check render ─▶ final render, all recorded in a run directory per
//! target. Optimisation is on the [transport basis](crate::transport), where
//! several targets share all renders, or in paper mode by finite differences of
//! fresh renders.
//! Every stage draws from seeds of its own, so that what is reported comes
//! from samples that chose nothing.

pub mod attainable;
mod basis;
mod check;
mod coordinates;
mod engine;
pub mod evaluator;
pub mod manifest;
mod optimise;
mod precision;
mod quest;
mod search;
pub mod shot;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use glam::UVec2;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::{
    audit::{AuditError, RunDir, lights::Lighting, picture, write_whole},
    film::{Picture, exr::write_exr, image_file::write_png},
    integrator::{Integrator, Observer, RenderError, aov},
    light::SizeDensity,
    math::{display::LuminanceMode, hash::hash_words},
    objective::{Evaluation, JackknifeEstimate, LABELLINGS, Objective, ObjectiveError, Target, Term},
    optim::{OptimError, StopReason},
    params::{ParamVector, survey, survey::SurveyError},
    sampler::SamplerKind,
    scene::{Scene, sidecar::FreeVariables},
};

pub use shot::{Camera, Shot};

/// How gradients are found.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "lowercase")]
pub enum Gradient {
    /// Exact, on the transport basis: one render, many starts
    #[default]
    Basis,
    /// Forward differences of fresh renders, from one start (the paper's way)
    Fd,
}

/// A look wanted, and where to record how it was found.
#[derive(Clone, Debug)]
pub struct Job {
    /// The look.
    pub target: Target,
    /// The run directory.
    pub out: PathBuf,
}

/// What a run is asked to do.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The looks wanted; all from one basis.
    pub jobs: Vec<Job>,
    /// How gradients are found.
    pub gradient: Gradient,
    /// Whether the whole box is searched too, on the basis.
    pub global: bool,
    /// Error of f_q (95 %) at which no more samples are added.
    pub tolerance: f64,
    /// Time after which no more samples are added for targets that are optimised together.
    pub time_limit: Option<Duration>,
    /// Where bases are kept for later runs.
    pub cache: Option<PathBuf>,
    /// Most memory of a basis, bytes.
    pub memory: u64,
    /// Light transport.
    pub integrator: Integrator,
    /// Sample sequences.
    pub sampler: SamplerKind,
    /// Measure of luminance.
    pub luminance: LuminanceMode,
    /// Size of the final picture, pixels.
    pub size: UVec2,
    /// Size at which the lights are optimised, pixels.
    pub work_size: UVec2,
    /// Samples per pixel of the first basis, or of every working render in paper mode; where
    /// none are given, the latter as many as the tolerance needs.
    pub spp: Option<u32>,
    /// Samples per pixel of the final picture.
    pub final_spp: u32,
    /// What may vary.
    pub free: FreeVariables,
    /// Seed of everything.
    pub seed: u64,
    /// Evaluations of f_q with its gradient, at most; in paper mode.
    pub max_evaluations: u32,
    /// Replace earlier runs.
    pub force: bool,
}

/// What a run found.
#[derive(Debug)]
pub struct RunReport {
    /// f_q at the start, from a render of its own.
    pub initial: JackknifeEstimate,
    /// f_q of the lights found, from the check render.
    pub check: JackknifeEstimate,
    /// f_q and terms of the final picture.
    pub last: Evaluation,
    /// The variables.
    pub variables: ParamVector,
    /// Their values.
    pub x: Vec<f64>,
    /// Renders made, all sizes.
    pub renders: u64,
    /// Evaluations of f_q with its gradient.
    pub evaluations: u32,
    /// Why the optimisation ended.
    pub stop: StopReason,
    /// What of each term the lights can reach; empty in paper mode.
    pub reach: Vec<attainable::Reach>,
    /// Why the result may not be what was meant.
    pub caution: Option<String>,
    /// Wall time from the beginning of the run, s.
    pub seconds: f64,
}

/// A run failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum RunError {
    #[error(transparent)]
    Survey(#[from] SurveyError),
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
    #[error(transparent)]
    Optim(#[from] OptimError),
    #[error(transparent)]
    Store(#[from] crate::transport::store::StoreError),
    #[error("cannot describe the transport basis")]
    About(#[source] std::io::Error),
    #[error("{path}: cannot make the directory", path = path.display())]
    Cache { path: PathBuf, source: std::io::Error },
    #[error(transparent)]
    Audit(#[from] AuditError),
    #[error(
        "the transport basis needs {needed} MiB, more than the {allowed} MiB allowed; allow more with --memory, \
         or make the working pictures smaller with --work-size"
    )]
    Memory { needed: u64, allowed: u64 },
    #[error("cannot write the manifest")]
    Manifest(#[from] toml::ser::Error),
}

impl From<crate::film::exr::ExrError> for RunError {
    fn from(e: crate::film::exr::ExrError) -> Self {
        Self::Audit(e.into())
    }
}

impl From<crate::film::image_file::ImageFileError> for RunError {
    fn from(e: crate::film::image_file::ImageFileError) -> Self {
        Self::Audit(e.into())
    }
}

/// What all jobs have in common.
struct Setting<'a> {
    scene: &'a mut Scene,
    /// Takes the working pictures.
    camera: &'a Camera,
    variables: &'a ParamVector,
    aovs: &'a aov::Aovs,
    options: &'a RunOptions,
}

/// A job being done.
struct Task<'a> {
    job: &'a Job,
    objective: Objective,
    /// The same of the picture on which starts are screened.
    reduced: Option<Objective>,
    /// Where a search may begin, in the optimiser's units.
    starts: Vec<(String, Vec<f64>)>,
    dir: RunDir,
}

/// Follows a run.
pub trait Reporter: Observer {
    /// A fact worth a line.
    fn note(&self, text: &str);
    /// A stage begins; it will render `rows` rows of pixels, when known.
    fn stage(&self, name: &str, rows: Option<u64>);
    /// An evaluation of the optimiser is done.
    fn evaluated(&self, progress: &Progress);
}

/// State of the optimisation.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Evaluations so far.
    pub evaluation: u32,
    /// The most there will be.
    pub max_evaluations: u32,
    /// Improvements so far.
    pub iterations: u32,
    /// f_q of this evaluation.
    pub f_q: f64,
    /// Best f_q so far.
    pub best: f64,
    /// Renders so far.
    pub renders: u64,
}

/// Independent uses of a run's seed. The full-size pictures use the seed
/// itself, so that `render --seed` makes them again.
#[derive(Clone, Copy, Debug)]
enum Purpose {
    Survey = 1,
    Optimise,
    Initial,
    Check,
}

fn seed_for(seed: u64, purpose: Purpose) -> u64 {
    hash_words(&[seed, purpose as u64])
}

/// Camera subpaths for each light subpath of a working picture: where those find much light that
/// next-event estimation does not, more samples will make up for it.
const CAMERA_SUBPATHS: u32 = 4;
/// Targets optimised together at most: each has its own part of the samples.
const MAX_TOGETHER: usize = SizeDensity::MAX_LIKELY;
/// Replicates of a render whose f_q is reported in paper mode.
const CHECK_REPLICATES: u32 = 8;
/// Samples of its check and initial renders, times those of a working render.
const CHECK_FACTOR: u32 = 4;
/// Samples per pixel of the survey.
const SURVEY_SPP: u32 = 64;
/// The initial picture is taken with this share of the final samples.
const INITIAL_SHARE: u32 = 4;

/// Runs the whole design of `scene` and records it; a report per job.
///
/// # Errors
/// When the scene cannot be optimised, rendered or recorded. What was recorded
/// until then stays.
pub fn run(
    scene: &mut Scene,
    scene_path: &Path,
    options: &RunOptions,
    reporter: &impl Reporter,
) -> Result<Vec<RunReport>, RunError> {
    let start = Instant::now();
    for job in &options.jobs {
        RunDir::check(&job.out, options.force)?;
    }
    if let Some(path) = &options.cache {
        std::fs::create_dir_all(path).map_err(|source| RunError::Cache { path: path.clone(), source })?;
    }
    let camera =
        Camera { integrator: options.integrator, sampler: options.sampler, luminance: options.luminance };
    let integrator = Integrator { camera_subpaths: CAMERA_SUBPATHS, ..camera.integrator };
    let working = Camera { integrator, ..camera };
    scene.camera.resize(options.work_size);
    let aovs = aov::trace(scene);
    let objectives = options
        .jobs
        .iter()
        .map(|job| Objective::new(&job.target, aovs.width, aovs.height, &aovs.mask))
        .collect::<Result<Vec<_>, _>>()?;

    reporter.stage("survey", Some(u64::from(options.work_size.y)));
    let (content, fitted) =
        rayon::join(|| manifest::content(scene_path), || survey::fit_sizes(scene, options.work_size));
    let (sizes, notes) = fitted?;
    notes.iter().for_each(|n| reporter.note(n));
    let range = survey::value_range(scene);
    let largest_value = range.map_or(1.0, |[_, hi]| hi);
    scene.set_background_value(1.0_f32.min(largest_value), largest_value);
    let mut renders = 1;
    let (mut engine, unit) = match options.gradient {
        Gradient::Fd => (None, unit_picture(scene, &working, options, reporter)?),
        Gradient::Basis => {
            let plan = engine::Plan::new(scene, &sizes, range.map(|[_, hi]| hi), options, reporter)?;
            let engine = engine::Engine::new(plan, scene, &working, options, reporter)?;
            let unit = engine.unit_picture();
            (Some(engine), unit)
        }
    };
    let variables = survey::variables(scene, &unit, &sizes, &options.free, options.luminance)?;
    let before = start.elapsed();
    let together = if engine.is_some() { MAX_TOGETHER } else { 1 };
    let mut reports = Vec::new();
    let jobs: Vec<(&Job, &Objective)> = options.jobs.iter().zip(&objectives).collect();
    for jobs in jobs.chunks(together) {
        let clock = Instant::now();
        scene.camera.resize(options.work_size);
        scene.select_all_lights();
        scene.set_background_value(1.0_f32.min(largest_value), largest_value);
        let mut setting =
            Setting { scene: &mut *scene, camera: &working, variables: &variables, aovs: &aovs, options };
        let source = (scene_path, content.as_str());
        let begun =
            jobs.par_iter().map(|&(job, objective)| begin(job, objective, source, &unit, &setting, before));
        let mut tasks = begun.collect::<Result<Vec<_>, _>>()?;
        let initials = measure_starts(&tasks, &mut setting, engine.as_ref(), reporter)?;
        for (task, initial) in tasks.iter().zip(&initials) {
            let (f_q, error) = (initial.evaluation.f_q, initial.error_bar());
            reporter.note(&format!("{}: start: f_q {f_q:.4} ± {error:.4}", task.job.target.name()));
        }
        let found = match &mut engine {
            Some(engine) => basis::optimise(engine, &mut tasks, &mut setting, &mut renders, reporter)?,
            None => tasks
                .iter_mut()
                .map(|task| find_by_differences(task, &mut setting, &mut renders, reporter))
                .collect::<Result<_, _>>()?,
        };
        let seconds = clock.elapsed().as_secs_f64();
        for ((mut task, found), initial) in tasks.into_iter().zip(found).zip(initials) {
            let (check, look) = (&found.check, task.job.target.name());
            reporter.note(&format!("{look}: f_q {:.4} ± {:.4}", check.evaluation.f_q, check.error_bar()));
            let caution = attainable::degenerate(&check.evaluation, &variables, &variables.decode(&found.u));
            caution.iter().for_each(|line| reporter.note(&format!("{look}: {line}")));
            task.dir.log_timing(&json!({"stage": "found", "seconds": seconds}))?;
            let last = take_pictures(&task, &found.u, &camera, &mut setting, largest_value, reporter)?;
            renders += 2;
            let seconds = start.elapsed().as_secs_f64();
            task.dir.log_timing(&json!({"stage": "all", "seconds": seconds}))?;
            reports.push(RunReport {
                initial,
                check: found.check,
                last,
                variables: variables.clone(),
                x: variables.decode(&found.u),
                renders,
                evaluations: found.evaluations,
                stop: found.stop,
                reach: found.reach,
                caution,
                seconds,
            });
        }
        if reporter.cancelled() {
            break;
        }
    }
    if let Some(engine) = &engine {
        engine.store(scene, &aovs, &variables, options)?;
    }
    Ok(reports)
}

/// Opens a job's record and finds out where its search may begin.
fn begin<'a>(
    job: &'a Job,
    objective: &Objective,
    source: (&Path, &str),
    unit: &Picture,
    setting: &Setting<'a>,
    surveyed: Duration,
) -> Result<Task<'a>, RunError> {
    let Setting { scene, variables, options, aovs, .. } = setting;
    let manifest = manifest::text(scene, source, options, &job.target, variables)?;
    let mut dir = RunDir::create(&job.out, options.force, &manifest)?;
    dir.log_timing(&json!({"stage": "survey", "seconds": surveyed.as_secs_f64()}))?;
    let means = [Term::MeanObj, Term::MeanBack].map(|t| job.target.target(t));
    let starts = survey::starts(scene, unit, &aovs.mask, variables, means, options.luminance);
    let reduced = engine::reduced_objective(setting, &job.target);
    Ok(Task { job, objective: objective.clone(), reduced, starts, dir })
}

/// f_q where every search begins, by the basis or from a render of its own.
fn measure_starts(
    tasks: &[Task],
    setting: &mut Setting,
    engine: Option<&engine::Engine>,
    reporter: &impl Reporter,
) -> Result<Vec<JackknifeEstimate>, RunError> {
    let start = setting.variables.start();
    if let Some(engine) = engine {
        let setting = &*setting;
        let measure = |task: &Task| engine.evaluator(setting, &task.objective).estimate(&start, LABELLINGS);
        return Ok(tasks.par_iter().map(measure).collect::<Result<_, _>>()?);
    }
    let x0 = setting.variables.decode(&start);
    let spp = setting.options.spp.unwrap_or(optimise::FIRST_SAMPLES);
    let what = (Purpose::Initial, "measuring the start");
    tasks.iter().map(|task| measure(&task.objective, setting, &x0, spp, what, reporter)).collect()
}

/// Paper mode: finds the lights and checks them.
fn find_by_differences<'a>(
    task: &mut Task<'a>,
    setting: &mut Setting<'a>,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<quest::Found, RunError> {
    let optimise::Found { u, spp, evaluations, stop } =
        optimise::by_differences(task, setting, renders, reporter)?;
    let (x, what) = (setting.variables.decode(&u), (Purpose::Check, "checking the result with new samples"));
    let check = measure(&task.objective, setting, &x, spp, what, reporter)?;
    *renders += 2;
    Ok(quest::Found { u, check, evaluations, stop, reach: Vec::new() })
}

/// A render with every light at radiance 1.
fn unit_picture(
    scene: &mut Scene,
    camera: &Camera,
    options: &RunOptions,
    reporter: &impl Reporter,
) -> Result<Picture, RunError> {
    let authored: Vec<(f32, f32)> = scene.lights.iter().map(|l| (l.radiance, l.size)).collect();
    for (i, (_, size)) in authored.iter().enumerate() {
        scene.set_light(i, 1.0, *size);
    }
    let shot = camera.shoot(scene, seed_for(options.seed, Purpose::Survey), SURVEY_SPP, 1, reporter)?;
    for (i, (radiance, size)) in authored.into_iter().enumerate() {
        scene.set_light(i, radiance, size);
    }
    Ok(shot.picture)
}

/// Takes a render whose f_q is reported in paper mode.
fn measure(
    objective: &Objective,
    setting: &mut Setting,
    x: &[f64],
    spp: u32,
    (purpose, stage): (Purpose, &str),
    reporter: &impl Reporter,
) -> Result<JackknifeEstimate, RunError> {
    let Setting { scene, camera, variables, options, .. } = setting;
    reporter.stage(stage, Some(u64::from(options.work_size.y * CHECK_REPLICATES)));
    variables.apply(scene, x);
    let seed = seed_for(options.seed, purpose);
    let shot = camera.shoot(scene, seed, CHECK_FACTOR * spp, CHECK_REPLICATES, &Unstoppable(reporter))?;
    Ok(shot.measure(objective)?.estimate)
}

/// An interrupt ends the optimisation; what was found is still rendered.
struct Unstoppable<'a, R>(&'a R);

impl<R: Reporter> Observer for Unstoppable<'_, R> {
    fn advance(&self, rows: u64) {
        self.0.advance(rows);
    }
}

/// Takes the full-size pictures of the start and of what was found, writes the lights, and
/// returns the f_q of the last picture as it was written.
fn take_pictures(
    task: &Task,
    found: &[f64],
    camera: &Camera,
    setting: &mut Setting,
    largest_value: f32,
    reporter: &impl Reporter,
) -> Result<Evaluation, RunError> {
    let (variables, options, out) = (setting.variables, setting.options, &task.job.out);
    setting.scene.camera.resize(options.size);
    let mut take = |name: &str, u: &[f64], spp: u32| {
        let x = variables.decode(u);
        let scene = &mut *setting.scene;
        variables.apply(scene, &x);
        let value = variables.background_value(&x).map_or(1.0_f32.min(largest_value), |v| v as f32);
        scene.set_background_value(value, value);
        scene.select_shining_lights();
        reporter.stage(&format!("{name} picture"), Some(u64::from(options.size.y)));
        let shot = camera.shoot(scene, options.seed, spp, 1, &Unstoppable(reporter))?;
        let aovs = aov::trace(scene);
        let objective = Objective::new(&task.job.target, aovs.width, aovs.height, &aovs.mask)?;
        let evaluation = objective.evaluate(&shot.display());
        let attribute = attribute(scene, options, &task.job.target, variables, &x, &evaluation, spp);
        let names: Vec<&str> = scene.lights.iter().map(|l| l.name.as_str()).collect();
        let exposure = f64::from(scene.exposure);
        let exr = picture::exr(&shot.picture, &aovs, &names, exposure, options.luminance, attribute);
        write_exr(&out.join(format!("{name}.exr")), &exr)?;
        write_png(&out.join(format!("{name}.png")), &picture::beauty(&shot.picture), exposure)?;
        Ok::<_, RunError>((evaluation, value))
    };
    take("initial", &variables.start(), (options.final_spp / INITIAL_SHARE).max(1))?;
    let (evaluation, value) = take("final", found, options.final_spp)?;
    let value = (!setting.scene.background().is_empty()).then_some(value);
    write_whole(&out.join("lights.toml"), toml::to_string(&Lighting::of(setting.scene, value))?)?;
    Ok(evaluation)
}

/// The `lightopt` attribute of a run's picture: enough to evaluate it again.
fn attribute(
    scene: &Scene,
    options: &RunOptions,
    target: &Target,
    variables: &ParamVector,
    x: &[f64],
    evaluation: &Evaluation,
    spp: u32,
) -> Value {
    json!({
        "scene": scene.name,
        "x": variables.named(x),
        "f_q": evaluation.f_q,
        "terms": evaluation.terms_json(),
        "exposure": scene.exposure,
        "luminance": options.luminance,
        "target": target,
        "integrator": options.integrator.kind,
        "spp": spp,
        "seed": options.seed,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": env!("LIGHTOPT_COMMIT"),
    })
}
