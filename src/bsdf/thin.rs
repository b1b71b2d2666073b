//! A thin sheet of clear or tinted glass: both faces at once, without refraction.
//!
//! Light that is not reflected passes straight on, or is blurred by the roughness. Between the two faces it
//! goes back and forth: where one face reflects R, the sheet reflects R + (1 − R)²R(1 + R² + …) =
//! 2R/(1 + R) and lets the rest pass. Both sides are alike, nothing is scaled by η², and so both modes of
//! transport are one.
//!
//! A rough sheet reflects at GGX facets; what it lets pass is the same lobe turned over to the other side,
//! as in glTF's `KHR_materials_transmission`. Light that facets pass on to each other ([`super::facets`])
//! leaves on both sides in the shares of the mean reflectance, so that a clear sheet loses nothing.
//!
//! # References
//! \[Walter07\] eqs. 20, 22; Khronos, *KHR_materials_transmission*.

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample, FacetsPoint, Scattering, fresnel, lobes, reflect, reflect_about, table::Cosine,
    turn_over,
};
use crate::math::{Rgb, SolidAnglePdf, luminance};

/// Nodes of the mean reflectance by the midpoint rule in √cos θ: within 10⁻⁴ for any IOR.
const N_NODES: u32 = 256;

/// A thin sheet.
#[derive(Clone, Copy, Debug)]
pub struct Thin<'a> {
    /// IOR of the sheet over that of its surroundings.
    pub eta: f32,
    /// Mean reflectance of the sheet over projected solid angle: [`average_reflectance`] of `eta`.
    pub average: f32,
    /// Factor on what passes, linear Rec.709 in [0, 1].
    pub tint: Rgb,
    /// Facets of a rough sheet; `None` is perfectly smooth.
    pub facets: Option<FacetsPoint<'a>>,
}

/// Reflectance of both faces of a sheet together, where `cos` is the cosine of incidence in air and `eta`
/// the IOR of the sheet.
#[must_use]
pub fn reflectance(cos: f32, eta: f32) -> f32 {
    let (r, _) = fresnel::dielectric(cos.abs(), eta);
    2.0 * r / (1.0 + r)
}

/// Mean of [`reflectance`] over projected solid angle.
#[must_use]
pub fn average_reflectance(eta: f32) -> f32 {
    // 2 ∫ R μ dμ with μ = x², for R is steep at the grazing end.
    let node = |i: u32| (i as f32 + 0.5) / N_NODES as f32;
    (0..N_NODES).map(node).map(|x| 4.0 * x * x * x * reflectance(x * x, eta)).sum::<f32>() / N_NODES as f32
}

/// The two sides of a sheet.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Reflected,
    Passed,
}

