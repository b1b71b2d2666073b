//! Scene description of Mitsuba 3 (3.9).
//!
//! A directory with `scene.xml`, a binary PLY per material and an EXR per
//! texture. Rendered with an `rgb` variant it converges to our picture.
//!
//! | ours | Mitsuba | |
//! | --- | --- | --- |
//! | camera | `perspective`, `fov_axis` y, `lookat`; `hdrfilm` with a box filter | exact |
//! | lens | `thinlens`, same radius and distance | exact |
//! | `max_depth` | `max_depth`: both count edges after the camera | exact |
//! | diffuse | `twosided(diffuse)` | exact |
//! | plastic, smooth | `twosided(plastic)`, `nonlinear` false, albedo times [`compensation`] | exact |
//! | plastic, rough | `twosided(roughplastic)`, GGX, alpha = roughness², likewise | exact to 0.05 %, the quadrature of its tables |
//! | conductor, rough | `twosided(principled)`, `metallic` 1, same roughness: Schlick over separable GGX | exact |
//! | conductor, smooth and white | `twosided(conductor)`, material `none` | exact |
//! | conductor, smooth, other | `principled` at its least slope 0.001 | approximate: a warning says so |
//! | dielectric | `dielectric`, `roughdielectric` (GGX), `ext_ior` 1 | exact |
//! | mixtures | `blendbsdf` by coat strength, then by share of metal | exact |
//! | roughness from an image | `principled`: exact; `roughdielectric`: its square is interpolated; `roughplastic`: one roughness | warning |
//! | opacity | `mask`; a null interaction of `volpath`, no edge | exact; a cutoff of an image only nearly |
//! | normal map, bump map | `normalmap`, `bumpmap` without flipping and shadowing; the back has its own, tilted the other way | exact; glass, mirrored images and bumps stretched unevenly only nearly |
//! | texture | linear float EXR with the tint multiplied in; `raw`, bilinear, repeat, `to_uv` | exact |
//! | rectangle, disk, sphere | same shape, `area` emitter, `null` BSDF | exact |
//! | body that stops light | the same with a black `diffuse` | exact |
//! | emissive mesh, flat | `area` emitter of its mesh | exact |
//! | emissive mesh, smooth or two-sided | its mesh moved back by a hair, before it one that emits with face normals and `null` BSDF | exact but for that hair |
//! | emission from an image | `area` with a bitmap | only if each texel is used once: a warning says so |
//! | environment | `constant`, or `envmap` with means between the rows, for its first and last lie on the poles | exact |
//! | distant | `directional` | exact |
//! | point | `point` | exact |
//! | spot of radius 0 | `spot` whose picture is the profile of its cone | exact |
//! | spot | 1024 of these on its disk, each with the disk's cosine | exact but for close surfaces; the disk is not seen: a warning says so |
//!
//! Our lights do not block: a ray collects all it crosses and goes on. `volpath`
//! does the same at a `null` surface that emits, for camera and shadow rays,
//! without counting an edge; `path` would stop there. All lights hidden from
//! the camera become `hide_emitters`, which hides bodies that emit too: they
//! keep a black one behind. A mixture is refused.

mod lights;
mod materials;

use std::{fmt::Write as _, fs, io::Write as _, path::Path};

use glam::{Affine2, Vec2, Vec3};

use self::materials::Compensations;
pub use self::materials::compensation;
use super::{ExportError, ply::Part};
use crate::{
    camera::Camera,
    files::write_atomically,
    film::exr::{ExrImage, ExrPart, write_exr},
    integrator::View,
    light::Light,
    lighting::Lighting,
    scene::{Material, Mesh, material::Model},
};

/// How far behind its emitting skin a body lies, over one plus the largest
/// coordinate: thrice what Mitsuba moves the origin of a ray off a surface.
const SKIN: f32 = 3.0 * 9e-5;

