//! Materials as BSDFs.

use std::collections::HashMap;

use super::{Export, ExportError, bitmap, list};
use crate::{
    bsdf::{microfacet::Ggx, plastic::internal_reflectance},
    film::exr::ExrPart,
    math::Rgb,
    scene::{Material, material::Model},
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

impl Export<'_> {
    /// The base colour under a parameter's name; writes its texture.
    fn color(&mut self, material: &Material, stem: &str, name: &str) -> Result<String, ExportError> {
        let scale = match material.model() {
            Model::Plastic => self.compensations.get(material.ior(), material.alpha()),
            _ => 1.0,
        };
        let tint = material.tint() * scale;
        let mut clamped = false;
        let mut limit = |c: Rgb| {
            clamped |= c.max_element() > 1.0;
            c.min(Rgb::ONE)
        };
        let element = match material.texture() {
            None => format!("<rgb name=\"{name}\" value=\"{}\"/>", list(limit(tint))),
            Some(texture) => {
                let [width, height] = texture.size();
                let texels: Vec<[f32; 3]> = (0..width * height)
                    .map(|i| {
                        let [r, g, b, _] = texture.texel(i % width, i / width);
                        limit(Rgb::new(r, g, b) * tint).to_array()
                    })
                    .collect();
                bitmap(name, &self.picture(stem, [width, height], ExrPart::rgb("color", &texels))?)
            }
        };
        if clamped {
            self.warnings.push(format!(
                "material `{}`: its base colour exceeds 1 in Mitsuba and was clamped",
                material.name
            ));
        }
        Ok(element)
    }

    pub(super) fn bsdf(&mut self, material: &Material, stem: &str) -> Result<String, ExportError> {
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
                return Ok(format!(
                    "        <bsdf type=\"{kind}\">\n            {ggx}{coat}\n        </bsdf>\n"
                ));
            }
            (Model::Diffuse, _) => ("diffuse", self.color(material, stem, "reflectance")?),
            (Model::Plastic, None) => (
                "plastic",
                format!(
                    "{}\n            {coat}\n            {linear}",
                    self.color(material, stem, "diffuse_reflectance")?
                ),
            ),
            (Model::Plastic, Some(_)) => (
                "roughplastic",
                format!(
                    "{}\n            {ggx}{coat}\n            {linear}",
                    self.color(material, stem, "diffuse_reflectance")?
                ),
            ),
            (Model::Conductor, None) if material.texture().is_none() && material.tint() == Rgb::ONE => {
                ("conductor", "<string name=\"material\" value=\"none\"/>".into())
            }
            (Model::Conductor, _) => {
                if alpha.is_none() {
                    self.warnings.push(format!(
                        "material `{}`: Mitsuba has no smooth metal with Schlick's reflectance; exported as slightly rough",
                        material.name
                    ));
                }
                let body = format!(
                    "{}\n            <float name=\"metallic\" value=\"1\"/>\n            \
                     <float name=\"roughness\" value=\"{}\"/>",
                    self.color(material, stem, "base_color")?,
                    alpha.unwrap_or(0.0).sqrt()
                );
                ("principled", body)
            }
        };
        Ok(format!(
            "        <bsdf type=\"twosided\">\n            <bsdf type=\"{kind}\">\n            {body}\n            </bsdf>\n        </bsdf>\n"
        ))
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
