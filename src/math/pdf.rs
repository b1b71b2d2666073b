//! Densities that carry their measure in their type.

use glam::Vec3;

/// Density per unit solid angle, sr⁻¹.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct SolidAnglePdf(pub f32);

/// Density per unit area, m⁻².
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct AreaPdf(pub f32);

/// Discrete probability, dimensionless.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Pmf(pub f32);

/// Least squared distance, m², between two vertices of a path. Two that fall on one rounded point, in the
/// corner of a room, would have an infinite density, and weights of 0 · ∞; at 10⁻¹⁵ m squares of densities are
/// numbers still.
pub const LEAST_DISTANCE2: f32 = 1e-30;

/// Squared distance of two vertices of a path, m², at least [`LEAST_DISTANCE2`].
#[must_use]
pub fn distance2(a: Vec3, b: Vec3) -> f32 {
    a.distance_squared(b).max(LEAST_DISTANCE2)
}

impl SolidAnglePdf {
    /// dω = |cos θ| dA / r²; `cos_target` is taken at the far end, with `ng`.
    #[must_use]
    pub fn to_area(self, dist2: f32, cos_target: f32) -> AreaPdf {
        AreaPdf(self.0 * cos_target.abs() / dist2)
    }
}

impl AreaPdf {
    /// dA = r² dω / |cos θ|; `cos_target` is taken at the far end, with `ng`.
    #[must_use]
    pub fn to_solid_angle(self, dist2: f32, cos_target: f32) -> SolidAnglePdf {
        SolidAnglePdf(self.0 * dist2 / cos_target.abs())
    }
}
