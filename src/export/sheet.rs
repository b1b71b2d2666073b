//! What exports write beside lights and surfaces: numbers, names, places.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde_json::{Value, json};

use super::{ExportError, ExportJob, LitLight, directory::Directory, job::Pose};
use crate::{
    film::exr::ExrPart,
    light::{Cone, Edge, Environment, Light, Outline, Planar, Shape},
    math::Rgb,
};

/// A number with the digits of an `f32`, in which the scene has it.
pub(super) fn short(v: f32) -> Value {
    // What an f32 prints is read back as an f64.
    v.to_string().parse::<f64>().map_or(Value::Null, |v| json!(v))
}

/// Three numbers with the digits of an `f32`.
pub(super) fn short3(v: Vec3) -> Value {
    json!([short(v.x), short(v.y), short(v.z)])
}

/// A colour whose largest channel is 1, and the factor that is left.
pub(super) fn scaled(color: Rgb) -> (Rgb, f64) {
    let most = color.max_element();
    if most > 0.0 { (color / most, f64::from(most)) } else { (Rgb::ZERO, 0.0) }
}

/// The cone of a disk that does not shine into its whole half-space.
pub(super) fn cone_of(p: &Planar) -> Option<Cone> {
    p.cone.filter(|c| c.cos_inner > 0.0)
}

/// Half-angle of a cone, radians.
pub(super) fn angle_of(cone: Cone) -> f64 {
    f64::from(cone.cos_outer).clamp(0.0, 1.0).acos()
}

/// Mean cosine of the light that a cone lets through: the power of a disk with this cone over that of a sphere
/// of the same radius, radiance and cone.
///
/// The edge is linear in the cosine c, with the profile f(x) from 0 to 1: ∫ f dx is 1/2 and ∫ f·x dx is 7/20
/// of the smooth step x²(3 − 2x), and 1/3 and 1/4 of x².
pub(super) fn mean_cosine(cone: Cone) -> f64 {
    let (inner, outer) = (f64::from(cone.cos_inner), f64::from(cone.cos_outer));
    let width = inner - outer;
    let (plain, weighted) = match cone.edge {
        Edge::Smooth => (0.5, 0.35),
        Edge::Squared => (1.0 / 3.0, 0.25),
    };
    let sphere = 1.0 - inner + width * plain;
    let disk = 0.5 * (1.0 - inner * inner) + width * (outer * plain + width * weighted);
    if sphere > 0.0 { disk / sphere } else { 1.0 }
}

/// Names of the materials that the background's value scales.
pub(super) fn background_names<'a>(job: &ExportJob<'a>) -> Vec<&'a str> {
    let scene = job.scene();
    scene.background().iter().map(|&i| scene.materials[i].name.as_str()).collect()
}

/// The material of an emissive mesh.
pub(super) fn material_of(job: &ExportJob, light: &Light) -> Option<usize> {
    let Shape::Mesh(m) = &light.shape else { return None };
    let prim = m.prims().next()? as usize;
    Some(job.scene().mesh.materials[prim] as usize)
}

/// The directory that the file `out` is in, and its name; an error unless it ends in `.{ending}`.
pub(super) fn place(
    out: &Path,
    ending: &'static str,
    format: &'static str,
) -> Result<(Directory, String), ExportError> {
    let name = out.file_name().and_then(|n| n.to_str()).filter(|n| n.ends_with(&format!(".{ending}")));
    let Some(name) = name else {
        return Err(ExportError::Ending { path: out.to_path_buf(), format, ending });
    };
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((Directory::create(parent)?, name.to_owned()))
}

/// Name of a file without its ending.
pub(super) fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Writes the picture of the surroundings, times a factor, as `{stem}.exr`, and returns the file's name; `None` where
/// the surroundings have no picture.
pub(super) fn surroundings(
    directory: &mut Directory,
    stem: &str,
    e: &Environment,
    factor: Rgb,
) -> Result<Option<String>, ExportError> {
    let Some(map) = &e.map else { return Ok(None) };
    let texels: Vec<_> = map.texels().iter().map(|&t| (Rgb::from_array(t) * factor).to_array()).collect();
    directory.picture(stem, map.size(), ExrPart::rgb("color", &texels)).map(Some)
}

/// Rows of the matrix that puts a thing in its place, for column vectors.
pub(super) fn matrix_rows(pose: &Pose) -> [[f64; 4]; 4] {
    let [x, y, z] = pose.axes.map(|a| a.as_dvec3());
    let t = pose.at;
    [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z], [0.0, 0.0, 0.0, 1.0]]
}

/// What a light is, in the keys of a sidecar, for programs that carry what they do not know.
pub(super) fn described(l: &LitLight) -> Value {
    let mut keys = serde_json::Map::new();
    let mut put = |key: &str, value: Value| keys.insert(key.to_owned(), value);
    put("radiance", short(l.radiance));
    put("unit", json!(l.light.unit()));
    put("color", short3(l.color));
    put("camera_visible", json!(l.light.camera_visible));
    put("occludes", json!(l.light.occludes));
    let kind = match &l.light.shape {
        Shape::Planar(p) => {
            put("size", short(l.size));
            let cone = cone_of(p);
            if let Some(cone) = cone {
                put("angle", json!(angle_of(cone).to_degrees()));
            }
            match p.outline {
                Outline::Rectangle { a, b } => {
                    put("half_extents", json!([short(a), short(b)]));
                    "rectangle"
                }
                Outline::Disk { r } => {
                    put("radius", short(r));
                    if cone.is_some() { "spot" } else { "disk" }
                }
            }
        }
        Shape::Sphere(s) => {
            put("size", short(l.size));
            put("radius", short(s.radius));
            "sphere"
        }
        Shape::Point(p) => p.cone.map_or("point", |(_, cone)| {
            put("angle", json!(angle_of(cone).to_degrees()));
            "spot"
        }),
        Shape::Distant(_) => "distant",
        Shape::Environment(e) => {
            put("rotation", short(e.rotation.to_degrees()));
            "environment"
        }
        Shape::Mesh(_) => "mesh",
    };
    put("type", json!(kind));
    Value::Object(keys)
}

/// The path as it is from the root of the file system, where that can be told.
pub(super) fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_cosine_of_a_cone_equals_quadrature() {
        for edge in [Edge::Smooth, Edge::Squared] {
            for (inner, outer) in [(0.95, 0.8), (0.6, 0.5), (1.0, 0.2), (0.9, 0.9)] {
                let cone = Cone { cos_inner: inner, cos_outer: outer, edge };
                let n = 200_000;
                let (mut disk, mut sphere) = (0.0, 0.0);
                for i in 0..n {
                    let c = f64::from(outer) + (1.0 - f64::from(outer)) * (f64::from(i) + 0.5) / f64::from(n);
                    let f = f64::from(cone.profile(c as f32));
                    (disk, sphere) = (disk + f * c, sphere + f);
                }
                assert!((mean_cosine(cone) - disk / sphere).abs() < 1e-5, "{inner} {outer} {edge:?}");
            }
        }
    }
}
