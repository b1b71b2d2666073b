//! The sidecar `NAME.toml` beside `NAME.obj` or `NAME.glb`: what the scene file cannot say.
//!
//! The structure of the file, as TOML has it. What every key means, with its unit, range and default, is
//! listed in `docs/formats.md`; ranges are checked where the scene is [built](super::builder).

use std::{collections::BTreeMap, fmt, path::Path};

use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, IntoDeserializer, Unexpected, Visitor},
};

use super::{axes::UpAxis, error::ImportError};
use crate::{
    files::toml_file,
    math::{ViewTransform, view::OCIO},
    scene::material::Model,
    variables::{FreeKinds, Wishes},
};

/// Version of the sidecar format.
pub const SCHEMA: u32 = 1;
/// Crease angle where the sidecar does not say, degrees: an octagon's sides (45°) stay flat, those of a
/// cylinder of ten or more are smooth.
pub const DEFAULT_CREASE: f64 = 40.0;
/// Film where neither the sidecar nor the scene file says, pixels.
pub const DEFAULT_FILM: [u32; 2] = [640, 480];

/// Content of a sidecar. Values are checked when the scene is built, not when the file is parsed: they are kept
/// as they were written until then, so that a message can show them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// Version of the format; must be [`SCHEMA`].
    pub schema: u32,
    /// Factor on luminance before display encoding; by default 1, or what the camera's settings make.
    pub exposure: Option<f64>,
    /// View through which pictures are seen; `srgb` by default.
    pub view: Option<ViewSpec>,
    /// Kinds of variables that may be free; all by default, of which the usual ones are.
    pub free: Option<FreeKinds>,
    /// Crease angle, degrees: edges of an OBJ's meshes without normals that bend by no more are smooth.
    #[serde(default = "default_crease")]
    pub crease_angle: f64,
    /// Metres per unit of an OBJ; 1 by default.
    pub scale: Option<f64>,
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
    /// Region in which lamps may be placed.
    #[serde(default)]
    pub movement: MovementSpec,
    /// Lights that stay as they are, are off, or follow others.
    #[serde(default)]
    pub ties: Wishes,
    /// Lights besides those of a glTF and the materials that emit.
    #[serde(default)]
    pub lights: Vec<LightSpec>,
    /// Material overrides by the material's name in the scene file.
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialSpec>,
}

/// `view`: a view transform.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewSpec {
    /// One of the program's own.
    Own(ViewTransform),
    /// One of a configuration of OpenColorIO, by its name; the path is sought from the sidecar's folder.
    Ocio(String),
}

impl<'de> Deserialize<'de> for ViewSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        if name.starts_with(OCIO) {
            return Ok(Self::Ocio(name));
        }
        ViewTransform::deserialize(name.into_deserializer()).map(Self::Own)
    }
}

/// `[camera]`: a perspective camera. What is not given is that of the scene file's camera.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// Name, or number from 1, of the scene file's camera; the first by default.
    pub name: Option<CameraName>,
    /// Position of the pinhole or of the lens's centre, metres.
    pub position: Option<[f64; 3]>,
    /// Point at the centre of the picture, metres.
    pub look_at: Option<[f64; 3]>,
    /// Up vector; +y by default where `look_at` is given.
    pub up: Option<[f64; 3]>,
    /// Vertical field of view, degrees.
    pub vfov: Option<f64>,
    /// Width and height of the film, pixels; [`DEFAULT_FILM`] by default without a camera in the file.
    pub size: Option<[u32; 2]>,
    /// Shift of the film to the right and up, in lengths of its longer side; 0 by default.
    pub shift: Option<[f64; 2]>,
    /// Sensitivity, ISO; with `shutter` and `f_number` in the place of `exposure`.
    pub iso: Option<f64>,
    /// Time of exposure, seconds.
    pub shutter: Option<f64>,
    /// Focal length over the diameter of the aperture; for the exposure alone.
    pub f_number: Option<f64>,
    /// Radius of the lens's aperture, metres; a pinhole by default.
    pub aperture_radius: Option<f64>,
    /// Distance of the plane in focus along the optical axis, metres; that of `look_at` by default, else
    /// that of the main object's middle.
    pub focus_distance: Option<f64>,
}

