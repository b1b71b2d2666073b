//! glTF 2.0 with `KHR_lights_punctual`.
//!
//! The format knows points, spots and directions, in candela and lux, at the 683 lm/W by which modelling
//! tools multiply. A light with a surface becomes the nearest of them, with a warning that says by how much
//! that is off, and stands in `extras` as the sidecar would describe it.
//!
//! | ours | glTF | |
//! | --- | --- | --- |
//! | point, sphere | `point`, 683·I; I = πr²s²·L | exact; a sphere casts hard shadows |
//! | rectangle, disk | `spot` of 90°, 683·A·L along its axis; A its area | a warning: cos² over the angle for cos, hard shadows |
//! | spot | `spot`, `innerConeAngle`, `outerConeAngle` | the edge falls off otherwise |
//! | distant | `directional`, 683·E | exact |
//! | environment, emissive mesh | the first in `extras` of the scene; the second as `emissiveFactor` with the meshes | a warning |
//! | background's value, exposure, view | `extras` of the scene; the meshes' colours include the value | |
//! | camera | `perspective`; shift and lens in `extras` | exact without these |
//! | materials | metallic roughness, `KHR_materials_ior`, `_transmission`, `_volume`, `_emissive_strength`; images as PNG | nearly |

mod surfaces;

use std::{
    f64::consts::{FRAC_PI_2, PI},
    io::Write as _,
    path::{Path, PathBuf},
};

use glam::{DMat3, DQuat};
use serde_json::{Value, json};

use self::surfaces::Surfaces;
use super::{
    ExportError, ExportJob, Exported, Exporter, LitLight, Offer,
    job::Pose,
    sheet::{angle_of, background_names, cone_of, described, place, scaled, short, short3, stem},
};
use crate::light::{LUMENS_PER_WATT, Outline, Shape};

/// Distances of the near and the far plane, metres, between which depths still differ in 24 bits.
const PLANES: [f64; 2] = [0.01, 1000.0];

/// glTF 2.0.
#[derive(Clone, Copy, Debug)]
pub struct Gltf;

