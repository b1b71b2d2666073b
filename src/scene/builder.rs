//! Merges OBJ and sidecar into a [`Scene`] and checks both.

mod lights;

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::{UVec2, Vec3};

use super::{
    Scene,
    material::{Coats, Material, MaterialParams, Model},
    obj,
    sidecar::{MaterialSpec, Selection, Sidecar},
    wavefront::{LineError, Part},
};
use crate::{
    camera::{Camera, Lens, MAX_PIXELS, is_film_size},
    embree::EmbreeError,
    files::{nearest, toml_file::TomlError},
    math::Rgb,
};

/// A scene could not be loaded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SceneError {
    #[error("{path}: no such scene{hint}", path = path.display())]
    NotFound { path: PathBuf, hint: String },
    #[error("{path}: is a directory; a scene is a Wavefront .obj file", path = path.display())]
    Directory { path: PathBuf },
    #[error("{path}: a scene is a Wavefront .obj file", path = path.display())]
    NotObj { path: PathBuf },
    #[error("{path}: cannot read the sidecar, which gives camera, main object and lights", path = path.display())]
    Sidecar { path: PathBuf, source: std::io::Error },
    #[error("{path}: cannot read the scene", path = path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path}: cannot read OBJ or MTL", path = path.display())]
    Obj { path: PathBuf, source: tobj::LoadError },
    #[error("{path}:{line}: {message}", path = path.display())]
    Line { path: PathBuf, line: usize, message: String },
    #[error("{path}: no triangle in this file", path = path.display())]
    NoTriangles { path: PathBuf },
    #[error("{path}: `{key}`: {message}", path = path.display())]
    Key { path: PathBuf, key: String, message: String },
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error(transparent)]
    Texture(#[from] super::texture::TextureError),
    #[error("{path}: `{key}`", path = path.display())]
    Picture { path: PathBuf, key: String, source: Box<crate::film::image_file::ImageFileError> },
    #[error("{path}: cannot build the ray-tracing structure", path = path.display())]
    Embree { path: PathBuf, source: EmbreeError },
}

impl SceneError {
    /// What is wrong with a line of a file.
    #[must_use]
    pub fn at(path: &Path, LineError { line, message }: LineError) -> Self {
        Self::Line { path: path.into(), line, message }
    }
}

/// Bounds that the sidecar sets on a light's variables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightBounds {
    /// Bounds of the size.
    pub size: Option<[f32; 2]>,
    /// Upper bound of the radiance.
    pub radiance_max: Option<f32>,
    /// Whether the radiance may vary.
    pub radiance_free: bool,
    /// Whether the size may vary.
    pub size_free: bool,
}

/// Where scenes are sought that are not found as given.
const LIBRARY: &str = "scenes";

/// Finds a scene file: as given or, for a relative path, in `scenes/`; the
/// ending `.obj` may be left out.
///
/// # Errors
/// When there is none, or the file is not an OBJ.
pub fn find(path: &Path) -> Result<PathBuf, SceneError> {
    let mut with_ending = path.as_os_str().to_owned();
    with_ending.push(".obj");
    let given = [path.to_path_buf(), with_ending.into()];
    let sought = given.iter().map(|p| Path::new(LIBRARY).join(p)).filter(|_| path.is_relative());
    let Some(found) = given.iter().cloned().chain(sought).find(|p| p.is_file()) else {
        if path.is_dir() {
            return Err(SceneError::Directory { path: path.into() });
        }
        return Err(SceneError::NotFound { path: path.into(), hint: hint(path) });
    };
    if !found.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
        return Err(SceneError::NotObj { path: found });
    }
    Ok(found)
}

/// The scenes that may have been meant.
fn hint(path: &Path) -> String {
    if path.is_absolute() {
        return String::new();
    }
    let is_obj = |n: &String| n.to_lowercase().ends_with(".obj");
    let list = |dir: &Path| -> Vec<String> {
        let entries = fs::read_dir(dir).into_iter().flatten().flatten();
        entries.map(|e| e.file_name().to_string_lossy().into_owned()).filter(is_obj).collect()
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut known = [list(beside), list(Path::new(LIBRARY))].concat();
    known.sort();
    match nearest(&name, known.iter().map(String::as_str)) {
        Some(near) => format!(", and none in {LIBRARY}/ either; did you mean `{near}`?"),
        None => format!(", and none in {LIBRARY}/ either"),
    }
}

/// Loads `path` (see [`find`]) and the sidecar beside it.
///
/// # Errors
/// With the file, the key and what is allowed.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    let obj_path = find(path)?;
    let toml_path = obj_path.with_extension("toml");
    let text = fs::read_to_string(&toml_path)
        .map_err(|source| SceneError::Sidecar { path: toml_path.clone(), source })?;
    let sidecar = Sidecar::parse(&toml_path, &text)?;
    let mut scene = Builder { obj_path: &obj_path, toml_path: &toml_path }.build(&sidecar)?;
    if obj_path != path {
        scene.warnings.insert(0, format!("using {}", obj_path.display()));
    }
    Ok(scene)
}

