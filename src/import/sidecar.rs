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

use super::{axes::UpAxis, backdrop, error::ImportError};
use crate::{files::toml_file, scene::material::Model, variables::FreeKinds};

/// Version of the sidecar format.
pub const SCHEMA: u32 = 1;
/// Crease angle where the sidecar does not say, degrees: an octagon's sides (45°) stay flat, those of a
/// cylinder of ten or more are smooth.
pub const DEFAULT_CREASE: f32 = 40.0;
/// Film where neither the sidecar nor the scene file says, pixels.
pub const DEFAULT_FILM: [u32; 2] = [640, 480];

/// Content of a sidecar. Values are checked when the scene is built, not when the file is parsed.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// Version of the format; must be [`SCHEMA`].
    pub schema: u32,
    /// Factor on luminance before display encoding.
    #[serde(default = "one")]
    pub exposure: f32,
    /// Kinds of variables that may be free; all by default.
    #[serde(default)]
    pub free: FreeKinds,
    /// Crease angle, degrees: edges of an OBJ's meshes without normals that bend by no more are smooth.
    #[serde(default = "default_crease")]
    pub crease_angle: f32,
    /// Metres per unit of an OBJ; 1 by default.
    pub scale: Option<f32>,
    /// Axis of an OBJ that points up; +y by default.
    pub up_axis: Option<UpAxis>,
    /// Camera; that of a glTF by default.
    pub camera: Option<CameraSpec>,
    /// Main object; everything in a glTF by default.
    pub main_object: Option<Selection>,
    /// Seamless sweep that is added behind and below the subject; none by default.
    pub backdrop: Option<BackdropSpec>,
    /// Materials that are the background, and bounds of its value.
    #[serde(default)]
    pub background: BackgroundSpec,
    /// Lights besides those of a glTF and the materials that emit.
    #[serde(default)]
    pub lights: Vec<LightSpec>,
    /// Material overrides by the material's name in the scene file.
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialSpec>,
}

/// `[camera]`: a perspective camera.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// Position of the pinhole or of the lens's centre, metres.
    pub position: [f32; 3],
    /// Point at the centre of the picture, metres.
    pub look_at: [f32; 3],
    /// Up vector; +y by default.
    #[serde(default = "up")]
    pub up: [f32; 3],
    /// Vertical field of view, degrees.
    pub vfov: f32,
    /// Width and height of the film, pixels; [`DEFAULT_FILM`] by default.
    #[serde(default = "default_film")]
    pub size: [u32; 2],
    /// Radius of the lens's aperture, metres; a pinhole by default.
    pub aperture_radius: Option<f32>,
    /// Distance of the plane in focus along the optical axis, metres; that of `look_at` by default.
    pub focus_distance: Option<f32>,
}

/// Triangles selected by object, material or place; any one of these selects.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// Patterns of OBJ object or group names, or of glTF node or mesh names.
    #[serde(default)]
    pub objects: Vec<String>,
    /// Patterns of material names.
    #[serde(default)]
    pub materials: Vec<String>,
    /// Least and largest corner of a box, metres, that selects the triangles wholly inside.
    pub inside: Option<[[f32; 3]; 2]>,
}

/// `[backdrop]`: a seamless sweep, a floor that bends up into a wall.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackdropSpec {
    /// Reference point on the floor, metres; the origin by default.
    #[serde(default)]
    pub position: [f32; 3],
    /// Rotation about +y, degrees; at 0, the default, the wall faces +z.
    #[serde(default)]
    pub turn: f32,
    /// Horizontal distance from `position` to the front edge of the floor, metres.
    pub front: f32,
    /// Horizontal distance from `position` to the wall, metres.
    pub back: f32,
    /// Horizontal extent across, metres.
    pub width: f32,
    /// Height of the wall, metres.
    pub height: f32,
    /// Radius of the bend, metres; half of the lesser of `back` and `height` by default.
    pub radius: Option<f32>,
    /// Diffuse albedo, linear Rec.709 in [0, 1]; [`backdrop::BASE_COLOR`] by default.
    #[serde(default = "backdrop_color")]
    pub base_color: [f32; 3],
}

/// `[background]`: the materials whose base colour one factor, the background's value, scales.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackgroundSpec {
    /// Patterns of material names; all that the main object does not use by default.
    pub materials: Option<Vec<String>>,
    /// Least and largest value, dimensionless.
    pub value_range: Option<[f32; 2]>,
}

