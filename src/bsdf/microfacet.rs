//! Trowbridge-Reitz (GGX) microfacet distribution.
//!
//! Directions are in the local shading frame (+z = `ns`) and point away from
//! the surface. `alpha` is the slope parameter, dimensionless, in (0, 1].
//! Masking is separable, `G = G1(wo)·G1(wi)`.
//!
//! # References
//! \[Walter07\] eq. 33 (`d`), eq. 34 (`g1`); \[Dupuy23\] listing 1 (`sample_wm`);
//! \[Heitz18\] eq. 3 (`pdf_wm`).

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::math::SolidAnglePdf;

/// An isotropic GGX distribution.
#[derive(Clone, Copy, Debug)]
pub struct Ggx {
    alpha: f32,
}

/// A pair of directions and the facets that reflect one into the other.
#[derive(Clone, Copy, Debug)]
pub struct Reflection {
    /// Cosine between either of them and the facets' normal.
    pub cos: f32,
    /// Value at reflectance 1, sr⁻¹.
    pub brdf: f32,
    /// Density of reflecting `wo` into `wi` at a facet visible from `wo`, sr⁻¹.
    pub pdf: f32,
    /// The same with the roles exchanged.
    pub pdf_rev: f32,
}

impl Ggx {
    /// Below this slope the lobe is sharper than f32 can evaluate: materials
    /// treat the surface as smooth.
    pub const MIN_ALPHA: f32 = 1e-3;

    /// A distribution with slope parameter `alpha` in (0, 1].
    #[must_use]
    pub fn new(alpha: f32) -> Self {
        Self { alpha }
    }

    /// Slope parameter.
    #[must_use]
    pub fn alpha(&self) -> f32 {
        self.alpha
    }

    /// Density of facets with normal `wm`, per unit solid angle and projected area.
    #[must_use]
    pub fn d(&self, wm: Vec3) -> f32 {
        if wm.z <= 0.0 {
            return 0.0;
        }
        // [Walter07] eq. 33 as a polynomial in wm, stable at normal incidence.
        let a2 = self.alpha * self.alpha;
        let e = (wm.x * wm.x + wm.y * wm.y) / a2 + wm.z * wm.z;
        1.0 / (PI * a2 * e * e)
    }

    /// Masking of facets `wm` seen from `w`.
    #[must_use]
    pub fn g1(&self, w: Vec3, wm: Vec3) -> f32 {
        // A facet seen from the wrong side is masked entirely.
        if w.dot(wm) * w.z <= 0.0 {
            return 0.0;
        }
        let z2 = w.z * w.z;
        let tan2 = (w.x * w.x + w.y * w.y) / z2;
        // [Walter07] eq. 34
        2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tan2).sqrt())
    }

    /// 1 − [`Self::g1`], with all its digits where masking is hardly any.
    #[must_use]
    pub(super) fn shadowing(&self, w: Vec3, wm: Vec3) -> f32 {
        if w.dot(wm) * w.z <= 0.0 {
            return 1.0;
        }
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        let a2_tan2 = self.alpha * self.alpha * tan2;
        // 1 − 2/(1 + s) = (s² − 1)/(1 + s)², s² = 1 + α² tan²θ; it is 1 where that is infinite.
        (a2_tan2 / (1.0 + (1.0 + a2_tan2).sqrt()).powi(2)).min(1.0)
    }

    /// Density of the facets visible from `w`, per unit solid angle of `wm`.
    #[must_use]
    pub fn pdf_wm(&self, w: Vec3, wm: Vec3) -> SolidAnglePdf {
        // [Heitz18] eq. 3
        SolidAnglePdf(self.g1(w, wm) * self.d(wm) * w.dot(wm).abs() / w.z.abs())
    }

    /// Reflection of a pair of directions above the surface at facets that reflect all.
    #[must_use]
    pub fn reflection(&self, wo: Vec3, wi: Vec3) -> Reflection {
        let wm = (wo + wi).normalize();
        let (d, g_o, g_i) = (self.d(wm), self.g1(wo, wm), self.g1(wi, wm));
        // [Walter07] eq. 14 (dω_m = dω_i / (4 |wo·wm|)) on [Heitz18] eq. 3, and eq. 20
        let (pdf, pdf_rev) = (g_o * d / (4.0 * wo.z), g_i * d / (4.0 * wi.z));
        Reflection { cos: wo.dot(wm), brdf: pdf * g_i / wi.z, pdf, pdf_rev }
    }

    /// Samples a facet normal visible from `w` (`w.z` of either sign).
    #[must_use]
    pub fn sample_wm(&self, w: Vec3, u: Vec2) -> Vec3 {
        let phi = 2.0 * PI * u.x;
        self.wm_towards(self.stretched(w), Vec2::new(phi.cos(), phi.sin()), u.y)
    }

    /// `w`, turned up, in the space where the facets are a hemisphere.
    pub(super) fn stretched(&self, w: Vec3) -> Vec3 {
        let w = if w.z < 0.0 { -w } else { w };
        Vec3::new(self.alpha * w.x, self.alpha * w.y, w.z).normalize()
    }

    /// [`Self::sample_wm`] of a stretched `wh`, of the unit vector `direction` at the angle
    /// 2π `u.x`, and of `u.y`.
    pub(super) fn wm_towards(&self, wh: Vec3, direction: Vec2, u_y: f32) -> Vec3 {
        // [Dupuy23] listing 1: uniform on the spherical cap of the hemisphere configuration.
        let z = (1.0 - u_y) * (1.0 + wh.z) - wh.z;
        let sin_theta = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
        let c = Vec3::new(sin_theta * direction.x, sin_theta * direction.y, z);
        let h = c + wh;
        Vec3::new(self.alpha * h.x, self.alpha * h.y, h.z.max(1e-7)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projected_area_of_all_facets_is_one() {
        for alpha in [0.05, 0.3, 1.0] {
            let g = Ggx::new(alpha);
            let n = 20_000;
            // ∫ D cos dω by the midpoint rule in tan θ.
            let sum: f64 = (0..n)
                .map(|i| {
                    let x = (i as f64 + 0.5) / n as f64;
                    let t = x / (1.0 - x) * f64::from(alpha);
                    let dt = f64::from(alpha) / (1.0 - x).powi(2) / n as f64;
                    let cos = 1.0 / (1.0 + t * t).sqrt();
                    let wm = Vec3::new((t * cos) as f32, 0.0, cos as f32);
                    f64::from(g.d(wm)) * cos * 2.0 * std::f64::consts::PI * t * cos.powi(3) * dt
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-4, "{alpha}: {sum}");
        }
    }
}
