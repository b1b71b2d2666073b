//! Scene description of Mitsuba 3 (3.9).
//!
//! A directory with `scene.xml`, a binary PLY per material and an EXR per
//! texture. Rendered with an `rgb` variant it converges to our picture.
//!
//! | ours | Mitsuba | |
//! | --- | --- | --- |
//! | camera | `perspective`, `fov_axis` y, `lookat`; `hdrfilm` with a box filter | exact |
//! | `max_depth` | `max_depth`: both count edges after the camera | exact |
//! | diffuse | `twosided(diffuse)` | exact |
//! | plastic, smooth | `twosided(plastic)`, `nonlinear` false, albedo times [`compensation`] | exact |
//! | plastic, rough | `twosided(roughplastic)`, GGX, alpha = roughness², likewise | exact to 0.05 %, the quadrature of its tables |
//! | conductor, rough | `twosided(principled)`, `metallic` 1, same roughness: Schlick over separable GGX | exact |
//! | conductor, smooth and white | `twosided(conductor)`, material `none` | exact |
//! | conductor, smooth, other | `principled` at its least slope 0.001 | approximate: a warning says so |
//! | dielectric | `dielectric`, `roughdielectric` (GGX), `ext_ior` 1 | exact |
//! | texture | linear float EXR with the tint multiplied in; `raw`, bilinear, repeat | exact |
//! | rectangle, disk, sphere | same shape, `area` emitter, `null` BSDF | exact |
//! | point | `point` | exact |
//! | spot | refused | |
//!
//! Our lights do not block: a ray collects all it crosses and goes on. `volpath`
//! does the same at a `null` surface that emits, for camera and shadow rays,
//! without counting an edge; `path` would stop there. All lights hidden from
//! the camera become `hide_emitters`; a mixture is refused.

use std::{
    collections::HashMap,
    fmt::Write as _,
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

use glam::Vec3;

use super::{ExportError, ply::Part};
use crate::{
    bsdf::{microfacet::Ggx, plastic::internal_reflectance},
    files::write_atomically,
    film::exr::{ExrImage, ExrPart, write_exr},
    light::{Light, Outline, Planar, Shape},
    math::Rgb,
    scene::{Material, Scene, material::Model},
};

/// Writes a scene as it is lit now into `directory`, made if it is not there.
/// Returns what a user should hear of.
///
/// # Errors
/// When a light has no exact counterpart (before anything is written), or a
/// file cannot be written. `scene.xml` comes last.
pub fn write(scene: &Scene, max_depth: usize, directory: &Path) -> Result<Vec<String>, ExportError> {
    let hide_emitters = hide_emitters(&scene.lights)?;
    let mut lights = String::new();
    for l in &scene.lights {
        light(&mut lights, l)?;
    }
    fs::create_dir_all(directory)
        .map_err(|source| ExportError::Directory { path: directory.to_path_buf(), source })?;
    let mut warnings = Vec::new();
    let mut compensations = Compensations::default();
    let mut surfaces = String::new();
    for (i, material) in scene.materials.iter().enumerate() {
        let part = Part::of_material(&scene.mesh, i as u32);
        if part.is_empty() {
            continue;
        }
        let stem = format!("{i:02}_{}", plain(&material.name));
        let path = directory.join(format!("{stem}.ply"));
        write_atomically(&path, |out| {
            part.write(out).map_err(|source| ExportError::Write { path: path.clone(), source })
        })?;
        let color = color(material, &stem, directory, &mut compensations, &mut warnings)?;
        let bsdf = bsdf(material, &color, &mut warnings);
        surfaces += &format!(
            "    <shape type=\"ply\">\n        <string name=\"filename\" value=\"{stem}.ply\"/>\n        \
             <boolean name=\"flip_tex_coords\" value=\"true\"/>\n{bsdf}    </shape>\n"
        );
    }
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<scene version=\"3.0.0\">\n    \
         <default name=\"spp\" value=\"64\"/>\n    \
         <!-- Lights do not block: volpath passes through their null surfaces. -->\n    \
         <integrator type=\"volpath\">\n        \
         <integer name=\"max_depth\" value=\"{max_depth}\"/>\n        \
         <boolean name=\"hide_emitters\" value=\"{hide_emitters}\"/>\n    </integrator>\n\
         {}{surfaces}{lights}</scene>\n",
        sensor(scene)
    );
    let path = directory.join("scene.xml");
    write_atomically(&path, |out| {
        out.write_all(text.as_bytes()).map_err(|source| ExportError::Write { path: path.clone(), source })
    })?;
    Ok(warnings)
}

