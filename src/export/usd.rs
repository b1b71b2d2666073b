//! UsdLux lights as `.usda`, and with them the meshes of the scene.
//!
//! Lights are not normalised: an intensity of 1 is a radiance of 1, in W·m⁻²·sr⁻¹, as Blender and most
//! programs write it, and with [`ExportOptions::photometric`](super::ExportOptions) in nits, as the schema
//! says. Lengths are metres, y is up.
//!
//! | ours | UsdLux | |
//! | --- | --- | --- |
//! | rectangle | `RectLight`, width 2as, height 2bs | exact |
//! | disk | `DiskLight` of radius rs | exact |
//! | sphere | `SphereLight` of radius rs | exact |
//! | point | `SphereLight` of radius 1 mm, intensity I/(π·10⁻⁶) | exact; not `treatAsPoint`, of which programs differ whether the radius counts |
//! | spot | `SphereLight` with `ShapingAPI`, its intensity times the mean cosine over the cone of a disk | the edge: smooth in the angle there, in its cosine here; a sphere: a warning |
//! | distant | `DistantLight`, `normalize` 1, intensity E, angle 0 | exact: without `normalize` its intensity is in nits |
//! | environment | `DomeLight`, its picture as EXR | exact |
//! | emissive mesh | `emissiveColor` of its material, with the meshes only | exact, from both sides in some programs |
//! | colour | `color`, of luminance 1; `enableColorTemperature` 0 | exact |
//! | background's value, exposure, view | `lightopt` in the data of the layer; the meshes' colours include the value | |
//! | camera | `Camera`: aperture 36 mm, offsets, `fStop` and `focusDistance` with a lens | exact |
//! | materials | `UsdPreviewSurface`: colours, roughness, metallic, IOR, opacity; images as linear EXR | nearly |

mod surfaces;

use std::{
    f64::consts::PI,
    fmt::{Display, Write as _},
    io::Write as _,
    path::{Path, PathBuf},
};

use super::{
    ExportError, ExportJob, Exported, Exporter, LitLight, Offer,
    directory::Directory,
    job::Pose,
    sheet::{angle_of, background_names, cone_of, matrix_rows, mean_cosine, place, stem, surroundings},
};
use crate::{
    light::{Cone, LUMENS_PER_WATT, Outline, Planar, Shape},
    math::Rgb,
};

/// Radius of the sphere that stands for a point, metres: far below any distance to a surface.
const POINT_RADIUS: f64 = 1e-3;
/// Width of the film in USD, tenths of a unit of the scene, which is a metre: 36 mm.
const APERTURE: f64 = 0.36;

/// Lights in the Universal Scene Description.
#[derive(Clone, Copy, Debug)]
pub struct Usd;

impl Exporter for Usd {
    fn name(&self) -> &'static str {
        "usd"
    }

    fn help(&self) -> &'static str {
        "Universal Scene Description: Houdini, Maya, Omniverse, Blender and others"
    }

    fn files(&self) -> &'static str {
        "a .usda layer with UsdLux lights and the camera, and the picture of the surroundings"
    }

    fn entry_point(&self, out: &Path) -> PathBuf {
        out.to_path_buf()
    }

    fn offers(&self, option: Offer) -> bool {
        matches!(option, Offer::Photometric | Offer::Whole)
    }

    fn write(&self, job: &ExportJob, out: &Path) -> Result<Exported, ExportError> {
        let (directory, name) = place(out, "usda", "USD")?;
        let mut layer = Layer {
            job,
            directory,
            stem: stem(&name).to_owned(),
            text: String::new(),
            names: Vec::new(),
            warnings: Vec::new(),
        };
        layer.camera();
        for l in job.lights().filter(|l| !l.is_dark()) {
            layer.light(&l)?;
        }
        if job.options.whole.is_some() {
            layer.surfaces()?;
        }
        let text = layer.finished();
        layer.directory.write(&name, |out| out.write_all(text.as_bytes()))?;
        Ok(layer.directory.finish(layer.warnings))
    }
}

/// A layer under way.
struct Layer<'a> {
    job: &'a ExportJob<'a>,
    directory: Directory,
    /// Name of the layer's file without ending, which begins the names of others.
    stem: String,
    /// The prims below the root.
    text: String,
    /// Names of prims that are taken.
    names: Vec<String>,
    warnings: Vec<String>,
}

/// Attributes of a prim, one a line.
#[derive(Default)]
struct Attributes(String);

