//! A diffuse base under a dielectric coat, smooth or GGX-rough.
//!
//! Light that enters the coat leaves it by the diffuse base: the base is seen
//! through the coat's transmittance on both ways, and what the coat reflects
//! back inside is returned without tint, so that the BSDF is affine in the
//! albedo (Mitsuba's `plastic` and `roughplastic` with `nonlinear = false`).

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

use super::{
    BsdfSample, conductor::reflection_pdf, diffuse::Diffuse, fresnel, microfacet::Ggx, reflect, reflect_about,
};
use crate::math::{Rgb, SolidAnglePdf, luminance};

/// Nodes of the transmittance table in cos θ.
const N_NODES: usize = 64;
/// Quadrature points per dimension of the visible-normal square.
const N_QUADRATURE: usize = 48;
/// A lobe that exists is chosen at least this often.
const MIN_LOBE_PROBABILITY: f32 = 0.1;

/// What a coat does to the light below it, tabulated once per material.
#[derive(Clone, Debug)]
pub struct Coat {
    eta: f32,
    ggx: Option<Ggx>,
    /// Transmittance into the coat at `cos θ = i/(N_NODES-1)`; empty when smooth.
    transmittance: Vec<f32>,
    /// 1 / (π η² (1 − R_int)): turns the product of both transmittances into a BRDF.
    base_scale: f32,
}

impl Coat {
    /// Tabulates a coat with relative IOR `eta` > 1; `alpha` `None` is smooth.
    #[must_use]
    pub fn new(eta: f32, alpha: Option<f32>) -> Self {
        let ggx = alpha.map(Ggx::new);
        let transmittance = match ggx {
            None => Vec::new(),
            Some(g) => (0..N_NODES)
                .map(|i| {
                    let cos = (i as f32 / (N_NODES - 1) as f32).max(1e-4);
                    rough_interface(g, cos, eta, Vec2::splat(0.5)).1
                })
                .collect(),
        };
        let r_int = diffuse_internal_reflectance(ggx, eta);
        Self { eta, ggx, transmittance, base_scale: FRAC_1_PI / (eta * eta * (1.0 - r_int)) }
    }

    /// Share of the light arriving at `cos` to the normal that enters the coat.
    #[must_use]
    pub fn transmittance(&self, cos: f32) -> f32 {
        if self.transmittance.is_empty() {
            return 1.0 - fresnel::dielectric(cos, self.eta).0;
        }
        let x = cos.clamp(0.0, 1.0) * (N_NODES - 1) as f32;
        let i = (x as usize).min(N_NODES - 2);
        let t = x - i as f32;
        self.transmittance[i] * (1.0 - t) + self.transmittance[i + 1] * t
    }
}

/// Reflectance of the interface for diffuse light from inside,
/// R_int = 2 ∫ R(μ, 1/η) μ dμ, by the midpoint rule.
///
/// At the critical angle R has a vertical tangent, of a square root: the range
/// is split there, and above it μ − μ_c is quadratic in the variable.
fn diffuse_internal_reflectance(ggx: Option<Ggx>, eta: f32) -> f32 {
    let critical = (1.0 - 1.0 / (eta * eta)).sqrt();
    let n = if ggx.is_some() { 3 * N_NODES as u32 } else { 1024 };
    let sum: f64 = (0..n)
        .map(|i| {
            let x = (i as f32 + 0.5) / n as f32;
            let below = critical * x;
            let above = critical + (1.0 - critical) * x * x;
            f64::from(internal_reflectance(eta, ggx, below, 2 * i) * below * critical)
                + f64::from(internal_reflectance(eta, ggx, above, 2 * i + 1) * above)
                    * f64::from((1.0 - critical) * 2.0 * x)
        })
        .sum();
    (2.0 * sum / f64::from(n)) as f32
}

/// Directional reflectance of a coat of relative IOR `eta` from inside, at
/// cosine `mu`; `ggx` `None` is smooth.
///
/// Total reflection begins at a line across the square of visible normals, on
/// which a fixed grid errs alike at every `mu`: the `i`-th evaluation of a sum
/// therefore uses a grid moved by the `i`-th point of the R2 sequence.
#[must_use]
pub fn internal_reflectance(eta: f32, ggx: Option<Ggx>, mu: f32, i: u32) -> f32 {
    /// Inverse of the plastic number, whose powers generate the sequence.
    const STEP: f64 = 0.754_877_666_246_692_8;
    let Some(ggx) = ggx else { return fresnel::dielectric(mu, 1.0 / eta).0 };
    let shift = |step: f64| (0.5 + f64::from(i) * step).fract() as f32;
    rough_interface(ggx, mu, 1.0 / eta, Vec2::new(shift(STEP), shift(STEP * STEP))).0
}

