//! The camera: that of the scene file, with what the sidecar says of it.

use std::ops::RangeInclusive;

use glam::{DVec2, UVec2, Vec3};

use super::{LoadOptions, source::Source};
use crate::{
    camera::{Camera, Lens, MAX_PIXELS, is_film_size},
    files::number::{Number, Numbers},
    import::{
        error::ImportError,
        imported::{Imported, ImportedCamera},
        sidecar::{CameraName, CameraSpec, DEFAULT_FILM, Sidecar},
    },
    lighting,
};

/// Largest aspect ratio, and inverse of the smallest, of an imported camera's film: beyond it a film
/// [`DEFAULT_FILM`] wide has fewer than 40 rows, or more than 10 240.
const MAX_ASPECT: f32 = 16.0;
/// Vertical fields of view, degrees. Narrower than the least, the rays of a picture have the same direction in
/// f32; at 180° they would have none.
const VFOVS: RangeInclusive<f64> = 0.001..=179.9;
/// Largest shift of the film, in lengths of its longer side: the range of Blender's, beyond which a picture
/// is seen at an angle of more than 87 degrees.
const MAX_SHIFT: f64 = 10.0;
/// Keys of `[camera]` that say where a camera is and what it sees.
const PLACE: &str = "`position`, `look_at`, `up` and `vfov`";

/// Luminous efficacy that turns W into lm, as the standard of radiometric units of glTF has it, lm/W.
const LUMENS_PER_WATT: f64 = 683.0;
/// Luminance that a camera set to EV 0 at ISO 100 shows as white, cd/m²: 78/(ISO·q) of \[ISO12232\] at ISO 100
/// with the share q = .65 of the light that passes a lens. \[Lagarde14\]
const WHITE_AT_EV_0: f64 = 1.2;
/// Sensitivities, times, s, and f-numbers that are taken: wider than any camera has.
const CAMERA_SETTING: RangeInclusive<f64> = 1e-6..=1e9;

