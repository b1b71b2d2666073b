//! A diffuse base under a dielectric coat, smooth or GGX-rough, that swallows nothing.
//!
//! With E(μ) the coat's directional albedo, light that its facets pass on to each
//! other included ([`super::facets`]), and albedo a of the base
//!
//! `f = f_coat + a (1 − E(μo)) (1 − E(μi)) / (π (1 − E_avg))`, `E_avg = 2 ∫ E(μ) μ dμ`,
//!
//! of \[Kelemen01\] and \[Kulla17\]: reciprocal, affine in a, and of albedo
//! `a + (1 − a) E(μ)`, which is 1 for a white base at any roughness and IOR.
//!
//! # What this model is not
//!
//! A base colour is here what it is in Blender and glTF, and to whoever measured it:
//! the colour of the surface as it is seen, whatever its coat. Light that walks to and
//! fro between a coat and a diffuse base below would be absorbed at each return to the
//! base, and the surface be darker and more saturated than its base colour. And the
//! transmittances of a single facet on both ways, of the model that Mitsuba calls
//! `roughplastic`, lose what facets pass on to each other twice over: at roughness 1 a base
//! of albedo 0.8 shows 0.23 under a white sky, here 0.80.

use std::{f32::consts::PI, sync::Arc};

use glam::{Vec2, Vec3};

pub use super::nearest::internal_reflectance;
use super::{
    Affine, BsdfSample, Facets, FacetsPoint, Scattering, fresnel, interface, lobes, reflect, reflect_about,
    table::{Cosine, Table, TableRow},
};
use crate::math::{Rgb, SolidAnglePdf, luminance, warp};

/// A coat's albedo, tabulated once per IOR and slope.
#[derive(Clone, Debug)]
pub struct Coat {
    eta: f32,
    /// Reflectance of a facet averaged over projected solid angle.
    average_fresnel: f32,
    /// `None` is smooth.
    rough: Option<RoughCoat>,
}

#[derive(Clone, Debug)]
struct RoughCoat {
    facets: Arc<Facets>,
    /// Share of the light that the first facet does not reflect away from the surface.
    remainder: Table,
}

impl Coat {
    /// A smooth coat of relative IOR `eta` > 1.
    #[must_use]
    pub fn smooth(eta: f32) -> Self {
        Self { eta, average_fresnel: fresnel::dielectric_average(eta), rough: None }
    }

    /// Tabulates a coat of relative IOR `eta` > 1 with these facets, of one slope or of any.
    #[must_use]
    pub fn rough(eta: f32, facets: Arc<Facets>) -> Self {
        let remainder = facets.tabulate(|ggx, cos| 1.0 - interface::reflectance(ggx, cos, eta));
        Self { rough: Some(RoughCoat { facets, remainder }), ..Self::smooth(eta) }
    }

    /// The coat at a point of slope `alpha`, at least [`super::microfacet::Ggx::MIN_ALPHA`];
    /// a coat of one slope, or a smooth one, is the same everywhere.
    #[must_use]
    pub fn at(&self, alpha: f32) -> CoatPoint<'_> {
        let rough = self.rough.as_ref().map(|c| {
            let facets = c.facets.at(alpha);
            RoughPoint {
                facets,
                remainder: c.remainder.row(alpha),
                returned: facets.returned(self.average_fresnel),
            }
        });
        let average = match rough {
            None => 1.0 - self.average_fresnel,
            Some(r) => r.remainder.average - r.returned * r.facets.average_loss(),
        };
        CoatPoint { eta: self.eta, rough, average }
    }
}

/// A coat at a point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct CoatPoint<'a> {
    pub(super) eta: f32,
    rough: Option<RoughPoint<'a>>,
    /// Mean transmittance over projected solid angle.
    average: f32,
}

#[derive(Clone, Copy, Debug)]
struct RoughPoint<'a> {
    facets: FacetsPoint<'a>,
    remainder: TableRow<'a>,
    /// Share of the light passed between facets that leaves above the surface.
    returned: f32,
}

