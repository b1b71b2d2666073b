//! Lights as emitters.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{
    ExportError, SKIN, Surface, Writer, no_counterpart,
    xml::{bitmap, element, float, inline, list, null, place, plain, property, rgb, string, to_world},
};
use crate::{
    camera::Camera,
    export::{ExportJob, LitLight},
    film::exr::ExrPart,
    light::{Cone, Environment, Light, Outline, Planar, RadianceMap, Shape, Sphere},
    math::{Frame, Rgb},
};

/// Number of point-like spots that stand for the disk of a spot. The share of them that
/// a straight edge hides differs from the share of the disk by 0.14 % of the whole
/// (root mean square), at most 0.74 %.
const N_SPOTS: u32 = 1024;
/// Smallest cosine of the edge of a cone (88 degrees). A projected picture cannot cover
/// a half-space; of a diffuse emitter's power less than 0.13 % leaves beyond.
const MIN_COS_CUTOFF: f32 = 0.035;

/// Whether the light is exported as emitters that no ray can hit.
pub(super) fn is_unseen(l: &Light) -> bool {
    l.is_delta() || spot(l).is_some()
}

/// The cone of a planar light, if it is not the whole half-space.
fn spot(l: &Light) -> Option<Cone> {
    match &l.shape {
        Shape::Planar(p) => p.cone.filter(|c| c.cos_inner > 0.0),
        _ => None,
    }
}

/// Whether the lights that rays of the camera can hit are hidden from it.
///
/// # Errors
/// When one of them is hidden and another is not. What lies outside the picture is neither.
pub(super) fn hide_emitters(job: &ExportJob) -> Result<bool, ExportError> {
    let mut lights = job.lights().filter(|l| !is_unseen(l.light));
    if lights.clone().all(|l| !l.light.camera_visible) {
        return Ok(lights.next().is_some());
    }
    let mut seen = lights.filter(|l| may_show(l, job.camera()));
    let Some(hidden) = seen.clone().find(|l| !l.light.camera_visible) else { return Ok(false) };
    if seen.any(|l| l.light.camera_visible) {
        let what = "a light hidden from the camera beside visible ones; give all the same `camera_visible`";
        return Err(no_counterpart(format!("light `{}`", hidden.light.name), what));
    }
    Ok(true)
}

/// Whether the light may show in the picture: true unless its shape surely lies outside.
fn may_show(l: &LitLight, camera: &Camera) -> bool {
    let cube = |center: Vec3, x: Vec3, y: Vec3, z: Vec3| {
        let sign = |i: u32, bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        (0..8).map(|i| center + x * sign(i, 0) + y * sign(i, 1) + z * sign(i, 2)).collect::<Vec<_>>()
    };
    match &l.light.shape {
        Shape::Planar(p) => {
            let (a, b) = match p.outline {
                Outline::Rectangle { a, b } => (a, b),
                Outline::Disk { r } => (r, r),
            };
            camera.may_see(&cube(p.center, p.frame.s * (a * l.size), p.frame.t * (b * l.size), Vec3::ZERO))
        }
        Shape::Sphere(s) => {
            let r = s.radius * l.size;
            camera.may_see(&cube(s.center, Vec3::X * r, Vec3::Y * r, Vec3::Z * r))
        }
        Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => true,
    }
}

/// Whether all lights have counterparts.
pub(super) fn check(lights: &[Light]) -> Result<(), ExportError> {
    let is_cone = |l: &&Light| {
        spot(l).is_some()
            && matches!(l.shape, Shape::Planar(Planar { outline: Outline::Rectangle { .. }, .. }))
    };
    match lights.iter().find(is_cone) {
        Some(l) => Err(no_counterpart(format!("light `{}`", l.name), "a rectangle with a cone")),
        None => Ok(()),
    }
}

