//! Metal: GGX reflection with Schlick's Fresnel, or a perfect mirror.

use glam::{Vec2, Vec3};

use super::{BsdfSample, Scattering, fresnel, microfacet::Ggx, reflect, reflect_about};
use crate::math::{Rgb, SolidAnglePdf};

/// A metal with normal-incidence reflectance `f0`.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    /// Reflectance at normal incidence; the reflectance is affine in it.
    pub f0: Rgb,
    /// Microfacet distribution; `None` is a perfect mirror.
    pub ggx: Option<Ggx>,
}

impl Conductor {
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        let Some(ggx) = self.ggx.filter(|_| wo.z > 0.0 && wi.z > 0.0) else { return Scattering::ZERO };
        let r = ggx.reflection(wo, wi);
        Scattering {
            value: fresnel::schlick(self.f0, r.cos) * r.brdf,
            pdf: SolidAnglePdf(r.pdf),
            pdf_rev: SolidAnglePdf(r.pdf_rev),
        }
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let Some(ggx) = self.ggx else {
            let f = fresnel::schlick(self.f0, wo.z) * (1.0 / wo.z);
            return Some(BsdfSample::delta(reflect(wo), f, 1.0));
        };
        let wi = reflect_about(wo, ggx.sample_wm(wo, u));
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi)))
    }
}
