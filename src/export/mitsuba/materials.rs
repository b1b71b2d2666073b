//! Materials as BSDFs.

use std::collections::HashMap;

use super::{
    ExportError, Surface, Writer,
    xml::{boolean, element, float, rgb, string, texture},
};
use crate::{
    bsdf::{GlassTint, microfacet::Ggx, plastic::internal_reflectance},
    math::Rgb,
    scene::{
        Material,
        material::{Model, Relief},
        texture::{ScalarMap, Texture},
    },
};

/// Largest ratio of the widths of an image on the triangles of a surface that counts as
/// even: texture coordinates of four digits are no more exact.
const MAX_STRETCH: f32 = 1.001;

/// Values of [`compensation`] that have been computed, by the bits of IOR and slope, for
/// materials that share both.
#[derive(Default)]
pub(super) struct Compensations(HashMap<(u32, Option<u32>), f32>);

impl Compensations {
    fn get(&mut self, ior: f32, alpha: Option<f32>) -> f32 {
        let key = (ior.to_bits(), alpha.map(f32::to_bits));
        *self.0.entry(key).or_insert_with(|| compensation(ior, alpha))
    }
}

/// A GGX distribution of this slope, a number or a texture.
fn ggx(alpha: &str) -> String {
    string("distribution", "ggx") + alpha
}

/// Refractive index inside, with air outside.
fn refraction(material: &Material) -> String {
    float("int_ior", material.ior()) + &float("ext_ior", 1.0)
}