/// Writes a view of a scene in a lighting into `directory`, made if it is not there.
/// Returns what a user should hear of.
///
/// # Errors
/// When a light has no exact counterpart (before anything is written), or a
/// file cannot be written. `scene.xml` comes last.
pub fn write(
    view: View,
    lighting: &Lighting,
    max_depth: usize,
    directory: &Path,
) -> Result<Vec<String>, ExportError> {
    let View { scene, camera } = view;
    let lights = lighting.lights(scene);
    let hide_emitters = lights::hide_emitters(&lights)?;
    lights::check(&lights)?;
    fs::create_dir_all(directory)
        .map_err(|source| ExportError::Directory { path: directory.to_path_buf(), source })?;
    let mut export = Export {
        mesh: &scene.mesh,
        materials: lighting.materials(scene),
        lights: &lights,
        directory,
        hide_emitters,
        elements: String::new(),
        warnings: Vec::new(),
        compensations: Compensations::default(),
    };
    for i in 0..scene.materials.len() {
        export.surface(i)?;
    }
    for l in &lights {
        export.light(l)?;
    }
    export.warn_of_lost_caustics();
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<scene version=\"3.0.0\">\n    \
         <default name=\"spp\" value=\"64\"/>\n    \
         <!-- Lights do not block: volpath passes through their null surfaces. -->\n    \
         <integrator type=\"volpath\">\n        \
         <integer name=\"max_depth\" value=\"{max_depth}\"/>\n        \
         <boolean name=\"hide_emitters\" value=\"{hide_emitters}\"/>\n    </integrator>\n\
         {}{}</scene>\n",
        sensor(camera),
        export.elements
    );
    let path = directory.join("scene.xml");
    write_atomically(&path, |out| {
        out.write_all(text.as_bytes()).map_err(|source| ExportError::Write { path: path.clone(), source })
    })?;
    Ok(export.warnings)
}

/// An export under way.
struct Export<'a> {
    mesh: &'a Mesh,
    /// Materials with the background's value in their base colours.
    materials: Vec<Material>,
    /// Lights at the radiances and sizes exported.
    lights: &'a [Light],
    directory: &'a Path,
    hide_emitters: bool,
    /// Shapes and emitters, XML.
    elements: String,
    warnings: Vec<String>,
    compensations: Compensations,
}

impl Export<'_> {
    /// The triangles of a material, with what they emit.
    fn surface(&mut self, index: usize) -> Result<(), ExportError> {
        let material = self.materials[index].clone();
        let part = Part::of_material(self.mesh, index as u32);
        if part.is_empty() {
            return Ok(());
        }
        let stem = format!("{index:02}_{}", plain(&material.name));
        let bsdf = self.bsdf(&material, &part, &stem)?;
        let Some((emitter, two_sided)) = self.mesh_emitter(index, &stem)? else {
            return self.ply(&part, &stem, &bsdf, "");
        };
        // Mitsuba emits from one side, about interpolated normals, and hides the body with the light.
        if !two_sided && !self.hide_emitters && part.is_flat() {
            return self.ply(&part, &stem, &bsdf, &emitter);
        }
        let behind = -SKIN * (1.0 + part.reach());
        self.ply(&part.moved(behind), &stem, &bsdf, "")?;
        let emitter = format!(
            "        <boolean name=\"face_normals\" value=\"true\"/>\n        <bsdf type=\"null\"/>\n{emitter}"
        );
        self.ply(&part, &format!("{stem}_front"), "", &emitter)?;
        if two_sided {
            self.ply(&part.moved(2.0 * behind).turned(), &format!("{stem}_back"), "", &emitter)?;
        }
        Ok(())
    }

    fn ply(&mut self, part: &Part, stem: &str, bsdf: &str, emitter: &str) -> Result<(), ExportError> {
        let path = self.directory.join(format!("{stem}.ply"));
        write_atomically(&path, |out| {
            part.write(out).map_err(|source| ExportError::Write { path: path.clone(), source })
        })?;
        let _ = write!(
            self.elements,
            "    <shape type=\"ply\">\n        <string name=\"filename\" value=\"{stem}.ply\"/>\n        \
             <boolean name=\"flip_tex_coords\" value=\"true\"/>\n{bsdf}{emitter}    </shape>\n"
        );
        Ok(())
    }

    /// Writes a picture and returns its name.
    fn picture(&self, stem: &str, [width, height]: [usize; 2], part: ExrPart) -> Result<String, ExportError> {
        let name = format!("{stem}.exr");
        let image = ExrImage { width, height, parts: vec![part], lightopt: None };
        write_exr(&self.directory.join(&name), &image)?;
        Ok(name)
    }

    /// A path tracer that goes from the camera cannot follow light from a point
    /// through glass.
    fn warn_of_lost_caustics(&mut self) {
        let used = |m: usize| self.mesh.materials.contains(&(m as u32));
        let smooth = self
            .materials
            .iter()
            .enumerate()
            .find(|(i, m)| m.alpha().is_none() && m.model() != Model::Diffuse && used(*i));
        if let Some((_, m)) = smooth
            && let Some(l) = self.lights.iter().find(|l| lights::is_unseen(l) && l.radiance > 0.0)
        {
            self.warnings.push(format!(
                "light `{}`: Mitsuba's volpath misses what the smooth material `{}` throws on from it",
                l.name, m.name
            ));
        }
    }
}

