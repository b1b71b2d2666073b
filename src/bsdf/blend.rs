//! A mixture at a point: diffuse, bare or below a coat of some strength, and a
//! share of metal of the same colour and roughness.
//!
//! `(1−m)·[(1−w)·diffuse + w·plastic] + m·conductor`. Coat and metal have the
//! same facets, so that there are two lobes: one diffuse, one about the mirror
//! direction. The BSDF is affine in the base colour.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample, Scattering, fresnel,
    microfacet::Ggx,
    plastic::{CoatPoint, lobe_probability},
    reflect, reflect_about,
};
use crate::math::{Rgb, SolidAnglePdf, luminance, warp};

/// A mixture of diffuse, plastic and metal, upper side.
#[derive(Clone, Copy, Debug)]
pub struct Blend<'a> {
    /// Base colour: albedo, and the metal's reflectance at normal incidence.
    pub color: Rgb,
    /// Luminance of the base colour that lobe selection uses: at the largest
    /// background value, so that sampling never depends on the value.
    pub sampling_color: f32,
    /// Share of metal, in [0, 1].
    pub metallic: f32,
    /// Strength of the coat, in [0, 1]; 0 where there is none.
    pub specular: f32,
    /// The coat.
    pub coat: Option<CoatPoint<'a>>,
    /// Facets of the metal, and of the coat; `None` is smooth.
    pub ggx: Option<Ggx>,
}

impl Blend<'_> {
    /// A blend that selects its lobes by its own colour.
    #[must_use]
    pub fn new<'a>(
        color: Rgb,
        metallic: f32,
        specular: f32,
        coat: Option<CoatPoint<'a>>,
        ggx: Option<Ggx>,
    ) -> Blend<'a> {
        let specular = if coat.is_some() { specular } else { 0.0 };
        Blend { color, sampling_color: luminance(color), metallic, specular, coat, ggx }
    }

    /// Whether there is a lobe besides a perfect mirror.
    pub(super) fn has_non_delta(&self) -> bool {
        self.ggx.is_some() || self.metallic < 1.0
    }

    /// Transmittance of the coat; 1 where there is none.
    fn transmittance(&self, cos: f32) -> f32 {
        self.coat.map_or(1.0, |c| c.transmittance(cos))
    }

    /// Probability of choosing the lobe about the mirror direction, where the coat's
    /// transmittance is `t`. It depends on the angle to the normal alone, which a mirror keeps.
    fn mirror_probability(&self, cos: f32, t: f32) -> f32 {
        let coated = self.coat.map_or(0.0, |c| self.specular * c.base_albedo(t));
        let metal = fresnel::schlick(Rgb::splat(self.sampling_color), cos).at(1.0).x;
        let mirror = (1.0 - self.metallic) * self.specular * (1.0 - t) + self.metallic * metal;
        let base = 1.0 - self.specular + coated;
        lobe_probability(mirror, (1.0 - self.metallic) * base * self.sampling_color)
    }

    /// Reflectance of facets, coat and metal together.
    fn facets(&self, cos: f32) -> Affine {
        let coat = self.coat.map_or(0.0, |c| self.specular * c.fresnel(cos));
        Affine::coat(Rgb::splat((1.0 - self.metallic) * coat))
            + fresnel::schlick(self.color, cos) * self.metallic
    }

    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Scattering::ZERO;
        }
        let [t_o, t_i] = [wo, wi].map(|w| self.transmittance(w.z));
        let coated = self.coat.map_or(0.0, |c| self.specular * c.base(t_o, t_i));
        let base = (1.0 - self.specular) * FRAC_1_PI + coated;
        let mut value = Affine::body(self.color * ((1.0 - self.metallic) * base));
        let mut facets = (0.0, 0.0);
        if let Some(ggx) = self.ggx {
            let r = ggx.reflection(wo, wi);
            value = value + self.facets(r.cos) * r.brdf;
            facets = (r.pdf, r.pdf_rev);
        }
        let density = |from: f32, t, facets, to| {
            let p = self.mirror_probability(from, t);
            SolidAnglePdf(p * facets + (1.0 - p) * warp::cosine_hemisphere_pdf(to).0)
        };
        Scattering {
            value,
            pdf: density(wo.z, t_o, facets.0, wi.z),
            pdf_rev: density(wi.z, t_i, facets.1, wo.z),
        }
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.mirror_probability(wo.z, self.transmittance(wo.z));
        let wi = match (uc < p, self.ggx) {
            (true, None) => {
                let f = self.facets(wo.z) * (1.0 / wo.z);
                return Some(BsdfSample::delta(reflect(wo), f, p));
            }
            (true, Some(ggx)) => reflect_about(wo, ggx.sample_wm(wo, u)),
            (false, _) => warp::square_to_cosine_hemisphere(u),
        };
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi)))
    }
}
