//! What a scene file holds, whatever its format.

use glam::Vec3;

use crate::{
    math::Rgb,
    scene::{Mesh, material::MaterialParams},
};

/// The content of a scene file.
#[derive(Debug, Default)]
pub struct Imported {
    /// Triangles; their normals are final.
    pub mesh: Mesh,
    /// Names of what triangles belong to, indexed by [`Mesh::objects`].
    pub parts: Vec<Part>,
    /// Material names and parameters, indexed by [`Mesh::materials`].
    pub materials: Vec<(String, MaterialParams)>,
    /// Facts that a user should hear of.
    pub warnings: Vec<String>,
    /// Camera, where the format has them.
    pub camera: Option<ImportedCamera>,
    /// Lights, where the format has them; their names are unique.
    pub lights: Vec<ImportedLight>,
}

/// What a triangle belongs to. An `o` ends the groups before it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Part {
    /// Name after `o`.
    pub object: Option<String>,
    /// Names after `g`, and the whole of several.
    pub groups: Vec<String>,
}

impl Part {
    /// All names that select the part.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.object.iter().chain(&self.groups).map(String::as_str)
    }
}

/// A perspective camera of a scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportedCamera {
    /// Position, metres.
    pub position: Vec3,
    /// A point it looks at.
    pub look_at: Vec3,
    /// Up vector.
    pub up: Vec3,
    /// Vertical field of view, degrees, in (0, 180).
    pub vfov: f32,
    /// Width over height of the picture it was made for.
    pub aspect: Option<f32>,
}

/// A light of a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedLight {
    /// Unique name of 1 to 200 ASCII characters.
    pub name: String,
    /// Kind.
    pub kind: Punctual,
    /// Position, metres; of no meaning for a directional light.
    pub position: Vec3,
    /// Unit direction of emission; of no meaning for a point.
    pub direction: Vec3,
    /// Linear Rec.709.
    pub color: Rgb,
    /// W·sr⁻¹ (point, spot) or W·m⁻² (directional) per unit of `color`.
    pub intensity: f32,
}

/// Kinds of lights without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Punctual {
    /// Shines alike in all directions.
    Point,
    /// A cone that fades from `inner` to `outer`, half-angles in radians.
    Spot {
        /// Full intensity within.
        inner: f32,
        /// Dark outside.
        outer: f32,
    },
    /// Parallel light from infinitely far.
    Directional,
}
