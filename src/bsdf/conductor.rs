//! Metal: GGX reflection with Schlick's Fresnel, or a perfect mirror. It may be tinted at its edge \[Kutz21\].
//!
//! Light that a facet sends into another leaves after all ([`super::facets`]),
//! so that a metal of reflectance 1 is white under a white sky at any roughness.
//!
//! # A background metal
//!
//! That light is tinted at every bounce: its share is not affine in the colour,
//! as values of a background must be. It is taken exactly at factor 0 and at the
//! material's own colour, factor 1, and linear in between, where the metal is then
//! brighter than the model. Albedo under a white sky too high by, at the worst factor
//! (0.5 to 0.6):
//!
//! | roughness | own colour 1 | 0.8 | 0.5 |
//! | --- | --- | --- | --- |
//! | 0.3 | 0.005 | 0.003 | 0.001 |
//! | 0.5 | 0.029 | 0.018 | 0.007 |
//! | 0.7 | 0.083 | 0.048 | 0.016 |
//! | 0.85 | 0.147 | 0.075 | 0.022 |
//! | 1 | 0.228 | 0.099 | 0.025 |
//!
//! Beyond factor 1 the line stays below the model: no metal gains light.

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample, FacetsPoint, Scattering, fresnel, lobes, reflect, reflect_about, table::Cosine,
};
use crate::math::{Rgb, SolidAnglePdf};

/// A metal with normal-incidence reflectance `f0`.
#[derive(Clone, Copy, Debug)]
pub struct Conductor<'a> {
    pub(super) f0: Rgb,
    /// Reflectance at 82 degrees over Schlick's.
    edge: Rgb,
    /// Brightness that lobe selection uses, of `f0` at the largest background value.
    sampling_f0: f32,
    pub(super) facets: Option<FacetsPoint<'a>>,
    /// Share of the light passed between facets that they return.
    returned: Affine,
}

impl<'a> Conductor<'a> {
    /// A metal.
    ///
    /// * `f0`: reflectance at normal incidence, in [0, 1]
    /// * `sampling_f0`: luminance of `f0` at the largest background value, so that
    ///   sampling never depends on the value
    /// * `facets`: `None` is a perfect mirror
    #[must_use]
    pub fn new(f0: Rgb, sampling_f0: f32, facets: Option<FacetsPoint<'a>>) -> Self {
        Self::tinted(f0, Rgb::ONE, sampling_f0, facets)
    }

    /// A metal whose reflectance at 82 degrees is `edge` times Schlick's, in [0, 1]; see [`Self::new`].
    #[must_use]
    pub fn tinted(f0: Rgb, edge: Rgb, sampling_f0: f32, facets: Option<FacetsPoint<'a>>) -> Self {
        let returned = facets.map_or(Affine::ZERO, |facets| returned(f0, edge, &facets));
        Self { f0, edge, sampling_f0, facets, returned }
    }

    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        let Some(facets) = self.facets.filter(|_| wo.z > 0.0 && wi.z > 0.0) else { return Scattering::ZERO };
        let r = facets.ggx.reflection(wo, wi);
        let [loss_o, loss_i] = [wo, wi].map(|w| facets.loss(Cosine::new(w.z)));
        let density = |from: f32, loss, mirror, to| {
            let wide = self.wide_probability(&facets, from, loss);
            SolidAnglePdf((1.0 - wide) * mirror + wide * facets.wide.pdf(to).0)
        };
        Scattering {
            value: fresnel::tinted(self.f0, self.edge, r.cos) * r.brdf
                + self.returned * facets.interreflection(loss_o, loss_i),
            pdf: density(wo.z, loss_o, r.pdf, wi.z),
            pdf_rev: density(wi.z, loss_i, r.pdf_rev, wo.z),
        }
    }

    /// Probability of choosing light between facets.
    fn wide_probability(&self, facets: &FacetsPoint, cos: f32, loss: f32) -> f32 {
        let single = (1.0 - loss) * mirror_albedo(self.sampling_f0, cos);
        lobes::wide_probability(loss * wide_albedo(self.sampling_f0, facets), single)
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let Some(facets) = self.facets else {
            let f = fresnel::tinted(self.f0, self.edge, wo.z) * (1.0 / wo.z);
            return Some(BsdfSample::delta(reflect(wo), f, 1.0));
        };
        let wide = self.wide_probability(&facets, wo.z, facets.loss(Cosine::new(wo.z)));
        let wi =
            if uc < wide { facets.wide.sample(u) } else { reflect_about(wo, facets.ggx.sample_wm(wo, u)) };
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi)))
    }
}

/// Share of the light passed between facets that metal facets return: exact at
/// factor 0 on `f0` and at 1, and affine.
pub(super) fn returned(f0: Rgb, edge: Rgb, facets: &FacetsPoint) -> Affine {
    let at = |f0| fresnel::tinted_average(f0, edge).map(|f| facets.returned(f));
    let whole = at(f0);
    let black = at(Rgb::ZERO).min(whole);
    Affine { coat: black, body: whole - black }
}

/// What metal of brightness `f0` reflects at one facet, roughly: for choosing lobes.
pub(super) fn mirror_albedo(f0: f32, cos: f32) -> f32 {
    fresnel::schlick(Rgb::splat(f0), cos).at(1.0).x
}

/// Share of the light passed between facets that metal of brightness `f0` returns: for choosing lobes.
pub(super) fn wide_albedo(f0: f32, facets: &FacetsPoint) -> f32 {
    facets.returned(fresnel::schlick_average(Rgb::splat(f0)).x)
}
