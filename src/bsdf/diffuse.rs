//! Lambertian reflection.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{Affine, BsdfSample};
use crate::math::{Rgb, SolidAnglePdf, warp};

/// Ideal diffuse reflection of the upper side.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Albedo, in [0, 1].
    pub albedo: Rgb,
}

impl Diffuse {
    pub(super) fn f(&self, wo: Vec3, wi: Vec3) -> Affine {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Affine::ZERO;
        }
        Affine::body(self.albedo * FRAC_1_PI)
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> SolidAnglePdf {
        if wo.z <= 0.0 { SolidAnglePdf(0.0) } else { warp::cosine_hemisphere_pdf(wi.z) }
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let wi = warp::square_to_cosine_hemisphere(u);
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf(wo, wi), delta: false })
    }
}
