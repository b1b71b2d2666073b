//! Lights as emitters.

use std::{f32::consts::PI, fmt::Write as _};

use glam::{Vec2, Vec3};

use super::{Export, ExportError, SKIN, bitmap, list, plain};
use crate::{
    film::exr::ExrPart,
    light::{Cone, Environment, Light, Outline, Planar, RadianceMap, Shape},
    math::{Frame, Rgb},
};

/// Points that stand for the disk of a spot. What a straight edge leaves of them
/// differs from what it leaves of the disk by 0.14 % of the whole (root mean
/// square), at most 0.74 %.
const N_SPOTS: u32 = 1024;
/// Least cosine of a cone's edge: a projected picture cannot cover a half-space,
/// and what leaves at more than 88 degrees is below 0.13 %.
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

/// Whether all lights that a ray can hit are hidden from the camera.
pub(super) fn hide_emitters(lights: &[Light]) -> Result<bool, ExportError> {
    let mut seen = lights.iter().filter(|l| !is_unseen(l));
    let Some(hidden) = seen.clone().find(|l| !l.camera_visible) else { return Ok(false) };
    if seen.any(|l| l.camera_visible) {
        return Err(ExportError::Visibility { light: hidden.name.clone() });
    }
    Ok(true)
}

/// Whether all lights have counterparts.
pub(super) fn check(lights: &[Light]) -> Result<(), ExportError> {
    let is_cone = |l: &&Light| {
        spot(l).is_some()
            && matches!(l.shape, Shape::Planar(Planar { outline: Outline::Rectangle { .. }, .. }))
    };
    match lights.iter().find(is_cone) {
        Some(l) => Err(ExportError::Cone { light: l.name.clone() }),
        None => Ok(()),
    }
}

