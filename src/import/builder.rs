//! Merges a scene file and its sidecar into a [`Scene`] and checks both.

mod camera;
mod emitters;
mod light_list;
mod lights;
mod lost;
mod materials;
mod movement;
mod place;
mod select;
mod source;

use std::{io::ErrorKind, path::Path};

use self::source::Source;
use super::{
    error::ImportError,
    find::find,
    gltf,
    imported::Imported,
    obj,
    sidecar::{CameraName, DEFAULT_CREASE, LightSpec, LightType, SCHEMA, Selection, Sidecar, ViewSpec},
    stage::{self, StageOptions, Staging},
};
use crate::{
    files::{
        number::{Number, Numbers},
        reach::{MAX_TEXT_BYTES, Reach, ReachError},
    },
    math::ViewTransform,
    scene::Scene,
    variables::{Constraints, FreeKinds, Wishes},
};

/// How a scene is loaded.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Whether files outside the scene's folder and the `textures` beside it are refused.
    pub confine: bool,
    /// The camera of the scene file that is taken, whatever the sidecar says; `None` for the sidecar's.
    pub camera: Option<CameraName>,
    /// Whether the lights of the sidecar and the scene file are left out, but for materials that emit.
    pub without_lights: bool,
    /// Lights that are added, or take the place of those of the same name, with the file that names them in
    /// messages.
    pub lights: Vec<LightSpec>,
}

impl LoadOptions {
    /// Changes the lights of a scene file and its sidecar as is asked for.
    fn change_lights(&self, sidecar: &mut Sidecar, imported: &mut Imported) {
        if self.without_lights {
            sidecar.lights.retain(|light| light.kind == Some(LightType::Mesh));
            imported.lights.clear();
        }
        let is_replaced = |name: &str| self.lights.iter().any(|light| light.name == name);
        sidecar.lights.retain(|light| !is_replaced(&light.name));
        imported.lights.retain(|light| !is_replaced(&light.name));
        sidecar.lights.extend(self.lights.iter().cloned());
    }

    /// What the scene file at `path` may read.
    fn reach(&self, path: &Path) -> Result<Reach, ImportError> {
        if self.confine { Ok(Reach::confined(path)?) } else { Ok(Reach::anywhere()) }
    }
}

/// A scene, and what its files say that is not part of it.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Constraints that the scene's author sets on the variables.
    pub constraints: Constraints,
    /// What was left out, replaced or guessed while loading, one line each.
    pub warnings: Vec<String>,
    /// What the sidecar wishes of the lights.
    pub wishes: Wishes,
    /// View through which the sidecar says that pictures are seen.
    pub view: Option<ViewTransform>,
    /// Whether Blender's exporter wrote the scene file.
    pub is_of_blender: bool,
    /// Text of the sidecar that was staged for a scene without one.
    pub staging: Option<String>,
    /// Whether the scene's lights are those that were staged, and no others.
    pub has_staged_lights: bool,
}

/// Loads `path` (see [`find`]) and the sidecar beside it. Without one the scene is staged
/// (see [`mod@stage`]), unless it is a glTF with camera and lights.
///
/// ```
/// use lightopt_embree::import::{self, Loaded};
///
/// let Loaded { scene, constraints, .. } = import::load("tests/mitsuba/scenes/cornell.obj".as_ref())?;
/// assert_eq!(scene.light_names(), ["ceiling"]);
/// assert!(constraints.free.contains("size"));
/// # Ok::<(), import::ImportError>(())
/// ```
///
/// # Errors
/// When no such scene exists, a file cannot be read, or a line or key of one is wrong. The error
/// names the file, the line or key, and what is allowed.
pub fn load(path: &Path) -> Result<Loaded, ImportError> {
    load_with(path, &LoadOptions::default())
}

/// As [`load`], with options.
///
/// # Errors
/// Every error of [`load`]; also when a file that the scene names is refused, or an option names what the
/// file does not have.
pub fn load_with(path: &Path, options: &LoadOptions) -> Result<Loaded, ImportError> {
    let scene_path = find(path)?;
    let sidecar_path = scene_path.with_extension("toml");
    let reach = options.reach(&scene_path)?;
    let sidecar = sidecar_text(&sidecar_path, &reach)?;
    let source = Source::new(&scene_path, &sidecar_path, reach);
    let mut loaded = match sidecar {
        Some(text) => {
            let sidecar = Sidecar::parse(&sidecar_path, &text)?;
            source.check_required(&sidecar)?;
            let mut imported = source.import(sidecar.crease_angle)?;
            source.choose_camera(options, Some(&sidecar), &mut imported)?;
            source.build(options, &sidecar, imported)?
        }
        None => source.build_without_sidecar(options)?,
    };
    if scene_path != path {
        loaded.warnings.insert(0, format!("using {}", scene_path.display()));
    }
    Ok(loaded)
}