impl Source<'_> {
    /// The exposure: that of the sidecar, or that of the camera's settings.
    pub fn exposure(&self, sidecar: &Sidecar) -> Result<f32, ImportError> {
        let camera = sidecar.camera.as_ref();
        let of = |setting: fn(&CameraSpec) -> Option<f64>| camera.and_then(setting);
        let settings = [
            ("camera.iso", of(|c| c.iso)),
            ("camera.shutter", of(|c| c.shutter)),
            ("camera.f_number", of(|c| c.f_number)),
        ];
        let Some((given, _)) = settings.iter().find(|(_, value)| value.is_some()) else {
            let exposure = sidecar.exposure.unwrap_or(1.0);
            return lighting::exposure(exposure).map_err(|message| self.error("exposure", message));
        };
        if sidecar.exposure.is_some() {
            return Err(self.error(*given, "takes the place of `exposure`: give one of them"));
        }
        let mut values = [0.0; 3];
        for ((key, value), out) in settings.iter().zip(&mut values) {
            match value {
                Some(value) if CAMERA_SETTING.contains(value) => *out = *value,
                Some(value) => {
                    let [least, most] = [CAMERA_SETTING.start(), CAMERA_SETTING.end()];
                    let message = format!("must be from {least:e} to {most:e}, got {}", Number(*value));
                    return Err(self.error(*key, message));
                }
                None => return Err(self.error(*key, format!("is needed beside `{given}`"))),
            }
        }
        let [iso, shutter, f_number] = values;
        // [Lagarde14]: EV100, and the luminance that saturates
        let white = WHITE_AT_EV_0 * f_number * f_number / shutter * 100.0 / iso;
        lighting::exposure(LUMENS_PER_WATT / white).map_err(|message| self.error(*given, message))
    }

    /// Chooses the camera of the scene file that the option names, else the sidecar, else the first; says
    /// so where the file has several.
    pub fn choose_camera(
        &self,
        options: &LoadOptions,
        sidecar: Option<&Sidecar>,
        imported: &mut Imported,
    ) -> Result<(), ImportError> {
        let spec = sidecar.and_then(|s| s.camera.as_ref());
        let named = spec.and_then(|c| c.name.as_ref());
        let chosen = match (&options.camera, named) {
            (Some(name), _) => self.find_camera(name, imported).map_err(|message| ImportError::Key {
                path: self.scene_path.into(),
                key: "--camera".into(),
                message,
            })?,
            (None, Some(name)) => {
                self.find_camera(name, imported).map_err(|message| self.error("camera.name", message))?
            }
            (None, None) => {
                let is_placed = spec.is_some_and(is_placed);
                if let [(first, _), _, ..] = &imported.cameras[..]
                    && !is_placed
                {
                    let n = imported.cameras.len();
                    let way = "`--camera` or `camera.name` in the sidecar takes another";
                    imported.warnings.push(format!("of {n} cameras `{first}` is taken, the first; {way}"));
                }
                return Ok(());
            }
        };
        let says_place = |c: &CameraSpec| {
            c.position.is_some() || c.look_at.is_some() || c.up.is_some() || c.vfov.is_some()
        };
        if options.camera.is_some() && spec.is_some_and(says_place) {
            let file = self.sidecar_path.display();
            imported.warnings.push(format!("{file}: {PLACE} of [camera] give way to `--camera`"));
        }
        let name = imported.cameras[chosen].0.clone();
        let same: Vec<String> = (0..imported.cameras.len())
            .filter(|&i| imported.cameras[i].0 == name)
            .map(|i| (i + 1).to_string())
            .collect();
        let asked = options.camera.as_ref().or(named);
        if same.len() > 1 && matches!(asked, Some(CameraName::Name(word)) if *word == name) {
            let numbers = same.join(", ");
            imported.warnings.push(format!(
                "the cameras {numbers} are called `{name}`: the first is taken; a number chooses another"
            ));
        }
        imported.camera = Some(imported.cameras[chosen].1);
        Ok(())
    }

    /// Index of a camera of the scene file; the error says which there are.
    fn find_camera(&self, name: &CameraName, imported: &Imported) -> Result<usize, String> {
        let cameras = &imported.cameras;
        let (word, number) = match name {
            CameraName::Name(word) => (word.clone(), word.parse().ok()),
            CameraName::Number(n) => (n.to_string(), Some(*n)),
        };
        let by_name = cameras.iter().position(|(known, _)| *known == word);
        let by_number = || number.and_then(|n: usize| n.checked_sub(1)).filter(|&i| i < cameras.len());
        by_name.or_else(by_number).ok_or_else(|| {
            let file = self.scene_path.display();
            let known: Vec<String> =
                cameras.iter().enumerate().map(|(i, (known, _))| format!("{} `{known}`", i + 1)).collect();
            match known.len() {
                0 => format!("no `{word}`: {}", self.no_camera(imported)),
                _ => format!("no `{word}`: the cameras of {file} are {}", known.join(", ")),
            }
        })
    }

    /// Says that the scene file has no camera that is read, and which it has.
    fn no_camera(&self, imported: &Imported) -> String {
        let file = self.scene_path.display();
        match imported.unread_cameras.first() {
            Some(name) => format!("{file} has no perspective camera, as others are not read (`{name}`)"),
            None => format!("{file} has no camera"),
        }
    }

    /// The scene file's camera with what the sidecar says in its place; `subject` is the middle of the main
    /// object, metres.
    pub fn camera(
        &self,
        options: &LoadOptions,
        sidecar: &Sidecar,
        imported: &Imported,
        subject: impl Fn() -> Vec3,
    ) -> Result<Camera, ImportError> {
        let base = imported.camera;
        let spec = match (&sidecar.camera, base) {
            (None, None) => {
                let why = self.no_camera(imported);
                return Err(self
                    .error("camera", format!("is missing, and {why}; give `position`, `look_at`, `vfov`")));
            }
            (None, Some(_)) => CameraSpec::default(),
            (Some(spec), _) if options.camera.is_some() => {
                CameraSpec { position: None, look_at: None, up: None, vfov: None, ..spec.clone() }
            }
            (Some(spec), _) => spec.clone(),
        };
        self.check(&spec)?;
        let needed = |key: &str| {
            self.error(format!("camera.{key}"), format!("is missing, and {}", self.no_camera(imported)))
        };
        let point = |key: &str, value: Option<[f64; 3]>| {
            value.map(|v| self.point(&format!("camera.{key}"), v)).transpose()
        };
        let position = point("position", spec.position)?;
        let position = position.or(base.map(|c| c.position)).ok_or_else(|| needed("position"))?;
        let ahead = base.map(|c| position + (c.look_at - c.position));
        let look_at = point("look_at", spec.look_at)?.or(ahead).ok_or_else(|| needed("look_at"))?;
        let own_up = base.filter(|_| spec.look_at.is_none()).map_or(Vec3::Y, |c| c.up);
        let up = spec.up.map_or(Ok(own_up), |up| self.finite("camera.up", up))?;
        let vfov = spec.vfov.map(|v| v as f32).or(base.map(|c| c.vfov)).ok_or_else(|| needed("vfov"))?;
        let own_size = base.filter(|_| !is_placed(&spec)).map_or(DEFAULT_FILM, |c| film_of(&c));
        let size = UVec2::from_array(spec.size.unwrap_or(own_size));
        let camera = Camera::new(position, look_at, up, vfov, size).ok_or_else(|| match &sidecar.camera {
            Some(CameraSpec { up: Some(up), .. }) if look_at != position => {
                let message = "must not be zero nor lie along the direction in which the camera looks, got";
                self.error("camera.up", format!("{message} {}", Numbers(up)))
            }
            Some(_) => self.error("camera.look_at", "must differ from `position` and not lie along `up`"),
            None => {
                let message = "cannot be used as it is placed; give [camera] in the sidecar".into();
                ImportError::Key { path: self.scene_path.into(), key: "cameras".into(), message }
            }
        })?;
        let middle = || match spec.look_at {
            Some(_) => look_at.distance(position),
            None => (subject() - position).dot(camera.forward()),
        };
        let lens = self.lens(&spec, middle)?;
        Ok(camera.with_lens(lens).with_shift(DVec2::from(spec.shift.unwrap_or_default()).as_vec2()))
    }

    /// Checks the values that are given.
    fn check(&self, c: &CameraSpec) -> Result<(), ImportError> {
        if let Some(vfov) = c.vfov.filter(|v| !VFOVS.contains(v)) {
            let [least, most] = [VFOVS.start(), VFOVS.end()];
            let message = format!("must be from {least} to {most} degrees, got {}", Number(vfov));
            return Err(self.error("camera.vfov", message));
        }
        if let Some(shift) = c.shift.filter(|s| !s.iter().all(|v| v.abs() <= MAX_SHIFT)) {
            let message = format!("must be from -{MAX_SHIFT} to {MAX_SHIFT}, got {}", Numbers(&shift));
            return Err(self.error("camera.shift", message));
        }
        if let Some(size) = c.size.filter(|&size| !is_film_size(size.into())) {
            let allowed = format!("must be at least 1 x 1 and at most {MAX_PIXELS} pixels");
            return Err(self.error("camera.size", format!("{allowed}, got {size:?}")));
        }
        Ok(())
    }

    /// The thin lens, focused at `middle`, metres, where the sidecar does not say; `None` for a pinhole.
    fn lens(&self, c: &CameraSpec, middle: impl Fn() -> f32) -> Result<Option<Lens>, ImportError> {
        match (c.aperture_radius, c.focus_distance) {
            (None, None) => Ok(None),
            (None, Some(_)) => Err(self.error("camera.focus_distance", "needs `aperture_radius`")),
            (Some(radius), focus) => {
                let radius = self.length("camera.aperture_radius", radius)?;
                let focus = focus.unwrap_or_else(|| f64::from(middle()));
                let focus_distance = self.length("camera.focus_distance", focus)?;
                Ok(Some(Lens { radius, focus_distance }))
            }
        }
    }
}

/// Whether the sidecar alone says where the camera is and what it sees.
fn is_placed(c: &CameraSpec) -> bool {
    c.position.is_some() && c.look_at.is_some() && c.vfov.is_some()
}

/// Film of an imported camera, pixels.
fn film_of(c: &ImportedCamera) -> [u32; 2] {
    let [width, height] = DEFAULT_FILM;
    let height = c.aspect.map_or(height, |a| {
        let aspect = a.clamp(1.0 / MAX_ASPECT, MAX_ASPECT);
        (width as f32 / aspect).round() as u32
    });
    [width, height]
}
