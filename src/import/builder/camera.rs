//! The camera: that of the sidecar, else that of the scene file.

use glam::{UVec2, Vec3};

use super::source::Source;
use crate::{
    camera::{Camera, Lens, MAX_PIXELS, is_film_size},
    import::{
        error::ImportError,
        imported::ImportedCamera,
        sidecar::{CameraSpec, DEFAULT_FILM, Sidecar},
    },
};

/// Largest aspect ratio, and inverse of the smallest, of an imported camera's film: beyond it a film
/// [`DEFAULT_FILM`] wide has fewer than 40 rows, or more than 10 240.
const MAX_ASPECT: f32 = 16.0;

impl Source<'_> {
    /// The sidecar's camera, else that of the scene file.
    pub fn camera(&self, sidecar: &Sidecar, imported: Option<ImportedCamera>) -> Result<Camera, ImportError> {
        match (&sidecar.camera, imported) {
            (Some(spec), _) => self.sidecar_camera(spec),
            (None, Some(camera)) => self.imported_camera(&camera),
            (None, None) => Err(self.missing("camera")),
        }
    }

    fn sidecar_camera(&self, c: &CameraSpec) -> Result<Camera, ImportError> {
        if !(c.vfov > 0.0 && c.vfov < 180.0) {
            return Err(self.error("camera.vfov", format!("must be in (0, 180) degrees, got {}", c.vfov)));
        }
        let (position, look_at) = self.camera_points(c)?;
        self.finite("camera.up", c.up)?;
        if !is_film_size(c.size.into()) {
            let allowed = format!("must be at least 1 x 1 and at most {MAX_PIXELS} pixels");
            return Err(self.error("camera.size", format!("{allowed}, got {:?}", c.size)));
        }
        let camera = Camera::new(position, look_at, c.up.into(), c.vfov, UVec2::from_array(c.size))
            .ok_or_else(|| {
                self.error("camera.look_at", "must differ from `position` and not lie along `up`")
            })?;
        Ok(camera.with_lens(self.lens(c)?))
    }

    /// Position of the sidecar's camera and the point that it looks at.
    fn camera_points(&self, c: &CameraSpec) -> Result<(Vec3, Vec3), ImportError> {
        Ok((self.point("camera.position", c.position)?, self.point("camera.look_at", c.look_at)?))
    }

    /// The thin lens, focused on `look_at` where the sidecar does not say; `None` for a pinhole.
    fn lens(&self, c: &CameraSpec) -> Result<Option<Lens>, ImportError> {
        match (c.aperture_radius, c.focus_distance) {
            (None, None) => Ok(None),
            (None, Some(_)) => Err(self.error("camera.focus_distance", "needs `aperture_radius`")),
            (Some(radius), focus) => {
                let radius = self.positive("camera.aperture_radius", radius)?;
                let (position, look_at) = self.camera_points(c)?;
                let looked_at = look_at.distance(position);
                let focus_distance = self.positive("camera.focus_distance", focus.unwrap_or(looked_at))?;
                Ok(Some(Lens { radius, focus_distance }))
            }
        }
    }

    fn imported_camera(&self, c: &ImportedCamera) -> Result<Camera, ImportError> {
        let [width, height] = DEFAULT_FILM;
        let height = c.aspect.map_or(height, |a| {
            let aspect = a.clamp(1.0 / MAX_ASPECT, MAX_ASPECT);
            (width as f32 / aspect).round() as u32
        });
        Camera::new(c.position, c.look_at, c.up, c.vfov, UVec2::new(width, height)).ok_or_else(|| {
            let message = "cannot be used as it is placed; give [camera] in the sidecar".into();
            ImportError::Key { path: self.scene_path.into(), key: "cameras".into(), message }
        })
    }
}
