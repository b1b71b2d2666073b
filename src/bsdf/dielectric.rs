//! Glass: a smooth or GGX-rough interface between two dielectrics.
//!
//! `eta` is the IOR inside (local −z) over the IOR outside.
//!
//! # References
//! \[Walter07\] eqs. 16, 17, 20, 21; \[PBRT4\] 9.5, 9.7.

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample, Scattering, TransportMode, fresnel, microfacet::Ggx, reflect, reflect_about,
};
use crate::math::{Rgb, SolidAnglePdf};

/// A clear dielectric interface.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// IOR inside over IOR outside.
    pub eta: f32,
    /// Microfacet distribution; `None` is perfectly smooth.
    pub ggx: Option<Ggx>,
}

/// Half vector, oriented to +z, and the relative IOR of the side of `wi`
/// against the side of `wo`; `None` for impossible pairs.
fn half_vector(wo: Vec3, wi: Vec3, eta: f32) -> Option<(Vec3, f32, bool)> {
    if wo.z == 0.0 || wi.z == 0.0 {
        return None;
    }
    let is_reflection = wo.z * wi.z > 0.0;
    let eta_p = match (is_reflection, wo.z > 0.0) {
        (true, _) => 1.0,
        (false, true) => eta,
        (false, false) => 1.0 / eta,
    };
    // [Walter07] eq. 16
    let h = wi * eta_p + wo;
    if h.length_squared() == 0.0 {
        return None;
    }
    let wm = h.normalize();
    let wm = if wm.z < 0.0 { -wm } else { wm };
    // Facets seen from behind do not exist.
    (wm.dot(wi) * wi.z > 0.0 && wm.dot(wo) * wo.z > 0.0).then_some((wm, eta_p, is_reflection))
}

/// Refracts `w` about `n` (on either side); `None` at total reflection.
fn refract(w: Vec3, n: Vec3, eta: f32) -> Option<(Vec3, f32)> {
    let (mut c, mut eta, mut n) = (w.dot(n), eta, n);
    if c < 0.0 {
        (c, eta, n) = (-c, 1.0 / eta, -n);
    }
    let sin2_t = (1.0 - c * c).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return None;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    Some((-w / eta + n * (c / eta - cos_t), eta))
}

impl Dielectric {
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Scattering {
        Scattering { value: self.f(wo, wi, mode), pdf: self.pdf(wo, wi), pdf_rev: self.pdf(wi, wo) }
    }

    fn f(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Affine {
        let Some(ggx) = self.ggx else { return Affine::ZERO };
        let Some((wm, eta_p, is_reflection)) = half_vector(wo, wi, self.eta) else { return Affine::ZERO };
        let (r, _) = fresnel::dielectric(wo.dot(wm), self.eta);
        let dg = ggx.d(wm) * ggx.g1(wo, wm) * ggx.g1(wi, wm);
        Affine::coat(Rgb::splat(if is_reflection {
            dg * r / (4.0 * wo.z * wi.z).abs() // [Walter07] eq. 20
        } else {
            let denom = (wi.dot(wm) + wo.dot(wm) / eta_p).powi(2) * wi.z * wo.z;
            let ft = dg * (1.0 - r) * (wi.dot(wm) * wo.dot(wm) / denom).abs(); // [Walter07] eq. 21
            scale_radiance(ft, eta_p, mode)
        }))
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
        let Some(ggx) = self.ggx else { return SolidAnglePdf(0.0) };
        let Some((wm, eta_p, is_reflection)) = half_vector(wo, wi, self.eta) else {
            return SolidAnglePdf(0.0);
        };
        let (r, _) = fresnel::dielectric(wo.dot(wm), self.eta);
        let p = ggx.pdf_wm(wo, wm).0;
        SolidAnglePdf(if is_reflection {
            p * r / (4.0 * wo.dot(wm).abs())
        } else {
            // [Walter07] eq. 17
            p * (1.0 - r) * wi.dot(wm).abs() / (wi.dot(wm) + wo.dot(wm) / eta_p).powi(2)
        })
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let Some(ggx) = self.ggx else { return self.sample_smooth(wo, uc, mode) };
        let wm = ggx.sample_wm(wo, u);
        let (r, _) = fresnel::dielectric(wo.dot(wm), self.eta);
        let wi = if uc < r { reflect_about(wo, wm) } else { refract(wo, wm, self.eta)?.0 };
        let same_side = wo.z * wi.z > 0.0;
        if same_side != (uc < r) {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi, mode))).filter(|s| s.pdf.0 > 0.0)
    }

    fn sample_smooth(&self, wo: Vec3, uc: f32, mode: TransportMode) -> Option<BsdfSample> {
        let (r, _) = fresnel::dielectric(wo.z, self.eta);
        if uc < r {
            let f = Affine::coat(Rgb::splat(r / wo.z.abs()));
            return Some(BsdfSample::delta(reflect(wo), f, r));
        }
        let (wi, eta_p) = refract(wo, Vec3::Z, self.eta)?;
        let t = scale_radiance(1.0 - r, eta_p, mode);
        Some(BsdfSample::delta(wi, Affine::coat(Rgb::splat(t / wi.z.abs())), 1.0 - r))
    }
}

/// Radiance is divided by η² on entering a medium, importance is not.
///
/// \[Veach97\] eq. 5.12; `eta_p` is the IOR on the side of `wi` over that of `wo`.
fn scale_radiance(ft: f32, eta_p: f32, mode: TransportMode) -> f32 {
    match mode {
        TransportMode::Radiance => ft / (eta_p * eta_p),
        TransportMode::Importance => ft,
    }
}