/// Names listed in a message, at most.
const MAX_LISTED: usize = 12;

struct Builder<'a> {
    obj_path: &'a Path,
    toml_path: &'a Path,
}

impl Builder<'_> {
    fn error(&self, key: impl Into<String>, message: impl Into<String>) -> SceneError {
        SceneError::Key { path: self.toml_path.to_path_buf(), key: key.into(), message: message.into() }
    }

    fn positive(&self, key: &str, value: f32) -> Result<f32, SceneError> {
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(self.error(key, format!("must be > 0, got {value}")))
    }

    fn finite(&self, key: &str, value: [f32; 3]) -> Result<(), SceneError> {
        if value.iter().all(|v| v.is_finite()) {
            return Ok(());
        }
        Err(self.error(key, format!("must be finite, got {value:?}")))
    }

    fn build(&self, sidecar: &Sidecar) -> Result<Scene, SceneError> {
        if !(0.0..=180.0).contains(&sidecar.crease_angle) {
            let message = format!("must be in [0, 180] degrees, got {}", sidecar.crease_angle);
            return Err(self.error("crease_angle", message));
        }
        let parts = obj::load(self.obj_path, sidecar.crease_angle.to_radians())?;
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
            .collect::<Result<_, SceneError>>()?;
        let mesh = parts.mesh;
        let is_main = self.select_main(&sidecar.main_object, &mesh, &parts.parts, &materials)?;
        let background = self.background(sidecar, &mesh, &is_main, &materials)?;
        if background.is_empty() {
            warnings.push("no background material has a colour: the background's value is not free".into());
        }
        let (lights, light_bounds) = self.lights(sidecar, &mesh, &materials, &mut warnings)?;
        let camera = self.camera(sidecar)?;
        if let Some([lo, hi]) = sidecar.background.value_range
            && !(lo >= 0.0 && lo <= hi && hi.is_finite())
        {
            let message = format!("must be 0 <= min <= max, got [{lo}, {hi}]");
            return Err(self.error("background.value_range", message));
        }
        let name =
            self.obj_path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
        let scene = Scene::new(&name, mesh, materials, lights, camera)
            .map_err(|source| SceneError::Embree { path: self.obj_path.to_path_buf(), source })?;
        Ok(Scene {
            parts: parts.parts,
            light_bounds,
            exposure: self.positive("exposure", sidecar.exposure)?,
            is_main,
            background,
            value_range: sidecar.background.value_range,
            free: sidecar.free.clone(),
            warnings,
            ..scene
        })
    }

    fn override_material(
        &self,
        name: &str,
        mut params: MaterialParams,
        spec: &MaterialSpec,
    ) -> Result<MaterialParams, SceneError> {
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
    ) -> SceneError {
        let file = self.obj_path.display();
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

    /// Indices of the names that a pattern (a name, or a beginning and `*`) matches.
    fn matches<'n>(
        &self,
        key: &str,
        pattern: &str,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> Result<Vec<usize>, SceneError> {
        let is_match = |n: &str| match pattern.strip_suffix('*') {
            Some(start) => n.starts_with(start),
            None => n == pattern,
        };
        let found: Vec<usize> =
            names.clone().enumerate().filter(|(_, n)| is_match(n)).map(|(i, _)| i).collect();
        if found.is_empty() { Err(self.unknown_name(key, pattern, names)) } else { Ok(found) }
    }

    fn select_main(
        &self,
        selection: &Selection,
        mesh: &super::Mesh,
        parts: &[Part],
        materials: &[Material],
    ) -> Result<Vec<bool>, SceneError> {
        let mut names: Vec<&str> = parts.iter().flat_map(Part::names).collect();
        names.sort_unstable();
        names.dedup();
        let mut main_object = vec![false; parts.len()];
        let mut main_material = vec![false; materials.len()];
        for pattern in &selection.objects {
            for i in self.matches("main_object.objects", pattern, names.iter().copied())? {
                for (is_main, part) in main_object.iter_mut().zip(parts) {
                    *is_main |= part.names().any(|n| n == names[i]);
                }
            }
        }
        for pattern in &selection.materials {
            for i in
                self.matches("main_object.materials", pattern, materials.iter().map(|m| m.name.as_str()))?
            {
                main_material[i] = true;
            }
        }
        let is_main: Vec<bool> = mesh
            .objects
            .iter()
            .zip(&mesh.materials)
            .map(|(&o, &m)| main_object[o as usize] || main_material[m as usize])
            .collect();
        if !is_main.contains(&true) {
            return Err(self.error("main_object", "names no triangle; give `objects` or `materials`"));
        }
        Ok(is_main)
    }

    fn background(
        &self,
        sidecar: &Sidecar,
        mesh: &super::Mesh,
        is_main: &[bool],
        materials: &[Material],
    ) -> Result<Vec<usize>, SceneError> {
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

    fn camera(&self, sidecar: &Sidecar) -> Result<Camera, SceneError> {
        let c = &sidecar.camera;
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
}