impl Thin<'_> {
    /// Share of the light that leaves on a side where the sheet reflects `r`.
    fn share(&self, side: Side, r: f32) -> Rgb {
        match side {
            Side::Reflected => Rgb::splat(r),
            Side::Passed => self.tint * (1.0 - r),
        }
    }

    /// Brightness of what leaves on both sides where the sheet reflects `r`.
    fn brightness(&self, r: f32) -> f32 {
        r + (1.0 - r) * luminance(self.tint)
    }

    /// Probability of choosing a side where the sheet reflects `r`: its share of the light that leaves, so
    /// that a dark tint costs no samples.
    fn probability(&self, side: Side, r: f32) -> f32 {
        let all = self.brightness(r);
        let reflected = if all > 0.0 { r / all } else { 1.0 };
        match side {
            Side::Reflected => reflected,
            Side::Passed => 1.0 - reflected,
        }
    }

    /// Probability of choosing light between facets, of which `loss` is passed on.
    fn wide_probability(&self, cos: f32, loss: f32) -> f32 {
        let single = (1.0 - loss) * self.brightness(reflectance(cos, self.eta));
        lobes::wide_probability(loss * self.brightness(self.average), single)
    }

    /// `wo` is above the surface.
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        let (side, above) = if wi.z > 0.0 { (Side::Reflected, wi) } else { (Side::Passed, turn_over(wi)) };
        let Some(facets) = self.facets.filter(|_| wo.z > 0.0 && above.z > 0.0) else {
            return Scattering::ZERO;
        };
        let lobe = facets.ggx.reflection(wo, above);
        let r = reflectance(lobe.cos, self.eta);
        let [loss_o, loss_i] = [wo, above].map(|w| facets.loss(Cosine::new(w.z)));
        let (single, wide) = (self.probability(side, r), self.probability(side, self.average));
        let density = |from: f32, loss, mirror, to| {
            let p = self.wide_probability(from, loss);
            SolidAnglePdf((1.0 - p) * single * mirror + p * wide * facets.wide.pdf(to).0)
        };
        let passed_on = self.share(side, self.average) * facets.interreflection(loss_o, loss_i);
        Scattering {
            value: Affine::coat(self.share(side, r) * lobe.brdf + passed_on),
            pdf: density(wo.z, loss_o, lobe.pdf, above.z),
            pdf_rev: density(above.z, loss_i, lobe.pdf_rev, wo.z),
        }
    }

    /// `wo` is above the surface.
    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let side = |uc: f32, r: f32| {
            if uc < self.probability(Side::Reflected, r) { Side::Reflected } else { Side::Passed }
        };
        let Some(facets) = self.facets else {
            let r = reflectance(wo.z, self.eta);
            let side = side(uc, r);
            let wi = if side == Side::Reflected { reflect(wo) } else { -wo };
            let f = Affine::coat(self.share(side, r) / wo.z);
            return Some(BsdfSample::delta(wi, f, self.probability(side, r)));
        };
        let p = self.wide_probability(wo.z, facets.loss(Cosine::new(wo.z)));
        let (above, side) = if uc < p {
            (facets.wide.sample(u), side(uc / p, self.average))
        } else {
            let wm = facets.ggx.sample_wm(wo, u);
            let uc = (uc - p) / (1.0 - p);
            (reflect_about(wo, wm), side(uc, reflectance(wo.dot(wm), self.eta)))
        };
        if above.z <= 0.0 {
            return None;
        }
        let wi = if side == Side::Reflected { above } else { turn_over(above) };
        Some(BsdfSample::of(wi, self.evaluate(wo, wi))).filter(|s| s.pdf.0 > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_reflects_what_its_two_faces_reflect() {
        for cos in [1.0, 0.7, 0.3, 0.05] {
            let r = f64::from(fresnel::dielectric(cos, 1.5).0);
            // Light that enters and meets the far face n times.
            let series: f64 = (0..200).map(|n| (1.0 - r).powi(2) * r.powi(2 * n + 1)).sum();
            let error = f64::from(reflectance(cos, 1.5)) - (r + series);
            assert!(error.abs() < 1e-6, "{cos}: {error}");
        }
        // At normal incidence 0.04 becomes 0.0769.
        assert!((reflectance(1.0, 1.5) - 0.08 / 1.04).abs() < 1e-6);
    }

    #[test]
    fn what_a_smooth_sheet_does_not_reflect_passes_straight_on() {
        let tint = Rgb::new(1.0, 0.5, 0.25);
        let sheet = Thin { eta: 1.5, average: average_reflectance(1.5), tint, facets: None };
        let wo = Vec3::new(0.8, 0.0, 0.6);
        let passed = sheet.sample(wo, 0.999, Vec2::ZERO).expect("light passes");
        let mirrored = sheet.sample(wo, 0.0, Vec2::ZERO).expect("light is reflected");
        assert_eq!((passed.wi, mirrored.wi), (-wo, Vec3::new(-0.8, 0.0, 0.6)));
        let r = reflectance(0.6, 1.5);
        assert!((passed.f.at(1.0) * 0.6 - tint * (1.0 - r)).abs().max_element() < 1e-6);
        assert!((mirrored.f.at(1.0) * 0.6 - Rgb::splat(r)).abs().max_element() < 1e-6);
        assert!((passed.pdf.0 + mirrored.pdf.0 - 1.0).abs() < 1e-6);
    }
}
