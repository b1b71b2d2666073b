//! `lights.toml`: a lighting on disk, to be rendered again. Its keys are listed in `docs/formats.md`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, Serializer};

use super::{
    placed::{Description, Placed},
    stored::About,
};
use crate::{
    files::{
        nearest,
        number::{Number, Numbers},
        toml_file::TomlError,
    },
    import::LoadOptions,
    light::{Light, LightColor},
    lighting::{self, Lighting, MAX_RADIANCE},
    math::{
        ViewTransform,
        blackbody::{MAX_TINT, TEMPERATURES},
    },
    scene::Scene,
    transport::Layout,
};

/// Version of the format that is read and written.
const SCHEMA: u32 = 1;

/// Contents of a `lights.toml`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LightsFile {
    /// Version of the format, which must be 1.
    pub schema: u32,
    /// Exposure, a factor on luminance before display encoding; that of the scene if absent.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "short_option")]
    pub exposure: Option<f64>,
    /// View through which the picture is seen; that of the scene if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<ViewTransform>,
    /// Setting of the background; that of the scene if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<Background>,
    /// Whether the lights of the scene's files are left out, but for materials that emit: all others are
    /// placed by this file.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub without_lights: bool,
    /// Settings of lights by name; other lights keep the scene's.
    #[serde(default)]
    pub lights: Vec<LightSetting>,
}

/// Setting of the background, `[background]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Background {
    /// Value of the background, a factor on the base colour of its materials.
    #[serde(serialize_with = "short")]
    pub value: f64,
}

/// Setting of a light, `[[lights]]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LightSetting {
    /// Name of the light in the scene.
    pub name: String,
    /// Radiance L of the light, in its own unit.
    #[serde(serialize_with = "short")]
    pub radiance: f64,
    /// Size s of the light, a factor on its unit extents; that of the scene if absent.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "short_option")]
    pub size: Option<f64>,
    /// Colour of the light, linear Rec.709 of luminance 1; that of the scene if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<[f32; 3]>,
    /// Temperature that made the colour, kelvin. With `color` it is written for people, and not read.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "short_option")]
    pub color_temperature: Option<f64>,
    /// Distance Duv of the colour from the Planckian locus; 0 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "short_option")]
    pub tint: Option<f64>,
    /// Place and shape of a lamp that the scene's files do not have, or have elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placed: Option<Placed>,
    /// What a photographer sets up; it is written for people, and not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setup: Option<Description>,
}

/// Writes a number with the digits of an `f32`, which is what pictures are rendered with.
fn short<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f32(*value as f32)
}

/// As [`short`], for a value that is there.
fn short_option<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    value.map(|v| v as f32).serialize(serializer)
}

/// A lighting cannot be read, or does not fit its scene or basis.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum LightingError {
    #[error("{path}: cannot read the lighting", path = path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error("{path}: `{key}`: {message}", path = path.display())]
    Key { path: PathBuf, key: String, message: String },
}

impl LightsFile {
    /// Settings that describe the lighting `x` of a scene.
    #[must_use]
    pub fn new(scene: &Scene, x: &Lighting) -> Self {
        let background = Background { value: x.value };
        let settings = scene.lights.iter().zip(&x.radiance).zip(&x.size).enumerate();
        let temperature = |l: usize| match x.color_of(l) {
            LightColor::Temperature { kelvin, tint } => (Some(kelvin), Some(tint).filter(|t| *t != 0.0)),
            LightColor::Recorded | LightColor::Rgb(_) => (None, None),
        };
        Self {
            schema: SCHEMA,
            exposure: Some(x.exposure),
            view: None,
            background: (!scene.background().is_empty()).then_some(background),
            without_lights: false,
            lights: settings
                .map(|(l, ((light, &radiance), &size))| LightSetting {
                    name: light.name.clone(),
                    radiance,
                    size: light.has_size().then_some(size),
                    color: x.color_of(l).gain(),
                    color_temperature: temperature(l).0,
                    tint: temperature(l).1,
                    placed: None,
                    setup: None,
                })
                .collect(),
        }
    }

    /// Settings that describe the lighting `x` of a stored basis.
    #[must_use]
    pub fn of_basis(about: &About, layout: &Layout, x: &Lighting) -> Self {
        let is_free = layout.nodes.len() > 1;
        let setting = |(l, name): (usize, &String)| LightSetting {
            name: name.clone(),
            radiance: x.radiance[l],
            size: layout.lights[l].knots.is_some().then_some(x.size[l]),
            color: x.color_of(l).gain(),
            color_temperature: None,
            tint: None,
            placed: None,
            setup: None,
        };
        Self {
            schema: SCHEMA,
            exposure: Some(x.exposure),
            view: None,
            background: is_free.then_some(Background { value: x.value }),
            without_lights: false,
            lights: about.lights.iter().enumerate().map(setting).collect(),
        }
    }

