//! The sidecar `NAME.toml` beside `NAME.obj` or `NAME.glb`: what the scene file cannot say.
//!
//! ```toml
//! schema = 1                        # version of this format
//! exposure = 1.0                    # factor on luminance before sRGB encoding
//! free = ["radiance", "size", "background"]   # what may vary (default: all)
//! crease_angle = 40.0               # degrees; for an OBJ's meshes without normals
//! scale = 0.01                      # metres per unit of an OBJ (default: 1)
//! up_axis = "z"                     # which way is up in an OBJ: y (default) or z
//!
//! [camera]                          # default: the camera of a glTF
//! position = [0.0, 0.5, 1.5]        # metres
//! look_at = [0.0, 0.1, 0.0]
//! up = [0.0, 1.0, 0.0]
//! vfov = 35.0                       # vertical field of view, degrees
//! size = [640, 480]                 # film, pixels
//! aperture_radius = 0.02            # metres; a thin lens (default: a pinhole)
//! focus_distance = 1.6              # of the plane in focus, metres (default: that of look_at)
//!
//! [main_object]                     # default: all of a glTF
//! objects = ["apple", "basket_*"]   # OBJ `o`/`g`, glTF node or mesh names; a trailing * matches any
//!                                   # ending, a lone * all of the file
//! materials = []                    # and/or names of materials
//! inside = [[-0.2, 0.0, -0.2], [0.2, 0.4, 0.2]]   # and/or all triangles in a box, metres
//!
//! [backdrop]                        # a seamless sweep that is added: floor, cove and wall
//! position = [0.0, 0.0, 0.0]        # a point of the floor, below the subject
//! turn = 30.0                       # degrees about +y; at 0 the wall faces +z
//! front = 3.0                       # from there to the floor's front edge, metres
//! back = 2.0                        # and to the wall
//! width = 6.0
//! height = 4.0                      # of the wall
//! radius = 1.0                      # of the cove (default: half of the lesser of back and height)
//! base_color = [0.6, 0.6, 0.6]      # [materials.backdrop] takes the rest
//!
//! [background]
//! materials = ["wall", "table"]     # default: all that the main object does not use
//! value_range = [0.05, 1.1]         # bounds of the factor on their base colour
//!
//! [[lights]]                        # besides those of a glTF
//! name = "key"                      # one that a light of the glTF has replaces it
//! type = "rectangle"                # rectangle | disk | sphere | spot | point
//!                                   # | distant | environment | mesh
//! position = [1.0, 2.0, 1.0]        # centre
//! look_at = [0.0, 0.0, 0.0]         # rectangle, disk, spot, distant: the side that emits
//! up = [0.0, 1.0, 0.0]              # rectangle: which way its height runs
//! half_extents = [0.4, 0.3]         # rectangle, metres at size 1
//! radius = 0.1                      # disk, sphere, spot, metres at size 1; spot: 0 is a point
//! angle = 30.0                      # spot: half-angle of the cone, degrees
//! softness = 0.2                    # spot: share of the angle that is soft edge
//! image = "sky.exr"                 # environment: equirectangular, y up (default: constant)
//! rotation = 90.0                   # environment: degrees about +y
//! material = "bulb"                 # mesh: the material whose triangles emit
//! size = 1.0                        # multiplies the extents
//! size_range = [0.1, 2.0]           # default: found from the geometry
//! radiance = 10.0                   # W·m⁻²·sr⁻¹ per unit of `color`; point, and spot of
//!                                   # radius 0: W·sr⁻¹; distant: irradiance, W·m⁻²
//! radiance_max = 500.0              # default: found from the picture
//! color = [1.0, 0.9, 0.8]           # linear Rec.709, scaled to luminance 1
//! camera_visible = true
//! occludes = false                  # rectangle, disk, sphere: a black body that stops light;
//!                                   # its size is then not free
//! free = ["radiance", "size"]       # default: all that the light has
//!
//! # A material that emits (MTL `Ke`, glTF `emissiveFactor`, `emission` below) is a
//! # light of its own, named after it, with a free radiance; a light of type `mesh`
//! # replaces that one.
//!
//! [materials.table]                 # overrides of the file's material `table`
//! model = "plastic"                 # diffuse | conductor | dielectric | plastic
//! base_color = [0.3, 0.2, 0.1]
//! roughness = 0.2                   # GGX slope is its square; 0 is smooth
//! ior = 1.5
//! metallic = 0.0                    # share of metal of the same colour and roughness
//! specular = 1.0                    # plastic: strength of the coat
//! opacity = 1.0                     # share of rays that do not pass straight through
//! emission = [0.0, 0.0, 0.0]        # radiance, W·m⁻²·sr⁻¹
//! ```
//!
//! A number that is given takes the place of the material's number; an image
//! still multiplies it. A `model` that is given is pure: the shares of metal of
//! the MTL, and for a `dielectric` its opacity, are left out.

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