/// `type` of a light. A new one needs a name here and a shape in the scene's builder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightType {
    /// Rectangle that emits from one side.
    Rectangle,
    /// Disk that emits from one side.
    Disk,
    /// Sphere that emits outward.
    Sphere,
    /// Disk, or point, that emits into a cone.
    Spot,
    /// Isotropic point light.
    Point,
    /// Parallel light from infinity.
    Distant,
    /// Light from all directions of infinity, constant or by a radiance map.
    Environment,
    /// Triangles of a material.
    Mesh,
}

impl LightType {
    /// The type's name in the sidecar.
    #[must_use]
    pub fn keyword(self) -> &'static str {
        match self {
            Self::Rectangle => "rectangle",
            Self::Disk => "disk",
            Self::Sphere => "sphere",
            Self::Spot => "spot",
            Self::Point => "point",
            Self::Distant => "distant",
            Self::Environment => "environment",
            Self::Mesh => "mesh",
        }
    }
}

/// `[[lights]]`: a light; which keys it takes depends on its type.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSpec {
    /// Unique name of 1 to 200 printable ASCII characters.
    pub name: String,
    /// Type of the light, `type` in the file.
    #[serde(rename = "type")]
    pub kind: LightType,
    /// Centre, metres.
    pub position: Option<[f32; 3]>,
    /// A point on the emitting side, in front of the centre, metres.
    pub look_at: Option<[f32; 3]>,
    /// Up vector of a rectangle, along which its height runs; +y by default.
    pub up: Option<[f32; 3]>,
    /// Half-extents of a rectangle across and up at size 1, metres.
    pub half_extents: Option<[f32; 2]>,
    /// Radius of a disk, sphere or spot at size 1, metres; a spot of radius 0 is a point.
    pub radius: Option<f32>,
    /// Half-angle of a spot's cone, degrees.
    pub angle: Option<f32>,
    /// Share in [0, 1] of a spot's half-angle over which the cone fades; 0.2 by default.
    pub softness: Option<f32>,
    /// Radiance map of an environment: a picture's path relative to the sidecar; constant by default.
    pub image: Option<String>,
    /// Rotation of an environment about +y, degrees.
    pub rotation: Option<f32>,
    /// Name of the material whose triangles are a mesh light.
    pub material: Option<String>,
    /// Factor on the extents; 1 by default.
    pub size: Option<f32>,
    /// Least and largest size; found from the geometry by default.
    pub size_range: Option<[f32; 2]>,
    /// Radiance per unit of `color`, W·m⁻²·sr⁻¹; of a point light its intensity, W·sr⁻¹, of a distant
    /// one its irradiance, W·m⁻². By default 1, of a mesh what its material emits.
    pub radiance: Option<f32>,
    /// Largest radiance; found from the picture by default.
    pub radiance_max: Option<f32>,
    /// Colour, linear Rec.709, which is scaled to luminance 1; white by default.
    pub color: Option<[f32; 3]>,
    /// Whether the camera sees the light itself; `true` by default.
    #[serde(default = "yes")]
    pub camera_visible: bool,
    /// Whether the light has a black body that blocks rays; `false` by default.
    #[serde(default)]
    pub occludes: bool,
    /// Kinds of variables of this light that may be free, among those of the whole file.
    pub free: Option<FreeKinds>,
}

/// `[materials.NAME]`: overrides of a material of the scene file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    /// Scattering model.
    pub model: Option<Model>,
    /// Albedo, or reflectance of a metal, linear Rec.709 in [0, 1].
    pub base_color: Option<[f32; 3]>,
    /// Perceptual roughness in [0, 1]; the GGX slope is its square.
    pub roughness: Option<f32>,
    /// Index of refraction in (1, 4].
    pub ior: Option<f32>,
    /// Weight in [0, 1] of a metal of the same base colour and roughness.
    pub metallic: Option<f32>,
    /// Weight in [0, 1] of a plastic's coat.
    pub specular: Option<f32>,
    /// Probability in [0, 1] that a ray does not pass straight through.
    pub opacity: Option<f32>,
    /// Emitted radiance, linear Rec.709, W·m⁻²·sr⁻¹.
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
fn default_film() -> [u32; 2] {
    DEFAULT_FILM
}
fn default_crease() -> f32 {
    DEFAULT_CREASE
}
fn backdrop_color() -> [f32; 3] {
    backdrop::BASE_COLOR
}

impl Sidecar {
    /// Parses the text of a sidecar and checks its version; `path` is for messages.
    ///
    /// # Errors
    /// When the text is not TOML, or a key is unknown, missing or of another type. The error names file
    /// and line, and the nearest known key.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ImportError> {
        let sidecar: Self = toml_file::parse(path, text)?;
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