/// Directional reflectance and transmittance of a GGX interface seen from the
/// side with relative IOR `eta`, by a product rule over the visible normals
/// whose points lie at `shift` in their cells.
///
/// The square's upper edge holds the facets seen edge-on, whose cosine, and so
/// whose transmittance, is a square root there: `u.y` = 1 − v² makes it linear.
fn rough_interface(ggx: Ggx, cos: f32, eta: f32, shift: Vec2) -> (f32, f32) {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let (mut reflectance, mut transmittance) = (0.0_f64, 0.0_f64);
    let step = 1.0 / N_QUADRATURE as f32;
    for i in 0..N_QUADRATURE * N_QUADRATURE {
        let v = ((i / N_QUADRATURE) as f32 + shift.y) * step;
        let weight = f64::from(2.0 * v);
        let u = Vec2::new(((i % N_QUADRATURE) as f32 + shift.x) * step, 1.0 - v * v);
        let wm = ggx.sample_wm(wo, u);
        let c = wo.dot(wm);
        let (r, cos_t) = fresnel::dielectric(c, eta);
        let wi = reflect_about(wo, wm);
        if wi.z > 0.0 {
            reflectance += weight * f64::from(r * ggx.g1(wi, wm));
        }
        if r < 1.0 {
            let wt = -wo / eta + wm * (c / eta + cos_t);
            if wt.z < 0.0 {
                transmittance += weight * f64::from((1.0 - r) * ggx.g1(wt, wm));
            }
        }
    }
    let n = (N_QUADRATURE * N_QUADRATURE) as f64;
    ((reflectance / n) as f32, (transmittance / n) as f32)
}

/// A coated diffuse surface, upper side.
#[derive(Clone, Copy, Debug)]
pub struct Plastic<'a> {
    /// Albedo of the base, in [0, 1]; the BSDF is affine in it.
    pub albedo: Rgb,
    /// Luminance of the albedo that lobe selection uses. It is taken at the
    /// largest background value, so that sampling never depends on the value.
    pub sampling_albedo: f32,
    /// The coat.
    pub coat: &'a Coat,
}

impl<'a> Plastic<'a> {
    /// A plastic that selects its lobes by its own albedo.
    #[must_use]
    pub fn new(albedo: Rgb, coat: &'a Coat) -> Self {
        Self { albedo, sampling_albedo: luminance(albedo), coat }
    }

    /// Probability of choosing the coat's lobe.
    fn coat_probability(&self, wo: Vec3) -> f32 {
        let t = self.coat.transmittance(wo.z);
        let base = t * t * self.sampling_albedo * self.coat.base_scale * PI;
        let coat = 1.0 - t;
        if base <= 0.0 {
            return 1.0;
        }
        (coat / (coat + base)).clamp(MIN_LOBE_PROBABILITY, 1.0 - MIN_LOBE_PROBABILITY)
    }

    fn base(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.albedo * (self.coat.transmittance(wo.z) * self.coat.transmittance(wi.z) * self.coat.base_scale)
    }

    pub(super) fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let mut f = self.base(wo, wi);
        if let Some(ggx) = self.coat.ggx {
            let wm = (wo + wi).normalize();
            let (r, _) = fresnel::dielectric(wo.dot(wm), self.coat.eta);
            // [Walter07] eq. 20
            f += Rgb::splat(r * ggx.d(wm) * ggx.g1(wo, wm) * ggx.g1(wi, wm) / (4.0 * wo.z * wi.z));
        }
        f
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return SolidAnglePdf(0.0);
        }
        let p = self.coat_probability(wo);
        let base = Diffuse { albedo: self.albedo }.pdf(wo, wi).0;
        let coat = self.coat.ggx.map_or(0.0, |g| reflection_pdf(g, wo, wi).0);
        SolidAnglePdf(p * coat + (1.0 - p) * base)
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.coat_probability(wo);
        let wi = match (uc < p, self.coat.ggx) {
            (true, None) => {
                let r = fresnel::dielectric(wo.z, self.coat.eta).0;
                let f = Rgb::splat(r / wo.z);
                return Some(BsdfSample { f, wi: reflect(wo), pdf: SolidAnglePdf(p), delta: true });
            }
            (true, Some(ggx)) => reflect_about(wo, ggx.sample_wm(wo, u)),
            (false, _) => crate::math::warp::square_to_cosine_hemisphere(u),
        };
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf(wo, wi), delta: false })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_internal_reflectance_does_not_depend_on_the_grid() {
        for (eta, alpha) in [(1.5, 0.04), (1.5, 0.1), (1.3, 0.04)] {
            let (ggx, n) = (Ggx::new(alpha), 256);
            // Many more grids at more cosines: 1 / (1 − R) is the brightness of the base.
            let fine = (0..n)
                .map(|i| {
                    let mu = (i as f32 + 0.5) / n as f32;
                    let mean =
                        (0..8).map(|k| internal_reflectance(eta, Some(ggx), mu, 8 * i + k)).sum::<f32>();
                    f64::from(2.0 * mu * mean / 8.0) / f64::from(n)
                })
                .sum::<f64>();
            let base = Coat::new(eta, Some(alpha)).base_scale * PI * eta * eta;
            let error = f64::from(base) * (1.0 - fine) - 1.0;
            assert!(error.abs() < 4e-4, "{eta} {alpha}: {error}");
        }
    }
}