impl Attributes {
    fn put(mut self, kind: &str, name: &str, value: impl Display) -> Self {
        let _ = writeln!(self.0, "        {kind} {name} = {value}");
        self
    }

    /// What every light has: `intensity` per unit of `color`.
    fn of_light(intensity: f64, color: Rgb, normalize: bool) -> Self {
        Self::default()
            .put("color3f", "inputs:color", triple(color))
            .put("float", "inputs:intensity", float(intensity))
            .put("float", "inputs:exposure", 0)
            .put("bool", "inputs:normalize", u8::from(normalize))
            .put("bool", "inputs:enableColorTemperature", 0)
    }

    /// A light with a radius, metres.
    fn ball(l: &LitLight, intensity: f64, radius: f64) -> Self {
        Self::of_light(intensity, l.color, false).put("float", "inputs:radius", float(radius))
    }

    fn pose(self, pose: &Pose) -> Self {
        // Rows of USD's matrices are the columns of others.
        let m = matrix_rows(pose);
        let row = |j: usize| format!("({}, {}, {}, {})", m[0][j], m[1][j], m[2][j], m[3][j]);
        let rows = format!("( {}, {}, {}, {} )", row(0), row(1), row(2), row(3));
        self.put("matrix4d", "xformOp:transform", rows).put(
            "uniform token[]",
            "xformOpOrder",
            "[\"xformOp:transform\"]",
        )
    }

    fn cone(self, cone: Cone) -> Self {
        let angle = angle_of(cone);
        let inner = f64::from(cone.cos_inner).clamp(0.0, 1.0).acos();
        let softness = if angle > 0.0 { (1.0 - inner / angle).clamp(0.0, 1.0) } else { 0.0 };
        self.put("float", "inputs:shaping:cone:angle", float(angle.to_degrees())).put(
            "float",
            "inputs:shaping:cone:softness",
            float(softness),
        )
    }
}