/// The text of the sidecar; `None` without one.
fn sidecar_text(path: &Path, reach: &Reach) -> Result<Option<String>, ImportError> {
    let unread = |source| ImportError::Sidecar { path: path.into(), source };
    match reach.read(path, MAX_TEXT_BYTES) {
        Ok(bytes) => String::from_utf8(bytes).map(Some).map_err(|_| unread("it is not UTF-8".into())),
        Err(ReachError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        Err(ReachError::Io { source, .. }) => Err(unread(source.into())),
        Err(refused) => Err(refused.into()),
    }
}

/// Stages the scene file `path` (see [`mod@stage`]), whatever its sidecar says.
///
/// # Errors
/// When the scene cannot be read, or the options name an object that it does not have.
pub fn stage(path: &Path, options: &StageOptions) -> Result<Staging, ImportError> {
    stage_with(path, options, &LoadOptions::default())
}

/// As [`stage()`], with options of loading.
///
/// # Errors
/// Every error of [`stage()`]; also when a file that the scene names is refused, or an option names what the
/// file does not have.
pub fn stage_with(path: &Path, options: &StageOptions, load: &LoadOptions) -> Result<Staging, ImportError> {
    let source = Source::new(path, path, load.reach(path)?);
    let mut imported = source.import(DEFAULT_CREASE)?;
    source.choose_camera(load, None, &mut imported)?;
    source.stage(&imported, options, load.camera.as_ref())
}

impl Source<'_> {
    /// Reads the scene file. `crease_angle` is in degrees and serves an OBJ only.
    fn import(&self, crease_angle: f64) -> Result<Imported, ImportError> {
        if !(0.0..=180.0).contains(&crease_angle) {
            let message = format!("must be in [0, 180] degrees, got {}", Number(crease_angle));
            return Err(self.error("crease_angle", message));
        }
        if self.is_obj {
            obj::load_within(self.scene_path, (crease_angle as f32).to_radians(), &self.reach)
        } else {
            gltf::load_within(self.scene_path, &self.reach)
        }
    }

    fn build_without_sidecar(&self, options: &LoadOptions) -> Result<Loaded, ImportError> {
        let mut imported = self.import(DEFAULT_CREASE)?;
        self.choose_camera(options, None, &mut imported)?;
        if stage::is_complete(&imported) {
            let empty = format!("schema = {SCHEMA}");
            return self.build(options, &Sidecar::parse(self.sidecar_path, &empty)?, imported);
        }
        let camera = options.camera.as_ref();
        let Staging { text, summary } = self.stage(&imported, &StageOptions::default(), camera)?;
        let sidecar = Sidecar::parse(self.sidecar_path, &text)?;
        let mut loaded = self.build(options, &sidecar, imported)?;
        let (file, beside) = (self.scene_path.display(), self.sidecar_path.display());
        loaded.warnings.push(format!("{file}: {summary}; `stage` writes this as {beside} to edit"));
        let n_staged = sidecar.lights.len();
        let has_staged_lights = n_staged > 0 && loaded.scene.lights.len() == n_staged;
        Ok(Loaded { staging: Some(text), has_staged_lights, ..loaded })
    }

    /// Stages the scene file, whose `camera` was chosen; `None` where nobody chose.
    fn stage(
        &self,
        imported: &Imported,
        options: &StageOptions,
        camera: Option<&CameraName>,
    ) -> Result<Staging, ImportError> {
        let objects = options.main_object.clone();
        let selection = Selection { objects, ..Selection::default() };
        let is_main = match options.main_object.is_empty() {
            true => None,
            false => Some(self.select_main("--main-object", &selection, imported)?),
        };
        let file = self.scene_path.file_name().unwrap_or_default().to_string_lossy();
        let mut staging = stage::stage(&file, self.is_obj, imported, is_main, options)
            .map_err(|source| self.embree(source))?;
        if let Some(name) = camera {
            let name = match name {
                CameraName::Number(n) => n.to_string(),
                CameraName::Name(name) => toml::Value::from(name.as_str()).to_string(),
            };
            staging.text += &format!("\n[camera]\nname = {name}\n");
        }
        Ok(staging)
    }

    /// Checks that the sidecar of an OBJ has what the format itself cannot say.
    fn check_required(&self, sidecar: &Sidecar) -> Result<(), ImportError> {
        let required = [(sidecar.camera.is_none(), "camera"), (sidecar.main_object.is_none(), "main_object")];
        match required.iter().find(|(is_missing, _)| self.is_obj && *is_missing) {
            Some((_, field)) => Err(self.missing(field)),
            None => Ok(()),
        }
    }

    fn build(
        &self,
        options: &LoadOptions,
        sidecar: &Sidecar,
        mut imported: Imported,
    ) -> Result<Loaded, ImportError> {
        let mut sidecar = sidecar.clone();
        options.change_lights(&mut sidecar, &mut imported);
        let sidecar = &sidecar;
        self.place(sidecar, &mut imported)?;
        Self { origin: imported.origin, ..self.clone() }.build_placed(options, sidecar, imported)
    }

    /// Builds the scene of a scene file in metres, y up.
    fn build_placed(
        &self,
        options: &LoadOptions,
        sidecar: &Sidecar,
        mut imported: Imported,
    ) -> Result<Loaded, ImportError> {
        imported.warnings.extend(lost::lost_lamps(self.scene_path, sidecar, &imported));
        let mut is_main = self.main_object(sidecar, &mut imported)?;
        let middle = || stage::bounds(&imported.mesh, &is_main).center();
        let camera = self.camera(options, sidecar, &imported, middle)?;
        if let Some(spec) = &sidecar.backdrop {
            self.add_backdrop(spec, &mut imported)?;
            is_main.resize(imported.mesh.indices.len(), false);
        }
        let Imported { mesh, materials, lost_shaders, lights, mut warnings, is_of_blender, .. } = imported;
        warnings.extend(materials::lost_shaders(sidecar, &lost_shaders));
        let materials = self.materials(sidecar, materials)?;
        let background = self.background(sidecar, &mesh, &is_main, &materials)?;
        if background.is_empty() {
            warnings.push("no background material has a colour: the background's value is not free".into());
        }
        let lights = self.lights(sidecar, &lights, &mesh, &materials, &mut warnings)?;
        let (lights, light_constraints) = lights.into_iter().unzip();
        let constraints = Constraints {
            free: run_free(sidecar),
            lights: light_constraints,
            value_range: self.value_range(sidecar)?,
            movement: self.movement(&sidecar.movement)?,
            bonds: Vec::new(),
            groups: Vec::new(),
        };
        let name = self.scene_path.file_stem().map_or("scene".into(), |s| s.to_string_lossy());
        let scene =
            Scene::new(&name, mesh, materials, lights, camera).map_err(|source| self.embree(source))?;
        let mut scene = scene.with_background(background);
        scene.origin = self.origin;
        scene.exposure = self.exposure(sidecar)?;
        scene.is_main = is_main;
        let (wishes, view) = (sidecar.ties.clone(), self.view(sidecar)?);
        Ok(Loaded {
            scene,
            constraints,
            warnings,
            wishes,
            view,
            is_of_blender,
            staging: None,
            has_staged_lights: false,
        })
    }

    /// The view that the sidecar names.
    fn view(&self, sidecar: &Sidecar) -> Result<Option<ViewTransform>, ImportError> {
        let error = |message: String| self.error("view", message);
        match &sidecar.view {
            None => Ok(None),
            Some(ViewSpec::Own(view)) => Ok(Some(*view)),
            Some(ViewSpec::Ocio(_)) if self.reach.is_confined() => Err(error(
                "a configuration of OpenColorIO names further files, which --confine does not follow; name it by --view"
                    .into(),
            )),
            Some(ViewSpec::Ocio(name)) => {
                let folder = self.sidecar_path.parent().unwrap_or(Path::new(""));
                ViewTransform::named(name, folder).map_err(|e| error(e.to_string()))
            }
        }
    }

    fn value_range(&self, sidecar: &Sidecar) -> Result<Option<[f32; 2]>, ImportError> {
        match sidecar.background.value_range {
            Some(range @ [lo, hi]) if !(lo >= 0.0 && lo <= hi && (hi as f32).is_finite()) => {
                let message =
                    format!("must be 0 <= min <= max, max at most {:e}, got {}", f32::MAX, Numbers(&range));
                Err(self.error("background.value_range", message))
            }
            range => Ok(range.map(|range| range.map(|v| v as f32))),
        }
    }
}
/// Kinds of variables that are free in a run where nobody else says: those that the sidecar lists, else the usual
/// ones and those that one of its lights lists.
fn run_free(sidecar: &Sidecar) -> FreeKinds {
    let of_lights = sidecar.lights.iter().filter_map(|light| light.free.as_ref());
    let or_usual = || of_lights.fold(FreeKinds::default(), FreeKinds::union);
    sidecar.free.clone().unwrap_or_else(or_usual)
}
