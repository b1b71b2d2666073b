//! `run.toml`: all options as they were resolved, enough to repeat a run.

use std::path::Path;

use serde::Serialize;

use super::{Gradient, setup::Setup};
use crate::{
    audit::placed::Placed,
    embree,
    integrator::IntegratorKind,
    math::{ViewTransform, display::LuminanceMode, hash::hash_words},
    objective::Target,
    sampler::SamplerKind,
    variables::{FreeKinds, ParamVector, Tie},
};

/// Contents of a manifest.
#[derive(Serialize)]
struct Manifest<'a> {
    schema: u32,
    program: Program,
    scene: SceneFacts<'a>,
    options: Options<'a>,
    target: &'a Target,
    variables: &'a ParamVector,
    /// Radiances that follow others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    ties: Vec<NamedTie<'a>>,
}

/// A radiance that is a multiple of another, by the names of the lights.
#[derive(Serialize)]
struct NamedTie<'a> {
    light: &'a str,
    follows: &'a str,
    factor: f64,
    /// `brought` where the factor is of what both bring to the main object, at any size.
    #[serde(skip_serializing_if = "Option::is_none")]
    of: Option<&'static str>,
}

/// The program, its build and the ray tracer.
#[derive(Serialize)]
struct Program {
    name: &'static str,
    version: &'static str,
    commit: &'static str,
    embree: String,
    isa: &'static str,
    target: &'static str,
    target_features: &'static str,
    rustc: &'static str,
    profile: &'static str,
}

/// The scene.
#[derive(Serialize)]
struct SceneFacts<'a> {
    path: String,
    /// Hash of the scene file and its sidecar.
    content: String,
    triangles: usize,
    lights: Vec<&'a str>,
    exposure: f32,
}

/// Options of the run, in the words of the command line.
#[derive(Serialize)]
struct Options<'a> {
    gradient: Gradient,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    global: bool,
    tolerance: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    time_limit: Option<f64>,
    /// Names of all targets of the run, if there are several: the result for one depends on the others,
    /// within its error.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    targets: Vec<&'a str>,
    memory_mib: u64,
    integrator: IntegratorKind,
    max_depth: usize,
    sampler: SamplerKind,
    luminance: LuminanceMode,
    view: ViewTransform,
    size: [u32; 2],
    work_size: [u32; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    spp: Option<u32>,
    final_spp: u32,
    final_noise: f64,
    denoise: bool,
    free: &'a FreeKinds,
    /// Lamps at most that the program was to place.
    #[serde(skip_serializing_if = "Option::is_none")]
    lamps: Option<usize>,
    /// Whether the scene's own lights were kept beside them.
    #[serde(skip_serializing_if = "Option::is_none")]
    keep: Option<bool>,
    seed: u64,
    max_evaluations: u32,
    /// Surroundings that the program chose.
    #[serde(skip_serializing_if = "Option::is_none")]
    environment: Option<Placed>,
}

/// Hash of the bytes of a scene file and its sidecar, in hexadecimal.
#[must_use]
pub fn content(scene_path: &Path) -> String {
    let hash = [scene_path.to_path_buf(), scene_path.with_extension("toml")]
        .iter()
        .filter_map(|p| std::fs::read(p).ok())
        .map(|bytes| {
            let (whole, rest) = bytes.as_chunks::<8>();
            let last = (!rest.is_empty()).then(|| rest.iter().fold(0, |word, &b| word << 8 | u64::from(b)));
            let words: Vec<u64> = whole
                .iter()
                .map(|&word| u64::from_be_bytes(word))
                .chain(last)
                .chain([bytes.len() as u64])
                .collect();
            hash_words(&words)
        })
        .fold(0, |h, file| hash_words(&[h, file]));
    format!("{hash:016x}")
}

/// Text of the manifest of a look, as TOML.
///
/// # Errors
/// When a value cannot be written as TOML.
pub(super) fn text(
    setup: Setup,
    (scene_path, content): (&Path, &str),
    target: &Target,
) -> Result<String, toml::ser::Error> {
    let (scene, options) = (setup.scene, setup.options);
    toml::to_string(&Manifest {
        schema: 1,
        program: Program {
            name: env!("CARGO_PKG_NAME"),
            version: env!("CARGO_PKG_VERSION"),
            commit: env!("LIGHTOPT_COMMIT"),
            embree: embree::version(),
            isa: embree::isa(),
            target: env!("LIGHTOPT_TARGET"),
            target_features: env!("LIGHTOPT_TARGET_FEATURES"),
            rustc: env!("LIGHTOPT_RUSTC"),
            profile: env!("LIGHTOPT_PROFILE"),
        },
        scene: SceneFacts {
            path: scene_path.display().to_string(),
            content: content.to_owned(),
            triangles: scene.mesh.indices.len(),
            lights: scene.light_names(),
            exposure: setup.fitted.lighting.exposure as f32,
        },
        options: Options {
            gradient: options.gradient,
            global: options.global,
            tolerance: options.tolerance,
            time_limit: options.time_limit.map(|t| t.as_secs_f64()),
            targets: match options.jobs.as_slice() {
                [_] => Vec::new(),
                jobs => jobs.iter().map(|job| job.target.name()).collect(),
            },
            memory_mib: options.memory >> 20,
            integrator: options.integrator.kind,
            max_depth: options.integrator.max_depth,
            sampler: options.sampler,
            luminance: options.measure.luminance,
            view: options.measure.view,
            size: options.size.to_array(),
            work_size: options.work_size.to_array(),
            spp: options.spp,
            final_spp: options.final_spp,
            final_noise: options.final_noise,
            denoise: options.denoise,
            free: &options.free,
            lamps: setup.rig.filter(|rig| rig.sky.is_none()).map(|rig| rig.most),
            keep: setup.rig.filter(|rig| rig.sky.is_none()).map(|rig| !rig.without_lights),
            seed: options.seed,
            max_evaluations: options.max_evaluations,
            environment: setup.rig.and_then(|rig| Some(rig.sky.as_ref()?.placed())),
        },
        target,
        variables: setup.variables,
        ties: {
            let name = |light: usize| scene.lights[light].name.as_str();
            let ties = setup.variables.ties.iter();
            let named = |t: &Tie| NamedTie {
                light: name(t.light),
                follows: name(t.leader),
                factor: t.factor,
                of: t.brought.is_some().then_some("brought"),
            };
            ties.map(named).collect()
        },
    })
}
