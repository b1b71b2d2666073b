//! A mixture at a point: diffuse, bare or below a coat of some strength, and a
//! share of metal of the same colour and roughness.
//!
//! `(1−m)·[(1−w)·diffuse + w·plastic] + m·conductor`. Coat and metal have the
//! same facets, so that there are three lobes: about the mirror direction, diffuse,
//! and the metal's light between facets. The BSDF is affine in the base colour, and
//! swallows nothing where that is white, as none of its parts does.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{
    Affine, BsdfSample, CoatPoint, FacetsPoint, Scattering, conductor, fresnel, lobes, plastic::Passage,
    reflect, reflect_about, table::Cosine,
};
use crate::math::{Rgb, SolidAnglePdf, luminance, warp};

/// What lies on the base of a blend.
#[derive(Clone, Copy, Debug)]
pub enum Layer<'a> {
    /// No coat; the metal is smooth.
    Bare,
    /// No coat; the metal has these facets.
    Facets(FacetsPoint<'a>),
    /// A coat, whose facets the metal shares.
    Coat(CoatPoint<'a>),
}

impl<'a> Layer<'a> {
    /// The coat; `None` where the base is bare.
    #[must_use]
    pub fn coat(&self) -> Option<&CoatPoint<'a>> {
        match self {
            Self::Coat(coat) => Some(coat),
            Self::Bare | Self::Facets(_) => None,
        }
    }

    /// Facets of coat and metal; `None` is smooth.
    #[must_use]
    pub fn facets(&self) -> Option<FacetsPoint<'a>> {
        match self {
            Self::Bare => None,
            Self::Facets(facets) => Some(*facets),
            Self::Coat(coat) => coat.facets(),
        }
    }
}

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
    /// Coat and facets.
    pub layer: Layer<'a>,
}

impl<'a> Blend<'a> {
    /// A blend that selects its lobes by its own colour.
    #[must_use]
    pub fn new(color: Rgb, metallic: f32, specular: f32, layer: Layer<'a>) -> Self {
        let specular = if layer.coat().is_some() { specular } else { 0.0 };
        Self { color, sampling_color: luminance(color), metallic, specular, layer }
    }

    /// Whether there is a lobe besides a perfect mirror.
    pub(super) fn has_non_delta(&self) -> bool {
        self.layer.facets().is_some() || self.metallic < 1.0
    }

    /// What coat and facets do to light from a direction; all passes where there are none.
    fn passage(&self, cos: f32) -> Passage {
        match &self.layer {
            Layer::Coat(coat) => coat.passage(cos),
            Layer::Facets(facets) => Passage { transmittance: 1.0, loss: facets.loss(Cosine::new(cos)) },
            Layer::Bare => Passage { transmittance: 1.0, loss: 0.0 },
        }
    }

    /// Probabilities of the lobes: about the mirror direction, diffuse, and between metal facets.
    /// With smooth facets they depend on the angle to the normal alone, which a mirror keeps.
    fn probabilities(&self, cos: f32, passage: Passage) -> [f32; 3] {
        let (m, w, color) = (self.metallic, self.specular, self.sampling_color);
        let [coat, between] =
            self.layer.coat().map_or([0.0; 2], |c| [c.mirror_albedo(passage), c.wide_albedo(passage)]);
        let metal = (1.0 - passage.loss) * conductor::mirror_albedo(color, cos);
        let base = (1.0 - w + w * passage.transmittance) * color;
        let wide = self.layer.facets().map_or(0.0, |f| passage.loss * conductor::wide_albedo(color, &f));
        let mirror = (1.0 - m) * w * coat + m * metal;
        let diffuse = (1.0 - m) * (base + w * between);
        let p = lobes::mirror_probability(mirror, diffuse);
        let wide = lobes::wide_probability(m * wide, mirror + diffuse);
        [(1.0 - wide) * p, (1.0 - wide) * (1.0 - p), wide]
    }

    /// Reflectance of facets, coat and metal together.
    fn facet(&self, cos: f32) -> Affine {
        let coat = self.layer.coat().map_or(0.0, |c| self.specular * c.fresnel(cos));
        Affine::coat(Rgb::splat((1.0 - self.metallic) * coat))
            + fresnel::schlick(self.color, cos) * self.metallic
    }

    /// Value of the base and of light between the coat's facets.
    fn diffuse(&self, o: Passage, i: Passage) -> Affine {
        let (bare, w) = ((1.0 - self.specular) * FRAC_1_PI, self.specular);
        let (base, coat) =
            self.layer.coat().map_or((0.0, 0.0), |c| (w * c.base(o, i), w * c.interreflection(o, i)));
        Affine { coat: Rgb::splat(coat), body: self.color * (bare + base) }
    }

    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Scattering::ZERO;
        }
        let [o, i] = [wo, wi].map(|w| self.passage(w.z));
        let mut value = self.diffuse(o, i) * (1.0 - self.metallic);
        let mut densities = [[0.0; 2]; 2];
        if let Some(facets) = &self.layer.facets() {
            let r = facets.ggx.reflection(wo, wi);
            value = value + self.facet(r.cos) * r.brdf;
            if self.metallic > 0.0 {
                let returned = conductor::returned(self.color, Rgb::ONE, facets) * self.metallic;
                value = value + returned * facets.interreflection(o.loss, i.loss);
            }
            densities = [[r.pdf, facets.wide.pdf(wi.z).0], [r.pdf_rev, facets.wide.pdf(wo.z).0]];
        }
        let density = |from: f32, passage, [mirror, wide]: [f32; 2], to| {
            let p = self.probabilities(from, passage);
            SolidAnglePdf(p[0] * mirror + p[1] * warp::cosine_hemisphere_pdf(to).0 + p[2] * wide)
        };
        Scattering {
            value,
            pdf: density(wo.z, o, densities[0], wi.z),
            pdf_rev: density(wi.z, i, densities[1], wo.z),
        }
    }

    pub(super) fn sample(&self, wo: Vec3, uc: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.probabilities(wo.z, self.passage(wo.z));
        let wi = match &self.layer.facets() {
            None if uc < p[0] => {
                let f = self.facet(wo.z) * (1.0 / wo.z);
                return Some(BsdfSample::delta(reflect(wo), f, p[0]));
            }
            Some(facets) if uc < p[0] => reflect_about(wo, facets.ggx.sample_wm(wo, u)),
            Some(facets) if uc < p[0] + p[2] => facets.wide.sample(u),
            _ => warp::square_to_cosine_hemisphere(u),
        };
        if wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi)))
    }
}
