//! The sidecar `NAME.toml` beside `NAME.obj` or `NAME.glb`: what the scene file cannot say.
//!
//! The structure of the file, as TOML has it. What every key means, with its unit, range and default, is
//! listed in `docs/formats.md`; ranges are checked where the scene is [built](super::builder).

use std::{collections::BTreeMap, path::Path};

use serde::Deserialize;

use super::error::ImportError;
use crate::{scene::material::Model, variables::FreeKinds};

/// Version of the sidecar format.
pub const SCHEMA: u32 = 1;
/// Largest smooth bend of meshes without normals where the sidecar does not say, degrees.
pub const DEFAULT_CREASE: f32 = 40.0;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// Must be [`SCHEMA`].
    pub schema: u32,
    /// Factor on luminance before display encoding.
    #[serde(default = "one")]
    pub exposure: f32,
    /// What may vary.
    #[serde(default)]
    pub free: FreeKinds,
    /// Largest bend of an edge that is still smooth, degrees.
    #[serde(default = "default_crease")]
    pub crease_angle: f32,
    /// Metres per unit of an OBJ.
    pub scale: Option<f32>,
    /// Which way is up in an OBJ.
    pub up_axis: Option<UpAxis>,
    /// Camera; a glTF may bring its own.
    pub camera: Option<CameraSpec>,
    /// Main object; absent it is all of a glTF.
    pub main_object: Option<Selection>,
    /// Seamless sweep behind and below the subject.
    pub backdrop: Option<BackdropSpec>,
    /// Background materials and value.
    #[serde(default)]
    pub background: BackgroundSpec,
    /// Lights.
    #[serde(default)]
    pub lights: Vec<LightSpec>,
    /// Material overrides by name.
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialSpec>,
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +y, as OBJ has it.
    #[default]
    Y,
    /// +z, as CAD programs have it; +y is then to the back.
    Z,
}

/// `[camera]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// Metres.
    pub position: [f32; 3],
    /// Metres.
    pub look_at: [f32; 3],
    /// Up vector.
    #[serde(default = "up")]
    pub up: [f32; 3],
    /// Degrees.
    pub vfov: f32,
    /// Pixels.
    #[serde(default = "default_size")]
    pub size: [u32; 2],
    /// Radius of the lens, metres.
    pub aperture_radius: Option<f32>,
    /// Distance of the plane in focus, metres.
    pub focus_distance: Option<f32>,
}

/// Names of objects and materials.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// OBJ object or group names, glTF node or mesh names.
    #[serde(default)]
    pub objects: Vec<String>,
    /// Material names.
    #[serde(default)]
    pub materials: Vec<String>,
    /// Least and largest corner of a box, metres: all triangles within.
    pub inside: Option<[[f32; 3]; 2]>,
}

/// `[backdrop]`: a floor that bends up into a wall.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackdropSpec {
    /// A point of the floor, metres.
    #[serde(default)]
    pub position: [f32; 3],
    /// Degrees about +y; at 0 the wall faces +z.
    #[serde(default)]
    pub turn: f32,
    /// From the position to the floor's front edge, metres.
    pub front: f32,
    /// From the position to the wall, metres.
    pub back: f32,
    /// Metres.
    pub width: f32,
    /// Of the wall, metres.
    pub height: f32,
    /// Of the cove, metres; absent it is half of the lesser of `back` and `height`.
    pub radius: Option<f32>,
    /// Linear Rec.709.
    #[serde(default = "light_grey")]
    pub base_color: [f32; 3],
}

/// `[background]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackgroundSpec {
    /// Material names; default all that the main object does not use.
    pub materials: Option<Vec<String>>,
    /// Bounds of the value factor.
    pub value_range: Option<[f32; 2]>,
}

/// Kind of a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightType {
    /// One-sided rectangle.
    Rectangle,
    /// One-sided disk.
    Disk,
    /// Sphere.
    Sphere,
    /// Disk with a cone.
    Spot,
    /// Point.
    Point,
    /// One direction.
    Distant,
    /// All directions from infinity.
    Environment,
    /// Triangles of a material.
    Mesh,
}

/// `[[lights]]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSpec {
    /// Unique name.
    pub name: String,
    /// Kind.
    #[serde(rename = "type")]
    pub kind: LightType,
    /// Centre, metres.
    pub position: Option<[f32; 3]>,
    /// A point on the emitting side.
    pub look_at: Option<[f32; 3]>,
    /// Which way a rectangle's height runs; absent it is y.
    pub up: Option<[f32; 3]>,
    /// Half-extents at size 1, metres.
    pub half_extents: Option<[f32; 2]>,
    /// Radius at size 1, metres.
    pub radius: Option<f32>,
    /// Half-angle of a spot, degrees.
    pub angle: Option<f32>,
    /// Share of the angle that is soft edge.
    pub softness: Option<f32>,
    /// Picture of the surroundings, beside the sidecar.
    pub image: Option<String>,
    /// Turn of the surroundings about +y, degrees.
    pub rotation: Option<f32>,
    /// Material whose triangles emit.
    pub material: Option<String>,
    /// Size factor.
    pub size: Option<f32>,
    /// Bounds of the size factor.
    pub size_range: Option<[f32; 2]>,
    /// Radiance per unit of colour.
    pub radiance: Option<f32>,
    /// Upper bound of the radiance.
    pub radiance_max: Option<f32>,
    /// Linear Rec.709.
    pub color: Option<[f32; 3]>,
    /// Whether the camera sees the light itself.
    #[serde(default = "yes")]
    pub camera_visible: bool,
    /// Whether its body stops light.
    #[serde(default)]
    pub occludes: bool,
    /// What may vary.
    pub free: Option<FreeKinds>,
}

/// `[materials.NAME]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    /// Scattering model.
    pub model: Option<Model>,
    /// Linear Rec.709.
    pub base_color: Option<[f32; 3]>,
    /// Perceptual roughness.
    pub roughness: Option<f32>,
    /// IOR.
    pub ior: Option<f32>,
    /// Share of metal.
    pub metallic: Option<f32>,
    /// Strength of a plastic's coat.
    pub specular: Option<f32>,
    /// Opacity.
    pub opacity: Option<f32>,
    /// Radiance emitted, W·m⁻²·sr⁻¹.
    pub emission: Option<[f32; 3]>,
}

fn one() -> f32 {
    1.0
}
fn yes() -> bool {
    true
}
fn up() -> [f32; 3] {
    [0.0, 1.0, 0.0]
}
fn default_size() -> [u32; 2] {
    [640, 480]
}
fn default_crease() -> f32 {
    DEFAULT_CREASE
}
fn light_grey() -> [f32; 3] {
    [0.6; 3]
}

impl Sidecar {
    /// Parses and checks the version.
    ///
    /// # Errors
    /// With file, line and the nearest known key.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ImportError> {
        let sidecar: Self = crate::files::toml_file::parse(path, text)?;
        if sidecar.schema != SCHEMA {
            return Err(ImportError::Key {
                path: path.to_path_buf(),
                key: "schema".into(),
                message: format!("this program reads version {SCHEMA}, the file says {}", sidecar.schema),
            });
        }
        Ok(sidecar)
    }
}
