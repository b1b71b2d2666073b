//! Scene description of Mitsuba 3 (3.9).
//!
//! A directory with `scene.xml`, a binary PLY per material and an EXR per
//! texture. Rendered with an `rgb` variant it converges to our picture.
//!
//! | ours | Mitsuba | |
//! | --- | --- | --- |
//! | camera | `perspective`, `fov_axis` y, `lookat`; `hdrfilm` with a box filter | exact |
//! | lens | `thinlens`, same radius and distance | exact; without a shift |
//! | shift | `principal_point_offset_x`, `_y` | exact |
//! | thin sheet, smooth | `thindielectric`, `specular_transmittance` | exact |
//! | thin sheet, rough | `principledthin`, `spec_trans` 1 | approximate: a warning says so |
//! | `max_depth` | `max_depth`: both count edges after the camera | exact |
//! | diffuse | `twosided(diffuse)` | exact |
//! | plastic, smooth | `twosided(plastic)`, `nonlinear` false, albedo times [`compensation`] | exact |
//! | plastic, rough | `twosided(roughplastic)`, GGX, alpha = roughness², likewise | darker: a warning says by how much |
//! | conductor, rough | `twosided(principled)`, `metallic` 1, same roughness: Schlick over separable GGX | darker: a warning says by how much |
//! | conductor, smooth and white | `twosided(conductor)`, material `none` | exact |
//! | conductor, smooth, other | `principled` at its least slope 0.001 | approximate: a warning says so |
//! | dielectric, smooth | `dielectric`, `ext_ior` 1 | exact |
//! | dielectric, rough | `roughdielectric`, GGX, `ext_ior` 1 | darker: a warning says by how much |
//! | mixtures | `blendbsdf` by coat strength, then by share of metal | exact |
//! | roughness from an image | `principled`: exact; `roughdielectric`: its square is interpolated; `roughplastic`: one roughness | warning |
//! | opacity | `mask`; a null interaction of `volpath`, no edge | exact; a cutoff of an image only nearly |
//! | normal map, bump map | `normalmap`, `bumpmap` without flipping and shadowing; the back has its own, tilted the other way | exact; glass, mirrored images and bumps stretched unevenly only nearly |
//! | texture | linear float EXR with the tint multiplied in; `raw`, bilinear, repeat, `to_uv` | exact |
//! | rectangle, disk, sphere | same shape, `area` emitter, `null` BSDF | exact |
//! | body that stops light, with `--path` every rectangle, disk and sphere | the same with a black `diffuse` | exact |
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
//! keep a black one behind. A mixture is refused, but for lights outside the picture.
//!
//! Mitsuba's rough models follow light to its first facet alone, and lose what that facet
//! sends into another one. `tests/mitsuba/facets.py` adds it there, so that our pictures can
//! be compared with Mitsuba's down to a pixel.

mod lights;
mod materials;
mod xml;

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use glam::Vec2;

pub use self::materials::compensation;
use self::{
    lights::is_unseen,
    materials::Compensations,
    xml::{boolean, element, empty, float, indented, integer, list, null, plain, property, string, to_world},
};
use super::{ExportError, ExportJob, Exported, Exporter, LitLight, Offer, directory::Directory, ply::Part};
use glam::DVec3;

use crate::{
    camera::Camera,
    light::{Light, Shape},
    math::{Rgb, luminance},
    scene::{Material, material::Model},
};

/// Distance of a body behind the surface that emits in its place, over one plus the
/// largest coordinate: thrice what Mitsuba moves the origin of a ray off a surface, so
/// that rays from the surface do not meet it again; 0.8 mm in a scene that reaches 2 m.
const SKIN: f32 = 3.0 * 9e-5;

/// Name of the scene description within the directory.
const SCENE_FILE: &str = "scene.xml";

/// Share of its light that a material must lose in Mitsuba to be warned about: as little as the
/// comparison of pictures would show.
const LEAST_LOSS: f32 = 0.003;

