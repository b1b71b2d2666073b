//! Glass: a smooth or GGX-rough interface between two dielectrics.
//!
//! `eta` is the IOR inside (local −z) over the IOR outside. Glass may be tinted at its surface: what a face
//! reflects and what it lets pass have a factor each, on the light between facets too, by the side where it
//! leaves. Directions are sampled as of clear glass.
//!
//! # Light between facets
//!
//! A rough interface sends the share L₊(μ) of the light from outside, and L₋(μ) of
//! that from inside, into its own facets. It comes out above or below, diffusely, so
//! that R + T = 1 on both sides. As energy, with l = 2 ∫ L(μ) μ dμ,
//!
//! `f(o → i) = s L(μo) L'(μi) / (π l')`
//!
//! where L and l are of the side of `o`, L' and l' of that of `i`, and s of the four
//! cases are shares: (t₊, 1 − t₊) from outside, (t₋, 1 − t₋) from inside. The two modes of
//! transport are adjoint if t₊ l₊ = η² t₋ l₋. \[Kulla17\] has t = (1 − F_avg) x on one
//! side and (1 − F_avg)(1 − x) on the other, which halves what passes. Only the ratio of
//! x to 1 − x is bound: here the larger of both is 1.
//!
//! Random walks on the same facets are the truth \[Heitz16\]. Reflected share of the light
//! at cos θ = 0.5 on glass of IOR 1.5:
//!
//! | roughness, from | random walk | here | \[Kulla17\] | single facet (transmitted) |
//! | --- | --- | --- | --- | --- |
//! | 0.5, outside | 0.07 | 0.07 | 0.08 | 0.07 (0.89) |
//! | 0.5, inside | 0.89 | 0.88 | 0.89 | 0.72 (0.10) |
//! | 1, outside | 0.03 | 0.05 | 0.14 | 0.02 (0.65) |
//! | 1, inside | 0.66 | 0.61 | 0.64 | 0.16 (0.29) |
//!
//! # References
//! \[Walter07\] eqs. 16, 17, 20, 21; \[PBRT4\] 9.5, 9.7; \[Kulla17\]; \[Heitz16\].

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample, Scattering, TransportMode,
    facets::{Slope, WideLobe},
    fresnel, interface,
    microfacet::Ggx,
    reflect, reflect_about,
    table::{Cosine, Table, TableRow},
    turn_over,
};
use crate::math::{Rgb, SolidAnglePdf};

/// Glass of one IOR and of one slope or of any, tabulated.
#[derive(Clone, Debug)]
pub struct Glass {
    eta: f32,
    /// Mean transmittance of a facet from outside over projected solid angle.
    average_transmittance: f32,
    /// `None` is smooth.
    rough: Option<RoughGlass>,
}

#[derive(Clone, Debug)]
struct RoughGlass {
    /// `None` where the slope varies.
    slope: Option<Slope>,
    /// What facets send into each other of the light from outside, and from inside.
    losses: [Table; 2],
}

impl Glass {
    /// Smooth glass; `eta` is the IOR inside over the IOR outside.
    #[must_use]
    pub fn smooth(eta: f32) -> Self {
        // As much light passes one way as the other.
        let outside = if eta < 1.0 { eta * eta } else { 1.0 };
        let average_transmittance = (1.0 - fresnel::dielectric_average(eta.max(1.0 / eta))) * outside;
        Self { eta, average_transmittance, rough: None }
    }

    /// Tabulates glass of slope `alpha`.
    #[must_use]
    pub fn rough(eta: f32, alpha: f32) -> Self {
        let slope = Slope::new(alpha);
        let loss = |eta| Table::new(slope.ggx, |ggx, cos| interface::dielectric_loss(ggx, cos, eta));
        let losses = [eta, 1.0 / eta].map(loss);
        Self { rough: Some(RoughGlass { slope: Some(slope), losses }), ..Self::smooth(eta) }
    }

    /// Tabulates glass whose slope varies; see [`Self::at`].
    #[must_use]
    pub fn of_any_slope(eta: f32) -> Self {
        let loss = |eta| Table::of_any_slope(|ggx, cos| interface::dielectric_loss(ggx, cos, eta));
        let losses = [eta, 1.0 / eta].map(loss);
        Self { rough: Some(RoughGlass { slope: None, losses }), ..Self::smooth(eta) }
    }