/// Whether all lights that a ray can hit are hidden from the camera.
fn hide_emitters(lights: &[Light]) -> Result<bool, ExportError> {
    let hidden = |l: &&Light| !l.is_delta() && !l.camera_visible;
    match lights.iter().find(hidden) {
        None => Ok(false),
        Some(_) if lights.iter().all(|l| l.is_delta() || !l.camera_visible) => Ok(true),
        Some(l) => Err(ExportError::Visibility { light: l.name.clone() }),
    }
}

/// A name that is safe in a file name and in XML.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}

fn list(v: Vec3) -> String {
    format!("{}, {}, {}", v.x, v.y, v.z)
}

fn sensor(scene: &Scene) -> String {
    let c = &scene.camera;
    format!(
        "    <sensor type=\"perspective\">\n        \
         <string name=\"fov_axis\" value=\"y\"/>\n        \
         <float name=\"fov\" value=\"{}\"/>\n        \
         <float name=\"near_clip\" value=\"1e-4\"/>\n        \
         <float name=\"far_clip\" value=\"1e6\"/>\n        \
         <transform name=\"to_world\">\n            \
         <lookat origin=\"{}\" target=\"{}\" up=\"{}\"/>\n        </transform>\n        \
         <sampler type=\"independent\">\n            \
         <integer name=\"sample_count\" value=\"$spp\"/>\n        </sampler>\n        \
         <film type=\"hdrfilm\">\n            \
         <integer name=\"width\" value=\"{}\"/>\n            \
         <integer name=\"height\" value=\"{}\"/>\n            \
         <string name=\"pixel_format\" value=\"rgb\"/>\n            \
         <string name=\"component_format\" value=\"float32\"/>\n            \
         <rfilter type=\"box\"/>\n        </film>\n    </sensor>\n",
        c.vfov(),
        list(c.position),
        list(c.position + c.forward()),
        list(c.up()),
        c.size().x,
        c.size().y,
    )
}

/// A light as shape and emitter; one that emits nothing is left out.
fn light(out: &mut String, l: &Light) -> Result<(), ExportError> {
    let radiance = l.color * l.radiance;
    let (shape, place) = match &l.shape {
        Shape::Planar(Planar { cone: Some(cone), .. }) if cone.cos_inner > 0.0 => {
            return Err(ExportError::Spot { light: l.name.clone() });
        }
        Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => {
            return Err(ExportError::Spot { light: l.name.clone() });
        }
        Shape::Point(p) => {
            let _ = write!(
                out,
                "    <emitter type=\"point\">\n        \
                 <point name=\"position\" value=\"{}\"/>\n        \
                 <rgb name=\"intensity\" value=\"{}\"/>\n    </emitter>\n",
                list(p.position),
                list(radiance)
            );
            return Ok(());
        }
        Shape::Planar(p) => {
            let (shape, a, b) = match p.outline {
                Outline::Rectangle { a, b } => ("rectangle", a, b),
                Outline::Disk { r } => ("disk", r, r),
            };
            // Mitsuba's unit shapes lie in the xy plane and face +z.
            let (x, y, z, c) = (p.frame.s * (a * l.size), p.frame.t * (b * l.size), p.frame.n, p.center);
            let rows: Vec<String> = (0..3).map(|i| format!("{} {} {} {}", x[i], y[i], z[i], c[i])).collect();
            let matrix = format!(
                "        <transform name=\"to_world\">\n            \
                 <matrix value=\"{} 0 0 0 1\"/>\n        </transform>\n",
                rows.join(" ")
            );
            (shape, matrix)
        }
        Shape::Sphere(s) => {
            let place = format!(
                "        <point name=\"center\" value=\"{}\"/>\n        \
                 <float name=\"radius\" value=\"{}\"/>\n",
                list(s.center),
                s.radius * l.size
            );
            ("sphere", place)
        }
    };
    if l.size <= 0.0 || radiance == Rgb::ZERO {
        return Ok(());
    }
    let _ = write!(
        out,
        "    <shape type=\"{shape}\">\n{place}        <bsdf type=\"null\"/>\n        \
         <emitter type=\"area\">\n            \
         <rgb name=\"radiance\" value=\"{}\"/>\n        </emitter>\n    </shape>\n",
        list(radiance)
    );
    Ok(())
}

