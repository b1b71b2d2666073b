//! Lights of pbrt.

use std::fmt::Write as _;

use glam::{Vec2, Vec3};

use super::{
    Writer,
    text::{numbers, param, plain, quoted, rgb},
};
use crate::{
    export::{
        ExportError, LitLight,
        sheet::{angle_of, cone_of},
    },
    film::exr::ExrPart,
    light::{Cone, Environment, Outline, Planar, Shape},
    math::{Rgb, warp::square_to_sphere_octahedral},
};

/// Points along a side of a texel at which the surroundings are sampled anew: their mean is that of the map.
const N_SAMPLES: usize = 4;
/// Largest side of the octahedral square, texels: 48 MiB, as the widest picture that is read.
const MAX_SIDE: usize = 2048;

impl Writer<'_> {
    /// Adds a light other than an emissive mesh.
    pub(super) fn light(&mut self, l: &LitLight) -> Result<(), ExportError> {
        let name = &l.light.name;
        let source = match &l.light.shape {
            Shape::Mesh(_) => return Ok(()),
            Shape::Point(p) => match p.cone {
                None => format!("LightSource \"point\" {} {}", rgb("I", l.rgb()), point("from", p.position)),
                Some((axis, cone)) => spot(p.position, axis, cone, l.rgb()),
            },
            Shape::Distant(d) => format!(
                "LightSource \"distant\" {} {} {}",
                rgb("L", l.rgb()),
                point("from", -d.direction),
                point("to", Vec3::ZERO)
            ),
            Shape::Environment(e) => self.environment(l, e)?,
            Shape::Planar(p) => match cone_of(p) {
                Some(cone) => {
                    self.warnings.push(format!("light `{name}`: its disk is a point in pbrt"));
                    spot(p.center, p.frame.n, cone, l.rgb() * p.area(l.size))
                }
                None => self.area(l, &planar(p, l.size)),
            },
            Shape::Sphere(s) => {
                let shape = format!(
                    "Translate {}\n  Shape \"sphere\" {}",
                    numbers(&s.center.to_array()),
                    param("float", "radius", s.radius * l.size)
                );
                self.area(l, &shape)
            }
        };
        let _ = write!(self.lights, "AttributeBegin\n  # {}\n  {source}\nAttributeEnd\n", quoted(name));
        Ok(())
    }

    /// A surface that emits. The place comes before the shape, of which rays pass unless it stops them.
    fn area(&mut self, l: &LitLight, shape: &str) -> String {
        let passed = if l.light.occludes { "" } else { " \"float alpha\" [ 0 ]" };
        if !l.light.occludes && l.light.camera_visible {
            self.warnings.push(format!(
                "light `{}`: rays pass it, so that in pbrt the camera and mirrors do not see it",
                l.light.name
            ));
        }
        format!("AreaLightSource \"diffuse\" {}\n  {shape}{passed}", rgb("L", l.rgb()))
    }

    fn environment(&mut self, l: &LitLight, e: &Environment) -> Result<String, ExportError> {
        let Some(map) = &e.map else {
            return Ok(format!("LightSource \"infinite\" {}", rgb("L", l.rgb())));
        };
        let [width, height] = map.size();
        // As many texels as the map has.
        let side = ((width * height) as f32).sqrt().ceil() as usize;
        let side = side.clamp(2, MAX_SIDE);
        let n = side * N_SAMPLES;
        let at = |i: usize| (i as f32 + 0.5) / n as f32;
        let texel = |i: usize| {
            let (x, y) = (i % side * N_SAMPLES, i / side * N_SAMPLES);
            let mut sum = Rgb::ZERO;
            for j in 0..N_SAMPLES * N_SAMPLES {
                let uv = Vec2::new(at(x + j % N_SAMPLES), at(y + j / N_SAMPLES));
                sum += e.radiance(square_to_sphere_octahedral(uv));
            }
            (sum * l.rgb() / (N_SAMPLES * N_SAMPLES) as f32).to_array()
        };
        let texels: Vec<_> = (0..side * side).map(texel).collect();
        let stem = format!("light_{}", plain(&l.light.name));
        let file = self.directory.picture(&stem, [side, side], ExrPart::rgb("color", &texels))?;
        Ok(format!("LightSource \"infinite\" \"string filename\" [ \"{file}\" ]"))
    }
}

/// A rectangle by its corners, or a disk in its place; the normal is where it emits.
fn planar(p: &Planar, size: f32) -> String {
    let frame = p.frame;
    match p.outline {
        Outline::Rectangle { a, b } => {
            let (s, t) = (frame.s * (a * size), frame.t * (b * size));
            let corners = [-s - t, s - t, -s + t, s + t].map(|d| (p.center + d).to_array());
            format!("Shape \"bilinearmesh\" \"point3 P\" [ {} ]", numbers(corners.as_flattened()))
        }
        Outline::Disk { r } => {
            // Columns of the matrix one after the other.
            let column = |v: Vec3, w: f32| numbers(&[v.x, v.y, v.z, w]);
            let columns =
                [column(frame.s, 0.0), column(frame.t, 0.0), column(frame.n, 0.0), column(p.center, 1.0)];
            format!(
                "ConcatTransform [ {} ]\n  Shape \"disk\" {}",
                columns.join(" "),
                param("float", "radius", r * size)
            )
        }
    }
}

fn point(name: &str, p: Vec3) -> String {
    format!("\"point3 {name}\" [ {} ]", numbers(&p.to_array()))
}

/// A spot: it falls off by a smooth step in the cosine, as ours.
fn spot(from: Vec3, axis: Vec3, cone: Cone, intensity: Rgb) -> String {
    let angle = angle_of(cone).to_degrees() as f32;
    let inner = cone.cos_inner.clamp(0.0, 1.0).acos().to_degrees();
    format!(
        "LightSource \"spot\" {} {} {} {} {}",
        rgb("I", intensity),
        point("from", from),
        point("to", from + axis),
        param("float", "coneangle", angle),
        param("float", "conedeltaangle", (angle - inner).max(0.0))
    )
}
