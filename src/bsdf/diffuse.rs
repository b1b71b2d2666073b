//! Lambertian reflection.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{Affine, BsdfSample, Scattering};
use crate::math::{Rgb, warp};

/// Ideal diffuse reflection of the upper side.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Albedo, in [0, 1].
    pub albedo: Rgb,
}

impl Diffuse {
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3) -> Scattering {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Scattering::ZERO;
        }
        Scattering {
            value: Affine::body(self.albedo * FRAC_1_PI),
            pdf: warp::cosine_hemisphere_pdf(wi.z),
            pdf_rev: warp::cosine_hemisphere_pdf(wo.z),
        }
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let wi = warp::square_to_cosine_hemisphere(u);
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return None;
        }
        Some(BsdfSample::of(wi, self.evaluate(wo, wi)))
    }
}
