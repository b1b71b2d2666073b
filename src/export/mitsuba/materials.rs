//! Materials as BSDFs.

use std::collections::HashMap;

use super::{Export, ExportError, Part, bitmap, list};
use crate::{
    bsdf::{microfacet::Ggx, plastic::internal_reflectance},
    film::exr::ExrPart,
    math::Rgb,
    scene::{
        Material,
        material::{Model, Relief},
        texture::ScalarMap,
    },
};

/// [`compensation`] by the bits of IOR and slope: materials that are alike share it.
#[derive(Default)]
pub(super) struct Compensations(HashMap<(u32, Option<u32>), f32>);

impl Compensations {
    fn get(&mut self, ior: f32, alpha: Option<f32>) -> f32 {
        let key = (ior.to_bits(), alpha.map(f32::to_bits));
        *self.0.entry(key).or_insert_with(|| compensation(ior, alpha))
    }
}

/// XML under construction: an element of a BSDF with its body indented.
fn element(kind: &str, body: &str) -> String {
    let body: String = body.lines().map(|l| format!("    {l}\n")).collect();
    format!("<bsdf type=\"{kind}\">\n{body}</bsdf>\n")
}

fn float(name: &str, value: f32) -> String {
    format!("<float name=\"{name}\" value=\"{value}\"/>\n")
}

