//! GGX facets that pass light on to each other.
//!
//! A microfacet model follows light to its first facet. What that facet sends
//! into another one, L(μ) = 1 − E(μ) of the light at cosine μ where facets
//! reflect all of it, is lost to the model: of a white sky 0.12 at roughness 0.5,
//! 0.62 at roughness 1. It leaves after all, in all directions, and \[Kulla17\]
//! adds the reciprocal BRDF
//!
//! `F_ms · L(μo) L(μi) / (π L_avg)`, `L_avg = 2 ∫ L(μ) μ dμ`,
//!
//! whose albedo is `F_ms · L(μo)`; `F_ms` is the share of it that facets of
//! average reflectance `F_avg` do not absorb. L is tabulated when a scene is loaded.
//!
//! # References
//! \[Kulla17\]; \[Hill18\] for `F_ms`; \[Heitz16\], the random walk that it replaces.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

use super::{
    interface,
    microfacet::Ggx,
    table::{Cosine, Table, TableRow},
};
use crate::math::SolidAnglePdf;

/// Facets of one slope, or of any.
#[derive(Clone, Debug)]
pub struct Facets {
    /// `None` where the slope varies.
    slope: Option<Slope>,
    loss: Table,
}

/// A distribution, and the density for what it passes on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    pub ggx: Ggx,
    pub wide: WideLobe,
}

impl Slope {
    pub fn new(alpha: f32) -> Self {
        let ggx = Ggx::new(alpha);
        Self { ggx, wide: WideLobe::new(ggx) }
    }
}

impl Facets {
    /// Tabulates facets of slope `alpha`.
    #[must_use]
    pub fn new(alpha: f32) -> Self {
        let slope = Slope::new(alpha);
        Self { slope: Some(slope), loss: Table::new(slope.ggx, interface::mirror_loss) }
    }

    /// Tabulates facets whose slope varies; see [`Self::at`].
    #[must_use]
    pub fn of_any_slope() -> Self {
        Self { slope: None, loss: Table::of_any_slope(interface::mirror_loss) }
    }

    /// Tabulates another function of their slopes and of the cosine.
    pub(super) fn tabulate(&self, f: impl Fn(Ggx, f32) -> f32 + Sync) -> Table {
        match self.slope {
            Some(slope) => Table::new(slope.ggx, f),
            None => Table::of_any_slope(f),
        }
    }

    /// The facets at a point of slope `alpha`, at least [`Ggx::MIN_ALPHA`]; facets
    /// of one slope have that one.
    #[must_use]
    pub fn at(&self, alpha: f32) -> FacetsPoint<'_> {
        let Slope { ggx, wide } = self.slope.unwrap_or_else(|| Slope::new(alpha));
        FacetsPoint { ggx, loss: self.loss.row(alpha), wide }
    }
}

/// Facets at a point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct FacetsPoint<'a> {
    pub(super) ggx: Ggx,
    /// What facets that reflect all send into each other.
    loss: TableRow<'a>,
    pub(super) wide: WideLobe,
}

impl FacetsPoint<'_> {
    /// Share of the light from a direction that facets which reflect all send into each other.
    pub(super) fn loss(&self, cos: Cosine) -> f32 {
        self.loss.at(cos)
    }

    /// Mean of [`Self::loss`] over projected solid angle.
    pub(super) fn average_loss(&self) -> f32 {
        self.loss.average
    }

    /// BRDF, sr⁻¹, of the light that facets which reflect all have passed on.
    pub(super) fn interreflection(&self, loss_o: f32, loss_i: f32) -> f32 {
        loss_o * loss_i / (PI * self.loss.average)
    }

    /// Share of that light which facets of reflectance `f_avg` on average return.
    ///
    /// From every further facet the share E_avg leaves and L_avg = 1 − E_avg meets the next: a geometric
    /// series, less the reflectance that E counts as 1.
    pub(super) fn returned(&self, f_avg: f32) -> f32 {
        let l = self.loss.average;
        f_avg * f_avg * (1.0 - l) / (1.0 - f_avg * l) // [Hill18]
    }
}

/// Density for light that facets have passed on, close to L(μ) μ at every slope.
///
/// L has its peak about μ = α and falls like (α/μ)²: μ/(μ² + (2α)²) follows it
/// within a factor of two wherever there is light to speak of, where a density
/// ∝ μ would need weights of L/L_avg, which reaches 10⁴.
#[derive(Clone, Copy, Debug)]
pub(super) struct WideLobe {
    /// Square of twice the slope.
    c2: f32,
    /// ln(1 + 1/c²), which normalises the density.
    norm: f32,
}

impl WideLobe {
    fn new(ggx: Ggx) -> Self {
        let c2 = 4.0 * ggx.alpha() * ggx.alpha();
        Self { c2, norm: (1.0 / c2).ln_1p() }
    }

    /// Draws a direction of the upper hemisphere.
    pub fn sample(&self, u: Vec2) -> Vec3 {
        let mu2 = (self.c2 * (u.x * self.norm).exp_m1()).min(1.0);
        let (sin_phi, cos_phi) = (2.0 * PI * u.y).sin_cos();
        let sin = (1.0 - mu2).sqrt();
        Vec3::new(sin * cos_phi, sin * sin_phi, mu2.sqrt())
    }

    /// Density of [`Self::sample`].
    pub fn pdf(&self, cos: f32) -> SolidAnglePdf {
        SolidAnglePdf(FRAC_1_PI * cos / ((cos * cos + self.c2) * self.norm))
    }
}