/// Texture coordinates at which a material with images is taken for that warning.
const MIDDLE: Vec2 = Vec2::splat(0.5);

/// Scene description of Mitsuba 3.
#[derive(Clone, Copy, Debug)]
pub struct Mitsuba;

impl Exporter for Mitsuba {
    fn name(&self) -> &'static str {
        "mitsuba"
    }

    fn help(&self) -> &'static str {
        "Mitsuba 3, rendered with `mitsuba -m llvm_ad_rgb`"
    }

    fn files(&self) -> &'static str {
        "a directory with scene.xml, meshes and textures"
    }

    fn entry_point(&self, out: &Path) -> PathBuf {
        out.join(SCENE_FILE)
    }

    fn offers(&self, option: Offer) -> bool {
        option == Offer::Blocking
    }

    fn write(&self, job: &ExportJob, out: &Path) -> Result<Exported, ExportError> {
        let hide_emitters = lights::hide_emitters(job)?;
        lights::check(&job.scene().lights)?;
        let mut writer = Writer {
            job: *job,
            directory: Directory::create(out)?,
            hide_emitters,
            elements: String::new(),
            warnings: Vec::new(),
            compensations: Compensations::default(),
            darker: Vec::new(),
        };
        for i in 0..job.scene().materials.len() {
            writer.surface(i)?;
        }
        for l in job.lights() {
            writer.light(&l)?;
        }
        writer.warn_of_lost_caustics();
        writer.warn_of_lost_light();
        writer.warn_of_bodies();
        writer.finish()
    }
}

/// An error about a part of the scene that Mitsuba cannot express.
fn no_counterpart(thing: String, what: &'static str) -> ExportError {
    ExportError::NoCounterpart { format: "Mitsuba", thing, what }
}

/// An export under way.
struct Writer<'a> {
    job: ExportJob<'a>,
    directory: Directory,
    /// Whether the camera sees no emitter, which Mitsuba decides for all at once.
    hide_emitters: bool,
    /// Shapes and emitters so far, XML at the level of the scene's elements.
    elements: String,
    warnings: Vec<String>,
    compensations: Compensations,
    /// Materials that Mitsuba's models make darker.
    darker: Vec<Darker>,
}

/// A material that is darker in Mitsuba.
struct Darker {
    material: String,
    /// Luminance under a white sky of luminance 1, here and in Mitsuba.
    albedos: [f32; 2],
}

/// The triangles of one material, which become one mesh.
struct Surface<'a> {
    /// Index of the material in the scene.
    index: usize,
    material: &'a Material,
    /// Base colour of the material, or the factor on its image.
    tint: Rgb,
    part: Part,
    /// Prefix of the names of all files of this surface.
    stem: String,
}