/// [`compensation`] by the bits of IOR and slope: materials that are alike share it.
#[derive(Default)]
struct Compensations(HashMap<(u32, Option<u32>), f32>);

impl Compensations {
    fn get(&mut self, ior: f32, alpha: Option<f32>) -> f32 {
        let key = (ior.to_bits(), alpha.map(f32::to_bits));
        *self.0.entry(key).or_insert_with(|| compensation(ior, alpha))
    }
}

/// The base colour as XML element whose name is still `NAME`; writes its texture.
fn color(
    material: &Material,
    stem: &str,
    directory: &Path,
    compensations: &mut Compensations,
    warnings: &mut Vec<String>,
) -> Result<String, ExportError> {
    if material.model() == Model::Dielectric {
        return Ok(String::new());
    }
    let scale = match material.model() {
        Model::Plastic => compensations.get(material.ior(), material.alpha()),
        _ => 1.0,
    };
    let tint = material.tint() * scale;
    let mut clamped = false;
    let mut limit = |c: Rgb| {
        clamped |= c.max_element() > 1.0;
        c.min(Rgb::ONE)
    };
    let element = match material.texture() {
        None => format!("<rgb name=\"NAME\" value=\"{}\"/>", list(limit(tint))),
        Some(texture) => {
            let [width, height] = texture.size();
            let texels: Vec<[f32; 3]> = (0..width * height)
                .map(|i| {
                    let [r, g, b, _] = texture.texel(i % width, i / width);
                    limit(Rgb::new(r, g, b) * tint).to_array()
                })
                .collect();
            let image =
                ExrImage { width, height, parts: vec![ExrPart::rgb("color", &texels)], lightopt: None };
            write_exr(&directory.join(PathBuf::from(format!("{stem}.exr"))), &image)?;
            format!(
                "<texture type=\"bitmap\" name=\"NAME\">\n                    \
                 <string name=\"filename\" value=\"{stem}.exr\"/>\n                    \
                 <boolean name=\"raw\" value=\"true\"/>\n                    \
                 <string name=\"format\" value=\"variant\"/>\n                \
                 </texture>"
            )
        }
    };
    if clamped {
        warnings.push(format!(
            "material `{}`: its base colour exceeds 1 in Mitsuba and was clamped",
            material.name
        ));
    }
    Ok(element)
}

