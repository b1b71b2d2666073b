//! A Python script for Blender that sets or makes lamps by name.
//!
//! It lays over a Blender file what was found: lamps, the world, what materials emit, the background's value,
//! exposure and view transform; where the file has no camera, also that. With
//! [`ExportOptions::whole`](super::ExportOptions) it first reads the scene file into an empty Blender.
//! With Cycles the picture is then ours, but for materials that Blender's importer reads otherwise.
//!
//! Powers are those of Cycles in Blender 5.0, measured lamp by lamp against our pictures
//! (`tests/blender/compare.py`). s is the size, L the radiance, I the intensity, E the irradiance; the
//! colour c is written with 1 as its largest channel, and the power times what it was.
//!
//! | ours | Blender | |
//! | --- | --- | --- |
//! | (x, y, z) | (x, -z, y) | exact |
//! | rectangle, half-extents a, b | Area, Rectangle 2as × 2bs, 4π·a·b·s²·L | exact |
//! | disk of radius r | Area, Disk 2rs, π²r²s²·L | exact |
//! | sphere of radius r | Point of radius rs without soft falloff, 4π²r²s²·L | exact |
//! | point | Point of radius 0, 4π·I | exact |
//! | spot of radius 0 | Spot of radius 0, 4π·I, 2·angle, blend (cos inner - cos outer)/(1 - cos outer) | exact |
//! | spot of radius r | the same of radius rs, 4π²r²s²·L times the mean cosine over its cone: a sphere in Blender, not a disk | as bright as a whole: a warning |
//! | distant | Sun of angle 0, strength E | exact |
//! | environment | World, strength; a picture turned by 90° - rotation | exact |
//! | emissive mesh | Emission Color and Strength of its material | exact |
//! | background's value v | Base Color times v | exact |
//! | exposure e | View, Exposure log₂ e | exact |
//! | occluding body | a warning: Blender's lamps do not block | |

use std::{f64::consts::PI, io::Write as _, path::Path, path::PathBuf};

use serde_json::{Map, Value, json};

use super::{
    ExportError, ExportJob, Exported, Exporter, LitLight, Offer,
    directory::Directory,
    job::Pose,
    sheet::{
        absolute, angle_of, background_names, cone_of, material_of, matrix_rows, mean_cosine, place, scaled,
        short, short3, stem, surroundings,
    },
};
use crate::{
    camera::Camera,
    light::{Cone, Edge, Outline, Shape},
    math::{Rgb, ViewTransform},
};

/// The part of the script that does what its data say; Blender's add-on uses the same.
const SETTER: &str = include_str!("../../blender/lightopt_embree/setter.py");

/// Width of a sensor in Blender by default, millimetres, for the lens of a field of view.
const SENSOR: f64 = 36.0;

/// Script for Blender.
#[derive(Clone, Copy, Debug)]
pub struct Blender;

impl Exporter for Blender {
    fn name(&self) -> &'static str {
        "blender"
    }

    fn help(&self) -> &'static str {
        "Blender 4.2 or newer, run with `blender FILE.blend --python OUT.py` or from its text editor"
    }

    fn files(&self) -> &'static str {
        "a Python script that sets or makes lamps by name, and the picture of the surroundings"
    }

    fn entry_point(&self, out: &Path) -> PathBuf {
        out.to_path_buf()
    }

    fn offers(&self, option: Offer) -> bool {
        option == Offer::Whole
    }

    fn write(&self, job: &ExportJob, out: &Path) -> Result<Exported, ExportError> {
        let (directory, name) = place(out, "py", "Blender")?;
        let mut script =
            Script { job, directory, warnings: Vec::new(), lamps: Vec::new(), emitters: Vec::new() };
        let mut world = Value::Null;
        for l in job.lights() {
            script.light(&l, stem(&name), &mut world)?;
        }
        if job.display == ViewTransform::PbrNeutral {
            script.warnings.push(
                "Blender's Khronos PBR Neutral is darker in the shadows than the published curve".into(),
            );
        }
        if let ViewTransform::Ocio(view) = job.display {
            script.warnings.push(format!(
                "view {}: Blender has it where the environment variable OCIO names that configuration",
                view.view()
            ));
        }
        let data = json!({
            "lamps": script.lamps,
            "world": world,
            "emitters": script.emitters,
            "background": background_names(job),
            "value": job.lighting.value,
            "exposure": job.lighting.exposure.log2(),
            "view": view_name(job.display),
            "camera": camera(job),
            "scene": job.options.whole.map(|p| absolute(p).display().to_string()),
        });
        let text = text(&data);
        script.directory.write(&name, |out| out.write_all(text.as_bytes()))?;
        Ok(script.directory.finish(script.warnings))
    }
}

