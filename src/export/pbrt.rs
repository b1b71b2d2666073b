//! Scene description of pbrt-v4.
//!
//! A directory with `scene.pbrt`, which includes `lights.pbrt`, a binary PLY per material and an EXR per
//! texture. `lights.pbrt` alone can be laid over another description of the same scene.
//!
//! Conventions are those of the format's description, <https://pbrt.org/fileformat-v4>, and of the source:
//! an `rgb` of 1 is a radiance of 1, for `L` is divided by the luminance of its illuminant (`lights.cpp`,
//! `SpectrumToPhotometric`), while `power` does not divide out the luminance of an rgb, and is not used. A film
//! of the sensor `cie1931` at ISO 100 and one second has no factor of its own.
//!
//! | ours | pbrt-v4 | |
//! | --- | --- | --- |
//! | camera | `Scale -1 1 1` and `LookAt`, for pbrt is left-handed; `fov` of the shorter side; `screenwindow` with a shift; `lensradius`, `focaldistance` | exact |
//! | rectangle, disk, sphere | `bilinearmesh`, `disk`, `sphere` with `AreaLightSource "diffuse"`; with an `alpha` of 0, so that rays pass | exact, but the camera and mirrors do not see it: a warning |
//! | occluding body | the same without `alpha` | the body emits there, and is black here: exact from before it |
//! | point, spot of radius 0 | `point`; `spot`, `coneangle` and `conedeltaangle` | exact |
//! | spot with a radius | `spot`, the disk's power in its middle | a warning |
//! | distant, environment | `distant`; `infinite`, its picture as an octahedral square of equal area \[Clarberg08\] | exact; the picture is sampled anew |
//! | emissive mesh | `diffuse` emission of its mesh | exact |
//! | diffuse, conductor, glass, thin sheet | `diffuse`, `conductor`, `dielectric`, `thindielectric` | exact but for light between facets |
//! | plastic | `coateddiffuse` | another model: a warning |
//! | background's value | in the reflectances | exact |
//! | exposure, view | a comment: pictures are linear | |

mod lights;
mod text;

use std::{
    fmt::Write as _,
    io::Write as _,
    path::{Path, PathBuf},
};

use glam::{DVec3, Vec2};

use self::text::{numbers, param, quoted, rgb};
use super::{
    ExportError, ExportJob, Exported, Exporter, directory::Directory, ply::Part, sheet::material_of,
};
use crate::{
    bsdf::GlassTint,
    math::Rgb,
    scene::{Material, material::Model},
};

/// Name of the scene description within the directory.
const SCENE_FILE: &str = "scene.pbrt";
/// Name of the lights within the directory.
const LIGHTS_FILE: &str = "lights.pbrt";

/// Scene description of pbrt-v4.
#[derive(Clone, Copy, Debug)]
pub struct Pbrt;

impl Exporter for Pbrt {
    fn name(&self) -> &'static str {
        "pbrt"
    }

    fn help(&self) -> &'static str {
        "pbrt-v4, rendered with `pbrt`"
    }

    fn files(&self) -> &'static str {
        "a directory with scene.pbrt, lights.pbrt, meshes and textures"
    }

    fn entry_point(&self, out: &Path) -> PathBuf {
        out.join(SCENE_FILE)
    }

    fn write(&self, job: &ExportJob, out: &Path) -> Result<Exported, ExportError> {
        let mut writer = Writer {
            job,
            directory: Directory::create(out)?,
            lights: String::new(),
            surfaces: String::new(),
            warnings: Vec::new(),
        };
        for l in job.lights().filter(|l| !l.is_dark()) {
            writer.light(&l)?;
        }
        for index in 0..job.scene().materials.len() {
            writer.surface(index)?;
        }
        let lights = std::mem::take(&mut writer.lights);
        writer.directory.write(LIGHTS_FILE, |out| out.write_all(lights.as_bytes()))?;
        let scene = writer.scene();
        writer.directory.write(SCENE_FILE, |out| out.write_all(scene.as_bytes()))?;
        Ok(writer.directory.finish(writer.warnings))
    }
}

/// An export under way.
struct Writer<'a> {
    job: &'a ExportJob<'a>,
    directory: Directory,
    lights: String,
    surfaces: String,
    warnings: Vec<String>,
}