    /// The same settings, seen through a view, of which nothing is said where it is `srgb`.
    #[must_use]
    pub fn seen_through(self, view: ViewTransform) -> Self {
        Self { view: (view != ViewTransform::Srgb).then_some(view), ..self }
    }

    /// Reads a file of settings.
    ///
    /// # Errors
    /// When the file cannot be read, with file, line and what is allowed.
    pub fn load(path: &Path) -> Result<Self, LightingError> {
        let text = crate::files::text::read(path)
            .map_err(|source| LightingError::Read { path: path.into(), source })?;
        let lighting: Self = crate::files::toml_file::parse(path, &text)?;
        if lighting.schema != SCHEMA {
            let message = format!("this program reads version {SCHEMA}, the file says {}", lighting.schema);
            return Err(LightingError::Key { path: path.into(), key: "schema".into(), message });
        }
        Ok(lighting)
    }

    /// How a scene is loaded that has the lamps which this file places.
    #[must_use]
    pub fn load_options(&self, options: LoadOptions) -> LoadOptions {
        let placed = self.lights.iter().filter_map(|l| Some(l.placed.as_ref()?.spec(&l.name)));
        LoadOptions { without_lights: self.without_lights, lights: placed.collect(), ..options }
    }

    /// Records those lights of a scene white to which the file gives a colour.
    pub fn record_white(&self, scene: &mut Scene) {
        let is_colored = |l: &LightSetting| l.color.is_some() || l.color_temperature.is_some();
        for l in self.lights.iter().filter(|l| is_colored(l)) {
            scene.lights.iter_mut().filter(|light| light.name == l.name).for_each(Light::record_white);
        }
    }

    /// Applies the settings to the lighting `x` of a scene, whose lights with a colour of the file are [recorded
    /// white](Self::record_white); `path` names the file in messages.
    ///
    /// # Errors
    /// With the key, when a name is unknown or a value outside its range.
    pub fn apply(&self, scene: &Scene, x: &mut Lighting, path: &Path) -> Result<(), LightingError> {
        let fail = |key: String, message: String| LightingError::Key { path: path.into(), key, message };
        let require = |ok: bool, key: String, what: &str, value: f64| {
            if ok { Ok(()) } else { Err(fail(key, format!("must be {what}, got {}", Number(value)))) }
        };
        for l in &self.lights {
            let Some(i) = scene.lights.iter().position(|s| s.name == l.name) else {
                let near = nearest(&l.name, scene.lights.iter().map(|s| s.name.as_str()));
                let known = || scene.lights.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
                let hint = near
                    .map_or_else(|| format!("; it has {}", known()), |n| format!("; did you mean `{n}`?"));
                return Err(fail("lights.name".into(), format!("the scene has no light `{}`{hint}", l.name)));
            };
            x.radiance[i] = f64::from(radiance(l).map_err(|(key, message)| fail(key, message))?);
            if let Some(color) = color(l).map_err(|(key, message)| fail(key, message))? {
                *x.color_mut(i) = color;
            }
            let Some(given) = l.size else { continue };
            let (size, fixed) = (given as f32, scene.lights[i].size);
            let key = format!("lights.{}.size", l.name);
            require(given > 0.0, key.clone(), "> 0", given)?;
            let range = format!("from {:e} to {:e}", f32::MIN_POSITIVE, f32::MAX);
            require(size.is_normal(), key.clone(), &range, given)?;
            if scene.lights[i].occludes && size != fixed {
                let message = format!("must be {fixed}, since the light occludes, got {}", Number(given));
                return Err(fail(key, message));
            }
            x.size[i] = f64::from(size);
        }
        if let Some(Background { value }) = self.background {
            let albedo = scene.background_albedo();
            let ok = value >= 0.0 && value as f32 * albedo <= 1.0 + 1e-5;
            require(
                ok,
                "background.value".into(),
                &format!("in [0, {}], for albedos up to 1", 1.0 / albedo),
                value,
            )?;
            x.value = f64::from(value as f32);
        }
        if let Some(e) = self.exposure {
            let exposure = lighting::exposure(e).map_err(|message| fail("exposure".into(), message))?;
            x.exposure = f64::from(exposure);
        }
        Ok(())
    }