/// A camera of a scene file, as a user names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CameraName {
    /// Its number, from 1.
    Number(usize),
    /// Its name.
    Name(String),
}

impl<'de> Deserialize<'de> for CameraName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrNumber;

        impl Visitor<'_> for NameOrNumber {
            type Value = CameraName;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a camera, or its number from 1")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<CameraName, E> {
                Ok(CameraName::Name(name.into()))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<CameraName, E> {
                let from_one = usize::try_from(number).ok().filter(|&n| n > 0);
                let wrong = || E::invalid_value(Unexpected::Signed(number), &self);
                from_one.map(CameraName::Number).ok_or_else(wrong)
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<CameraName, E> {
                let wrong = || E::invalid_value(Unexpected::Unsigned(number), &self);
                i64::try_from(number).map_err(|_| wrong()).and_then(|number| self.visit_i64(number))
            }
        }

        deserializer.deserialize_any(NameOrNumber)
    }
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
    pub inside: Option<[[f64; 3]; 2]>,
}

/// `[backdrop]`: a seamless sweep, a floor that bends up into a wall.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackdropSpec {
    /// Reference point on the floor, metres; the origin by default.
    #[serde(default)]
    pub position: [f64; 3],
    /// Rotation about +y, degrees; at 0, the default, the wall faces +z.
    #[serde(default)]
    pub turn: f64,
    /// Horizontal distance from `position` to the front edge of the floor, metres.
    pub front: f64,
    /// Horizontal distance from `position` to the wall, metres.
    pub back: f64,
    /// Horizontal extent across, metres.
    pub width: f64,
    /// Height of the wall, metres.
    pub height: f64,
    /// Radius of the bend, metres; half of the lesser of `back` and `height` by default.
    pub radius: Option<f64>,
    /// Diffuse albedo, linear Rec.709 in [0, 1]; [`BASE_COLOR`](super::backdrop::BASE_COLOR) by default.
    pub base_color: Option<[f64; 3]>,
}

/// `[background]`: the materials whose base colour one factor, the background's value, scales.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackgroundSpec {
    /// Patterns of material names; all that the main object does not use by default.
    pub materials: Option<Vec<String>>,
    /// Least and largest value, dimensionless.
    pub value_range: Option<[f64; 2]>,
}

/// `[movement]`: the region in which lamps may be placed, seen from the middle of the main object. What is not
/// given has the defaults of [`Movement`](crate::variables::Movement).
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovementSpec {
    /// Least and largest angle about the subject, degrees to the right of the camera in the picture.
    pub azimuth: Option<[f64; 2]>,
    /// Least and largest angle above the subject's middle, degrees.
    pub elevation: Option<[f64; 2]>,
    /// Least and largest distance from the subject's middle, metres.
    pub distance: Option<[f64; 2]>,
    /// Least and largest height above the floor, metres.
    pub height: Option<[f64; 2]>,
    /// Distance that a lamp keeps from the subject and from all surfaces before it, metres.
    pub clearance: Option<f64>,
    /// Whether lamps may stand in the picture; `false` by default.
    #[serde(default)]
    pub in_frame: bool,
}

/// `type` of a light. A new one needs a name here and a shape in the scene's builder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
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