impl Export<'_> {
    fn warn(&mut self, material: &Material, message: &str) {
        self.warnings.push(format!("material `{}`: {message}", material.name));
    }

    /// What a material scatters, and lets pass.
    pub(super) fn bsdf(
        &mut self,
        material: &Material,
        part: &Part,
        stem: &str,
    ) -> Result<String, ExportError> {
        let mut body = if material.model() == Model::Dielectric {
            let glass = self.dielectric(material, stem)?;
            match self.relief(material, part, stem, &glass)? {
                None => glass,
                Some([front, _]) => {
                    self.warn(material, "Mitsuba bends grazing light differently at its relief");
                    front
                }
            }
        } else {
            let opaque = self.opaque(material, stem)?;
            let sides = self.relief(material, part, stem, &opaque)?;
            element("twosided", &sides.map_or(opaque, |[front, back]| front + &back))
        };
        if material.is_translucent() {
            if material.opacity_cutoff().is_some() && material.opacity_map().is_some() {
                self.warn(material, "Mitsuba cannot cut its opacity off between texels; the edges differ");
            }
            let cutoff = material.opacity_cutoff();
            let limit = move |v: f32| cutoff.map_or(v, |c| f32::from(v >= c));
            let map = material.opacity_map();
            let opacity = self.number(stem, "opacity", material.opacity_factor(), map, limit)?;
            body = element("mask", &(opacity + &body));
        }
        Ok(body.lines().map(|l| format!("        {l}\n")).collect())
    }

    /// `factor` times what its image says, through `f`: a number or a texture.
    fn number(
        &mut self,
        stem: &str,
        name: &str,
        factor: f32,
        map: Option<&ScalarMap>,
        f: impl Fn(f32) -> f32,
    ) -> Result<String, ExportError> {
        let Some(map) = map else { return Ok(float(name, f(factor))) };
        let [width, height] = map.texture.size();
        let texels = (0..width * height)
            .map(|i| {
                f((factor * map.texture.texel(i % width, i / width)[map.channel as usize]).clamp(0.0, 1.0))
            })
            .collect();
        let part = ExrPart::single(name, "Y", texels);
        let file = self.picture(&format!("{stem}_{name}"), [width, height], part)?;
        Ok(bitmap(name, &file, map.texture.transform()))
    }

    /// The base colour times `scale` under a parameter's name; writes its texture.
    fn color(
        &mut self,
        material: &Material,
        stem: &str,
        name: &str,
        scale: f32,
    ) -> Result<String, ExportError> {
        let tint = material.tint() * scale;
        let mut clamped = false;
        let mut limit = |c: Rgb| {
            clamped |= c.max_element() > 1.0;
            c.min(Rgb::ONE)
        };
        let element = match material.texture() {
            None => format!("<rgb name=\"{name}\" value=\"{}\"/>\n", list(limit(tint))),
            Some(texture) => {
                let [width, height] = texture.size();
                let texels: Vec<[f32; 3]> = (0..width * height)
                    .map(|i| {
                        let [r, g, b, _] = texture.texel(i % width, i / width);
                        limit(Rgb::new(r, g, b) * tint).to_array()
                    })
                    .collect();
                // A coat has its own factor.
                let stem = if scale == 1.0 { stem.to_owned() } else { format!("{stem}_coated") };
                let file = self.picture(&stem, [width, height], ExrPart::rgb("color", &texels))?;
                bitmap(name, &file, texture.transform())
            }
        };
        if clamped {
            self.warn(material, "its base colour exceeds 1 in Mitsuba and was clamped");
        }
        Ok(element)
    }

    fn dielectric(&mut self, material: &Material, stem: &str) -> Result<String, ExportError> {
        let ior = float("int_ior", material.ior()) + &float("ext_ior", 1.0);
        Ok(match self.alpha(material, stem)? {
            None => element("dielectric", &ior),
            Some(alpha) => element("roughdielectric", &(alpha + &ior)),
        })
    }

    /// The GGX slope; `None` is smooth.
    fn alpha(&mut self, material: &Material, stem: &str) -> Result<Option<String>, ExportError> {
        let ggx = "<string name=\"distribution\" value=\"ggx\"/>\n".to_owned();
        if let Some(map) = material.roughness_map() {
            self.warn(
                material,
                "Mitsuba interpolates the square of its roughness; lookups between texels differ",
            );
            let squared = |r: f32| (r * r).max(Ggx::MIN_ALPHA);
            return Ok(Some(ggx + &self.number(stem, "alpha", material.roughness(), Some(map), squared)?));
        }
        Ok(material.alpha().map(|a| ggx + &float("alpha", a)))
    }

    /// One side of what is not glass: (1 − m)·[(1 − w)·diffuse + w·plastic] + m·metal.
    fn opaque(&mut self, material: &Material, stem: &str) -> Result<String, ExportError> {
        let (m, m_map) = (material.metallic(), material.metallic_map());
        if material.model() == Model::Conductor || (m >= 1.0 && m_map.is_none()) {
            return self.metal(material, stem);
        }
        let (w, w_map) = (material.specular(), material.specular_map());
        let (w, w_map) = if material.model() == Model::Plastic { (w, w_map) } else { (0.0, None) };
        let base = match (w, w_map.is_some()) {
            (0.0, _) => self.diffuse(material, stem)?,
            (1.0, false) => self.plastic(material, stem)?,
            _ => {
                let both = self.diffuse(material, stem)? + &self.plastic(material, stem)?;
                element("blendbsdf", &(self.number_as(stem, "coat", "weight", w, w_map)? + &both))
            }
        };
        if m == 0.0 {
            return Ok(base);
        }
        let both = base + &self.metal(material, stem)?;
        Ok(element("blendbsdf", &(self.number_as(stem, "metallic", "weight", m, m_map)? + &both)))
    }

    /// A number whose picture is named otherwise.
    fn number_as(
        &mut self,
        stem: &str,
        picture: &str,
        name: &str,
        factor: f32,
        map: Option<&ScalarMap>,
    ) -> Result<String, ExportError> {
        let text = self.number(stem, picture, factor, map, |v| v)?;
        Ok(text.replacen(&format!("name=\"{picture}\""), &format!("name=\"{name}\""), 1))
    }

    fn diffuse(&mut self, material: &Material, stem: &str) -> Result<String, ExportError> {
        Ok(element("diffuse", &self.color(material, stem, "reflectance", 1.0)?))
    }

    fn plastic(&mut self, material: &Material, stem: &str) -> Result<String, ExportError> {
        let alpha = match material.roughness_map() {
            None => material.alpha(),
            Some(map) => {
                self.warn(
                    material,
                    "Mitsuba's coat has one roughness; exported with the middle of its range",
                );
                let [lo, hi] = map.range().map(|v| (material.roughness() * v).clamp(0.0, 1.0));
                Some((0.25 * (lo + hi) * (lo + hi)).max(Ggx::MIN_ALPHA))
            }
        };
        let scale = self.compensations.get(material.ior(), alpha);
        let body = format!(
            "{}{}{}<boolean name=\"nonlinear\" value=\"false\"/>\n",
            self.color(material, stem, "diffuse_reflectance", scale)?,
            float("int_ior", material.ior()),
            float("ext_ior", 1.0),
        );
        Ok(match alpha {
            None => element("plastic", &body),
            Some(a) => element(
                "roughplastic",
                &format!("{body}<string name=\"distribution\" value=\"ggx\"/>\n{}", float("alpha", a)),
            ),
        })
    }

    fn metal(&mut self, material: &Material, stem: &str) -> Result<String, ExportError> {
        let is_smooth = material.alpha().is_none() && material.roughness_map().is_none();
        if is_smooth && material.texture().is_none() && material.tint() == Rgb::ONE {
            return Ok(element("conductor", "<string name=\"material\" value=\"none\"/>\n"));
        }
        if is_smooth {
            self.warn(
                material,
                "Mitsuba has no smooth metal with Schlick's reflectance; exported as slightly rough",
            );
        }
        let roughness = match material.roughness_map() {
            None => float("roughness", material.alpha().unwrap_or(0.0).sqrt()),
            map => self.number(stem, "roughness", material.roughness(), map, |r| r)?,
        };
        let color = self.color(material, stem, "base_color", 1.0)?;
        Ok(element("principled", &format!("{color}{}{roughness}", float("metallic", 1.0))))
    }

    /// The front and the back of a surface whose normals are tilted, each around `inner`.
    ///
    /// `twosided` mirrors the back, we turn it over as a whole: there the tilt is
    /// the other way round.
    fn relief(
        &mut self,
        material: &Material,
        part: &Part,
        stem: &str,
        inner: &str,
    ) -> Result<Option<[String; 2]>, ExportError> {
        const PLAIN: &str = "<boolean name=\"flip_invalid_normals\" value=\"false\"/>\n\
                             <boolean name=\"use_shadowing_function\" value=\"false\"/>\n";
        match material.relief() {
            None => Ok(None),
            Some(Relief::NormalMap { texture, scale }) => {
                let mirrored = part.mirrored();
                if mirrored > 0 && mirrored < part.len() {
                    self.warn(
                        material,
                        "its image is mirrored on some triangles, where Mitsuba's green is down",
                    );
                }
                let green = if 2 * mirrored > part.len() { -scale } else { *scale };
                let [width, height] = texture.size();
                let mut sides = [String::new(), String::new()];
                for (side, sign, name) in [(0, 1.0, "normals"), (1, -1.0, "normals_back")] {
                    let texels: Vec<[f32; 3]> = (0..width * height)
                        .map(|i| {
                            let [x, y, z, _] = texture.texel(i % width, i / width);
                            let tilt = |v: f32, scale: f32| 0.5 + (v - 0.5) * scale * sign;
                            [tilt(x, *scale), tilt(y, green), z]
                        })
                        .collect();
                    let picture = ExrPart::rgb("normals", &texels);
                    let file = self.picture(&format!("{stem}_{name}"), [width, height], picture)?;
                    let map = bitmap("normalmap", &file, texture.transform());
                    sides[side] = element("normalmap", &(map + PLAIN + inner));
                }
                Ok(Some(sides))
            }
            Some(Relief::BumpMap { height, scale }) => {
                let [lo, hi] = part.widths();
                if hi > 1.001 * lo {
                    self.warn(material, "its image is not stretched alike everywhere; Mitsuba's heights are");
                }
                let map = self.number(stem, "heights", 1.0, Some(height), |v| v)?;
                let scale = scale * 0.5 * (lo + hi);
                Ok(Some([scale, -scale].map(|scale| {
                    element("bumpmap", &format!("{map}{}{PLAIN}{inner}", float("scale", scale)))
                })))
            }
        }
    }
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
}