/// A bitmap's texture element under a parameter's name. `transform` maps the
/// surface's texture coordinates to the image's, v up.
fn bitmap(name: &str, file: &str, transform: Affine2) -> String {
    let to_uv = if transform == Affine2::IDENTITY {
        String::new()
    } else {
        // v runs down in the exported mesh and in Mitsuba's images.
        let flip = Affine2::from_cols(Vec2::X, Vec2::NEG_Y, Vec2::Y);
        let t = flip * transform * flip;
        format!(
            "    <transform name=\"to_uv\"><matrix value=\"{} {} 0 {} {} {} 0 {} 0 0 1 0 0 0 0 1\"/></transform>\n",
            t.matrix2.x_axis.x,
            t.matrix2.y_axis.x,
            t.translation.x,
            t.matrix2.x_axis.y,
            t.matrix2.y_axis.y,
            t.translation.y
        )
    };
    format!(
        "<texture type=\"bitmap\" name=\"{name}\">\n    \
         <string name=\"filename\" value=\"{file}\"/>\n    \
         <boolean name=\"raw\" value=\"true\"/>\n    \
         <string name=\"format\" value=\"variant\"/>\n{to_uv}</texture>\n"
    )
}

/// A name that is safe in a file name and in XML.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}

fn list(v: Vec3) -> String {
    format!("{}, {}, {}", v.x, v.y, v.z)
}

fn sensor(c: &Camera) -> String {
    let (kind, lens) = match c.lens() {
        None => ("perspective", String::new()),
        Some(lens) => (
            "thinlens",
            format!(
                "        <float name=\"aperture_radius\" value=\"{}\"/>\n        \
                 <float name=\"focus_distance\" value=\"{}\"/>\n",
                lens.radius, lens.focus_distance
            ),
        ),
    };
    format!(
        "    <sensor type=\"{kind}\">\n{lens}        \
         <string name=\"fov_axis\" value=\"y\"/>\n        \
         <float name=\"fov\" value=\"{}\"/>\n        \
         <float name=\"near_clip\" value=\"1e-4\"/>\n        \
         <float name=\"far_clip\" value=\"1e6\"/>\n        \
         <transform name=\"to_world\">\n            \
         <lookat origin=\"{}\" target=\"{}\" up=\"{}\"/>\n        </transform>\n        \
         <sampler type=\"multijitter\">\n            \
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_safe() {
        assert_eq!(plain("a/b <c>&\u{e9}"), "a_b__c___");
    }
}