impl Writer<'_> {
    /// Adds a light other than an emissive mesh. A light that emits nothing and stops no
    /// ray is left out.
    pub(super) fn light(&mut self, l: &LitLight) -> Result<(), ExportError> {
        let radiance = l.rgb();
        if !l.light.occludes && (l.size <= 0.0 || radiance == Rgb::ZERO) {
            return Ok(());
        }
        match &l.light.shape {
            Shape::Mesh(_) => {}
            Shape::Point(p) => match p.cone {
                None => {
                    let position = property("point", "position", list(p.position));
                    self.put(&element("emitter", "point", &(position + &rgb("intensity", radiance))));
                }
                Some((axis, cone)) => {
                    let id = self.projected(l.light, cone, |_| 1.0)?;
                    self.spot(&id, cone, place(Frame::from_normal(axis), p.position), radiance, 1.0);
                }
            },
            Shape::Distant(d) => {
                let direction = property("vector", "direction", list(d.direction));
                self.put(&element("emitter", "directional", &(direction + &rgb("irradiance", radiance))));
            }
            Shape::Environment(e) => self.environment(l, e)?,
            Shape::Planar(p) => match (spot(l.light), p.outline) {
                (Some(cone), Outline::Disk { r }) => self.spots(l, p, r, cone)?,
                (_, outline) => self.planar(l, p, outline),
            },
            Shape::Sphere(s) => self.sphere(l, s),
        }
        Ok(())
    }

    /// Adds a spot with a disk of radius `r` (metres at unit size) as [`N_SPOTS`] spots
    /// without extent.
    fn spots(&mut self, l: &LitLight, p: &Planar, r: f32, cone: Cone) -> Result<(), ExportError> {
        let id = self.projected(l.light, cone, |cos| cos)?;
        let share = 1.0 / N_SPOTS as f32;
        let intensity = l.rgb() * (p.area(l.size) * share);
        for x in disk_points(p.center, p.frame, r * l.size) {
            self.spot(&id, cone, place(p.frame, x), intensity, share);
        }
        self.warnings.push(format!(
            "light `{}`: exported as {N_SPOTS} points; its disk is not seen, nor mirrored",
            l.light.name
        ));
        Ok(())
    }

    /// Adds a rectangle or a disk. Mitsuba's unit shapes lie in the xy plane and face +z.
    fn planar(&mut self, l: &LitLight, p: &Planar, outline: Outline) {
        let (shape, a, b) = match outline {
            Outline::Rectangle { a, b } => ("rectangle", a, b),
            Outline::Disk { r } => ("disk", r, r),
        };
        let frame = Frame { s: p.frame.s * (a * l.size), t: p.frame.t * (b * l.size), n: p.frame.n };
        self.area(l, shape, p.center, |distance| place(frame, p.center + p.frame.n * distance));
    }

    fn sphere(&mut self, l: &LitLight, s: &Sphere) {
        let radius = s.radius * l.size;
        self.area(l, "sphere", s.center.abs() + radius, |distance| {
            property("point", "center", list(s.center)) + &float("radius", radius + distance)
        });
    }

    /// Adds a shape that emits and either lets all rays pass or is black. `place` gives the
    /// position parameters of the shape moved forward by a distance (metres); `reach` bounds
    /// the coordinates of the shape's centre.
    fn area(&mut self, l: &LitLight, shape: &str, reach: Vec3, place: impl Fn(f32) -> String) {
        let emitter =
            if l.rgb() == Rgb::ZERO { String::new() } else { area_emitter(&rgb("radiance", l.rgb())) };
        let black = inline("bsdf", "diffuse", &property("rgb", "reflectance", 0));
        let hide = self.hide_emitters;
        let mut put = |distance: f32, bsdf: &str, emitter: &str| {
            self.put(&element("shape", shape, &(place(distance) + bsdf + emitter)));
        };
        match (l.light.occludes, hide) {
            (false, _) => put(0.0, &null(), &emitter),
            (true, false) => put(0.0, &black, &emitter),
            // Mitsuba hides the body with the light; ours stays, black.
            (true, true) => {
                put(-SKIN * (1.0 + reach.abs().max_element()), &black, "");
                if !emitter.is_empty() {
                    put(0.0, &null(), &emitter);
                }
            }
        }
    }

    /// The emitter of a surface, XML, and whether it emits from both sides; `None` for a
    /// surface that does not emit.
    pub(super) fn mesh_emitter(&mut self, s: &Surface) -> Result<Option<(String, bool)>, ExportError> {
        let materials = &self.job.scene().mesh.materials;
        let light = self.job.lights().find_map(|l| match &l.light.shape {
            Shape::Mesh(m) => {
                let prim = m.prims().next()? as usize;
                (materials[prim] as usize == s.index).then_some((l, m))
            }
            _ => None,
        });
        let Some((l, m)) = light.filter(|(l, _)| l.shines()) else { return Ok(None) };
        // What lets light pass emits less; Mitsuba's emits in full.
        let opacity = if s.material.opacity_map().is_some() {
            self.warn(s.material, "emits in Mitsuba where it is transparent");
            1.0
        } else {
            s.material.opacity(Vec2::ZERO)
        };
        let radiance = l.color * (l.radiance * opacity);
        let emitted = match s.material.emission_texture() {
            None => rgb("radiance", radiance),
            Some(image) => {
                let scaled = |[r, g, b, _]: [f32; 4]| (Rgb::new(r, g, b) * radiance).to_array();
                let stem = format!("{}_emission", s.stem);
                let file = self.directory.color_texture(&stem, "emission", image, scaled)?;
                self.warn(
                    s.material,
                    "Mitsuba samples what it emits rightly only where each texel is used once",
                );
                self.texture(s, "radiance", &file, image)
            }
        };
        Ok(Some((area_emitter(&emitted), m.two_sided())))
    }

    fn environment(&mut self, l: &LitLight, e: &Environment) -> Result<(), ExportError> {
        let radiance = l.rgb();
        let Some(map) = &e.map else {
            self.put(&element("emitter", "constant", &rgb("radiance", radiance)));
            return Ok(());
        };
        let [width, height] = map.size();
        let part = ExrPart::rgb("color", &between_rows(map, radiance));
        let stem = self.light_stem(l.light);
        let file = self.directory.picture(&stem, [width, 2 * height + 1], part)?;
        let rotation = to_world(&format!("<rotate y=\"1\" angle=\"{}\"/>", e.rotation.to_degrees()));
        self.put(&element("emitter", "envmap", &(string("filename", &file) + &rotation)));
        Ok(())
    }

    /// Adds the texture that a `spot` projects to emit the profile of `cone` times
    /// `factor` of the cosine, and returns the texture's id.
    ///
    /// The picture covers the square about the cone on a plane across the axis, so that
    /// texels are evenly spaced in the tangent of the angle.
    fn projected(
        &mut self,
        l: &Light,
        cone: Cone,
        factor: impl Fn(f32) -> f32,
    ) -> Result<String, ExportError> {
        let (_, edge) = cutoff(cone);
        let n = profile_resolution(cone, edge);
        let texels = (0..n * n)
            .map(|i| {
                let at = |k: usize| ((k as f32 + 0.5) / n as f32 * 2.0 - 1.0) * edge;
                let (x, y) = (at(i % n), at(i / n));
                let cos = 1.0 / (1.0 + x * x + y * y).sqrt();
                cone.profile(cos) * factor(cos)
            })
            .collect();
        let id = self.light_stem(l);
        let file = self.directory.picture(&id, [n, n], ExrPart::single("profile", "Y", texels))?;
        self.put(&bitmap(&format!("id=\"{id}\""), &file, &string("wrap_mode", "clamp")));
        Ok(id)
    }

    /// File name, without its ending, for the picture of a light. Lights whose names differ
    /// only in unsafe characters get numbers.
    fn light_stem(&self, l: &Light) -> String {
        let plain = format!("light_{}", plain(&l.name));
        let mut stem = plain.clone();
        let mut n = 1;
        while self.directory.has(&format!("{stem}.exr")) {
            n += 1;
            stem = format!("{plain}_{n}");
        }
        stem
    }

    /// Adds a spot without extent; `weight` is how often Mitsuba chooses it beside others.
    fn spot(&mut self, texture: &str, cone: Cone, place: String, intensity: Rgb, weight: f32) {
        let angle = cutoff(cone).0.acos().to_degrees();
        let body = [
            place,
            float("cutoff_angle", angle),
            float("beam_width", angle),
            rgb("intensity", intensity),
            format!("<ref name=\"texture\" id=\"{texture}\"/>"),
            float("sampling_weight", weight),
        ];
        self.put(&inline("emitter", "spot", &body.concat()));
    }
}