impl Writer<'_> {
    pub(super) fn warn(&mut self, material: &Material, message: &str) {
        self.warnings.push(format!("material `{}`: {message}", material.name));
    }

    /// A picture file as the texture of the parameter `name`, laid out as `image` is.
    pub(super) fn texture(&mut self, s: &Surface, name: &str, file: &str, image: &Texture) -> String {
        let [across, down] = image.wrap();
        if across != down {
            self.warn(s.material, "Mitsuba goes on beyond an image across and down alike; taken as across");
        }
        texture(name, file, image)
    }

    /// The BSDF of a surface, with its opacity.
    pub(super) fn bsdf(&mut self, s: &Surface) -> Result<String, ExportError> {
        let scattered = if s.material.model().transmits() {
            let glass = match s.material.model() {
                Model::Thin => self.thin(s)?,
                _ => self.dielectric(s)?,
            };
            match self.relief(s, &glass)? {
                None => glass,
                Some([front, _]) => {
                    self.warn(s.material, "Mitsuba bends grazing light differently at its relief");
                    front
                }
            }
        } else {
            let opaque = self.opaque(s)?;
            let sides = self.relief(s, &opaque)?;
            element("bsdf", "twosided", &sides.map_or(opaque, |[front, back]| front + &back))
        };
        if !s.material.is_translucent() {
            return Ok(scattered);
        }
        let (map, cutoff) = (s.material.opacity_map(), s.material.opacity_cutoff());
        if cutoff.is_some() && map.is_some() {
            self.warn(s.material, "Mitsuba cannot cut its opacity off between texels; the edges differ");
        }
        let limit = move |v: f32| cutoff.map_or(v, |c| f32::from(v >= c));
        let opacity = self.number(s, ["opacity"; 2], s.material.opacity_factor(), map, limit)?;
        Ok(element("bsdf", "mask", &(opacity + &scattered)))
    }

    /// The parameter `name` with `factor` times the value of `map`, clamped to [0, 1] and
    /// passed through `f`: a number without a map, else a texture in a file called by
    /// `file`.
    fn number(
        &mut self,
        s: &Surface,
        [file, name]: [&str; 2],
        factor: f32,
        map: Option<&ScalarMap>,
        f: impl Fn(f32) -> f32,
    ) -> Result<String, ExportError> {
        let Some(map) = map else { return Ok(float(name, f(factor))) };
        let scaled = |v: f32| f((factor * v).clamp(0.0, 1.0));
        let written = self.directory.scalar_texture(&format!("{}_{file}", s.stem), file, map, scaled)?;
        Ok(self.texture(s, name, &written, &map.texture))
    }

    /// The parameter `name` with the base colour times `scale`, a number or a texture.
    fn color(&mut self, s: &Surface, name: &str, scale: f32) -> Result<String, ExportError> {
        let tint = s.tint * scale;
        let mut clamped = false;
        let mut limit = |c: Rgb| {
            clamped |= c.max_element() > 1.0;
            c.min(Rgb::ONE)
        };
        let element = match s.material.texture() {
            None => rgb(name, limit(tint)),
            Some(image) => {
                // A coat has its own factor.
                let stem = if scale == 1.0 { s.stem.clone() } else { format!("{}_coated", s.stem) };
                let tinted = |[r, g, b, _]: [f32; 4]| limit(Rgb::new(r, g, b) * tint).to_array();
                let file = self.directory.color_texture(&stem, "color", image, tinted)?;
                self.texture(s, name, &file, image)
            }
        };
        if clamped {
            self.warn(s.material, "its base colour exceeds 1 in Mitsuba and was clamped");
        }
        Ok(element)
    }

    fn dielectric(&mut self, s: &Surface) -> Result<String, ExportError> {
        let GlassTint { reflected, transmitted } = s.material.glass_tint();
        let tints = [("specular_reflectance", reflected), ("specular_transmittance", transmitted)];
        let tints = tints.into_iter().filter(|(_, c)| *c != Rgb::ONE).map(|(name, c)| rgb(name, c));
        let ior = refraction(s.material) + &tints.collect::<String>();
        Ok(match self.alpha(s)? {
            None => element("bsdf", "dielectric", &ior),
            Some(alpha) => element("bsdf", "roughdielectric", &(ggx(&alpha) + &ior)),
        })
    }

    fn thin(&mut self, s: &Surface) -> Result<String, ExportError> {
        if s.material.alpha().is_none() && s.material.roughness_map().is_none() {
            let tint = self.color(s, "specular_transmittance", 1.0)?;
            return Ok(element("bsdf", "thindielectric", &(refraction(s.material) + &tint)));
        }
        self.warn(s.material, "Mitsuba blurs what passes a rough sheet by its index of refraction too");
        let roughness =
            self.number(s, ["roughness"; 2], s.material.roughness(), s.material.roughness_map(), |r| r)?;
        let body = [
            self.color(s, "base_color", 1.0)?,
            roughness,
            float("spec_trans", 1.0),
            float("eta", s.material.ior()),
        ];
        Ok(element("bsdf", "principledthin", &body.concat()))
    }

    /// The GGX slope as a number or a texture; `None` for a smooth surface.
    fn alpha(&mut self, s: &Surface) -> Result<Option<String>, ExportError> {
        let Some(map) = s.material.roughness_map() else {
            return Ok(s.material.alpha().map(|a| float("alpha", a)));
        };
        self.warn(
            s.material,
            "Mitsuba interpolates the square of its roughness; lookups between texels differ",
        );
        let squared = |r: f32| (r * r).max(Ggx::MIN_ALPHA);
        self.number(s, ["alpha"; 2], s.material.roughness(), Some(map), squared).map(Some)
    }

    /// The BSDF of one side of an opaque surface:
    /// (1 − m)·[(1 − w)·diffuse + w·plastic] + m·metal.
    fn opaque(&mut self, s: &Surface) -> Result<String, ExportError> {
        let (m, m_map) = (s.material.metallic(), s.material.metallic_map());
        if s.material.model() == Model::Conductor || (m >= 1.0 && m_map.is_none()) {
            return self.metal(s);
        }
        let (w, w_map) = match s.material.model() {
            Model::Plastic => (s.material.specular(), s.material.specular_map()),
            _ => (0.0, None),
        };
        let base = match (w, w_map.is_some()) {
            (0.0, _) => self.diffuse(s)?,
            (1.0, false) => self.plastic(s)?,
            _ => {
                let both = self.diffuse(s)? + &self.plastic(s)?;
                self.blend(s, "coat", w, w_map, &both)?
            }
        };
        if m == 0.0 {
            return Ok(base);
        }
        let both = base + &self.metal(s)?;
        self.blend(s, "metallic", m, m_map, &both)
    }

    /// A mixture of two BSDFs. `weight` times `map` is the share of the second one, which an
    /// image file called by `file` holds when there is a map.
    fn blend(
        &mut self,
        s: &Surface,
        file: &str,
        weight: f32,
        map: Option<&ScalarMap>,
        both: &str,
    ) -> Result<String, ExportError> {
        let weight = self.number(s, [file, "weight"], weight, map, |v| v)?;
        Ok(element("bsdf", "blendbsdf", &(weight + both)))
    }

    fn diffuse(&mut self, s: &Surface) -> Result<String, ExportError> {
        Ok(element("bsdf", "diffuse", &self.color(s, "reflectance", 1.0)?))
    }

    fn plastic(&mut self, s: &Surface) -> Result<String, ExportError> {
        let alpha = match s.material.roughness_map() {
            None => s.material.alpha(),
            Some(map) => {
                self.warn(
                    s.material,
                    "Mitsuba's coat has one roughness; exported with the middle of its range",
                );
                let [lo, hi] = map.range().map(|v| (s.material.roughness() * v).clamp(0.0, 1.0));
                Some((0.25 * (lo + hi) * (lo + hi)).max(Ggx::MIN_ALPHA))
            }
        };
        let scale = self.compensations.get(s.material.ior(), alpha);
        let color = self.color(s, "diffuse_reflectance", scale)?;
        let body = color + &refraction(s.material) + &boolean("nonlinear", false);
        Ok(match alpha {
            None => element("bsdf", "plastic", &body),
            Some(a) => element("bsdf", "roughplastic", &(body + &ggx(&float("alpha", a)))),
        })
    }

    fn metal(&mut self, s: &Surface) -> Result<String, ExportError> {
        if s.material.edge_tint() != Rgb::ONE {
            self.warn(s.material, "the tint of its edge is lost");
        }
        let is_smooth = s.material.alpha().is_none() && s.material.roughness_map().is_none();
        if is_smooth && s.material.texture().is_none() && s.tint == Rgb::ONE {
            return Ok(element("bsdf", "conductor", &string("material", "none")));
        }
        if is_smooth {
            self.warn(
                s.material,
                "Mitsuba has no smooth metal with Schlick's reflectance; exported as slightly rough",
            );
        }
        let roughness = match s.material.roughness_map() {
            None => float("roughness", s.material.alpha().unwrap_or(0.0).sqrt()),
            map => self.number(s, ["roughness"; 2], s.material.roughness(), map, |r| r)?,
        };
        let color = self.color(s, "base_color", 1.0)?;
        Ok(element("bsdf", "principled", &(color + &float("metallic", 1.0) + &roughness)))
    }

    /// The BSDF `inner` with the tilted normals of the surface's relief, on the front and on
    /// the back; `None` for a surface without relief.
    ///
    /// `twosided` mirrors the back, our renderer turns it over as a whole: there the tilt is
    /// the other way round.
    fn relief(&mut self, s: &Surface, inner: &str) -> Result<Option<[String; 2]>, ExportError> {
        match s.material.relief() {
            None => Ok(None),
            Some(Relief::NormalMap { texture, scale }) => {
                self.normal_map(s, texture, *scale, inner).map(Some)
            }
            Some(Relief::BumpMap { height, scale }) => self.bump_map(s, height, *scale, inner).map(Some),
        }
    }

    fn normal_map(
        &mut self,
        s: &Surface,
        image: &Texture,
        scale: f32,
        inner: &str,
    ) -> Result<[String; 2], ExportError> {
        let mirrored = s.part.mirrored();
        if mirrored > 0 && mirrored < s.part.len() {
            self.warn(s.material, "its image is mirrored on some triangles, where Mitsuba's green is down");
        }
        if !self.job.scene().mesh.tangents.is_empty() {
            self.warn(
                s.material,
                "Mitsuba lays normals out by texture coordinates, not by the file's tangents",
            );
        }
        let green = if 2 * mirrored > s.part.len() { -scale } else { scale };
        let mut side = |name: &str, sign: f32| -> Result<String, ExportError> {
            let tilt = |v: f32, scale: f32| 0.5 + (v - 0.5) * scale * sign;
            let tilted = |[x, y, z, _]: [f32; 4]| [tilt(x, scale), tilt(y, green), z];
            let stem = format!("{}_{name}", s.stem);
            let file = self.directory.color_texture(&stem, "normals", image, tilted)?;
            let map = self.texture(s, "normalmap", &file, image);
            Ok(element("bsdf", "normalmap", &(map + &unbent() + inner)))
        };
        Ok([side("normals", 1.0)?, side("normals_back", -1.0)?])
    }

    fn bump_map(
        &mut self,
        s: &Surface,
        height: &ScalarMap,
        scale: f32,
        inner: &str,
    ) -> Result<[String; 2], ExportError> {
        let [lo, hi] = s.part.widths();
        if hi > MAX_STRETCH * lo {
            self.warn(s.material, "its image is not stretched alike everywhere; Mitsuba's heights are");
        }
        let map = self.number(s, ["heights"; 2], 1.0, Some(height), |v| v)?;
        let scale = scale * 0.5 * (lo + hi);
        let side = |scale: f32| {
            element("bsdf", "bumpmap", &(map.clone() + &float("scale", scale) + &unbent() + inner))
        };
        Ok([side(scale), side(-scale)])
    }
}