/// `[[lights]]`: a light; which keys it takes depends on its type. What is not given is that of the scene
/// file's light of this name, if there is one.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSpec {
    /// Unique name of 1 to 200 printable ASCII characters.
    pub name: String,
    /// Type of the light, `type` in the file; by default what the scene file's light of this name is.
    #[serde(rename = "type")]
    pub kind: Option<LightType>,
    /// Centre, metres.
    pub position: Option<[f64; 3]>,
    /// A point on the emitting side, in front of the centre, metres.
    pub look_at: Option<[f64; 3]>,
    /// Up vector of a rectangle, along which its height runs; +y by default.
    pub up: Option<[f64; 3]>,
    /// Half-extents of a rectangle across and up at size 1, metres.
    pub half_extents: Option<[f64; 2]>,
    /// Radius of a disk, sphere or spot at size 1, metres; a spot of radius 0 is a point.
    pub radius: Option<f64>,
    /// Half-angle of a spot's cone, degrees.
    pub angle: Option<f64>,
    /// Share in [0, 1] of a spot's half-angle over which the cone fades; 0.2 by default.
    pub softness: Option<f64>,
    /// Radiance map of an environment: a picture's path relative to the sidecar; constant by default.
    pub image: Option<String>,
    /// Rotation of an environment about +y, degrees.
    pub rotation: Option<f64>,
    /// Name of the material whose triangles are a mesh light.
    pub material: Option<String>,
    /// Factor on the extents; 1 by default.
    pub size: Option<f64>,
    /// Least and largest size; found from the geometry by default.
    pub size_range: Option<[f64; 2]>,
    /// Radiance per unit of `color`, W·m⁻²·sr⁻¹; of a point light its intensity, W·sr⁻¹, of a distant
    /// one its irradiance, W·m⁻². By default 1, of a mesh what its material emits.
    pub radiance: Option<f64>,
    /// Largest radiance; found from the picture by default.
    pub radiance_max: Option<f64>,
    /// Colour, linear Rec.709, which is scaled to luminance 1; white by default.
    pub color: Option<[f64; 3]>,
    /// Temperature of the colour, kelvin, in the place of `color`.
    pub color_temperature: Option<f64>,
    /// Distance Duv of the colour from the Planckian locus, green above it; 0 by default.
    pub tint: Option<f64>,
    /// Least and largest temperature where it is free, kelvin.
    pub color_temperature_range: Option<[f64; 2]>,
    /// Whether the camera sees the light itself; `true` by default.
    #[serde(default = "yes")]
    pub camera_visible: bool,
    /// Whether the light has a black body that blocks rays; `false` by default.
    #[serde(default)]
    pub occludes: bool,
    /// Kinds of variables of this light that may be free, among those of the whole file.
    pub free: Option<FreeKinds>,
    /// Whether the light may be moved, where lights are; `true` by default.
    #[serde(default = "yes")]
    pub movable: bool,
}

impl LightSpec {
    /// A light of which nothing but the name is given.
    #[must_use]
    pub fn named(name: &str) -> Self {
        Self {
            name: name.into(),
            kind: None,
            position: None,
            look_at: None,
            up: None,
            half_extents: None,
            radius: None,
            angle: None,
            softness: None,
            image: None,
            rotation: None,
            material: None,
            size: None,
            size_range: None,
            radiance: None,
            radiance_max: None,
            color: None,
            color_temperature: None,
            tint: None,
            color_temperature_range: None,
            camera_visible: yes(),
            occludes: false,
            free: None,
            movable: yes(),
        }
    }
}

/// `[materials.NAME]`: overrides of a material of the scene file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    /// Scattering model.
    pub model: Option<Model>,
    /// Albedo, or reflectance of a metal, linear Rec.709 in [0, 1].
    pub base_color: Option<[f64; 3]>,
    /// Perceptual roughness in [0, 1]; the GGX slope is its square.
    pub roughness: Option<f64>,
    /// Index of refraction in (1, 4].
    pub ior: Option<f64>,
    /// Factor on what each face of a body of glass reflects, linear Rec.709 in [0, 1].
    pub reflected: Option<[f64; 3]>,
    /// Factor on what each face of a body of glass lets pass.
    pub transmitted: Option<[f64; 3]>,
    /// Factor on a metal's reflectance at 82 degrees, linear Rec.709 in [0, 1].
    pub edge_tint: Option<[f64; 3]>,
    /// Weight in [0, 1] of a metal of the same base colour and roughness.
    pub metallic: Option<f64>,
    /// Weight in [0, 1] of a plastic's coat.
    pub specular: Option<f64>,
    /// Probability in [0, 1] that a ray does not pass straight through.
    pub opacity: Option<f64>,
    /// Emitted radiance, linear Rec.709, W·m⁻²·sr⁻¹.
    pub emission: Option<[f64; 3]>,
}

fn yes() -> bool {
    true
}
fn default_crease() -> f64 {
    DEFAULT_CREASE
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