fn area_emitter(radiance: &str) -> String {
    element("emitter", "area", radiance)
}

/// Number of texels along a side of the picture of a cone's profile; `edge` is the tangent
/// of the angle at which the cone ends.
///
/// Bilinear interpolation between texels of size h errs by h²/8 |f''|: at most 6/8 (h/w)²
/// on a smooth step of width w, and h²/8 on the cosine. 0.1 % of the peak is allowed, but
/// no more than 2048² texels (16 MiB).
fn profile_resolution(cone: Cone, edge: f32) -> usize {
    let cos_inner = cone.cos_inner.max(MIN_COS_CUTOFF);
    let width = edge - (1.0 - cos_inner * cos_inner).max(0.0).sqrt() / cos_inner;
    let step = if width > 0.0 { (0.036 * width).min(0.09) } else { 0.09 };
    ((2.0 * edge / step) as usize).clamp(64, 2048).next_power_of_two()
}

/// The rows of an environment map times `radiance`, with the means between them.
///
/// Mitsuba's bilinear picture has its first and last row at the poles, ours has them half
/// a row away: with the means both interpolate alike.
fn between_rows(map: &RadianceMap, radiance: Rgb) -> Vec<[f32; 3]> {
    let [width, height] = map.size();
    let row = |y: usize| &map.texels()[y * width..(y + 1) * width];
    let mut texels = Vec::with_capacity(width * (2 * height + 1));
    for j in 0..=2 * height {
        // Row j of the export is at j/2 rows of ours from the pole.
        let above = row((j.max(1) - 1) / 2);
        let below = row((j / 2).min(height - 1));
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| {
            (0.5 * (Vec3::from_array(*a) + Vec3::from_array(*b)) * radiance).to_array()
        };
        texels.extend(above.iter().zip(below).map(mean));
    }
    texels
}