/// Parameters of `normalmap` and `bumpmap` with which Mitsuba tilts normals as we do.
fn unbent() -> String {
    boolean("flip_invalid_normals", false) + &boolean("use_shadowing_function", false)
}

/// Factor on the albedo of a plastic of relative IOR `ior` and GGX slope `alpha` with
/// which Mitsuba's plastic reflects as much as ours.
///
/// With `nonlinear` false the base is proportional to albedo/(1 − R), R being
/// the diffuse reflectance 2 ∫ R(μ) μ dμ of the coat from inside. We integrate
/// it. Mitsuba 3.9 takes a polynomial fit for the smooth `plastic` (W. Egan and
/// T. Hilgeman), 0.1 % off, and for `roughplastic` the plain mean over 64 nodes
/// from μ = 0 to 1 with both ends in full, 1 to 2 % off.
#[must_use]
pub fn compensation(ior: f32, alpha: Option<f32>) -> f32 {
    // The number of nodes of Mitsuba's quadrature.
    const N_NODES: u32 = 64;
    let ggx = alpha.map(Ggx::new);
    let weighted = |mu: f64, i: u32| 2.0 * mu * f64::from(internal_reflectance(ior, ggx, mu as f32, i));
    let mean = |n: u32, f: &dyn Fn(u32) -> f64| (0..n).map(f).sum::<f64>() / f64::from(n);
    // Measured against many more nodes for IOR from 1.3 to 1.8: rough within 3e-4, smooth
    // within 2e-5; 0.13 s for a rough one.
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
