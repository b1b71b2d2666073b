//! Cameras.

use glam::{Mat4, Vec3};
use gltf_json::{Index, Node, camera::Type, validation::Checked};

use super::file::File;
use crate::import::{error::ImportError, imported::ImportedCamera, warnings::Warnings};

/// The perspective cameras of a file.
#[derive(Default)]
pub struct Cameras {
    /// Names and cameras in the order of their nodes.
    pub list: Vec<(String, ImportedCamera)>,
    /// Names of the cameras that are not perspective ones, which are left out.
    pub unread: Vec<String>,
}

impl Cameras {
    /// Reads the camera of the node at `key`; one that is not a perspective camera is left out, and so is
    /// one behind the first that cannot be used.
    ///
    /// # Errors
    /// When the camera does not exist, or the first perspective camera has no field of view or no
    /// direction.
    pub fn read(
        &mut self,
        file: &File,
        key: &str,
        node: &Node,
        world: &Mat4,
        warnings: &mut Warnings,
    ) -> Result<(), ImportError> {
        let Some(index) = node.camera else { return Ok(()) };
        let json = file.get(&format!("{key}.camera"), index)?;
        let name = node.name.as_ref().or(json.name.as_ref());
        let name = name.cloned().unwrap_or_else(|| format!("camera {}", index.value()));
        let (Checked::Valid(Type::Perspective), Some(perspective)) = (&json.type_, &json.perspective) else {
            warnings.about("camera", &name, "is left out: it must be a perspective camera".into());
            self.unread.push(name);
            return Ok(());
        };
        match placed(file, key, index, perspective, world) {
            Ok(camera) => self.list.push((name, camera)),
            Err(e) if self.list.is_empty() => return Err(e),
            Err(e) => warnings.about("camera", &name, format!("is left out: {e}")),
        }
        Ok(())
    }
}

/// A camera at the origin that looks along −z, y up, moved by `world`.
fn placed(
    file: &File,
    key: &str,
    index: Index<gltf_json::Camera>,
    perspective: &gltf_json::camera::Perspective,
    world: &Mat4,
) -> Result<ImportedCamera, ImportError> {
    let vfov = perspective.yfov.to_degrees();
    if !(vfov > 0.0 && vfov < 180.0) {
        let key = format!("cameras[{}].perspective.yfov", index.value());
        let message = format!("must be in (0, π) radians, got {}", perspective.yfov);
        return Err(file.error(key, message));
    }
    let position = world.transform_point3(Vec3::ZERO);
    let (forward, up) = (world.transform_vector3(Vec3::NEG_Z), world.transform_vector3(Vec3::Y));
    let (Some(forward), Some(up)) = (forward.try_normalize(), up.try_normalize()) else {
        return Err(file.error(key, "its camera looks nowhere: the scale must not be 0"));
    };
    let aspect = perspective.aspect_ratio.filter(|a| a.is_finite() && *a > 0.0);
    Ok(ImportedCamera { position, look_at: position + forward, up, vfov, aspect })
}