impl Writer<'_> {
    /// Adds lines to the scene.
    fn put(&mut self, lines: &str) {
        self.elements += &indented(lines);
    }

    /// The triangles of a material, with what they emit.
    fn surface(&mut self, index: usize) -> Result<(), ExportError> {
        let material = self.job.material(index);
        let part = Part::of_material(&self.job.scene().mesh, index as u32);
        if part.is_empty() {
            return Ok(());
        }
        let stem = format!("{index:02}_{}", plain(&material.name));
        let s = Surface { index, material, tint: self.job.tint(index), part, stem };
        self.note_lost_light(&s);
        let bsdf = self.bsdf(&s)?;
        let Some((emitter, two_sided)) = self.mesh_emitter(&s)? else {
            return self.ply(&s.part, &s.stem, &bsdf);
        };
        // Mitsuba emits from one side, about interpolated normals, and hides the body with the light.
        if !two_sided && !self.hide_emitters && s.part.is_flat() {
            return self.ply(&s.part, &s.stem, &(bsdf + &emitter));
        }
        let behind = -SKIN * (1.0 + s.part.reach());
        self.ply(&s.part.moved(behind), &s.stem, &bsdf)?;
        let emitter = boolean("face_normals", true) + &null() + &emitter;
        self.ply(&s.part, &format!("{}_front", s.stem), &emitter)?;
        if two_sided {
            let back = s.part.moved(2.0 * behind).turned();
            self.ply(&back, &format!("{}_back", s.stem), &emitter)?;
        }
        Ok(())
    }

    /// A mesh in a file of its own, with its BSDF and emitter.
    fn ply(&mut self, part: &Part, stem: &str, content: &str) -> Result<(), ExportError> {
        let name = format!("{stem}.ply");
        self.directory.write(&name, |out| part.write(out))?;
        let file = string("filename", &name) + &boolean("flip_tex_coords", true);
        self.put(&element("shape", "ply", &(file + content)));
        Ok(())
    }

    /// A path tracer that goes from the camera cannot follow light from a point
    /// through glass.
    fn warn_of_lost_caustics(&mut self) {
        let scene = self.job.scene();
        let used = |m: usize| scene.mesh.materials.contains(&(m as u32));
        let is_smooth = |m: &Material| m.alpha().is_none() && m.model() != Model::Diffuse;
        let smooth = scene.materials.iter().enumerate().find(|(i, m)| is_smooth(m) && used(*i));
        if let Some((_, m)) = smooth
            && let Some(l) = self.job.lights().find(|l| is_unseen(l.light) && l.shines())
        {
            self.warnings.push(format!(
                "light `{}`: Mitsuba's {} misses what the smooth material `{}` throws on from it",
                l.light.name,
                self.integrator(),
                m.name
            ));
        }
    }

    /// Remembers a material that is darker where light between facets is left out.
    fn note_lost_light(&mut self, s: &Surface) {
        let bsdf = s.material.bsdf(MIDDLE, 1.0);
        let value = self.job.scene().value_of(s.index, self.job.lighting.value as f32);
        let albedos =
            [bsdf.white_sky_albedo(), bsdf.single_scattering_albedo()].map(|a| luminance(a.at(value)));
        if albedos[1] < (1.0 - LEAST_LOSS) * albedos[0] {
            self.darker.push(Darker { material: s.material.name.clone(), albedos });
        }
    }

    /// One line about all materials that Mitsuba's models make darker.
    fn warn_of_lost_light(&mut self) {
        let ratio = |d: &Darker| d.albedos[1] / d.albedos[0];
        let Some(worst) = self.darker.iter().min_by(|a, b| ratio(a).total_cmp(&ratio(b))) else { return };
        let [ours, theirs] = worst.albedos;
        let others = match self.darker.len() - 1 {
            0 => String::new(),
            1 => "; another rough material is darker too".to_owned(),
            n => format!("; {n} other rough materials are darker too"),
        };
        self.warnings.push(format!(
            "material `{}`: Mitsuba's model loses the light that rough facets pass on to each other: under a \
             white sky of radiance 1 it shows {theirs:.3}, here {ours:.3}{others}",
            worst.material
        ));
    }

    /// Name of the integrator.
    fn integrator(&self) -> &'static str {
        if self.job.options.blocking { "path" } else { "volpath" }
    }

    /// Which lamps stop rays, in words. What emits as a material stops them as any surface does.
    fn bodies(&self) -> String {
        let is_lamp = |l: &LitLight| matches!(l.light.shape, Shape::Planar(_) | Shape::Sphere(_));
        let lamps: Vec<_> = self.job.lights().filter(|l| is_lamp(l) && !is_unseen(l.light)).collect();
        let (solid, passed): (Vec<&LitLight>, Vec<_>) = lamps.iter().partition(|l| self.stops_rays(l.light));
        match (solid.is_empty(), passed.is_empty()) {
            (true, true) => "No lamp has a surface that rays could meet.".to_owned(),
            (true, false) => "Lights do not block: volpath passes through their null surfaces.".to_owned(),
            (false, true) => "All lamps with a surface are black bodies that stop rays.".to_owned(),
            (false, false) => {
                let names: Vec<_> = solid.iter().map(|l| plain(&l.light.name)).collect();
                // Two hyphens would end a comment.
                let names = names.join(", ").replace("--", "__");
                format!(
                    "Black bodies that stop rays: {names}. Other lights do not block: volpath passes through their \
                     null surfaces."
                )
            }
        }
    }

    /// Whether a light becomes a black body.
    fn stops_rays(&self, l: &Light) -> bool {
        let has_surface = matches!(l.shape, Shape::Planar(_) | Shape::Sphere(_)) && !is_unseen(l);
        l.occludes || self.job.options.blocking && has_surface
    }

    /// What `path` shows differently from `volpath`.
    fn warn_of_bodies(&mut self) {
        if !self.job.options.blocking {
            return;
        }
        let changed: Vec<_> = self
            .job
            .lights()
            .filter(|l| self.stops_rays(l.light) && !l.light.occludes)
            .map(|l| format!("`{}`", l.light.name))
            .collect();
        if !changed.is_empty() {
            self.warnings
                .push(format!("lights {} stop rays in this export; here they do not", changed.join(", ")));
        }
    }

    /// Writes the scene description.
    fn finish(mut self) -> Result<Exported, ExportError> {
        let integrator = element(
            "integrator",
            self.integrator(),
            &(integer("max_depth", self.job.max_depth) + &boolean("hide_emitters", self.hide_emitters)),
        );
        let origin = self.job.scene().origin;
        let place = match origin.to_array() {
            // Mitsuba counts in f32 too: it would lose what was read as f64.
            [x, y, z] if origin != DVec3::ZERO => {
                format!("    <!-- Add ({x}, {y}, {z}) for the coordinates of the scene file. -->\n")
            }
            _ => String::new(),
        };
        let text = format!(
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<scene version=\"3.0.0\">\n\
             {place}{}    <!-- {} -->\n{}{}{}</scene>\n",
            indented(&property("default", "spp", 64)),
            self.bodies(),
            indented(&integrator),
            indented(&sensor(self.job.camera())?),
            self.elements
        );
        self.directory.write(SCENE_FILE, |out| out.write_all(text.as_bytes()))?;
        Ok(self.directory.finish(self.warnings))
    }
}

