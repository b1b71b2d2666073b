//! A diffuse base under a dielectric coat, smooth or GGX-rough.
//!
//! Light that enters the coat leaves it by the diffuse base: the base is seen
//! through the coat's transmittance on both ways, and what the coat reflects
//! back inside is returned without tint, so that the BSDF is affine in the
//! albedo (Mitsuba's `plastic` and `roughplastic` with `nonlinear = false`).

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{Affine, BsdfSample, Scattering, fresnel, microfacet::Ggx, reflect, reflect_about};
use crate::math::{Rgb, SolidAnglePdf, luminance, warp};

/// Nodes of the transmittance table in cos θ.
const N_NODES: usize = 64;
/// Quadrature points per dimension of the visible-normal square.
const N_QUADRATURE: usize = 48;
/// Rows of a coat of varying roughness, and quadrature points per dimension and
/// nodes of their internal reflectance: coarser than for one roughness, for all
/// rows together are to take a second at most. See the tests for the error.
const N_ROUGHNESS: usize = 49;
const N_COARSE_QUADRATURE: usize = 32;
const N_COARSE_NODES: usize = 128;
/// A lobe that exists is chosen at least this often.
pub(super) const MIN_LOBE_PROBABILITY: f32 = 0.1;

/// What a coat does to the light below it, tabulated once per material.
#[derive(Clone, Debug)]
pub struct Coat {
    eta: f32,
    /// `None` is smooth, or of a roughness that varies.
    ggx: Option<Ggx>,
    /// Transmittance into the coat at `cos θ = i/(N_NODES-1)`, a row for each
    /// roughness; empty when smooth.
    transmittance: Vec<f32>,
    /// 1 / (π η² (1 − R_int)) of each roughness: turns the product of both
    /// transmittances into a BRDF.
    base_scale: Vec<f32>,
}

impl Coat {
    /// Tabulates a coat with relative IOR `eta` > 1; `alpha` `None` is smooth.
    #[must_use]
    pub fn new(eta: f32, alpha: Option<f32>) -> Self {
        let ggx = alpha.map(Ggx::new);
        let transmittance = ggx.map_or_else(Vec::new, |g| transmittances(g, eta, N_QUADRATURE));
        let n = if ggx.is_some() { N_COARSE_NODES } else { 1024 };
        let r_int = diffuse_internal_reflectance(ggx, eta, n, N_COARSE_QUADRATURE);
        Self { eta, ggx, transmittance, base_scale: vec![base_scale(eta, r_int)] }
    }

    /// Tabulates a coat whose roughness varies; see [`Self::at`].
    #[must_use]
    pub fn of_any_roughness(eta: f32) -> Self {
        let rows: Vec<(Vec<f32>, f32)> = (0..N_ROUGHNESS)
            .into_par_iter()
            .map(|i| {
                let roughness = i as f32 / (N_ROUGHNESS - 1) as f32;
                let ggx = Ggx::new((roughness * roughness).max(Ggx::MIN_ALPHA));
                let r_int = diffuse_internal_reflectance(Some(ggx), eta, N_COARSE_NODES, N_COARSE_QUADRATURE);
                (transmittances(ggx, eta, N_QUADRATURE), base_scale(eta, r_int))
            })
            .collect();
        Self {
            eta,
            ggx: None,
            transmittance: rows.iter().flat_map(|r| r.0.iter().copied()).collect(),
            base_scale: rows.iter().map(|r| r.1).collect(),
        }
    }

    /// Share of the light arriving at `cos` to the normal that enters the coat,
    /// where its roughness does not vary.
    #[must_use]
    pub fn transmittance(&self, cos: f32) -> f32 {
        self.constant().transmittance(cos)
    }

    /// The coat where its roughness does not vary.
    #[must_use]
    pub fn constant(&self) -> CoatPoint<'_> {
        CoatPoint { coat: self, ggx: self.ggx, row: 0, t: 0.0, base_scale: self.base_scale[0] }
    }

    /// The coat at a point of slope `alpha`, at least [`Ggx::MIN_ALPHA`]; of a
    /// coat of any roughness.
    #[must_use]
    pub fn at(&self, alpha: f32) -> CoatPoint<'_> {
        let n = self.base_scale.len();
        let x = alpha.sqrt().clamp(0.0, 1.0) * (n - 1) as f32;
        let row = (x as usize).min(n.saturating_sub(2));
        let t = x - row as f32;
        let next = self.base_scale[(row + 1).min(n - 1)];
        let base_scale = self.base_scale[row] * (1.0 - t) + next * t;
        CoatPoint { coat: self, ggx: Some(Ggx::new(alpha)), row, t, base_scale }
    }
}

