//! The region in which lamps may be placed.

use super::source::Source;
use crate::{
    files::number::Numbers,
    import::{error::ImportError, sidecar::MovementSpec},
    variables::Movement,
};

impl Source<'_> {
    /// The region of `[movement]`.
    pub fn movement(&self, spec: &MovementSpec) -> Result<Movement, ImportError> {
        let default = Movement::default();
        let range = |key: &str, given: Option<[f64; 2]>, least: f64, most: f64| {
            let Some(range @ [lo, hi]) = given else { return Ok(None) };
            if least <= lo && lo <= hi && hi <= most {
                return Ok(Some(range.map(|v| v as f32)));
            }
            let message = format!("must be {least} <= min <= max <= {most}, got {}", Numbers(&range));
            Err(self.error(format!("movement.{key}"), message))
        };
        let most = f64::from(super::source::MAX_LENGTH);
        Ok(Movement {
            azimuth: range("azimuth", spec.azimuth, -180.0, 180.0)?.unwrap_or(default.azimuth),
            elevation: range("elevation", spec.elevation, -90.0, 90.0)?.unwrap_or(default.elevation),
            distance: range("distance", spec.distance, 0.0, most)?,
            height: range("height", spec.height, 0.0, most)?,
            clearance: spec.clearance.map(|c| self.length("movement.clearance", c)).transpose()?,
            in_frame: spec.in_frame,
        })
    }
}
