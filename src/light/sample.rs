//! Points on lights, and samples of the light that arrives from them or leaves them.

use glam::Vec3;

use crate::math::{AreaPdf, Rgb, SolidAnglePdf};

/// The end of a path on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Position, metres; for a light at infinity a point beyond the scene.
    pub p: Vec3,
    /// Unit normal of the emitting side; zero for a point light, for a light at infinity the direction
    /// of emission.
    pub n: Vec3,
    /// Size coordinate ρ, dimensionless.
    pub rho: f32,
    /// Index of the triangle among those of an emissive mesh; 0 for other lights.
    pub element: u32,
}

/// A light met by a ray before its first surface.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Ray parameter, metres.
    pub t: f32,
    /// Point at which the ray meets the light, of the largest size that is sampled.
    pub at: LightPoint,
    /// Radiance toward the ray's origin for L = 1: the light's colour times its profile.
    pub radiance: Rgb,
}

/// A light point sampled as seen from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct LightLiSample {
    /// Radiance toward the reference point for L = 1, W·sr⁻¹·m⁻²; for a point light its intensity over
    /// the squared distance, for a distant light its irradiance.
    pub radiance: Rgb,
    /// Unit direction from the reference point to the light.
    pub wi: Vec3,
    /// Density of `wi` per unit solid angle at the reference point, without the selection
    /// [`Pmf`](crate::math::Pmf); 1 for a point or distant light.
    pub pdf: SolidAnglePdf,
    /// Point on the light.
    pub at: LightPoint,
}

/// A sampled emission: the first edge of a light subpath.
#[derive(Clone, Copy, Debug)]
pub struct LightLeSample {
    /// Radiance along `dir` for L = 1, W·sr⁻¹·m⁻²; for a point light its intensity, for a distant light
    /// its irradiance.
    pub radiance: Rgb,
    /// Point on the light, where the ray starts.
    pub at: LightPoint,
    /// Unit direction of emission.
    pub dir: Vec3,
    /// Density of the point per unit area, m⁻²; 1 for a point or distant light.
    pub pdf_pos: AreaPdf,
    /// Density of `dir` per unit solid angle, given the point.
    pub pdf_dir: SolidAnglePdf,
}