/// A script under way.
struct Script<'a> {
    job: &'a ExportJob<'a>,
    directory: Directory,
    warnings: Vec<String>,
    lamps: Vec<Value>,
    emitters: Vec<Value>,
}

impl Script<'_> {
    /// Adds a light; a dark one is kept, at no power, so that its lamp in Blender is dark too.
    fn light(&mut self, l: &LitLight, stem: &str, world: &mut Value) -> Result<(), ExportError> {
        if l.light.occludes {
            let name = &l.light.name;
            self.warnings.push(format!("light `{name}`: Blender's lamps do not block light; here it does"));
        }
        let (color, most) = scaled(l.color);
        let power = f64::from(l.radiance) * most;
        match &l.light.shape {
            Shape::Mesh(_) => {
                let material = material_of(self.job, l.light).map(|i| &self.job.material(i).name);
                self.emitters.push(json!({
                    "material": material, "color": short3(color), "strength": power,
                }));
            }
            Shape::Environment(e) => {
                if !world.is_null() {
                    let name = &l.light.name;
                    self.warnings.push(format!("light `{name}`: Blender has one world; left out"));
                    return Ok(());
                }
                let image = surroundings(&mut self.directory, &format!("{stem}_world"), e, Rgb::ONE)?;
                *world = json!({
                    "color": short3(color),
                    "strength": power,
                    "image": image,
                    "turn": std::f64::consts::FRAC_PI_2 - f64::from(e.rotation),
                    "visible": l.light.camera_visible,
                });
            }
            _ => {
                let Some(pose) = l.pose(self.job.scene().origin) else { return Ok(()) };
                let (kind, settings) = self.lamp(l);
                let mut settings = settings;
                let unit = settings.remove("energy").and_then(|v| v.as_f64()).unwrap_or_default();
                settings.insert("energy".to_owned(), json!(unit * power));
                settings.insert("color".to_owned(), short3(color));
                self.lamps.push(json!({
                    "name": l.light.name,
                    "type": kind,
                    "settings": settings,
                    "matrix": in_blender(&pose),
                    "visible": l.light.camera_visible,
                }));
            }
        }
        Ok(())
    }

    /// Type and settings of a lamp in Blender, `energy` at unit radiance.
    fn lamp(&mut self, l: &LitLight) -> (&'static str, Map<String, Value>) {
        let s = f64::from(l.size);
        let (kind, settings) = match &l.light.shape {
            Shape::Planar(p) => match (p.outline, cone_of(p)) {
                (Outline::Rectangle { a, b }, _) => {
                    let (a, b) = (f64::from(a) * s, f64::from(b) * s);
                    let energy = 4.0 * PI * a * b;
                    let settings =
                        json!({"shape": "RECTANGLE", "size": 2.0 * a, "size_y": 2.0 * b, "energy": energy});
                    ("AREA", settings)
                }
                (Outline::Disk { r }, None) => {
                    let r = f64::from(r) * s;
                    ("AREA", json!({"shape": "DISK", "size": 2.0 * r, "energy": PI * PI * r * r}))
                }
                (Outline::Disk { r }, Some(cone)) => {
                    let r = f64::from(r) * s;
                    self.warnings.push(format!(
                        "light `{}`: a spot of radius {r:.3} m is a sphere in Blender and a disk here: as bright as a \
                         whole, {:.0} % brighter at the edge of its cone over its axis",
                        l.light.name,
                        100.0 * (1.0 / f64::from(cone.cos_outer).max(0.01) - 1.0)
                    ));
                    ("SPOT", self.spot(l, cone, r, 4.0 * PI * PI * r * r * mean_cosine(cone)))
                }
            },
            Shape::Sphere(sphere) => {
                let r = f64::from(sphere.radius) * s;
                ("POINT", ball(r, 4.0 * PI * PI * r * r))
            }
            Shape::Point(p) => match p.cone {
                None => ("POINT", ball(0.0, 4.0 * PI)),
                Some((_, cone)) => ("SPOT", self.spot(l, cone, 0.0, 4.0 * PI)),
            },
            _ => ("SUN", json!({"angle": 0.0, "energy": 1.0})),
        };
        let Value::Object(settings) = settings else { return (kind, Map::new()) };
        (kind, settings)
    }

    /// Settings of a spot of a radius, metres.
    fn spot(&mut self, l: &LitLight, cone: Cone, radius: f64, energy: f64) -> Value {
        if cone.edge == Edge::Squared {
            self.warnings.push(format!(
                "light `{}`: its edge falls off as in a glTF; Blender's is a smooth step",
                l.light.name
            ));
        }
        let (inner, outer) = (f64::from(cone.cos_inner), f64::from(cone.cos_outer));
        let mut settings = ball(radius, energy);
        settings["spot_size"] = json!(2.0 * angle_of(cone));
        settings["spot_blend"] = json!(((inner - outer) / (1.0 - outer)).clamp(0.0, 1.0));
        settings
    }
}

