//! Merges scene file and sidecar into a [`Scene`] and checks both.

mod lights;
mod place;
mod select;

use std::{fs, io::ErrorKind, path::Path};

use glam::{UVec2, Vec3};

use super::{
    error::ImportError,
    find::{ending, find},
    gltf,
    imported::{Imported, ImportedCamera},
    obj,
    sidecar::{DEFAULT_CREASE, MaterialSpec, SCHEMA, Selection, Sidecar},
    stage::{self, StageOptions, Staging},
};
use crate::{
    camera::{Camera, Lens, MAX_PIXELS, is_film_size},
    embree::MAX_COORDINATE,
    files::nearest,
    lighting::MAX_EXPOSURE,
    math::Rgb,
    scene::{
        Mesh, Scene,
        material::{Coats, Material, MaterialParams, Model},
    },
    variables::Constraints,
};

/// A scene with what its files say beside it.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Constraints that the scene's author sets on the variables.
    pub constraints: Constraints,
    /// Facts found while loading that a user should hear of.
    pub warnings: Vec<String>,
    /// The sidecar that was made for a scene without one.
    pub staging: Option<String>,
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
/// With the file, the key and what is allowed.
pub fn load(path: &Path) -> Result<Loaded, ImportError> {
    let scene_path = find(path)?;
    let toml_path = scene_path.with_extension("toml");
    let written = match fs::read_to_string(&toml_path) {
        Ok(text) => Some(text),
        Err(e) if e.kind() == ErrorKind::NotFound => None,
        Err(source) => return Err(ImportError::Sidecar { path: toml_path, source }),
    };
    let builder = Builder::new(&scene_path, &toml_path, written.is_some());
    let mut loaded = match written {
        Some(text) => {
            let sidecar = Sidecar::parse(&toml_path, &text)?;
            builder.check_required(&sidecar)?;
            builder.build(&sidecar, builder.import(sidecar.crease_angle)?)?
        }
        None => builder.build_alone()?,
    };
    if scene_path != path {
        loaded.warnings.insert(0, format!("using {}", scene_path.display()));
    }
    Ok(loaded)
}

/// Stages `path` (see [`find`] and [`mod@stage`]), whatever its sidecar says.
///
/// # Errors
/// When the scene cannot be read, or the options name an object that it has not.
pub fn stage(path: &Path, options: &StageOptions) -> Result<Staging, ImportError> {
    let builder = Builder::new(path, path, false);
    let imported = builder.import(DEFAULT_CREASE)?;
    builder.stage(&imported, options)
}

/// Names listed in a message, at most.
const MAX_LISTED: usize = 12;

/// Width of the picture of an imported camera, pixels; the sidecar's default.
const CAMERA_WIDTH: u32 = 640;
/// Its height where the file does not give the aspect.
const CAMERA_HEIGHT: u32 = 480;
/// Largest aspect, and inverse of the smallest, of an imported camera.
const MAX_ASPECT: f32 = 16.0;

struct Builder<'a> {
    scene_path: &'a Path,
    toml_path: &'a Path,
    is_obj: bool,
    has_sidecar: bool,
}

impl<'a> Builder<'a> {
    fn new(scene_path: &'a Path, toml_path: &'a Path, has_sidecar: bool) -> Self {
        Self { scene_path, toml_path, is_obj: ending(scene_path) == Some("obj"), has_sidecar }
    }
}

