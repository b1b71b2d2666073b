//! Merges OBJ and sidecar into a [`Scene`] and checks both.

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::{UVec2, Vec3};

use super::{
    Scene,
    material::{Coats, Material, MaterialParams},
    obj,
    sidecar::{LightSpec, LightType, MaterialSpec, Selection, Sidecar},
};
use crate::{
    camera::Camera,
    embree::EmbreeError,
    files::{nearest, toml_file::TomlError},
    light::{Cone, Light, Outline, Planar, Shape, SizeDensity, Sphere, look_frame},
    math::{Rgb, luminance},
};

/// A scene could not be loaded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum SceneError {
    #[error("{path}: no such scene, and none in {fallback} either", path = path.display(), fallback = fallback.display())]
    NotFound { path: PathBuf, fallback: PathBuf },
    #[error("{path}: a scene is a Wavefront .obj file", path = path.display())]
    NotObj { path: PathBuf },
    #[error("{path}: cannot read the sidecar, which gives camera, main object and lights", path = path.display())]
    Sidecar { path: PathBuf, source: std::io::Error },
    #[error("{path}: cannot read OBJ", path = path.display())]
    Obj { path: PathBuf, source: tobj::LoadError },
    #[error("{path}: no triangle in this file", path = path.display())]
    NoTriangles { path: PathBuf },
    #[error("{path}: `{key}`: {message}", path = path.display())]
    Key { path: PathBuf, key: String, message: String },
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error(transparent)]
    Texture(#[from] super::texture::TextureError),
    #[error("{path}: cannot build the ray-tracing structure", path = path.display())]
    Embree { path: PathBuf, source: EmbreeError },
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

/// Finds a scene file: as given or, for a bare name, in `scenes/`.
///
/// # Errors
/// When there is none, or the file is not an OBJ.
pub fn find(path: &Path) -> Result<PathBuf, SceneError> {
    let fallback = Path::new("scenes").join(path);
    let found = if path.is_file() {
        path.to_path_buf()
    } else if path.is_relative() && fallback.is_file() {
        fallback
    } else {
        return Err(SceneError::NotFound { path: path.to_path_buf(), fallback: "scenes/".into() });
    };
    if !found.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
        return Err(SceneError::NotObj { path: found });
    }
    Ok(found)
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

    fn build(&self, sidecar: &Sidecar) -> Result<Scene, SceneError> {
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
        let is_main = self.select_main(&sidecar.main_object, &mesh, &parts.objects, &materials)?;
        let background = self.background(sidecar, &mesh, &is_main, &materials)?;
        if background.is_empty() {
            warnings.push("no background material has a colour: the background's value is not free".into());
        }
        let mut names = std::collections::HashSet::new();
        for l in &sidecar.lights {
            if !names.insert(&l.name) {
                return Err(self.error(format!("lights.{}", l.name), "two lights have this name"));
            }
        }
        let lights: Vec<Light> = sidecar.lights.iter().map(|l| self.light(l)).collect::<Result<_, _>>()?;
        let light_bounds =
            sidecar.lights.iter().map(|l| self.light_bounds(sidecar, l)).collect::<Result<_, _>>()?;
        let camera = self.camera(sidecar)?;
        if let Some([lo, hi]) = sidecar.background.value_range {
            if !(lo >= 0.0 && lo <= hi && hi.is_finite()) {
                return Err(self
                    .error("background.value_range", format!("must be 0 <= min <= max, got [{lo}, {hi}]")));
            }
        }
        let name =
            self.obj_path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
        let scene = Scene::new(&name, mesh, materials, lights, camera)
            .map_err(|source| SceneError::Embree { path: self.obj_path.to_path_buf(), source })?;
        Ok(Scene {
            objects: parts.objects,
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
        if let Some(r) = spec.roughness {
            if !(0.0..=1.0).contains(&r) {
                return Err(self.error(key("roughness"), format!("must be in [0, 1], got {r}")));
            }
            params.roughness = r;
        }
        if let Some(ior) = spec.ior {
            if !(ior > 1.0 && ior <= 4.0) {
                return Err(self.error(key("ior"), format!("must be in (1, 4], got {ior}")));
            }
            params.ior = ior;
        }
        params.model = spec.model.unwrap_or(params.model);
        Ok(params)
    }

    fn unknown_name<'n>(
        &self,
        key: &str,
        name: &str,
        known: impl Iterator<Item = &'n str> + Clone,
    ) -> SceneError {
        let message = match nearest(name, known.clone()) {
            Some(near) => format!("no `{name}` in {}; did you mean `{near}`?", self.obj_path.display()),
            None => format!("no `{name}`: {} names none", self.obj_path.display()),
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
        objects: &[String],
        materials: &[Material],
    ) -> Result<Vec<bool>, SceneError> {
        let mut main_object = vec![false; objects.len()];
        let mut main_material = vec![false; materials.len()];
        for pattern in &selection.objects {
            for i in self.matches("main_object.objects", pattern, objects.iter().map(String::as_str))? {
                main_object[i] = true;
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
        if c.size.contains(&0) || c.size.iter().any(|&n| n > 65_536) {
            return Err(self.error("camera.size", format!("must be 1 to 65536 pixels, got {:?}", c.size)));
        }
        Camera::new(c.position.into(), c.look_at.into(), c.up.into(), c.vfov, UVec2::from_array(c.size))
            .ok_or_else(|| self.error("camera.look_at", "must differ from `position` and not lie along `up`"))
    }

    fn light_bounds(&self, sidecar: &Sidecar, l: &LightSpec) -> Result<LightBounds, SceneError> {
        use super::sidecar::FreeKind::{Radiance, Size};
        if let Some([lo, hi]) = l.size_range {
            if !(lo > 0.0 && lo <= hi && hi.is_finite()) {
                let key = format!("lights.{}.size_range", l.name);
                return Err(self.error(key, format!("must be 0 < min <= max, got [{lo}, {hi}]")));
            }
        }
        if let Some(max) = l.radiance_max {
            self.positive(&format!("lights.{}.radiance_max", l.name), max)?;
        }
        let free = |kind| sidecar.free.contains(kind) && l.free.as_ref().is_none_or(|f| f.contains(kind));
        Ok(LightBounds {
            size: l.size_range,
            radiance_max: l.radiance_max,
            radiance_free: free(Radiance),
            size_free: free(Size) && l.kind != LightType::Point,
        })
    }

    fn light(&self, l: &LightSpec) -> Result<Light, SceneError> {
        let key = |k: &str| format!("lights.{}.{k}", l.name);
        let missing = |k: &str, kind: &str| self.error(key(k), format!("a {kind} light needs this key"));
        let unused = |k: &str, given: bool, kinds: &str| {
            if given { Err(self.error(key(k), format!("only for {kinds}"))) } else { Ok(()) }
        };
        let planar = matches!(l.kind, LightType::Rectangle | LightType::Disk | LightType::Spot);
        unused("half_extents", l.half_extents.is_some() && l.kind != LightType::Rectangle, "a rectangle")?;
        unused("look_at", l.look_at.is_some() && !planar, "a rectangle, disk or spot")?;
        unused("angle", l.angle.is_some() && l.kind != LightType::Spot, "a spot")?;
        unused("softness", l.softness.is_some() && l.kind != LightType::Spot, "a spot")?;
        let center = Vec3::from_array(l.position);
        if !center.is_finite() {
            return Err(self.error(key("position"), "must be finite"));
        }
        let radius = |kind: &str| match l.radius {
            Some(r) => self.positive(&key("radius"), r),
            None => Err(missing("radius", kind)),
        };
        let frame = |kind: &str| {
            let target = l.look_at.ok_or_else(|| missing("look_at", kind))?;
            let normal = (Vec3::from_array(target) - center)
                .try_normalize()
                .ok_or_else(|| self.error(key("look_at"), "must differ from `position`"))?;
            Ok::<_, SceneError>(look_frame(normal, l.up.into()))
        };
        let shape = match l.kind {
            LightType::Point => Shape::Point(center),
            LightType::Sphere => Shape::Sphere(Sphere { center, radius: radius("sphere")? }),
            LightType::Rectangle => {
                let [a, b] = l.half_extents.ok_or_else(|| missing("half_extents", "rectangle"))?;
                self.positive(&key("half_extents"), a.min(b))?;
                Shape::Planar(Planar {
                    center,
                    frame: frame("rectangle")?,
                    outline: Outline::Rectangle { a, b },
                    cone: None,
                })
            }
            LightType::Disk => {
                let outline = Outline::Disk { r: radius("disk")? };
                Shape::Planar(Planar { center, frame: frame("disk")?, outline, cone: None })
            }
            LightType::Spot => {
                let outline = Outline::Disk { r: radius("spot")? };
                let angle = l.angle.ok_or_else(|| missing("angle", "spot"))?;
                if !(angle > 0.0 && angle <= 90.0) {
                    return Err(self.error(key("angle"), format!("must be in (0, 90] degrees, got {angle}")));
                }
                let softness = l.softness.unwrap_or(0.2);
                if !(0.0..=1.0).contains(&softness) {
                    return Err(self.error(key("softness"), format!("must be in [0, 1], got {softness}")));
                }
                let cos = |a: f32| a.to_radians().cos().max(0.0);
                let cone = Cone { cos_inner: cos(angle * (1.0 - softness)), cos_outer: cos(angle) };
                Shape::Planar(Planar { center, frame: frame("spot")?, outline, cone: Some(cone) })
            }
        };
        let color = Rgb::from_array(l.color);
        let y = luminance(color);
        if !(color.min_element() >= 0.0 && y > 0.0 && color.is_finite()) {
            return Err(
                self.error(key("color"), format!("channels must be >= 0 and not all 0, got {:?}", l.color))
            );
        }
        let size = self.positive(&key("size"), l.size)?;
        if !(l.radiance >= 0.0 && l.radiance.is_finite()) {
            return Err(self.error(key("radiance"), format!("must be >= 0, got {}", l.radiance)));
        }
        Ok(Light {
            name: l.name.clone(),
            shape,
            color: color / y,
            radiance: l.radiance,
            size,
            size_density: SizeDensity::UniformArea { extent: size },
            camera_visible: l.camera_visible,
        })
    }
}