fn sensor(c: &Camera) -> Result<String, ExportError> {
    if c.lens().is_some() && c.shift() != Vec2::ZERO {
        return Err(no_counterpart("the camera".into(), "a lens whose film is shifted"));
    }
    // Mitsuba counts in widths and heights of the film, to the right and down.
    let size = c.size().as_vec2();
    let [x, y] = (c.shift() * Vec2::new(1.0, -1.0) * size.max_element() / size).to_array();
    let shift = match c.shift() {
        Vec2::ZERO => String::new(),
        _ => float("principal_point_offset_x", x) + &float("principal_point_offset_y", y),
    };
    let (kind, lens) = match c.lens() {
        None => ("perspective", String::new()),
        Some(lens) => {
            let radius = float("aperture_radius", lens.radius);
            ("thinlens", radius + &float("focus_distance", lens.focus_distance))
        }
    };
    let (from, toward, up) = (list(c.position), list(c.position + c.forward()), list(c.up()));
    let film = [
        integer("width", c.size().x),
        integer("height", c.size().y),
        string("pixel_format", "rgb"),
        string("component_format", "float32"),
        empty("rfilter", "box"),
    ];
    let body = [
        lens,
        shift,
        string("fov_axis", "y"),
        float("fov", c.vfov()),
        property("float", "near_clip", "1e-4"),
        property("float", "far_clip", "1e6"),
        to_world(&format!("<lookat origin=\"{from}\" target=\"{toward}\" up=\"{up}\"/>")),
        element("sampler", "multijitter", &integer("sample_count", "$spp")),
        element("film", "hdrfilm", &film.concat()),
    ];
    Ok(element("sensor", kind, &body.concat()))
}
