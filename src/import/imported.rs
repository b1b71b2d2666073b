//! Content of a scene file, common to all formats.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::{
    light::Cone,
    math::Rgb,
    scene::{Mesh, material::MaterialParams},
};

/// Longest name of a light, bytes. EXR allows a part's name 255; `light.` and a number come on top.
pub const MAX_LIGHT_NAME: usize = 200;
/// Longest name of a light that is named after something else, characters: leaves 20 of
/// [`MAX_LIGHT_NAME`] for the number that makes it unique.
const MAX_DERIVED_NAME: usize = 180;

/// Content of a scene file, before the sidecar's overrides.
#[derive(Debug, Default)]
pub struct Imported {
    /// Triangles in the file's units, relative to `origin`, with the normals that are rendered.
    pub mesh: Mesh,
    /// Place of the mesh's origin in the file's coordinates, see [`origin`](super::origin): zero in a scene
    /// near the origin. Cameras and lights are relative to it too.
    pub origin: DVec3,
    /// Objects and groups that triangles belong to, indexed by [`Mesh::objects`].
    pub parts: Vec<Part>,
    /// Material names and parameters, indexed by [`Mesh::materials`].
    pub materials: Vec<(String, MaterialParams)>,
    /// Names of the materials whose shader the exporter dropped: white diffuse ones, unless the sidecar knows
    /// better.
    pub lost_shaders: Vec<String>,
    /// What was left out or replaced while reading, one line each.
    pub warnings: Vec<String>,
    /// Names and perspective cameras; empty in a format without cameras.
    pub cameras: Vec<(String, ImportedCamera)>,
    /// The camera that is used, the first unless another is chosen; `None` where there is none.
    pub camera: Option<ImportedCamera>,
    /// Names of the cameras that are left out, since they are not perspective ones.
    pub unread_cameras: Vec<String>,
    /// Punctual lights with unique names; empty in a format without lights.
    pub lights: Vec<ImportedLight>,
    /// Nodes without content that may have been lamps.
    pub lost_lamps: Vec<LostLamp>,
    /// Whether Blender's exporter wrote the file.
    pub is_of_blender: bool,
}

/// A node without content, which a lamp that the exporter dropped may have left.
#[derive(Clone, Debug)]
pub struct LostLamp {
    /// Name of the node.
    pub name: String,
    /// Place of the node, in the file's coordinates.
    pub position: DVec3,
    /// A point ahead of it, to which a lamp would shine.
    pub look_at: DVec3,
}

/// Object and groups that a triangle belongs to.
///
/// In an OBJ, an `o` ends the groups before it. In a glTF, the object is the node, the groups are
/// its ancestors and its mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Part {
    /// Name of the object (OBJ `o`, glTF node).
    pub object: Option<String>,
    /// Names of the groups; of an OBJ's `g` with several names also the whole line.
    pub groups: Vec<String>,
}

impl Part {
    /// All names by which the part can be selected.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.object.iter().chain(&self.groups).map(String::as_str)
    }
}

/// A perspective camera of a scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportedCamera {
    /// Position of the pinhole, metres.
    pub position: Vec3,
    /// A point on the optical axis in front of the camera, metres.
    pub look_at: Vec3,
    /// Unit up vector.
    pub up: Vec3,
    /// Vertical field of view, degrees, in (0, 180).
    pub vfov: f32,
    /// Width over height of the picture; `None` if the file leaves it open.
    pub aspect: Option<f32>,
}

/// A punctual light of a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedLight {
    /// Unique name of 1 to [`MAX_LIGHT_NAME`] printable ASCII characters.
    pub name: String,
    /// Angular distribution.
    pub kind: Punctual,
    /// Position, metres; unused by a directional light.
    pub position: Vec3,
    /// Unit direction of emission; unused by a point light.
    pub direction: Vec3,
    /// Colour, linear Rec.709.
    pub color: Rgb,
    /// Radiant intensity, W·sr⁻¹ (point, spot), or irradiance, W·m⁻² (directional), per unit of `color`.
    pub intensity: f32,
}

/// Types of lights without extent, as in `KHR_lights_punctual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Punctual {
    /// Isotropic point light.
    Point,
    /// Point light that emits into a cone.
    Spot(Cone),
    /// Parallel light from infinity.
    Directional,
}

/// Names in use.
#[derive(Debug, Default)]
pub struct UniqueNames(HashMap<String, u32>);

impl UniqueNames {
    /// `name`, or with `_2` and so on behind it when it is in use; it is from now on.
    pub fn take(&mut self, name: String) -> String {
        let Some(&(mut n)) = self.0.get(&name) else {
            self.0.insert(name.clone(), 2);
            return name;
        };
        loop {
            let numbered = format!("{name}_{n}");
            n += 1;
            if !self.0.contains_key(&numbered) {
                // The numbers below are taken: names that are all alike would else be counted anew.
                self.0.insert(name, n);
                self.0.insert(numbered.clone(), 2);
                return numbered;
            }
        }
    }
}

/// `name` cut to the length of a derived light name, with `_` for what is not printable ASCII: names
/// of lights become those of EXR parts.
pub fn printable_name(name: &str) -> String {
    let printable = |c: char| if c == ' ' || c.is_ascii_graphic() { c } else { '_' };
    name.chars().take(MAX_DERIVED_NAME).map(printable).collect()
}