/// The cosine and the tangent of the angle at which a `spot` for this cone ends.
fn cutoff(cone: Cone) -> (f32, f32) {
    let cos = cone.cos_outer.max(MIN_COS_CUTOFF);
    (cos, (1.0 - cos * cos).sqrt() / cos)
}

/// [`N_SPOTS`] points that share the area of a disk evenly, as the florets of a sunflower
/// do (H. Vogel, Math. Biosciences 44, 1979).
fn disk_points(center: Vec3, frame: Frame, radius: f32) -> impl Iterator<Item = Vec3> {
    let golden = PI * (3.0 - 5.0_f32.sqrt());
    (0..N_SPOTS).map(move |i| {
        let (sin, cos) = (golden * i as f32).sin_cos();
        let r = radius * ((i as f32 + 0.5) / N_SPOTS as f32).sqrt();
        center + (frame.s * cos + frame.t * sin) * r
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_between_keep_the_bilinear_picture() {
        let texels: Vec<[f32; 3]> = (0..6).map(|i| [i as f32, 1.0, 0.0]).collect();
        let map = RadianceMap::new(2, 3, texels).unwrap();
        let red: Vec<f32> = between_rows(&map, Rgb::splat(2.0)).iter().map(|t| t[0]).collect();
        assert_eq!(red, [0.0, 2.0, 0.0, 2.0, 2.0, 4.0, 4.0, 6.0, 6.0, 8.0, 8.0, 10.0, 8.0, 10.0]);
    }
}
