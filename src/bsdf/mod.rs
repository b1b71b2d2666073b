//! Bidirectional scattering distribution functions.
//!
//! Directions are in the local shading frame (+z = `ns`) and point away from
//! the surface: `wo` toward the previous vertex, `wi` onward. `f` is without
//! cosine, sr⁻¹. Opaque models scatter on both sides alike (the frame is
//! turned over for `wo.z < 0`); a dielectric knows its inside (local −z).
//!
//! Values are affine in a factor v on the base colour ([`Affine`]); sampling
//! decides by the largest v there will be.
//!
//! No model loses light to its roughness: what one facet sends into another comes out
//! after all ([`facets`]), so that white stays white and clear glass clear.
//!
//! # References
//! \[Walter07\] (microfacets), \[Kulla17\] (light between facets), \[Veach97\] 5.2 and 5.3 (adjoint BSDFs, shading normals).

mod affine;
pub mod blend;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod facets;
pub mod fresnel;
mod interface;
mod lobes;
pub mod microfacet;
pub mod nearest;
pub mod plastic;
mod table;
pub mod thin;

use glam::{Vec2, Vec3};

use crate::math::SolidAnglePdf;

pub use affine::Affine;
pub use blend::{Blend, Layer};
pub use conductor::Conductor;
pub use dielectric::{Dielectric, Glass, GlassTint};
pub use diffuse::Diffuse;
pub use facets::{Facets, FacetsPoint};
pub use plastic::{Coat, CoatPoint, Plastic};
pub use thin::Thin;

/// What is transported along the subpath that is being extended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransportMode {
    /// A camera subpath: `wi` points toward the light.
    Radiance,
    /// A light subpath: `wi` points toward the camera.
    Importance,
}

/// What a surface does with a pair of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// BSDF value, sr⁻¹; at a surface times cosine ([`adjoint_cosine`]). Delta lobes are zero.
    pub value: Affine,
    /// Density with which `wi` is drawn given `wo`, delta lobes excluded.
    pub pdf: SolidAnglePdf,
    /// Density with which `wo` is drawn given `wi`.
    pub pdf_rev: SolidAnglePdf,
}

impl Scattering {
    /// None at all.
    pub const ZERO: Self = Self { value: Affine::ZERO, pdf: SolidAnglePdf(0.0), pdf_rev: SolidAnglePdf(0.0) };
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// BSDF value without cosine, sr⁻¹; for a delta lobe, its weight over |cos θ_i|.
    pub f: Affine,
    /// The sampled direction.
    pub wi: Vec3,
    /// Density of `wi`; for a delta lobe the probability of choosing it.
    pub pdf: SolidAnglePdf,
    /// Density of the reverse choice. A delta lobe is chosen with the same probability from
    /// both ends: Fresnel's reflectance is reciprocal and a mirror keeps the angle.
    pub pdf_rev: SolidAnglePdf,
    /// Whether the direction came from a delta lobe.
    pub delta: bool,
}

impl BsdfSample {
    fn of(wi: Vec3, s: Scattering) -> Self {
        Self { f: s.value, wi, pdf: s.pdf, pdf_rev: s.pdf_rev, delta: false }
    }

    fn delta(wi: Vec3, f: Affine, probability: f32) -> Self {
        let pdf = SolidAnglePdf(probability);
        Self { f, wi, pdf, pdf_rev: pdf, delta: true }
    }
}