impl Builder<'_> {
    /// Builds a scene that has no sidecar.
    fn build_alone(&self) -> Result<Loaded, ImportError> {
        let imported = self.import(DEFAULT_CREASE)?;
        if stage::is_complete(&imported) {
            return self.build(&Sidecar::parse(self.toml_path, &format!("schema = {SCHEMA}"))?, imported);
        }
        let Staging { text, summary } = self.stage(&imported, &StageOptions::default())?;
        let mut loaded = self.build(&Sidecar::parse(self.toml_path, &text)?, imported)?;
        let (file, sidecar) = (self.scene_path.display(), self.toml_path.display());
        loaded.warnings.push(format!("{file}: {summary}; `stage` writes this as {sidecar} to edit"));
        Ok(Loaded { staging: Some(text), ..loaded })
    }

    fn stage(&self, imported: &Imported, options: &StageOptions) -> Result<Staging, ImportError> {
        let objects = options.main_object.clone();
        let named = Selection { objects, ..Selection::default() };
        let is_main = match options.main_object.is_empty() {
            true => None,
            false => Some(self.select_main("--main-object", &named, imported)?),
        };
        let file = self.scene_path.file_name().unwrap_or_default().to_string_lossy();
        stage::stage(&file, self.is_obj, imported, is_main, options)
            .map_err(|source| ImportError::Embree { path: self.scene_path.into(), source })
    }

    /// What an OBJ's sidecar must have.
    fn check_required(&self, sidecar: &Sidecar) -> Result<(), ImportError> {
        let required = [(sidecar.camera.is_none(), "camera"), (sidecar.main_object.is_none(), "main_object")];
        match required.iter().find(|(is_missing, _)| self.is_obj && *is_missing) {
            Some((_, field)) => Err(self.missing(field)),
            None => Ok(()),
        }
    }

    fn error(&self, key: impl Into<String>, message: impl Into<String>) -> ImportError {
        ImportError::Key { path: self.toml_path.to_path_buf(), key: key.into(), message: message.into() }
    }

    fn positive(&self, key: &str, value: f32) -> Result<f32, ImportError> {
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(self.error(key, format!("must be > 0, got {value}")))
    }

    fn finite(&self, key: &str, value: [f32; 3]) -> Result<(), ImportError> {
        if !value.iter().all(|v| v.is_finite()) {
            return Err(self.error(key, format!("must be finite, got {value:?}")));
        }
        if value.iter().any(|v| v.abs() > MAX_COORDINATE) {
            let message = format!("must be at most {MAX_COORDINATE:e} in magnitude, got {value:?}");
            return Err(self.error(key, message));
        }
        Ok(())
    }

    fn build(&self, sidecar: &Sidecar, mut parts: Imported) -> Result<Loaded, ImportError> {
        self.place(sidecar, &mut parts)?;
        let camera = self.camera(sidecar, parts.camera)?;
        let mut is_main = self.main_object(sidecar, &mut parts)?;
        if let Some(spec) = &sidecar.backdrop {
            self.add_backdrop(spec, &mut parts)?;
            is_main.resize(parts.mesh.indices.len(), false);
        }
        let mut warnings = parts.warnings;
        for name in sidecar.materials.keys() {
            if !parts.materials.iter().any(|(n, _)| n == name) {
                let known = parts.materials.iter().map(|(n, _)| n.as_str());
                return Err(self.unknown_name("materials", name, known));
            }
        }
        let mut coats = Coats::default();
        let materials: Vec<Material> = parts
            .materials
            .into_iter()
            .map(|(name, params)| {
                let params = match sidecar.materials.get(&name) {
                    Some(spec) => self.override_material(&name, params, spec)?,
                    None => params,
                };
                Ok(Material::new(name, params, &mut coats))
            })
            .collect::<Result<_, ImportError>>()?;
        let mesh = parts.mesh;
        let background = self.background(sidecar, &mesh, &is_main, &materials)?;
        if background.is_empty() {
            warnings.push("no background material has a colour: the background's value is not free".into());
        }
        let (lights, light_constraints) =
            self.lights(sidecar, &parts.lights, &mesh, &materials, &mut warnings)?;
        if let Some([lo, hi]) = sidecar.background.value_range
            && !(lo >= 0.0 && lo <= hi && hi.is_finite())
        {
            let message = format!("must be 0 <= min <= max, got [{lo}, {hi}]");
            return Err(self.error("background.value_range", message));
        }
        let name =
            self.scene_path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
        let scene = Scene::new(&name, mesh, materials, lights, camera)
            .map_err(|source| ImportError::Embree { path: self.scene_path.to_path_buf(), source })?;
        let exposure = self.positive("exposure", sidecar.exposure)?;
        if !(1.0 / MAX_EXPOSURE..=MAX_EXPOSURE).contains(&exposure) {
            let message =
                format!("must be from {:e} to {MAX_EXPOSURE:e}, got {exposure:e}", 1.0 / MAX_EXPOSURE);
            return Err(self.error("exposure", message));
        }
        let constraints = Constraints {
            free: sidecar.free.clone(),
            lights: light_constraints,
            value_range: sidecar.background.value_range,
        };
        let mut scene = scene.with_background(background);
        scene.exposure = exposure;
        scene.is_main = is_main;
        Ok(Loaded { scene, constraints, warnings, staging: None })
    }

    /// What the scene file holds.
    fn import(&self, crease_angle: f32) -> Result<Imported, ImportError> {
        if !(0.0..=180.0).contains(&crease_angle) {
            let message = format!("must be in [0, 180] degrees, got {}", crease_angle);
            return Err(self.error("crease_angle", message));
        }
        if self.is_obj {
            obj::load(self.scene_path, crease_angle.to_radians())
        } else {
            gltf::load(self.scene_path)
        }
    }

    fn override_material(
        &self,
        name: &str,
        mut params: MaterialParams,
        spec: &MaterialSpec,
    ) -> Result<MaterialParams, ImportError> {
        let key = |k: &str| format!("materials.{name}.{k}");
        if let Some(c) = spec.base_color {
            params.base_color = Rgb::from_array(c);
            if !(params.base_color.min_element() >= 0.0 && params.base_color.max_element() <= 1.0) {
                return Err(self.error(key("base_color"), format!("channels must be in [0, 1], got {c:?}")));
            }
        }
        for (k, given, value) in [
            ("roughness", spec.roughness, &mut params.roughness),
            ("metallic", spec.metallic, &mut params.metallic),
            ("specular", spec.specular, &mut params.specular),
            ("opacity", spec.opacity, &mut params.opacity),
        ] {
            let Some(v) = given else { continue };
            if !(0.0..=1.0).contains(&v) {
                return Err(self.error(key(k), format!("must be in [0, 1], got {v}")));
            }
            *value = v;
        }
        if let Some(e) = spec.emission {
            params.emission = Rgb::from_array(e);
            if !(params.emission.is_finite() && params.emission.min_element() >= 0.0) {
                return Err(self.error(key("emission"), format!("channels must be >= 0, got {e:?}")));
            }
        }
        if let Some(ior) = spec.ior {
            if !(ior > 1.0 && ior <= 4.0) {
                return Err(self.error(key("ior"), format!("must be in (1, 4], got {ior}")));
            }
            params.ior = ior;
        }
        if let Some(model) = spec.model {
            // It says what the surface is: glass is not paint that lets rays through, nor part metal.
            let pure = MaterialParams { model, metallic: 0.0, metallic_map: None, ..params.clone() };
            params = match model {
                Model::Dielectric => MaterialParams { opacity: 1.0, opacity_map: None, ..pure },
                _ => pure,
            };
            params.metallic = spec.metallic.unwrap_or(0.0);
            params.opacity = spec.opacity.unwrap_or(params.opacity);
        }
        Ok(params)
    }

    fn unknown_name<'n>(
        &self,
        key: &str,
        name: &str,
        known: impl Iterator<Item = &'n str> + Clone,
    ) -> ImportError {
        let file = self.scene_path.display();
        let message = match (nearest(name, known.clone()), known.clone().count()) {
            (Some(near), _) => format!("no `{name}` in {file}; did you mean `{near}`?"),
            (None, 0) => format!("no `{name}`: {file} names none"),
            (None, n) => {
                let some: Vec<&str> = known.take(MAX_LISTED).collect();
                let more = if n > MAX_LISTED { ", …" } else { "" };
                format!("no `{name}` in {file}, which has {}{more}", some.join(", "))
            }
        };
        self.error(key, message)
    }

    fn background(
        &self,
        sidecar: &Sidecar,
        mesh: &Mesh,
        is_main: &[bool],
        materials: &[Material],
    ) -> Result<Vec<usize>, ImportError> {
        let mut selected = vec![false; materials.len()];
        match &sidecar.background.materials {
            Some(patterns) => {
                for pattern in patterns {
                    for i in self.matches(
                        "background.materials",
                        pattern,
                        materials.iter().map(|m| m.name.as_str()),
                    )? {
                        selected[i] = true;
                    }
                }
            }
            None => {
                for &m in &mesh.materials {
                    selected[m as usize] = true;
                }
                for (&m, _) in mesh.materials.iter().zip(is_main).filter(|(_, main)| **main) {
                    selected[m as usize] = false;
                }
            }
        }
        Ok((0..materials.len()).filter(|&i| selected[i] && materials[i].has_value()).collect())
    }

    /// That the sidecar lacks something.
    fn missing(&self, field: &str) -> ImportError {
        let message = format!("missing field `{field}`");
        ImportError::Line { path: self.toml_path.to_path_buf(), line: 1, message }
    }

    /// The sidecar's camera, else that of the scene file.
    fn camera(&self, sidecar: &Sidecar, imported: Option<ImportedCamera>) -> Result<Camera, ImportError> {
        let Some(c) = &sidecar.camera else {
            return match imported {
                Some(c) => self.imported_camera(&c),
                None => Err(self.missing("camera")),
            };
        };
        if !(c.vfov > 0.0 && c.vfov < 180.0) {
            return Err(self.error("camera.vfov", format!("must be in (0, 180) degrees, got {}", c.vfov)));
        }
        for (key, value) in
            [("camera.position", c.position), ("camera.look_at", c.look_at), ("camera.up", c.up)]
        {
            self.finite(key, value)?;
        }
        if !is_film_size(c.size.into()) {
            let allowed = format!("must be at least 1 x 1 and at most {MAX_PIXELS} pixels");
            return Err(self.error("camera.size", format!("{allowed}, got {:?}", c.size)));
        }
        let camera =
            Camera::new(c.position.into(), c.look_at.into(), c.up.into(), c.vfov, UVec2::from_array(c.size))
                .ok_or_else(|| {
                    self.error("camera.look_at", "must differ from `position` and not lie along `up`")
                })?;
        let lens = match (c.aperture_radius, c.focus_distance) {
            (None, None) => None,
            (None, Some(_)) => return Err(self.error("camera.focus_distance", "needs `aperture_radius`")),
            (Some(radius), focus) => {
                let radius = self.positive("camera.aperture_radius", radius)?;
                let looked_at = Vec3::from(c.look_at).distance(c.position.into());
                let focus_distance = self.positive("camera.focus_distance", focus.unwrap_or(looked_at))?;
                Some(Lens { radius, focus_distance })
            }
        };
        Ok(camera.with_lens(lens))
    }

    fn imported_camera(&self, c: &ImportedCamera) -> Result<Camera, ImportError> {
        let height = c.aspect.map_or(CAMERA_HEIGHT, |a| {
            let aspect = a.clamp(1.0 / MAX_ASPECT, MAX_ASPECT);
            (CAMERA_WIDTH as f32 / aspect).round() as u32
        });
        let size = UVec2::new(CAMERA_WIDTH, height);
        Camera::new(c.position, c.look_at, c.up, c.vfov, size).ok_or_else(|| {
            let message = "cannot be used as it is placed; give [camera] in the sidecar".into();
            ImportError::Key { path: self.scene_path.into(), key: "cameras".into(), message }
        })
    }
}
