//! One of the lightings that a run offers, to be rendered.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use glam::UVec2;
use serde::Deserialize;

use crate::{
    audit::{MANIFEST, pick_stem},
    files::text,
    integrator::IntegratorKind,
};

/// A lighting of a run with what its picture is rendered by.
pub(super) struct Picked {
    /// Scene file.
    pub scene: PathBuf,
    /// The `lights.toml` of the lighting.
    pub lights: PathBuf,
    /// Samples per pixel at most of the final picture.
    pub spp: u32,
    /// Size of the final picture, pixels.
    pub size: UVec2,
    /// Whether the run's pictures are denoised.
    pub denoise: bool,
    /// Integrator of the run.
    pub integrator: IntegratorKind,
}

/// What is read of a manifest.
#[derive(Deserialize)]
struct Manifest {
    scene: Scene,
    options: Options,
}

#[derive(Deserialize)]
struct Scene {
    path: PathBuf,
}

#[derive(Deserialize)]
struct Options {
    size: [u32; 2],
    final_spp: u32,
    denoise: bool,
    integrator: IntegratorKind,
}

/// The lighting of a number, from 1, that a run directory offers.
///
/// # Errors
/// When the directory is that of no run, or offers no such lighting.
pub(super) fn resolve(run: &Path, number: usize) -> anyhow::Result<Picked> {
    let path = run.join(MANIFEST);
    let read = text::read(&path).with_context(|| format!("{}: no run directory", run.display()))?;
    let Manifest { scene, options } =
        toml::from_str(&read).map_err(|e| anyhow::anyhow!("{}: {}", path.display(), e.message()))?;
    let file = |n: usize| run.join(pick_stem(n)).with_extension("toml");
    let lights = file(number);
    if !lights.is_file() {
        let offered = (1..).take_while(|&n| file(n).is_file()).count();
        bail!("--pick {number}: {} offers {offered} lightings, from 1", run.display());
    }
    Ok(Picked {
        scene: scene.path,
        lights,
        spp: options.final_spp,
        size: UVec2::from_array(options.size),
        denoise: options.denoise,
        integrator: options.integrator,
    })
}