/// The closed set of scattering models.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Lambertian.
    Diffuse(Diffuse),
    /// Metal.
    Conductor(Conductor<'a>),
    /// Glass.
    Dielectric(Dielectric<'a>),
    /// Coated diffuse.
    Plastic(Plastic<'a>),
    /// A mixture of the opaque models.
    Blend(Blend<'a>),
    /// A thin sheet of glass.
    Thin(Thin<'a>),
}

impl Bsdf<'_> {
    /// Value and densities for a pair of directions.
    #[must_use]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Scattering {
        let (up_o, up_i, _) = face_up(wo, wi);
        match self {
            Self::Diffuse(b) => b.evaluate(up_o, up_i),
            Self::Conductor(b) => b.evaluate(up_o, up_i),
            Self::Plastic(b) => b.evaluate(up_o, up_i),
            Self::Blend(b) => b.evaluate(up_o, up_i),
            Self::Thin(b) => b.evaluate(up_o, up_i),
            Self::Dielectric(b) => b.evaluate(wo, wi, mode),
        }
    }

    /// Value for a pair of directions, sr⁻¹; delta lobes are zero.
    #[must_use]
    pub fn f(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Affine {
        self.evaluate(wo, wi, mode).value
    }

    /// Density with which [`Self::sample`] draws `wi` given `wo`, delta lobes excluded.
    #[must_use]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
        self.evaluate(wo, wi, TransportMode::Radiance).pdf
    }

    /// Samples `wi` given `wo`; `uc` chooses the lobe, `u` the direction.
    /// `None` when the sample is absorbed.
    #[must_use]
    pub fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: TransportMode) -> Option<BsdfSample> {
        let (up, _, flipped) = face_up(wo, wo);
        let sample = match self {
            Self::Dielectric(b) => return b.sample(wo, uc, u, mode),
            Self::Diffuse(b) => b.sample(up, u),
            Self::Conductor(b) => b.sample(up, uc, u),
            Self::Plastic(b) => b.sample(up, uc, u),
            Self::Blend(b) => b.sample(up, uc, u),
            Self::Thin(b) => b.sample(up, uc, u),
        };
        sample.map(|s| if flipped { BsdfSample { wi: turn_over(s.wi), ..s } } else { s })
    }

    /// Whether light may leave the surface on the other side.
    #[must_use]
    pub fn transmits(&self) -> bool {
        match self {
            Self::Dielectric(_) | Self::Thin(_) => true,
            Self::Diffuse(_) | Self::Conductor(_) | Self::Plastic(_) | Self::Blend(_) => false,
        }
    }

    /// Whether [`Self::f`] can be non-zero: only then is a connection worth a ray.
    #[must_use]
    pub fn has_non_delta(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Plastic(_) => true,
            Self::Conductor(b) => b.facets.is_some(),
            Self::Dielectric(b) => b.facets.is_some(),
            Self::Blend(b) => b.has_non_delta(),
            Self::Thin(b) => b.facets.is_some(),
        }
    }
}

/// `f·cos` in world space with both corrections of non-symmetric scattering:
/// the throughput of a vertex, to be divided by the density of `wi`.
///
/// With w_l toward the light and w_c toward the camera the path integral holds
/// `f(w_l, w_c)·|w_l·ns|/|w_l·ng|` at each vertex; in solid angle about `wi`
/// that is `f·|wi·ns|` for radiance, and for importance \[Veach97\] eq. 5.19.
#[must_use]
pub fn adjoint_cosine(wo: Vec3, wi: Vec3, ns: Vec3, ng: Vec3, mode: TransportMode) -> f32 {
    match mode {
        TransportMode::Radiance => wi.dot(ns).abs(),
        TransportMode::Importance => {
            let denom = wo.dot(ng).abs();
            if denom == 0.0 { 0.0 } else { wo.dot(ns).abs() * wi.dot(ng).abs() / denom }
        }
    }
}

/// Mirror direction about +z.
fn reflect(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}

/// Mirror direction about a unit `m`.
fn reflect_about(w: Vec3, m: Vec3) -> Vec3 {
    2.0 * w.dot(m) * m - w
}

fn turn_over(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

/// Turns both directions over when `wo` is below the surface.
fn face_up(wo: Vec3, wi: Vec3) -> (Vec3, Vec3, bool) {
    if wo.z < 0.0 { (turn_over(wo), turn_over(wi), true) } else { (wo, wi, false) }
}