/// Settings of a lamp that is a ball of a radius, metres.
fn ball(radius: f64, energy: f64) -> Value {
    json!({"shadow_soft_size": radius, "use_soft_falloff": false, "energy": energy})
}

/// Rows of the matrix of a thing in Blender, where z is up.
fn in_blender(pose: &Pose) -> [[f64; 4]; 4] {
    let [x, y, z, w] = matrix_rows(pose);
    [x, z.map(|v| -v), y, w]
}

/// Blender's name of a view transform.
fn view_name(view: ViewTransform) -> &'static str {
    match view {
        ViewTransform::Srgb => "Standard",
        ViewTransform::Agx => "AgX",
        ViewTransform::Filmic => "Filmic",
        ViewTransform::PbrNeutral => "Khronos PBR Neutral",
        ViewTransform::Linear => "Raw",
        ViewTransform::Ocio(view) => view.view(),
    }
}

/// The camera in Blender's terms: the lens for a sensor of 36 mm across the longer side.
fn camera(job: &ExportJob) -> Value {
    let c: &Camera = job.camera();
    let size = c.size().as_dvec2();
    let half = (f64::from(c.vfov()).to_radians() / 2.0).tan() * size.max_element() / size.y;
    let lens = SENSOR / (2.0 * half);
    let focus = c.lens().map(|l| {
        // Blender's aperture: the focal length over the diameter.
        json!({"distance": short(l.focus_distance), "fstop": lens / 1000.0 / (2.0 * f64::from(l.radius))})
    });
    json!({
        "matrix": in_blender(&Pose::of_camera(c, job.scene().origin)),
        "lens": lens,
        "sensor": SENSOR,
        "shift": [short(c.shift().x), short(c.shift().y)],
        "size": [c.size().x, c.size().y],
        "focus": focus,
    })
}

/// The script.
fn text(data: &Value) -> String {
    // In a raw string of Python only its own quotes would end it.
    let data = format!("{data:#}").replace('\'', "\\u0027");
    format!(
        "# Lights for Blender 4.2 or newer: run it in the text editor, or `blender FILE.blend --python THIS`.\n\
         # To compare pictures in Cycles: as many diffuse and glossy bounces as the longest path has edges,\n\
         # less two; clamping, light threshold and filter glossy 0; no denoising.\n\n\
         DATA = r'''{data}'''\n\n{SETTER}\n\nif __name__ == \"__main__\":\n    import json\n\n    \
         apply(json.loads(DATA))\n"
    )
}