impl Layer<'_> {
    /// A name for a prim that is not taken.
    fn name(&mut self, wanted: &str) -> String {
        let plain = identifier(wanted);
        let mut name = plain.clone();
        let mut n = 1;
        while self.names.contains(&name) {
            n += 1;
            name = format!("{plain}_{n}");
        }
        self.names.push(name.clone());
        name
    }

    /// Adds a prim with its metadata and attributes.
    fn prim(&mut self, kind: &str, name: &str, metadata: &str, attributes: &Attributes) {
        let _ = write!(self.text, "\n    def {kind} \"{name}\"{metadata}\n    {{\n{}    }}\n", attributes.0);
    }

    /// The number that is written for a radiance of 1.
    fn unit(&self) -> f64 {
        if self.job.options.photometric { f64::from(LUMENS_PER_WATT) } else { 1.0 }
    }

    /// Adds a light other than an emissive mesh, which is a matter of its material.
    fn light(&mut self, l: &LitLight) -> Result<(), ExportError> {
        if matches!(l.light.shape, Shape::Mesh(_)) {
            if self.job.options.whole.is_none() {
                self.warnings.push(format!(
                    "light `{}`: a material that emits; give it an emission of {} times its colour",
                    l.light.name, l.radiance
                ));
            }
            return Ok(());
        }
        let name = self.name(&l.light.name);
        if l.light.occludes {
            let light = &l.light.name;
            self.warnings
                .push(format!("light `{light}`: lights of USD do not say that they block; here it does"));
        }
        let intensity = f64::from(l.radiance) * self.unit();
        let (kind, shaped, attributes) = match &l.light.shape {
            Shape::Planar(p) => self.planar(l, p, intensity),
            Shape::Sphere(sphere) => {
                let r = f64::from(sphere.radius) * f64::from(l.size);
                ("SphereLight", false, Attributes::ball(l, intensity, r))
            }
            Shape::Point(p) => {
                let intensity = intensity / (PI * POINT_RADIUS * POINT_RADIUS);
                let point = Attributes::ball(l, intensity, POINT_RADIUS);
                match p.cone {
                    None => ("SphereLight", false, point),
                    Some((_, cone)) => ("SphereLight", true, point.cone(cone)),
                }
            }
            Shape::Distant(_) => {
                let sun = Attributes::of_light(intensity, l.color, true).put("float", "inputs:angle", 0);
                ("DistantLight", false, sun)
            }
            Shape::Environment(e) => {
                let file = format!("{}_{name}", self.stem);
                let image = surroundings(&mut self.directory, &file, e, Rgb::ONE)?;
                let mut dome = Attributes::of_light(intensity, l.color, false);
                if let Some(image) = image {
                    dome = dome
                        .put("asset", "inputs:texture:file", format!("@./{image}@"))
                        .put("token", "inputs:texture:format", "\"latlong\"")
                        .put("float", "xformOp:rotateY", e.rotation.to_degrees())
                        .put("uniform token[]", "xformOpOrder", "[\"xformOp:rotateY\"]");
                }
                ("DomeLight", false, dome)
            }
            Shape::Mesh(_) => return Ok(()),
        };
        let attributes = match l.pose(self.job.scene().origin) {
            Some(pose) => attributes.pose(&pose),
            None => attributes,
        };
        let api = if shaped { "        prepend apiSchemas = [\"ShapingAPI\"]\n" } else { "" };
        let metadata = format!(" (\n{api}        displayName = {}\n    )", quoted(&l.light.name));
        self.prim(kind, &name, &metadata, &attributes);
        Ok(())
    }

    /// Type of a planar light, whether it has a cone, and its attributes.
    fn planar(&mut self, l: &LitLight, p: &Planar, intensity: f64) -> (&'static str, bool, Attributes) {
        let s = f64::from(l.size);
        match (p.outline, cone_of(p)) {
            (Outline::Rectangle { a, b }, _) => {
                let sides = Attributes::of_light(intensity, l.color, false)
                    .put("float", "inputs:width", float(2.0 * f64::from(a) * s))
                    .put("float", "inputs:height", float(2.0 * f64::from(b) * s));
                ("RectLight", false, sides)
            }
            (Outline::Disk { r }, None) => {
                ("DiskLight", false, Attributes::ball(l, intensity, f64::from(r) * s))
            }
            (Outline::Disk { r }, Some(cone)) => {
                let r = f64::from(r) * s;
                self.warnings.push(format!(
                    "light `{}`: a spot of radius {r:.3} m is a sphere in USD and a disk here",
                    l.light.name
                ));
                ("SphereLight", true, Attributes::ball(l, intensity * mean_cosine(cone), r).cone(cone))
            }
        }
    }

    fn camera(&mut self) {
        let c = self.job.camera();
        let size = c.size().as_dvec2();
        let width = 2.0 * (f64::from(c.vfov()).to_radians() / 2.0).tan() * size.x / size.y;
        let shift = c.shift().as_dvec2() * (APERTURE * size.max_element() / size.x);
        let mut camera = Attributes::default()
            .put("token", "projection", "\"perspective\"")
            .put("float", "horizontalAperture", float(APERTURE))
            .put("float", "verticalAperture", float(APERTURE * size.y / size.x))
            .put("float", "horizontalApertureOffset", float(shift.x))
            .put("float", "verticalApertureOffset", float(shift.y))
            .put("float", "focalLength", float(APERTURE / width))
            .put("float2", "clippingRange", "(0.0001, 1000000)");
        if let Some(lens) = c.lens() {
            // In tenths of a metre, as the aperture.
            let diameter = 20.0 * f64::from(lens.radius);
            camera = camera.put("float", "fStop", float(APERTURE / width / diameter)).put(
                "float",
                "focusDistance",
                lens.focus_distance,
            );
        }
        let pose = Pose::of_camera(c, self.job.scene().origin);
        let name = self.name("camera");
        self.prim("Camera", &name, "", &camera.pose(&pose));
    }

    /// The text of the whole layer.
    fn finished(&self) -> String {
        let names: Vec<_> = background_names(self.job).iter().map(|n| quoted(n)).collect();
        let unit = if self.job.options.photometric { "nit" } else { "W/(m2 sr)" };
        format!(
            "#usda 1.0\n(\n    customLayerData = {{\n        dictionary lightopt = {{\n            string[] \
             background = [{}]\n            double exposure = {}\n            string intensity = \"{unit}\"\n            \
             double value = {}\n            string view = \"{}\"\n        }}\n    }}\n    defaultPrim = \"World\"\n    \
             metersPerUnit = 1\n    upAxis = \"Y\"\n)\n\ndef Xform \"World\"\n{{{}}}\n",
            names.join(", "),
            self.job.lighting.exposure,
            self.job.lighting.value,
            self.job.display.name(),
            self.text
        )
    }
}

/// A number with the digits of an `f32`.
fn float(v: f64) -> f32 {
    v as f32
}

/// Three numbers.
fn triple(v: Rgb) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

/// A string.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// The name of a prim: letters, digits and `_`, not a digit first.
fn identifier(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') { plain } else { format!("_{plain}") }
}
