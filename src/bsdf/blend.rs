//! A mixture at a point: diffuse, bare or below a coat of some strength, and a
//! share of metal of the same colour and roughness.
//!
//! `(1−m)·[(1−w)·diffuse + w·plastic] + m·conductor`. Coat and metal have the
//! same facets, so that there are two lobes: one diffuse, one about the mirror
//! direction. The BSDF is affine in the base colour.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample,
    conductor::reflection_pdf,
    fresnel,
    microfacet::Ggx,
    plastic::{CoatPoint, lobe_probability},
    reflect, reflect_about,
};
use crate::math::{Rgb, SolidAnglePdf, luminance, warp};

/// A mixture of diffuse, plastic and metal, upper side.
#[derive(Clone, Copy, Debug)]
pub struct Blend<'a> {
    /// Base colour: albedo, and the metal's reflectance at normal incidence.
    pub color: Rgb,
    /// Luminance of the base colour that lobe selection uses: at the largest
    /// background value, so that sampling never depends on the value.
    pub sampling_color: f32,
    /// Share of metal, in [0, 1].
    pub metallic: f32,
    /// Strength of the coat, in [0, 1]; 0 where there is none.
    pub specular: f32,
    /// The coat.
    pub coat: Option<CoatPoint<'a>>,
    /// Facets of the metal, and of the coat; `None` is smooth.
    pub ggx: Option<Ggx>,
}

impl Blend<'_> {
    /// A blend that selects its lobes by its own colour.
    #[must_use]
    pub fn new<'a>(
        color: Rgb,
        metallic: f32,
        specular: f32,
        coat: Option<CoatPoint<'a>>,
        ggx: Option<Ggx>,
    ) -> Blend<'a> {
        let specular = if coat.is_some() { specular } else { 0.0 };
        Blend { color, sampling_color: luminance(color), metallic, specular, coat, ggx }
    }

    /// Whether there is a lobe besides a perfect mirror.
    pub(super) fn has_non_delta(&self) -> bool {
        self.ggx.is_some() || self.metallic < 1.0
    }

    /// Probability of choosing the lobe about the mirror direction. It depends
    /// on the angle to the normal alone, which a mirror keeps.
    fn mirror_probability(&self, wo: Vec3) -> f32 {
        let bare = 1.0 - self.specular;
        let (coat, base) = self.coat.map_or((0.0, 1.0), |c| {
            let t = c.transmittance(wo.z);
            (self.specular * (1.0 - t), bare + self.specular * c.base_albedo(t))
        });
        let metal = fresnel::schlick(Rgb::splat(self.sampling_color), wo.z).at(1.0).x;
        let mirror = (1.0 - self.metallic) * coat + self.metallic * metal;
        lobe_probability(mirror, (1.0 - self.metallic) * base * self.sampling_color)
    }

    /// Reflectance of facets, coat and metal together.
    fn facets(&self, cos: f32) -> Affine {
        let coat = self.coat.map_or(0.0, |c| self.specular * c.fresnel(cos));
        Affine::coat(Rgb::splat((1.0 - self.metallic) * coat))
            + fresnel::schlick(self.color, cos) * self.metallic
    }

    pub(super) fn f(&self, wo: Vec3, wi: Vec3) -> Affine {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Affine::ZERO;
        }
        let coated = self.coat.map_or(0.0, |c| self.specular * c.base(wo, wi));
        let base = (1.0 - self.specular) * FRAC_1_PI + coated;
        let f = Affine::body(self.color * ((1.0 - self.metallic) * base));
        let Some(ggx) = self.ggx else { return f };
        let wm = (wo + wi).normalize();
        // [Walter07] eq. 20
        f + self.facets(wo.dot(wm)) * (ggx.d(wm) * ggx.g1(wo, wm) * ggx.g1(wi, wm) / (4.0 * wo.z * wi.z))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return SolidAnglePdf(0.0);
        }
        let p = self.mirror_probability(wo);
        let mirror = self.ggx.map_or(0.0, |g| reflection_pdf(g, wo, wi).0);
        SolidAnglePdf(p * mirror + (1.0 - p) * warp::cosine_hemisphere_pdf(wi.z).0)
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.mirror_probability(wo);
        let wi = match (uc < p, self.ggx) {
            (true, None) => {
                let f = self.facets(wo.z) * (1.0 / wo.z);
                return Some(BsdfSample { f, wi: reflect(wo), pdf: SolidAnglePdf(p), delta: true });
            }
            (true, Some(ggx)) => reflect_about(wo, ggx.sample_wm(wo, u)),
            (false, _) => warp::square_to_cosine_hemisphere(u),
        };
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf(wo, wi), delta: false })
    }
}
