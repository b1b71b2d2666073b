//! Options, reports and errors of a run.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use glam::UVec2;
use serde::{Deserialize, Serialize};

use super::{alternatives::Alternative, attainable::Reach, noise::Noise, rig::Rig};
use crate::{
    audit::{AuditError, placed::Description},
    canvas::FigureError,
    files::number::Bytes,
    film::{exr::ExrError, image_file::ImageFileError},
    import::radiance_map::MapError,
    integrator::{Integrator, RenderError},
    lighting::Lighting,
    math::Measure,
    objective::{JackknifeEstimate, ObjectiveError, Target},
    optim::{OptimError, StopReason},
    photo::weights::Weights,
    sampler::SamplerKind,
    scene::Scene,
    transport::store::StoreError,
    variables::{Constraints, FreeKinds, ParamVector, SurveyError},
};

/// Source of the gradients of f_q.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Gradient {
    /// Exact derivatives on the transport basis, rendered once for many starts.
    #[default]
    Basis,
    /// Forward differences of fresh renders from one start, as in \[PG14\]: paper mode.
    Fd,
}

/// A look to be found, and the directory that records how it was found.
#[derive(Clone, Debug)]
pub struct Job {
    /// Target of the look.
    pub target: Target,
    /// Run directory.
    pub out: PathBuf,
}

/// A scene to be lit.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Path of the scene file, for the record.
    pub path: &'a Path,
    /// Lighting that the scene's author gave it.
    pub authored: &'a Lighting,
    /// Constraints that the scene's author sets on the variables.
    pub constraints: &'a Constraints,
    /// Lamps that the program placed; `None` where all lights are the scene's own.
    pub rig: Option<&'a Rig>,
    /// What is left for this scene of the time that the options allow; `None` where it is all of it.
    pub time_left: Option<Duration>,
}

/// Options of a run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Looks to be found, all from one basis.
    pub jobs: Vec<Job>,
    /// Source of the gradients of f_q.
    pub gradient: Gradient,
    /// Whether the whole box of the variables is also searched on the basis, without starts or gradients.
    pub global: bool,
    /// Half width of the 95 % interval of f_q at which no more samples are added.
    pub tolerance: f64,
    /// Time that the whole run may take from when its scene is loaded: search, checks and pictures;
    /// one pass of each is made in any case.
    pub time_limit: Option<Duration>,
    /// Directory that keeps bases for later runs; `None` to keep none.
    pub cache: Option<PathBuf>,
    /// Upper bound of the memory of transport bases, bytes, and of the final pictures that are rendered
    /// together; one is rendered in any case.
    pub memory: u64,
    /// Integrator with its options.
    pub integrator: Integrator,
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Weights in the place of the mask of the main object.
    pub weights: Option<Weights>,
    /// Measure of luminance.
    pub measure: Measure,
    /// Size of the final picture, pixels.
    pub size: UVec2,
    /// Size at which the lights are optimised, pixels.
    pub work_size: UVec2,
    /// Samples per pixel of the first basis, or of every working render in paper mode; `None` for a fixed
    /// number for the former, and for as many as the tolerance needs for the latter.
    pub spp: Option<u32>,
    /// Samples per pixel of the final picture at most.
    pub final_spp: u32,
    /// [Error](Noise::error) that noise may leave in the final picture as it is shown: no more samples are
    /// taken when it is below; with 0 as many are as may be.
    pub final_noise: f64,
    /// Whether pictures that are looked at are denoised; what is measured never is.
    pub denoise: bool,
    /// Kinds of variables that are free.
    pub free: FreeKinds,
    /// Seed of all samples and of the search.
    pub seed: u64,
    /// Upper bound of the evaluations of f_q with its gradient in paper mode.
    pub max_evaluations: u32,
    /// Whether earlier runs in the directories are replaced.
    pub force: bool,
    /// Directory in which the run finds what an earlier attempt at it has made, and keeps what it makes, so
    /// that another attempt goes on from there; `None` to keep nothing.
    pub products: Option<PathBuf>,
    /// File to which the transport basis is written when lights are found in it; `None` for none.
    pub basis_file: Option<PathBuf>,
    /// File to which a small copy of the basis is written, for the report; `None` for none.
    pub live_file: Option<PathBuf>,
    /// Whether other lightings that are nearly as good are sought, to choose from.
    pub alternatives: bool,
    /// Words of the command line, for the record.
    pub command: Vec<String>,
}

/// Result of a run for one look.
#[derive(Debug)]
pub struct RunReport {
    /// f_q at the start, from a render of its own.
    pub initial: JackknifeEstimate,
    /// f_q of the lights found, from the check render.
    pub check: JackknifeEstimate,
    /// The final picture; `None` where an interrupt left no time for one.
    pub last: Option<FinalPicture>,
    /// Free variables.
    pub variables: ParamVector,
    /// Values of the variables, in their order.
    pub x: Vec<f64>,
    /// Lamps that the program placed, by name, with what a photographer sets up.
    pub lamps: Vec<(String, Description)>,
    /// Surroundings that the program chose, in one line.
    pub surroundings: Option<String>,
    /// Number of renders so far in the run, of all sizes.
    pub renders: u64,
    /// Number of evaluations of f_q with its gradient.
    pub evaluations: u32,
    /// Reason why the optimisation ended.
    pub stop: StopReason,
    /// Range of each term within reach of the lights; empty in paper mode.
    pub reach: Vec<Reach>,
    /// Other lightings that are nearly as good and look different, from the least f_q on.
    pub alternatives: Vec<Alternative>,
    /// Reason why the result may not be what was meant.
    pub caution: Option<String>,
    /// Wall time from the beginning of the run, s.
    pub seconds: f64,
}

/// Measures of a final picture.
#[derive(Clone, Debug)]
pub struct FinalPicture {
    /// f_q and its terms, freed of noise bias, with their error.
    pub estimate: JackknifeEstimate,
    /// f_q of the picture as it is, noise included.
    pub f_q_picture: f64,
    /// Error that noise leaves in the picture as it is displayed.
    pub noise: Noise,
    /// Samples per pixel that it has.
    pub spp: u32,
    /// Whether it was ended before it was good enough and had as many samples as it may.
    pub is_incomplete: bool,
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
        "the transport basis needs {needed}, more than the {allowed} allowed; allow more with --memory, \
         or make the working pictures smaller with --work-size"
    )]
    Memory { needed: Bytes, allowed: Bytes },
    #[error("the camera sees nothing of the main object, so that lamps have no subject")]
    NoSubject,
    #[error("there is no place for a lamp; allow more of them in [movement]")]
    NoPlace,
    #[error("cannot read the surroundings again")]
    Surroundings(#[source] MapError),
    #[error(transparent)]
    Figure(#[from] FigureError),
    #[error("cannot write a table")]
    Table(#[from] csv::Error),
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
