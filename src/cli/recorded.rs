//! What the directory of a run says of its scene.

use std::path::{Path, PathBuf};

use anyhow::bail;
use serde::Deserialize;

use crate::{
    audit::MANIFEST,
    design::manifest,
    files::{text, toml_file},
    import,
    integrator::IntegratorKind,
    math::ViewTransform,
};

/// The scene and the lights of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Path of the scene file.
    pub scene: PathBuf,
    /// Path of the lights that were found.
    pub lights: PathBuf,
    /// View through which the run measured.
    pub view: ViewTransform,
    /// How the final picture was rendered.
    pub pictures: RecordedPictures,
}

/// How the final picture of a run is rendered.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct RecordedPictures {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Samples per pixel at most.
    pub final_spp: u32,
    /// Whether the pictures are denoised; those of runs that do not say so are not.
    #[serde(default)]
    pub denoise: bool,
    /// Integrator of the run.
    pub integrator: IntegratorKind,
}

/// The keys of the record that are asked for; the others are for people.
#[derive(Deserialize)]
struct Record {
    scene: SceneRecord,
    options: OptionsRecord,
}

#[derive(Deserialize)]
struct SceneRecord {
    path: PathBuf,
    content: String,
}

#[derive(Deserialize)]
struct OptionsRecord {
    view: ViewTransform,
    #[serde(flatten)]
    pictures: RecordedPictures,
}

impl Recorded {
    /// What the directory of a run records; `None` for a path that is not a directory. The scene is sought where
    /// the run was begun, if that is told by the present directory or one above that of the run.
    ///
    /// # Errors
    /// When the directory is not one of a run, or its scene is not found.
    pub fn of(directory: &Path, say: impl Fn(&str)) -> anyhow::Result<Option<Self>> {
        if !directory.is_dir() {
            return Ok(None);
        }
        let file = directory.join(MANIFEST);
        if !file.is_file() {
            // The ending of a scene may be left out, and its name be that of a directory too.
            if import::find(directory).is_ok() {
                return Ok(None);
            }
            bail!("{}: a directory without {MANIFEST} is not one of a run", directory.display());
        }
        let record: Record = toml_file::parse(&file, &text::read(&file)?)?;
        let whole = std::path::absolute(directory)?;
        let near = whole.ancestors().skip(1).map(|above| above.join(&record.scene.path));
        let places = std::iter::once(record.scene.path.clone()).chain(near);
        let found: Vec<PathBuf> = places.filter_map(|place| import::find(&place).ok()).collect();
        let same = |scene: &&PathBuf| manifest::content(scene) == record.scene.content;
        let Some(scene) = found.iter().find(same).or(found.first()) else {
            bail!(
                "{}: `scene.path`: {} is not there, seen from here or from above the run; name the scene, and \
                 the run's lights by --lights",
                file.display(),
                record.scene.path.display()
            );
        };
        if !same(&scene) {
            say(&format!("{}: the scene or its sidecar has changed since the run", scene.display()));
        }
        let lights = directory.join("lights.toml");
        let OptionsRecord { view, pictures } = record.options;
        Ok(Some(Self { scene: scene.clone(), lights, view, pictures }))
    }
}