impl Export<'_> {
    /// A light that is no mesh; one that emits nothing and stops no ray is left out.
    pub(super) fn light(&mut self, l: &Light) -> Result<(), ExportError> {
        let radiance = l.color * l.radiance;
        if !l.occludes && (l.size <= 0.0 || radiance == Rgb::ZERO) {
            return Ok(());
        }
        match &l.shape {
            Shape::Mesh(_) => {}
            Shape::Point(p) => match p.cone {
                None => {
                    let _ = write!(
                        self.elements,
                        "    <emitter type=\"point\">\n        \
                         <point name=\"position\" value=\"{}\"/>\n        \
                         <rgb name=\"intensity\" value=\"{}\"/>\n    </emitter>\n",
                        list(p.position),
                        list(radiance)
                    );
                }
                Some((axis, cone)) => {
                    let id = self.projected(l, cone, |_| 1.0)?;
                    self.spot(&id, cone, matrix(Frame::from_normal(axis), p.position), radiance, 1.0);
                }
            },
            Shape::Distant(d) => {
                let _ = write!(
                    self.elements,
                    "    <emitter type=\"directional\">\n        \
                     <vector name=\"direction\" value=\"{}\"/>\n        \
                     <rgb name=\"irradiance\" value=\"{}\"/>\n    </emitter>\n",
                    list(d.direction),
                    list(radiance)
                );
            }
            Shape::Environment(e) => self.environment(l, e)?,
            Shape::Planar(p) => match (spot(l), p.outline) {
                (Some(cone), Outline::Disk { r }) => {
                    let id = self.projected(l, cone, |cos| cos)?;
                    let share = 1.0 / N_SPOTS as f32;
                    let intensity = radiance * (p.area(l.size) * share);
                    for x in disk_points(p.center, p.frame, r * l.size) {
                        self.spot(&id, cone, matrix(p.frame, x), intensity, share);
                    }
                    self.warnings.push(format!(
                        "light `{}`: exported as {N_SPOTS} points; its disk is not seen, nor mirrored",
                        l.name
                    ));
                }
                (_, outline) => {
                    let (shape, a, b) = match outline {
                        Outline::Rectangle { a, b } => ("rectangle", a, b),
                        Outline::Disk { r } => ("disk", r, r),
                    };
                    // Mitsuba's unit shapes lie in the xy plane and face +z.
                    let (s, t) = (p.frame.s * (a * l.size), p.frame.t * (b * l.size));
                    let place = |distance: f32| {
                        let frame = Frame { s, t, n: p.frame.n };
                        format!("        {}\n", matrix(frame, p.center + p.frame.n * distance))
                    };
                    self.area(shape, place, p.center, l);
                }
            },
            Shape::Sphere(s) => {
                let place = |distance: f32| {
                    format!(
                        "        <point name=\"center\" value=\"{}\"/>\n        \
                         <float name=\"radius\" value=\"{}\"/>\n",
                        list(s.center),
                        s.radius * l.size + distance
                    )
                };
                self.area("sphere", place, s.center.abs() + s.radius * l.size, l);
            }
        }
        Ok(())
    }

    /// A shape that emits and lets all rays pass, or is black. `place` puts it a
    /// distance before its place; `reach` is its centre or farther.
    fn area(&mut self, shape: &str, place: impl Fn(f32) -> String, reach: Vec3, l: &Light) {
        let radiance = l.color * l.radiance;
        let emitter = area_emitter(&format!("<rgb name=\"radiance\" value=\"{}\"/>", list(radiance)));
        let emitter = if radiance == Rgb::ZERO { "" } else { &emitter };
        let mut put = |place: String, bsdf: &str, emitter: &str| {
            let _ = write!(
                self.elements,
                "    <shape type=\"{shape}\">\n{place}        {bsdf}\n{emitter}    </shape>\n"
            );
        };
        let (null, black) = (
            "<bsdf type=\"null\"/>",
            "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf>",
        );
        match (l.occludes, self.hide_emitters) {
            (false, _) => put(place(0.0), null, emitter),
            (true, false) => put(place(0.0), black, emitter),
            // Mitsuba hides the body with the light; ours stays, black.
            (true, true) => {
                put(place(-SKIN * (1.0 + reach.abs().max_element())), black, "");
                if !emitter.is_empty() {
                    put(place(0.0), null, emitter);
                }
            }
        }
    }

    /// What the triangles of a material emit, and whether from both sides.
    pub(super) fn mesh_emitter(
        &mut self,
        material: usize,
        stem: &str,
    ) -> Result<Option<(String, bool)>, ExportError> {
        let light = self.lights.iter().find_map(|l| match &l.shape {
            Shape::Mesh(m) => {
                let prim = m.prims().next()? as usize;
                (self.mesh.materials[prim] as usize == material).then_some((l, m))
            }
            _ => None,
        });
        let Some((l, m)) = light.filter(|(l, _)| l.radiance > 0.0) else { return Ok(None) };
        // What lets light pass emits less; Mitsuba's emits in full.
        let opacity = if self.materials[material].opacity_map().is_some() {
            self.warnings.push(format!(
                "material `{}`: emits in Mitsuba where it is transparent",
                self.materials[material].name
            ));
            1.0
        } else {
            self.materials[material].opacity(Vec2::ZERO)
        };
        let radiance = l.color * (l.radiance * opacity);
        let element = match self.materials[material].emission_texture() {
            None => format!("<rgb name=\"radiance\" value=\"{}\"/>", list(radiance)),
            Some(texture) => {
                let [width, height] = texture.size();
                let texels: Vec<[f32; 3]> = (0..width * height)
                    .map(|i| {
                        let [r, g, b, _] = texture.texel(i % width, i / width);
                        (Rgb::new(r, g, b) * radiance).to_array()
                    })
                    .collect();
                let part = ExrPart::rgb("emission", &texels);
                let file = self.picture(&format!("{stem}_emission"), [width, height], part)?;
                self.warnings.push(format!(
                    "material `{}`: Mitsuba samples what it emits rightly only where each texel is used once",
                    self.materials[material].name
                ));
                bitmap("radiance", &file, texture.transform())
            }
        };
        Ok(Some((area_emitter(&element), m.two_sided())))
    }

    fn environment(&mut self, l: &Light, e: &Environment) -> Result<(), ExportError> {
        let radiance = l.color * l.radiance;
        let Some(map) = &e.map else {
            let _ = write!(
                self.elements,
                "    <emitter type=\"constant\">\n        \
                 <rgb name=\"radiance\" value=\"{}\"/>\n    </emitter>\n",
                list(radiance)
            );
            return Ok(());
        };
        let [width, height] = map.size();
        let part = ExrPart::rgb("color", &between_rows(map, radiance));
        let file = self.picture(&format!("light_{}", plain(&l.name)), [width, 2 * height + 1], part)?;
        let _ = write!(
            self.elements,
            "    <emitter type=\"envmap\">\n        \
             <string name=\"filename\" value=\"{file}\"/>\n        \
             <transform name=\"to_world\">\n            \
             <rotate y=\"1\" angle=\"{}\"/>\n        </transform>\n    </emitter>\n",
            e.rotation.to_degrees()
        );
        Ok(())
    }

    /// The picture that a `spot` projects to emit `cone`'s profile times `factor`
    /// of the cosine; returns its id.
    ///
    /// It covers the square about the cone on a plane across the axis, so texels
    /// are even in the tangent of the angle.
    fn projected(
        &mut self,
        l: &Light,
        cone: Cone,
        factor: impl Fn(f32) -> f32,
    ) -> Result<String, ExportError> {
        let (_, edge) = cutoff(cone);
        let cos_inner = cone.cos_inner.max(MIN_COS_CUTOFF);
        let width = edge - (1.0 - cos_inner * cos_inner).max(0.0).sqrt() / cos_inner;
        // Bilinear interpolation errs by h²/8 |f''|: at most 6/8 (h/w)² on a smooth
        // step of width w, and h²/8 on the cosine. 0.1 % of the peak is allowed.
        let step = if width > 0.0 { (0.036 * width).min(0.09) } else { 0.09 };
        let n = ((2.0 * edge / step) as usize).clamp(64, 2048).next_power_of_two();
        let texels = (0..n * n)
            .map(|i| {
                let at = |k: usize| ((k as f32 + 0.5) / n as f32 * 2.0 - 1.0) * edge;
                let (x, y) = (at(i % n), at(i / n));
                let cos = 1.0 / (1.0 + x * x + y * y).sqrt();
                cone.profile(cos) * factor(cos)
            })
            .collect();
        let id = format!("light_{}", plain(&l.name));
        let file = self.picture(&id, [n, n], ExrPart::single("profile", "Y", texels))?;
        let _ = write!(
            self.elements,
            "    <texture type=\"bitmap\" id=\"{id}\">\n        \
             <string name=\"filename\" value=\"{file}\"/>\n        \
             <boolean name=\"raw\" value=\"true\"/>\n        \
             <string name=\"format\" value=\"variant\"/>\n        \
             <string name=\"wrap_mode\" value=\"clamp\"/>\n    </texture>\n"
        );
        Ok(id)
    }

    fn spot(&mut self, texture: &str, cone: Cone, place: String, intensity: Rgb, weight: f32) {
        let angle = cutoff(cone).0.acos().to_degrees();
        let _ = writeln!(
            self.elements,
            "    <emitter type=\"spot\">{place}\
             <float name=\"cutoff_angle\" value=\"{angle}\"/>\
             <float name=\"beam_width\" value=\"{angle}\"/>\
             <rgb name=\"intensity\" value=\"{}\"/><ref name=\"texture\" id=\"{texture}\"/>\
             <float name=\"sampling_weight\" value=\"{weight}\"/></emitter>",
            list(intensity)
        );
    }
}

fn area_emitter(radiance: &str) -> String {
    let radiance: String = radiance.lines().map(|l| format!("            {l}\n")).collect();
    format!("        <emitter type=\"area\">\n{radiance}        </emitter>\n")
}

fn matrix(frame: Frame, p: Vec3) -> String {
    let rows: Vec<String> =
        (0..3).map(|i| format!("{} {} {} {}", frame.s[i], frame.t[i], frame.n[i], p[i])).collect();
    format!("<transform name=\"to_world\"><matrix value=\"{} 0 0 0 1\"/></transform>", rows.join(" "))
}

/// The rows of a map and the means between them, as Mitsuba's bilinear picture
/// has its first and last row at the poles and ours its rows half a row away.
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

/// Points that share a disk's area evenly, as the florets of a sunflower do
/// (H. Vogel, Math. Biosciences 44, 1979).
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
