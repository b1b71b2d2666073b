//! Metal: GGX reflection with Schlick's Fresnel, or a perfect mirror.

use glam::{Vec2, Vec3};

use super::{Affine, BsdfSample, fresnel, microfacet::Ggx, reflect, reflect_about};
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
    pub(super) fn f(&self, wo: Vec3, wi: Vec3) -> Affine {
        let Some(ggx) = self.ggx else { return Affine::ZERO };
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Affine::ZERO;
        }
        let wm = (wo + wi).normalize();
        // [Walter07] eq. 20
        fresnel::schlick(self.f0, wo.dot(wm))
            * (ggx.d(wm) * ggx.g1(wo, wm) * ggx.g1(wi, wm) / (4.0 * wo.z * wi.z))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
        let Some(ggx) = self.ggx else { return SolidAnglePdf(0.0) };
        reflection_pdf(ggx, wo, wi)
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let Some(ggx) = self.ggx else {
            let f = fresnel::schlick(self.f0, wo.z) * (1.0 / wo.z);
            return Some(BsdfSample { f, wi: reflect(wo), pdf: SolidAnglePdf(1.0), delta: true });
        };
        let wi = reflect_about(wo, ggx.sample_wm(wo, u));
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf(wo, wi), delta: false })
    }
}

/// Density of reflecting `wo` into `wi` at a facet visible from `wo`.
///
/// \[Walter07\] eq. 14: dω_m = dω_i / (4 |wo·wm|).
pub(super) fn reflection_pdf(ggx: Ggx, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return SolidAnglePdf(0.0);
    }
    let wm = (wo + wi).normalize();
    SolidAnglePdf(ggx.pdf_wm(wo, wm).0 / (4.0 * wo.dot(wm).abs()))
}