impl Exporter for Gltf {
    fn name(&self) -> &'static str {
        "gltf"
    }

    fn help(&self) -> &'static str {
        "glTF 2.0: game engines, viewers, Blender"
    }

    fn files(&self) -> &'static str {
        "a .gltf with punctual lights and the camera"
    }

    fn entry_point(&self, out: &Path) -> PathBuf {
        out.to_path_buf()
    }

    fn offers(&self, option: Offer) -> bool {
        option == Offer::Whole
    }

    fn write(&self, job: &ExportJob, out: &Path) -> Result<Exported, ExportError> {
        let (mut directory, name) = place(out, "gltf", "glTF")?;
        let mut warnings = Vec::new();
        let mut nodes = vec![camera_node(job, &mut warnings)];
        let (mut lights, mut others) = (Vec::new(), Vec::new());
        for l in job.lights().filter(|l| !l.is_dark()) {
            match punctual(job, &l, &mut warnings) {
                Some((light, pose)) => {
                    nodes.push(json!({
                        "name": l.light.name,
                        "translation": pose.at.to_array(),
                        "rotation": rotation(&pose),
                        "extensions": {"KHR_lights_punctual": {"light": lights.len()}},
                    }));
                    lights.push(light);
                }
                None => others.push(json!({"name": l.light.name, "lightopt": described(&l)})),
            }
        }
        let c = job.camera();
        let aspect = f64::from(c.size().x) / f64::from(c.size().y);
        let mut root = json!({
            "asset": {"version": "2.0", "generator": concat!("lightopt-embree ", env!("CARGO_PKG_VERSION"))},
            "cameras": [{"type": "perspective", "perspective": {
                "aspectRatio": aspect,
                "yfov": f64::from(c.vfov()).to_radians(),
                "znear": PLANES[0],
                "zfar": PLANES[1],
            }}],
            "extensionsUsed": [],
            "scene": 0,
            "scenes": [{"extras": {"lightopt": {
                "exposure": job.lighting.exposure,
                "view": job.display.name(),
                "value": job.lighting.value,
                "background": background_names(job),
                "lights": others,
            }}}],
        });
        // An extension that is named must be used, and a list must have something in it.
        if !lights.is_empty() {
            root["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
            root["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        }
        if job.options.whole.is_some() {
            let mut surfaces = Surfaces::new(job, &mut directory, stem(&name));
            surfaces.write_all()?;
            surfaces.finish(&mut root, &mut nodes, &mut warnings)?;
        }
        if root["extensionsUsed"].as_array().is_some_and(Vec::is_empty) {
            root.as_object_mut().map(|o| o.remove("extensionsUsed"));
        }
        root["scenes"][0]["nodes"] = (0..nodes.len()).collect::<Vec<_>>().into();
        root["nodes"] = nodes.into();
        let text = format!("{root:#}\n");
        directory.write(&name, |out| out.write_all(text.as_bytes()))?;
        Ok(directory.finish(warnings))
    }
}

/// The punctual light nearest to a light, and its place; `None` where there is none.
fn punctual(job: &ExportJob, l: &LitLight, warnings: &mut Vec<String>) -> Option<(Value, Pose)> {
    let name = &l.light.name;
    let Some(pose) = l.pose(job.scene().origin) else {
        if matches!(l.light.shape, Shape::Environment(_)) || job.options.whole.is_none() {
            warnings.push(format!("light `{name}`: no counterpart in glTF; described in the scene's extras"));
        }
        return None;
    };
    let (color, most) = scaled(l.color);
    let unit = f64::from(l.radiance) * f64::from(LUMENS_PER_WATT) * most;
    let s = f64::from(l.size);
    let spot = |inner: f64, outer: f64| {
        // The format asks for an inner angle below the outer one.
        json!({"innerConeAngle": inner.clamp(0.0, outer * (1.0 - 1e-6)), "outerConeAngle": outer.min(FRAC_PI_2)})
    };
    let (kind, intensity, cone) = match &l.light.shape {
        Shape::Point(p) => match p.cone {
            None => ("point", unit, None),
            Some((_, c)) => {
                ("spot", unit, Some(spot(f64::from(c.cos_inner).clamp(0.0, 1.0).acos(), angle_of(c))))
            }
        },
        Shape::Distant(_) => ("directional", unit, None),
        Shape::Sphere(sphere) => {
            let r = f64::from(sphere.radius) * s;
            warnings.push(format!("light `{name}`: a point in glTF; its shadows are hard there"));
            ("point", unit * PI * r * r, None)
        }
        Shape::Planar(p) => {
            let (area, extent) = match p.outline {
                Outline::Rectangle { a, b } => {
                    let (a, b) = (f64::from(a) * s, f64::from(b) * s);
                    (4.0 * a * b, a.max(b))
                }
                Outline::Disk { r } => (PI * (f64::from(r) * s).powi(2), f64::from(r) * s),
            };
            let cone = match cone_of(p) {
                Some(c) => spot(f64::from(c.cos_inner).clamp(0.0, 1.0).acos(), angle_of(c)),
                None => spot(0.0, FRAC_PI_2),
            };
            warnings.push(off(job, l, &pose, extent, cone_of(p).is_none()));
            ("spot", unit * area, Some(cone))
        }
        Shape::Environment(_) | Shape::Mesh(_) => return None,
    };
    let mut light = json!({
        "name": name, "type": kind, "color": short3(color), "intensity": intensity,
        "extras": {"lightopt": described(l)},
    });
    if let Some(cone) = cone {
        light["spot"] = cone;
    }
    Some((light, pose))
}

/// By how much the spot that stands for a panel is off: at the middle of the scene, from the nearness of the
/// panel, which on the axis of a disk is 1/(1 + (r/d)²), and off the axis.
fn off(job: &ExportJob, l: &LitLight, pose: &Pose, extent: f64, is_lambertian: bool) -> String {
    let scene = job.scene();
    let middle = scene.mesh.bounds().center().as_dvec3() + scene.origin;
    let to = middle - pose.at;
    let near = 100.0 * (extent * extent / to.length_squared().max(f64::MIN_POSITIVE)).min(1.0);
    let cos = to.try_normalize().map_or(1.0, |d| -d.dot(pose.axes[2].as_dvec3())).clamp(0.0, 1.0);
    let name = &l.light.name;
    let edge = if is_lambertian {
        format!(", and {:.0} % too dark there, off its axis", 100.0 * (1.0 - cos))
    } else {
        String::new()
    };
    format!(
        "light `{name}`: a spot in glTF, with hard shadows; at the middle of the scene up to {near:.1} % too bright \
         for its extent{edge}"
    )
}

/// A rotation as a quaternion x, y, z, w.
fn rotation(pose: &Pose) -> [f64; 4] {
    let [x, y, z] = pose.axes.map(|a| a.as_dvec3());
    DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize().to_array()
}

fn camera_node(job: &ExportJob, warnings: &mut Vec<String>) -> Value {
    let c = job.camera();
    let pose = Pose::of_camera(c, job.scene().origin);
    let mut extras = json!({"size": [c.size().x, c.size().y]});
    if c.shift() != glam::Vec2::ZERO {
        extras["shift"] = json!([short(c.shift().x), short(c.shift().y)]);
        warnings.push("the camera: a glTF has no shift; it stands in the extras".to_owned());
    }
    if let Some(lens) = c.lens() {
        extras["aperture_radius"] = short(lens.radius);
        extras["focus_distance"] = short(lens.focus_distance);
        warnings.push("the camera: a glTF has no lens; it stands in the extras".to_owned());
    }
    json!({
        "name": "camera",
        "camera": 0,
        "translation": pose.at.to_array(),
        "rotation": rotation(&pose),
        "extras": {"lightopt": extras},
    })
}