impl Writer<'_> {
    /// The triangles of a material, with what they emit.
    fn surface(&mut self, index: usize) -> Result<(), ExportError> {
        let part = Part::of_material(&self.job.scene().mesh, index as u32);
        if part.is_empty() {
            return Ok(());
        }
        let material = self.job.material(index);
        let stem = format!("{index:02}_{}", text::plain(&material.name));
        let ply = format!("{stem}.ply");
        self.directory.write(&ply, |out| part.write(out))?;
        let bsdf = self.material(index, &stem)?;
        let lit = self.job.lights().find(|l| material_of(self.job, l.light) == Some(index));
        let emitted = match lit.filter(|l| !l.is_dark()) {
            Some(l) => {
                let two_sided = param("bool", "twosided", material.emits_from_both_sides());
                format!("  AreaLightSource \"diffuse\" {} {two_sided}\n", rgb("L", l.rgb()))
            }
            None => String::new(),
        };
        let alpha = if material.opacity_factor() < 1.0 {
            format!(" {}", param("float", "alpha", material.opacity_factor()))
        } else {
            String::new()
        };
        let _ = write!(
            self.surfaces,
            "AttributeBegin\n  # {}\n{bsdf}{emitted}  Shape \"plymesh\" \"string filename\" [ \"{ply}\" ]{alpha}\nAttributeEnd\n",
            quoted(&material.name)
        );
        Ok(())
    }

    /// The lines of a material.
    fn material(&mut self, index: usize, stem: &str) -> Result<String, ExportError> {
        let m: &Material = self.job.material(index);
        let tint = self.job.tint(index);
        let alpha = m.roughness() * m.roughness();
        let rough =
            format!("{} {}", param("float", "roughness", alpha), param("bool", "remaproughness", false));
        let eta = param("float", "eta", m.ior());
        let mut lines = String::new();
        let reflectance = match m.texture() {
            None => rgb("reflectance", tint),
            Some(image) => {
                let tinted = |[r, g, b, _]: [f32; 4]| (Rgb::new(r, g, b) * tint).to_array();
                let file = self.directory.color_texture(stem, "color", image, tinted)?;
                let _ = writeln!(
                    lines,
                    "  Texture \"{stem}\" \"spectrum\" \"imagemap\" \"string filename\" [ \"{file}\" ]"
                );
                format!("\"texture reflectance\" [ \"{stem}\" ]")
            }
        };
        let of = match m.model() {
            Model::Diffuse => format!("\"diffuse\" {reflectance}"),
            Model::Conductor => {
                if m.edge_tint() != Rgb::ONE {
                    self.warnings.push(format!("material `{}`: the tint of its edge is lost", m.name));
                }
                format!("\"conductor\" {reflectance} {rough}")
            }
            Model::Dielectric => {
                if m.glass_tint() != GlassTint::CLEAR {
                    self.warnings.push(format!("material `{}`: pbrt's glass has no tint", m.name));
                }
                format!("\"dielectric\" {eta} {rough}")
            }
            Model::Thin => format!("\"thindielectric\" {eta}"),
            Model::Plastic if m.metallic() >= 0.5 => format!("\"conductor\" {reflectance} {rough}"),
            Model::Plastic => {
                self.warnings.push(format!(
                    "material `{}`: pbrt's coateddiffuse is another model of a coat than ours",
                    m.name
                ));
                format!("\"coateddiffuse\" {reflectance} {eta} {rough}")
            }
        };
        let _ = writeln!(lines, "  Material {of}");
        Ok(lines)
    }

    /// The scene description.
    fn scene(&self) -> String {
        let c = self.job.camera();
        let size = c.size().as_vec2();
        // Half of the film's sides over half of the shorter one.
        let window = size / size.min_element();
        let middle = c.shift() * (2.0 * size.max_element() / size.min_element());
        let [lo, hi] = [middle - window, middle + window].map(|v: Vec2| v.to_array());
        let half = (c.vfov().to_radians() / 2.0).tan() * size.min_element() / size.y;
        let fov = (2.0 * half.atan()).to_degrees();
        let lens = c.lens().map_or_else(String::new, |l| {
            let radius = param("float", "lensradius", l.radius);
            format!(" {radius} {}", param("float", "focaldistance", l.focus_distance))
        });
        let (from, at, up) = (c.position, c.position + c.forward(), c.up());
        let origin = self.job.scene().origin;
        let place = if origin == DVec3::ZERO {
            String::new()
        } else {
            format!(
                "# Add ({}, {}, {}) for the coordinates of the scene file.\n",
                origin.x, origin.y, origin.z
            )
        };
        format!(
            "# pbrt-v4. Pictures are linear: exposure {}, view {}.\n{place}Scale -1 1 1\nLookAt {} {} {}\nCamera \
             \"perspective\" {} {}{lens}\nFilm \"rgb\" \"string sensor\" [ \"cie1931\" ] {} {} \"string filename\" [ \
             \"scene.exr\" ]\nSampler \"zsobol\" \"integer pixelsamples\" [ 256 ]\nIntegrator \"volpath\" {}\n\
             WorldBegin\nInclude \"{LIGHTS_FILE}\"\n{}",
            self.job.lighting.exposure,
            self.job.display.name(),
            numbers(&from.to_array()),
            numbers(&at.to_array()),
            numbers(&up.to_array()),
            param("float", "fov", fov),
            format_args!("\"float screenwindow\" [ {} ]", numbers(&[lo[0], hi[0], lo[1], hi[1]])),
            param("integer", "xresolution", c.size().x),
            param("integer", "yresolution", c.size().y),
            // pbrt counts bounces: edges after the first.
            param("integer", "maxdepth", self.job.max_depth.saturating_sub(1)),
            self.surfaces
        )
    }
}
