//! The files that a scene is built from, and checks whose errors name them.

use std::path::Path;

use glam::{DVec3, Vec3};

use crate::{
    embree::{EmbreeError, MAX_COORDINATE},
    files::{
        nearest,
        number::{Number, Numbers},
        reach::Reach,
    },
    import::{error::ImportError, find::ending},
    lighting,
    math::Rgb,
};

/// Names listed in a message, at most: about a line of a terminal.
const MAX_LISTED: usize = 12;
/// Largest length, metres: that of a coordinate.
pub const MAX_LENGTH: f32 = MAX_COORDINATE;
/// Least length, metres: below it an area and its inverse leave the range of f32.
pub const MIN_LENGTH: f32 = 1e-18;

/// Whether a length, metres, is in the range that can be computed with.
pub fn is_length(value: f64) -> bool {
    (MIN_LENGTH..=MAX_LENGTH).contains(&(value as f32))
}

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

    /// `value`, if it is positive and an `f32` can hold it.
    pub fn positive(&self, key: &str, value: f64) -> Result<f32, ImportError> {
        let rounded = value as f32;
        if rounded.is_normal() && rounded > 0.0 {
            return Ok(rounded);
        }
        let got = Number(value);
        Err(self.error(
            key,
            match value > 0.0 {
                true => format!("must be from {:e} to {:e}, got {got}", f32::MIN_POSITIVE, f32::MAX),
                false => format!("must be > 0, got {got}"),
            },
        ))
    }

    /// A length in metres, if it is positive and of a magnitude that Embree accepts.
    pub fn length(&self, key: &str, value: f64) -> Result<f32, ImportError> {
        if value > 0.0 && !is_length(value) {
            let message = format!("must be from {MIN_LENGTH:e} to {MAX_LENGTH:e}, got {}", Number(value));
            return Err(self.error(key, message));
        }
        self.positive(key, value)
    }

    /// `value`, if it is in [0, 1].
    pub fn fraction(&self, key: &str, value: f64) -> Result<f32, ImportError> {
        if (0.0..=1.0).contains(&value) {
            return Ok(value as f32);
        }
        Err(self.error(key, format!("must be in [0, 1], got {}", Number(value))))
    }

    /// The colour of an albedo, if its channels are in [0, 1].
    pub fn albedo(&self, key: &str, value: [f64; 3]) -> Result<Rgb, ImportError> {
        if value.iter().all(|v| (0.0..=1.0).contains(v)) {
            return Ok(DVec3::from_array(value).as_vec3());
        }
        Err(self.error(key, format!("channels must be in [0, 1], got {}", Numbers(&value))))
    }

    /// A radiance, if it is not negative and no larger than any light may be.
    pub fn radiance(&self, key: &str, value: f64) -> Result<f32, ImportError> {
        lighting::radiance(value).map_err(|message| self.error(key, message))
    }

    /// An angle of any number of turns, degrees.
    pub fn turn(&self, key: &str, value: f64) -> Result<f32, ImportError> {
        if value.is_finite() {
            return Ok((value % 360.0) as f32);
        }
        Err(self.error(key, format!("must be finite, got {}", Number(value))))
    }

    /// The point of the scene that the sidecar gives in the scene file's coordinates; each must be finite and
    /// of a magnitude that Embree accepts.
    pub fn point(&self, key: &str, value: [f64; 3]) -> Result<Vec3, ImportError> {
        self.finite(key, value)?;
        Ok((DVec3::from_array(value) - self.origin).as_vec3())
    }

    /// A vector whose components are finite and of a magnitude that Embree accepts.
    pub fn finite(&self, key: &str, value: [f64; 3]) -> Result<Vec3, ImportError> {
        if !value.iter().all(|v| v.is_finite()) {
            return Err(self.error(key, format!("must be finite, got {}", Numbers(&value))));
        }
        if value.iter().any(|v| v.abs() as f32 > MAX_COORDINATE) {
            let got = Numbers(&value);
            return Err(
                self.error(key, format!("must be at most {MAX_COORDINATE:e} in magnitude, got {got}"))
            );
        }
        Ok(DVec3::from_array(value).as_vec3())
    }
}