fn bsdf(material: &Material, color: &str, warnings: &mut Vec<String>) -> String {
    let color = |name: &str| color.replacen("NAME", name, 1);
    let alpha = material.alpha();
    let coat = format!(
        "<float name=\"int_ior\" value=\"{}\"/>\n            \
         <float name=\"ext_ior\" value=\"1\"/>",
        material.ior()
    );
    let ggx = alpha.map_or_else(String::new, |a| {
        format!(
            "<string name=\"distribution\" value=\"ggx\"/>\n            \
             <float name=\"alpha\" value=\"{a}\"/>\n            "
        )
    });
    let linear = "<boolean name=\"nonlinear\" value=\"false\"/>";
    let (kind, body) = match (material.model(), alpha) {
        (Model::Dielectric, _) => {
            let kind = if alpha.is_some() { "roughdielectric" } else { "dielectric" };
            return format!("        <bsdf type=\"{kind}\">\n            {ggx}{coat}\n        </bsdf>\n");
        }
        (Model::Diffuse, _) => ("diffuse", color("reflectance")),
        (Model::Plastic, None) => {
            ("plastic", format!("{}\n            {coat}\n            {linear}", color("diffuse_reflectance")))
        }
        (Model::Plastic, Some(_)) => (
            "roughplastic",
            format!("{}\n            {ggx}{coat}\n            {linear}", color("diffuse_reflectance")),
        ),
        (Model::Conductor, None) if material.texture().is_none() && material.tint() == Rgb::ONE => {
            ("conductor", "<string name=\"material\" value=\"none\"/>".into())
        }
        (Model::Conductor, _) => {
            if alpha.is_none() {
                warnings.push(format!(
                    "material `{}`: Mitsuba has no smooth metal with Schlick's reflectance; exported as slightly rough",
                    material.name
                ));
            }
            let body = format!(
                "{}\n            <float name=\"metallic\" value=\"1\"/>\n            \
                 <float name=\"roughness\" value=\"{}\"/>",
                color("base_color"),
                alpha.unwrap_or(0.0).sqrt()
            );
            ("principled", body)
        }
    };
    format!(
        "        <bsdf type=\"twosided\">\n            <bsdf type=\"{kind}\">\n            {body}\n            </bsdf>\n        </bsdf>\n"
    )
}

/// Factor on the albedo of a plastic of relative IOR `ior` and GGX slope `alpha`.
///
/// With `nonlinear` false the base is proportional to albedo/(1 − R), R being
/// the diffuse reflectance 2 ∫ R(μ) μ dμ of the coat from inside. We integrate
/// it. Mitsuba 3.9 takes a polynomial fit for the smooth `plastic` (W. Egan and
/// T. Hilgeman), 0.1 % off, and for `roughplastic` the plain mean over 64 nodes
/// from μ = 0 to 1 with both ends in full, 1 to 2 % off.
#[must_use]
pub fn compensation(ior: f32, alpha: Option<f32>) -> f32 {
    const N_NODES: u32 = 64;
    let ggx = alpha.map(Ggx::new);
    let weighted = |mu: f64, i: u32| 2.0 * mu * f64::from(internal_reflectance(ior, ggx, mu as f32, i));
    let mean = |n: u32, f: &dyn Fn(u32) -> f64| (0..n).map(f).sum::<f64>() / f64::from(n);
    let n = if alpha.is_some() { 512 } else { 4096 };
    let exact = mean(n, &|i| weighted((f64::from(i) + 0.5) / f64::from(n), i));
    let theirs = if alpha.is_some() {
        // Several grids a node.
        mean(8 * N_NODES, &|i| weighted((f64::from(i / 8) / f64::from(N_NODES - 1)).max(1e-6), i))
    } else {
        let eta = 1.0 / f64::from(ior);
        -1.4399 * eta * eta + 0.7099 * eta + 0.6681 + 0.0636 / eta
    };
    ((1.0 - theirs) / (1.0 - exact)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_compensation_is_the_measured_ratio_of_both_plastics() {
        // The base of Mitsuba 3.9.1's plastics over the converged one, measured over random
        // pairs of directions.
        for (ior, alpha, ratio) in [
            (1.3, None, 1.000_7),
            (1.5, None, 1.001_154),
            (1.8, None, 0.999_336),
            (1.5, Some(0.04), 0.979_7),
            (1.5, Some(0.1), 0.981_9),
            (1.5, Some(0.25), 0.988_3),
        ] {
            let error = compensation(ior, alpha) * ratio - 1.0;
            assert!(error.abs() < if alpha.is_some() { 3e-4 } else { 2e-5 }, "{ior} {alpha:?}: {error}");
        }
    }

    #[test]
    fn names_become_safe() {
        assert_eq!(plain("a/b <c>&\u{e9}"), "a_b__c___");
    }
}