    /// The interface at a point of slope `alpha`, at least [`Ggx::MIN_ALPHA`]; glass of
    /// one slope, or smooth glass, is the same everywhere.
    #[must_use]
    pub fn at(&self, alpha: f32) -> Dielectric<'_> {
        let facets = self.rough.as_ref().map(|rough| {
            let Slope { ggx, wide } = rough.slope.unwrap_or_else(|| Slope::new(alpha));
            let losses = rough.losses.each_ref().map(|l| l.row(alpha));
            let ratio = losses[1].average / losses[0].average;
            let outside = self.average_transmittance * ratio.min(1.0);
            let inside = self.average_transmittance / (self.eta * self.eta) * (1.0 / ratio).min(1.0);
            GlassFacets { ggx, losses, transmitted: [outside, inside], wide }
        });
        Dielectric { eta: self.eta, facets, tint: GlassTint::CLEAR }
    }
}

/// Factors on the light at a face of glass, linear Rec.709 in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlassTint {
    /// On what it reflects, from either side.
    pub reflected: Rgb,
    /// On what it lets pass, one way or the other; what goes through a body passes two faces.
    pub transmitted: Rgb,
}

impl GlassTint {
    /// Tint of clear glass, which takes nothing away.
    pub const CLEAR: Self = Self { reflected: Rgb::ONE, transmitted: Rgb::ONE };

    fn of(&self, is_reflection: bool) -> Rgb {
        if is_reflection { self.reflected } else { self.transmitted }
    }
}

/// A dielectric interface.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric<'a> {
    /// IOR inside over IOR outside.
    eta: f32,
    pub(super) tint: GlassTint,
    /// `None` is perfectly smooth.
    pub(super) facets: Option<GlassFacets<'a>>,
}

/// The facets of glass at a point; pairs are of the outside and of the inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct GlassFacets<'a> {
    ggx: Ggx,
    /// What they send into each other.
    losses: [TableRow<'a>; 2],
    /// Share of it that passes to the other side.
    transmitted: [f32; 2],
    wide: WideLobe,
}

impl GlassFacets<'_> {
    /// Share of the light along `w` that the facets send into each other.
    fn loss(&self, w: Vec3) -> f32 {
        self.losses[side(w)].at(Cosine::new(w.z))
    }

    /// Share of it that leaves on the side of `wi`.
    fn share(&self, wo: Vec3, wi: Vec3) -> f32 {
        let transmitted = self.transmitted[side(wo)];
        if wo.z * wi.z > 0.0 { 1.0 - transmitted } else { transmitted }
    }

    /// BSDF of the light between facets, sr⁻¹, as energy.
    fn interreflection(&self, wo: Vec3, wi: Vec3, [loss_o, loss_i]: [f32; 2]) -> f32 {
        self.share(wo, wi) * loss_o * loss_i / (PI * self.losses[side(wi)].average)
    }
}

/// 0 outside, 1 inside.
fn side(w: Vec3) -> usize {
    usize::from(w.z < 0.0)
}

