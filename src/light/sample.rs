//! Points on lights, and what is sampled of them.

use glam::Vec3;

use crate::math::{AreaPdf, Rgb, SolidAnglePdf};

/// The end of a path on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Position, metres; of a light at infinity, somewhere beyond the scene.
    pub p: Vec3,
    /// Unit normal of the emitting side; zero for a point light, the direction
    /// of emission for a light at infinity.
    pub n: Vec3,
    /// Size coordinate.
    pub rho: f32,
    /// Which triangle of an emissive mesh.
    pub element: u32,
}

/// A light met by a ray before its first surface.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Ray parameter.
    pub t: f32,
    /// The point, on the light at its extent.
    pub at: LightPoint,
    /// Unit radiance times colour and profile toward the ray's origin.
    pub radiance: Rgb,
}

/// A light point sampled as seen from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct LightLiSample {
    /// Emitted toward the reference point for L = 1, W·sr⁻¹·m⁻²; for a point
    /// light the intensity over the squared distance, for a distant one the irradiance.
    pub radiance: Rgb,
    /// Unit direction from the reference point to the light.
    pub wi: Vec3,
    /// Per unit solid angle at the reference point, without the selection
    /// [`Pmf`](crate::math::Pmf); 1 for a point or distant light.
    pub pdf: SolidAnglePdf,
    /// Point on the light.
    pub at: LightPoint,
}

/// A sampled emission: the first edge of a light subpath.
#[derive(Clone, Copy, Debug)]
pub struct LightLeSample {
    /// Emitted along `dir` for L = 1.
    pub radiance: Rgb,
    /// Point on the light, where the ray starts.
    pub at: LightPoint,
    /// Unit direction of emission.
    pub dir: Vec3,
    /// Density of the point; 1 for a point or distant light.
    pub pdf_pos: AreaPdf,
    /// Density of `dir` given the point.
    pub pdf_dir: SolidAnglePdf,
}