/// A coat at a point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct CoatPoint<'a> {
    coat: &'a Coat,
    ggx: Option<Ggx>,
    /// Row of the table and how far to the next.
    row: usize,
    t: f32,
    base_scale: f32,
}

impl CoatPoint<'_> {
    /// Share of the light arriving at `cos` to the normal that enters the coat.
    #[must_use]
    pub fn transmittance(&self, cos: f32) -> f32 {
        let table = &self.coat.transmittance;
        if table.is_empty() {
            return 1.0 - fresnel::dielectric(cos, self.coat.eta).0;
        }
        let x = cos.clamp(0.0, 1.0) * (N_NODES - 1) as f32;
        let i = (x as usize).min(N_NODES - 2);
        let t = x - i as f32;
        let row = |row: usize| {
            let k = row * N_NODES + i;
            table[k] * (1.0 - t) + table[k + 1] * t
        };
        let value = row(self.row);
        if self.t == 0.0 { value } else { value * (1.0 - self.t) + row(self.row + 1) * self.t }
    }

    /// Reflectance of a facet.
    pub(super) fn fresnel(&self, cos: f32) -> f32 {
        fresnel::dielectric(cos, self.coat.eta).0
    }

    /// Value of a white base below the coat, sr⁻¹, by the transmittances on both ways.
    pub(super) fn base(&self, t_o: f32, t_i: f32) -> f32 {
        t_o * t_i * self.base_scale
    }

    /// What leaves a base of albedo 1 towards `cos`, roughly: for choosing lobes.
    pub(super) fn base_albedo(&self, transmittance: f32) -> f32 {
        transmittance * transmittance * self.base_scale * PI
    }
}

/// Transmittances of a GGX interface at the nodes.
fn transmittances(ggx: Ggx, eta: f32, n_quadrature: usize) -> Vec<f32> {
    (0..N_NODES)
        .into_par_iter()
        .map(|i| {
            let cos = (i as f32 / (N_NODES - 1) as f32).max(1e-4);
            rough_interface(ggx, cos, eta, Vec2::splat(0.5), n_quadrature).1
        })
        .collect()
}

fn base_scale(eta: f32, r_int: f32) -> f32 {
    FRAC_1_PI / (eta * eta * (1.0 - r_int))
}

/// Reflectance of the interface for diffuse light from inside,
/// R_int = 2 ∫ R(μ, 1/η) μ dμ, by the midpoint rule.
///
/// At the critical angle R has a vertical tangent, of a square root: the range
/// is split there, and above it μ − μ_c is quadratic in the variable.
fn diffuse_internal_reflectance(ggx: Option<Ggx>, eta: f32, n: usize, n_quadrature: usize) -> f32 {
    let critical = (1.0 - 1.0 / (eta * eta)).sqrt();
    let n = n as u32;
    let reflectance = |mu: f32, i: u32| internal_reflectance_by(eta, ggx, mu, i, n_quadrature);
    let terms: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|i| {
            let x = (i as f32 + 0.5) / n as f32;
            let below = critical * x;
            let above = critical + (1.0 - critical) * x * x;
            f64::from(reflectance(below, 2 * i) * below * critical)
                + f64::from(reflectance(above, 2 * i + 1) * above) * f64::from((1.0 - critical) * 2.0 * x)
        })
        .collect();
    (2.0 * terms.iter().sum::<f64>() / f64::from(n)) as f32
}

/// Directional reflectance of a coat of relative IOR `eta` from inside, at
/// cosine `mu`; `ggx` `None` is smooth.
///
/// Total reflection begins at a line across the square of visible normals, on
/// which a fixed grid errs alike at every `mu`: the `i`-th evaluation of a sum
/// therefore uses a grid moved by the `i`-th point of the R2 sequence.
#[must_use]
pub fn internal_reflectance(eta: f32, ggx: Option<Ggx>, mu: f32, i: u32) -> f32 {
    internal_reflectance_by(eta, ggx, mu, i, N_QUADRATURE)
}

/// [`internal_reflectance`] with `n` × `n` points.
fn internal_reflectance_by(eta: f32, ggx: Option<Ggx>, mu: f32, i: u32, n: usize) -> f32 {
    /// Inverse of the plastic number, whose powers generate the sequence.
    const STEP: f64 = 0.754_877_666_246_692_8;
    let Some(ggx) = ggx else { return fresnel::dielectric(mu, 1.0 / eta).0 };
    let shift = |step: f64| (0.5 + f64::from(i) * step).fract() as f32;
    rough_interface(ggx, mu, 1.0 / eta, Vec2::new(shift(STEP), shift(STEP * STEP)), n).0
}