/// Half vector, oriented to +z, and the relative IOR of the side of `wi`
/// against the side of `wo`; `None` for impossible pairs.
fn half_vector(wo: Vec3, wi: Vec3, eta: f32) -> Option<(Vec3, f32, bool)> {
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

impl Dielectric<'_> {
    /// The interface with another tint.
    #[must_use]
    pub fn tinted(self, tint: GlassTint) -> Self {
        Self { tint, ..self }
    }

    /// What a single facet loses of a white sky outside.
    pub(super) fn average_loss(&self) -> f32 {
        self.facets.map_or(0.0, |f| f.losses[0].average)
    }

    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Scattering {
        let Some(facets) = self.facets.as_ref().filter(|_| wo.z != 0.0 && wi.z != 0.0) else {
            return Scattering::ZERO;
        };
        let losses = [wo, wi].map(|w| facets.loss(w));
        let energy = self.single(&facets.ggx, wo, wi) + facets.interreflection(wo, wi, losses);
        let value = match (wo.z > 0.0, wi.z > 0.0) {
            (true, false) => scale_radiance(energy, self.eta, mode),
            (false, true) => scale_radiance(energy, 1.0 / self.eta, mode),
            _ => energy,
        };
        Scattering {
            value: Affine::coat(self.tint.of(wo.z * wi.z > 0.0) * value),
            pdf: self.pdf(facets, wo, wi, losses[0]),
            pdf_rev: self.pdf(facets, wi, wo, losses[1]),
        }
    }

    /// BSDF of a single facet, sr⁻¹, as energy.
    fn single(&self, ggx: &Ggx, wo: Vec3, wi: Vec3) -> f32 {
        let Some((wm, eta_p, is_reflection)) = half_vector(wo, wi, self.eta) else { return 0.0 };
        let (r, _) = fresnel::dielectric(wo.dot(wm), self.eta);
        let dg = ggx.d(wm) * ggx.g1(wo, wm) * ggx.g1(wi, wm);
        if is_reflection {
            dg * r / (4.0 * wo.z * wi.z).abs() // [Walter07] eq. 20
        } else {
            let denom = (wi.dot(wm) + wo.dot(wm) / eta_p).powi(2) * wi.z * wo.z;
            dg * (1.0 - r) * (wi.dot(wm) * wo.dot(wm) / denom).abs() // [Walter07] eq. 21
        }
    }

    /// Density of `wi`; light between facets is chosen with its share of the light, `loss`.
    fn pdf(&self, facets: &GlassFacets, wo: Vec3, wi: Vec3, loss: f32) -> SolidAnglePdf {
        let wide = facets.share(wo, wi) * facets.wide.pdf(wi.z.abs()).0;
        SolidAnglePdf((1.0 - loss) * self.single_pdf(&facets.ggx, wo, wi) + loss * wide)
    }

    /// Density of scattering `wo` into `wi` at a single facet.
    fn single_pdf(&self, ggx: &Ggx, wo: Vec3, wi: Vec3) -> f32 {
        let Some((wm, eta_p, is_reflection)) = half_vector(wo, wi, self.eta) else { return 0.0 };
        let (r, _) = fresnel::dielectric(wo.dot(wm), self.eta);
        let p = ggx.pdf_wm(wo, wm).0;
        if is_reflection {
            p * r / (4.0 * wo.dot(wm).abs())
        } else {
            // [Walter07] eq. 17
            p * (1.0 - r) * wi.dot(wm).abs() / (wi.dot(wm) + wo.dot(wm) / eta_p).powi(2)
        }
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let Some(facets) = &self.facets else { return self.sample_smooth(wo, uc, mode) };
        let p = 1.0 - facets.loss(wo);
        let wi = if uc < p {
            self.sample_single(&facets.ggx, wo, uc / p, u)?
        } else {
            let wi = facets.wide.sample(u);
            let is_transmission = (uc - p) / (1.0 - p) < facets.transmitted[side(wo)];
            if is_transmission == (wo.z > 0.0) { turn_over(wi) } else { wi }
        };
        Some(BsdfSample::of(wi, self.evaluate(wo, wi, mode))).filter(|s| s.pdf.0 > 0.0)
    }

    /// Scatters `wo` at a facet; `None` when that meets another facet.
    fn sample_single(&self, ggx: &Ggx, wo: Vec3, uc: f32, u: Vec2) -> Option<Vec3> {
        let wm = ggx.sample_wm(wo, u);
        let (r, _) = fresnel::dielectric(wo.dot(wm), self.eta);
        let is_reflection = uc < r;
        let wi = if is_reflection { reflect_about(wo, wm) } else { refract(wo, wm, self.eta)?.0 };
        (is_reflection == (wo.z * wi.z > 0.0)).then_some(wi)
    }

    fn sample_smooth(&self, wo: Vec3, uc: f32, mode: TransportMode) -> Option<BsdfSample> {
        let (r, _) = fresnel::dielectric(wo.z, self.eta);
        if uc < r {
            let f = Affine::coat(self.tint.reflected * (r / wo.z.abs()));
            return Some(BsdfSample::delta(reflect(wo), f, r));
        }
        let (wi, eta_p) = refract(wo, Vec3::Z, self.eta)?;
        let t = scale_radiance(1.0 - r, eta_p, mode);
        Some(BsdfSample::delta(wi, Affine::coat(self.tint.transmitted * (t / wi.z.abs())), 1.0 - r))
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
