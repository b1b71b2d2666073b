//! What a run is asked, what it answers, and how it fails.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use glam::UVec2;
use serde::{Deserialize, Serialize};

use super::attainable::Reach;
use crate::{
    audit::AuditError,
    film::{exr::ExrError, image_file::ImageFileError},
    integrator::{Integrator, RenderError},
    lighting::Lighting,
    math::display::LuminanceMode,
    objective::{Evaluation, JackknifeEstimate, ObjectiveError, Target},
    optim::{OptimError, StopReason},
    sampler::SamplerKind,
    scene::Scene,
    transport::store::StoreError,
    variables::{FreeKinds, ParamVector, SurveyError, Wishes},
};

/// How gradients are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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

/// What is to be lit.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its file, for the record.
    pub path: &'a Path,
    /// The lighting that its author gave it.
    pub authored: &'a Lighting,
    /// What its author wishes of the variables.
    pub wishes: &'a Wishes,
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
    /// Time that the whole run may take from when its scene is loaded: search, checks and pictures;
    /// one pass of each is made in any case.
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
    pub free: FreeKinds,
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
    /// f_q and terms of the final picture; `None` where an interrupt left no time for one.
    pub last: Option<Evaluation>,
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
    pub reach: Vec<Reach>,
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
    Store(#[from] StoreError),
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

impl From<ExrError> for RunError {
    fn from(e: ExrError) -> Self {
        Self::Audit(e.into())
    }
}

impl From<ImageFileError> for RunError {
    fn from(e: ImageFileError) -> Self {
        Self::Audit(e.into())
    }
}