/// What a coat does to light from one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// Share that reaches the base, 1 − E(μ).
    pub transmittance: f32,
    /// Share that facets which reflect all send into each other.
    pub loss: f32,
}

impl<'a> CoatPoint<'a> {
    /// Facets of the coat; `None` where the coat is smooth.
    #[must_use]
    pub fn facets(&self) -> Option<FacetsPoint<'a>> {
        self.rough.map(|r| r.facets)
    }

    /// Share of light from everywhere that reaches the base: the mean of 1 − E over projected solid angle.
    #[must_use]
    pub fn average_transmittance(&self) -> f32 {
        self.average
    }

    pub(super) fn passage(&self, cos: f32) -> Passage {
        match &self.rough {
            None => Passage { transmittance: 1.0 - self.fresnel(cos), loss: 0.0 },
            Some(r) => {
                let cos = Cosine::new(cos);
                let loss = r.facets.loss(cos);
                Passage { transmittance: r.remainder.at(cos) - r.returned * loss, loss }
            }
        }
    }

    /// Reflectance of a facet.
    pub(super) fn fresnel(&self, cos: f32) -> f32 {
        fresnel::dielectric(cos, self.eta).0
    }

    /// BRDF of a white base below the coat, sr⁻¹.
    pub(super) fn base(&self, o: Passage, i: Passage) -> f32 {
        o.transmittance * i.transmittance / (PI * self.average)
    }

    /// BRDF of the light that leaves the coat after several facets, sr⁻¹.
    pub(super) fn interreflection(&self, o: Passage, i: Passage) -> f32 {
        self.rough.map_or(0.0, |r| r.returned * r.facets.interreflection(o.loss, i.loss))
    }

    /// Share of the light that leaves the coat after one facet.
    pub(super) fn mirror_albedo(&self, p: Passage) -> f32 {
        (1.0 - p.transmittance - self.wide_albedo(p)).max(0.0)
    }

    /// Share of the light that leaves the coat after several facets.
    pub(super) fn wide_albedo(&self, p: Passage) -> f32 {
        self.rough.map_or(0.0, |r| r.returned * p.loss)
    }
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
    /// A plastic that selects its lobes by its own albedo.
    #[must_use]
    pub fn new(albedo: Rgb, coat: CoatPoint<'a>) -> Self {
        Self { albedo, sampling_albedo: luminance(albedo), coat }
    }

    /// Probability of choosing the coat's facets over what leaves in all directions.
    fn mirror_probability(&self, p: Passage) -> f32 {
        let base = p.transmittance * self.sampling_albedo;
        lobes::mirror_probability(self.coat.mirror_albedo(p), base + self.coat.wide_albedo(p))
    }

    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Scattering::ZERO;
        }
        let [o, i] = [wo, wi].map(|w| self.coat.passage(w.z));
        let mut value = Affine {
            coat: Rgb::splat(self.coat.interreflection(o, i)),
            body: self.albedo * self.coat.base(o, i),
        };
        let mut mirror = [0.0; 2];
        if let Some(facets) = self.coat.facets() {
            let r = facets.ggx.reflection(wo, wi);
            value.coat += Rgb::splat(self.coat.fresnel(r.cos) * r.brdf);
            mirror = [r.pdf, r.pdf_rev];
        }
        let density = |from, mirror, to| {
            let p = self.mirror_probability(from);
            SolidAnglePdf(p * mirror + (1.0 - p) * warp::cosine_hemisphere_pdf(to).0)
        };
        Scattering { value, pdf: density(o, mirror[0], wi.z), pdf_rev: density(i, mirror[1], wo.z) }
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.mirror_probability(self.coat.passage(wo.z));
        let wi = match (uc < p, self.coat.facets()) {
            (true, None) => {
                let f = Affine::coat(Rgb::splat(self.coat.fresnel(wo.z) / wo.z));
                return Some(BsdfSample::delta(reflect(wo), f, p));
            }
            (true, Some(facets)) => reflect_about(wo, facets.ggx.sample_wm(wo, u)),
            (false, _) => warp::square_to_cosine_hemisphere(u),
        };
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi)))
    }
}
