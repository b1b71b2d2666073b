//! The files that a scene is built from, and checks whose errors name them.

use std::path::Path;

use glam::{DVec3, Vec3};

use crate::{
    embree::{EmbreeError, MAX_COORDINATE},
    files::{nearest, reach::Reach},
    import::{error::ImportError, find::ending},
    math::Rgb,
};

/// Names listed in a message, at most: about a line of a terminal.
const MAX_LISTED: usize = 12;

/// A scene file and its sidecar.
#[derive(Clone)]
pub struct Source<'a> {
    /// Path of the scene file.
    pub scene_path: &'a Path,
    /// Path that the sidecar has, or would have.
    pub sidecar_path: &'a Path,
    /// Whether the scene file is an OBJ; otherwise it is a glTF.
    pub is_obj: bool,
    /// What both files may read.
    pub reach: Reach,
    /// Place of the scene's origin in the coordinates of the files, metres, y up.
    pub origin: DVec3,
}

impl<'a> Source<'a> {
    /// The source of a scene file and a sidecar; the format follows from the file's ending.
    pub fn new(scene_path: &'a Path, sidecar_path: &'a Path, reach: Reach) -> Self {
        let is_obj = ending(scene_path) == Some("obj");
        Self { scene_path, sidecar_path, is_obj, reach, origin: DVec3::ZERO }
    }

    /// The error of a key of the sidecar.
    pub fn error(&self, key: impl Into<String>, message: impl Into<String>) -> ImportError {
        ImportError::Key { path: self.sidecar_path.to_path_buf(), key: key.into(), message: message.into() }
    }

    /// The error of a field that the sidecar lacks.
    pub fn missing(&self, field: &str) -> ImportError {
        let message = format!("missing field `{field}`");
        ImportError::Line { path: self.sidecar_path.to_path_buf(), line: 1, message }
    }

    /// The error of triangles that Embree refuses.
    pub fn embree(&self, source: EmbreeError) -> ImportError {
        ImportError::Embree { path: self.scene_path.to_path_buf(), source }
    }

    /// The error of a name that the scene file does not have, with the nearest of those it has.
    pub fn unknown_name<'n>(
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

    /// `value`, if it is finite and positive.
    pub fn positive(&self, key: &str, value: f32) -> Result<f32, ImportError> {
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(self.error(key, format!("must be > 0, got {value}")))
    }

    /// `value`, if it is in [0, 1].
    pub fn fraction(&self, key: &str, value: f32) -> Result<f32, ImportError> {
        if (0.0..=1.0).contains(&value) {
            return Ok(value);
        }
        Err(self.error(key, format!("must be in [0, 1], got {value}")))
    }

    /// The colour of an albedo, if its channels are in [0, 1].
    pub fn albedo(&self, key: &str, value: [f32; 3]) -> Result<Rgb, ImportError> {
        let color = Rgb::from_array(value);
        if color.min_element() >= 0.0 && color.max_element() <= 1.0 {
            return Ok(color);
        }
        Err(self.error(key, format!("channels must be in [0, 1], got {value:?}")))
    }

    /// The point of the scene that the sidecar gives in the scene file's coordinates; each must be finite and
    /// of a magnitude that Embree accepts.
    pub fn point(&self, key: &str, value: [f64; 3]) -> Result<Vec3, ImportError> {
        if !value.iter().all(|v| v.is_finite()) {
            return Err(self.error(key, format!("must be finite, got {value:?}")));
        }
        let p = (DVec3::from_array(value) - self.origin).as_vec3();
        if value.iter().any(|v| v.abs() > f64::from(MAX_COORDINATE)) {
            let message = format!("must be at most {MAX_COORDINATE:e} in magnitude, got {value:?}");
            return Err(self.error(key, message));
        }
        Ok(p)
    }

    /// Checks that coordinates are finite and of a magnitude that Embree accepts.
    pub fn finite(&self, key: &str, value: [f32; 3]) -> Result<(), ImportError> {
        if !value.iter().all(|v| v.is_finite()) {
            return Err(self.error(key, format!("must be finite, got {value:?}")));
        }
        if value.iter().any(|v| v.abs() > MAX_COORDINATE) {
            let message = format!("must be at most {MAX_COORDINATE:e} in magnitude, got {value:?}");
            return Err(self.error(key, message));
        }
        Ok(())
    }
}