/// Directional reflectance and transmittance of a GGX interface seen from the
/// side with relative IOR `eta`, by a product rule over the visible normals
/// whose `n` × `n` points lie at `shift` in their cells.
///
/// The square's upper edge holds the facets seen edge-on, whose cosine, and so
/// whose transmittance, is a square root there: `u.y` = 1 − v² makes it linear.
fn rough_interface(ggx: Ggx, cos: f32, eta: f32, shift: Vec2, n: usize) -> (f32, f32) {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let (mut reflectance, mut transmittance) = (0.0_f64, 0.0_f64);
    let direction = |i: usize| Vec2::from_angle(2.0 * PI * (i as f32 + shift.x) / n as f32);
    let directions: Vec<Vec2> = (0..n).map(direction).collect();
    for i in 0..n {
        let v = (i as f32 + shift.y) / n as f32;
        let weight = f64::from(2.0 * v);
        for &direction in &directions {
            let wm = ggx.wm_towards(wo, direction, 1.0 - v * v);
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
    }
    let n = (n * n) as f64;
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
    pub coat: CoatPoint<'a>,
}

impl<'a> Plastic<'a> {
    /// A plastic of one roughness that selects its lobes by its own albedo.
    #[must_use]
    pub fn new(albedo: Rgb, coat: &'a Coat) -> Self {
        Self { albedo, sampling_albedo: luminance(albedo), coat: coat.constant() }
    }

    /// Probability of choosing the coat's lobe, where its transmittance is `t`.
    fn coat_probability(&self, t: f32) -> f32 {
        lobe_probability(1.0 - t, self.coat.base_albedo(t) * self.sampling_albedo)
    }

    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Scattering::ZERO;
        }
        let [t_o, t_i] = [wo, wi].map(|w| self.coat.transmittance(w.z));
        let mut value = Affine::body(self.albedo * self.coat.base(t_o, t_i));
        let mut facets = (0.0, 0.0);
        if let Some(ggx) = self.coat.ggx {
            let r = ggx.reflection(wo, wi);
            value.coat = Rgb::splat(self.coat.fresnel(r.cos) * r.brdf);
            facets = (r.pdf, r.pdf_rev);
        }
        let density = |t, facets, cos| {
            let p = self.coat_probability(t);
            SolidAnglePdf(p * facets + (1.0 - p) * warp::cosine_hemisphere_pdf(cos).0)
        };
        Scattering { value, pdf: density(t_o, facets.0, wi.z), pdf_rev: density(t_i, facets.1, wo.z) }
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.coat_probability(self.coat.transmittance(wo.z));
        let wi = match (uc < p, self.coat.ggx) {
            (true, None) => {
                let f = Affine::coat(Rgb::splat(self.coat.fresnel(wo.z) / wo.z));
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

/// Probability of choosing a lobe that reflects about `mirror` over one that
/// reflects about `diffuse`.
pub(super) fn lobe_probability(mirror: f32, diffuse: f32) -> f32 {
    if diffuse <= 0.0 {
        return 1.0;
    }
    if mirror <= 0.0 {
        return 0.0;
    }
    (mirror / (mirror + diffuse)).clamp(MIN_LOBE_PROBABILITY, 1.0 - MIN_LOBE_PROBABILITY)
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
            let base = Coat::new(eta, Some(alpha)).base_scale[0] * PI * eta * eta;
            let error = f64::from(base) * (1.0 - fine) - 1.0;
            assert!(error.abs() < 4e-4, "{eta} {alpha}: {error}");
        }
    }

    #[test]
    fn a_coat_of_any_roughness_is_that_of_the_roughness_at_the_point() {
        let any = Coat::of_any_roughness(1.5);
        let mut worst = [0.0_f32; 2];
        for i in 0..40 {
            let roughness = 0.04 + i as f32 * 0.024;
            let alpha = (roughness * roughness).max(Ggx::MIN_ALPHA);
            let (one, at) = (Coat::new(1.5, Some(alpha)), any.at(alpha));
            worst[0] = worst[0].max((at.base_scale / one.base_scale[0] - 1.0).abs());
            for k in 1..64 {
                let cos = k as f32 / 63.0;
                let e = at.transmittance(cos) - one.transmittance(cos);
                worst[1] = worst[1].max(e.abs());
            }
        }
        println!("base {:.1e}, transmittance {:.1e}", worst[0], worst[1]);
        assert!(worst[0] < 8e-4 && worst[1] < 1e-3, "{worst:?}");
    }
}