    /// Applies the settings to the lighting `x` of a stored basis; `path` names the file in messages.
    ///
    /// # Errors
    /// With the key, when a name is unknown or a value is not in the basis.
    pub fn apply_to(
        &self,
        about: &About,
        layout: &Layout,
        x: &mut Lighting,
        path: &Path,
    ) -> Result<(), LightingError> {
        let fail = |key: String, message: String| LightingError::Key { path: path.into(), key, message };
        for l in &self.lights {
            if let Some(leader) = about.group(&l.name) {
                x.radiance[leader] = f64::from(radiance(l).map_err(|(key, message)| fail(key, message))?);
                for tie in &about.ties {
                    x.radiance[tie.light] = tie.ratio(x).0 * x.radiance[tie.leader];
                }
                continue;
            }
            let Some(i) = about.lights.iter().position(|n| *n == l.name) else {
                let known = about.lights.join(", ");
                let message = format!("the basis has no light `{}`; it has {known}", l.name);
                return Err(fail("lights.name".into(), message));
            };
            x.radiance[i] = f64::from(radiance(l).map_err(|(key, message)| fail(key, message))?);
            if let Some(color) = color(l).map_err(|(key, message)| fail(key, message))? {
                if !about.white.get(i).is_some_and(|white| *white) {
                    let message = "the basis has the light in a colour of its own; `run --free color` makes one in \
                                   which it can be set";
                    return Err(fail(format!("lights.{}.color", l.name), message.into()));
                }
                *x.color_mut(i) = color;
            }
            let Some(given) = l.size else { continue };
            let (size, got) = (given as f32, Number(given));
            let cells = &layout.lights[i];
            let key = format!("lights.{}.size", l.name);
            // Sizes are written in f32.
            let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 * b;
            match &cells.knots {
                None if near(size, cells.size) => {}
                None => {
                    return Err(fail(
                        key,
                        format!("is {} in this basis, and not free; got {got}", cells.size),
                    ));
                }
                Some(_) if size > 0.0 && (size <= cells.size || near(size, cells.size)) => {
                    x.size[i] = f64::from(size.min(cells.size));
                }
                Some(_) => return Err(fail(key, format!("must be in (0, {}], got {got}", cells.size))),
            }
        }
        if let Some(Background { value }) = self.background {
            let largest = layout.nodes.values()[0];
            let free = layout.nodes.len() > 1;
            let (value, got) = (f64::from(value as f32), Number(value));
            let same = (value - largest).abs() <= 1e-5 * largest;
            let allowed =
                if free { format!("in [0, {largest}]") } else { format!("{largest}: it is not free") };
            if !(same || free && (0.0..=largest).contains(&value)) {
                let message = format!("must be {allowed}, got {got}");
                return Err(fail("background.value".into(), message));
            }
            x.value = value.min(largest);
        }
        if let Some(e) = self.exposure {
            let exposure = lighting::exposure(e).map_err(|message| fail("exposure".into(), message))?;
            x.exposure = f64::from(exposure);
        }
        Ok(())
    }
}

/// The colour that a light is given, if it is; or its key and what is wrong with it.
fn color(light: &LightSetting) -> Result<Option<LightColor>, (String, String)> {
    let fail = |key: &str, message: String| Err((format!("lights.{}.{key}", light.name), message));
    let (tint, [least, most]) = (light.tint.unwrap_or(0.0), TEMPERATURES);
    if !(-MAX_TINT..=MAX_TINT).contains(&tint) {
        return fail("tint", format!("must be from -{MAX_TINT} to {MAX_TINT}, got {}", Number(tint)));
    }
    match (light.color, light.color_temperature) {
        (Some(rgb), _) => {
            let is_color = rgb.iter().all(|v| (0.0..=MAX_RADIANCE).contains(v)) && rgb != [0.0; 3];
            if !is_color {
                let got = Numbers(&rgb.map(f64::from));
                return fail("color", format!("channels must be >= 0 and not all 0, got {got}"));
            }
            Ok(Some(LightColor::Rgb(rgb.map(f64::from))))
        }
        (None, Some(kelvin)) if !(least..=most).contains(&kelvin) => {
            fail("color_temperature", format!("must be from {least} to {most} K, got {}", Number(kelvin)))
        }
        (None, Some(kelvin)) => Ok(Some(LightColor::Temperature { kelvin, tint })),
        (None, None) => Ok(None),
    }
}

/// The radiance of a light, or its key and what is wrong with it.
fn radiance(light: &LightSetting) -> Result<f32, (String, String)> {
    lighting::radiance(light.radiance).map_err(|message| (format!("lights.{}.radiance", light.name), message))
}
