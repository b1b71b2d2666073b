//! Point lights, isotropic or with a cone.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{Cone, Edge, LightLeSample, LightLiSample, LightPoint};
use crate::math::{AreaPdf, Frame, Rgb, SolidAnglePdf, warp};

/// A point light: its radiance is an intensity, W·sr⁻¹.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Position, metres.
    pub position: Vec3,
    /// Unit axis and cone to which emission is limited; `None` for all directions alike.
    pub cone: Option<(Vec3, Cone)>,
}

impl Point {
    /// A point light that emits in all directions alike.
    #[must_use]
    pub fn isotropic(position: Vec3) -> Self {
        Self { position, cone: None }
    }

    fn at(&self) -> LightPoint {
        LightPoint { p: self.position, n: Vec3::ZERO, rho: 0.0, element: 0 }
    }

    fn profile(&self, dir: Vec3) -> f32 {
        self.cone.map_or(1.0, |(axis, cone)| cone.profile(dir.dot(axis)))
    }

    pub(super) fn sample_li(&self, reference: Vec3) -> Option<LightLiSample> {
        let d = self.position - reference;
        let d2 = d.length_squared();
        let wi = d / d2.sqrt();
        let profile = self.profile(-wi);
        (d2 > 0.0 && profile > 0.0).then(|| LightLiSample {
            radiance: Rgb::splat(profile / d2),
            wi,
            pdf: SolidAnglePdf(1.0),
            at: self.at(),
        })
    }

    pub(super) fn sample_le(&self, u: Vec2) -> Option<LightLeSample> {
        let dir = match self.cone {
            None => warp::square_to_sphere(u),
            Some((axis, cone)) => {
                let cos = 1.0 - u.x * (1.0 - cone.cos_outer);
                let sin = (1.0 - cos * cos).max(0.0).sqrt();
                let (sin_phi, cos_phi) = (2.0 * PI * u.y).sin_cos();
                Frame::from_normal(axis).to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos))
            }
        };
        let pdf_dir = self.pdf_dir(dir);
        (pdf_dir.0 > 0.0).then(|| LightLeSample {
            radiance: Rgb::splat(self.profile(dir)),
            at: self.at(),
            dir,
            pdf_pos: AreaPdf(1.0),
            pdf_dir,
        })
    }

    /// Density of an emitted direction: uniform within the cone.
    pub(super) fn pdf_dir(&self, dir: Vec3) -> SolidAnglePdf {
        match self.cone {
            None => warp::UNIFORM_SPHERE_PDF,
            Some((axis, cone)) if dir.dot(axis) > cone.cos_outer => {
                SolidAnglePdf(1.0 / (2.0 * PI * (1.0 - cone.cos_outer)))
            }
            Some(_) => SolidAnglePdf(0.0),
        }
    }

    /// Power at unit intensity, W.
    pub(super) fn power(&self) -> f32 {
        // The mean of the profile over its edge is a half, or a third.
        let solid_angle = self.cone.map_or(2.0, |(_, c)| match c.edge {
            Edge::Smooth => 1.0 - 0.5 * (c.cos_inner + c.cos_outer),
            Edge::Squared => 1.0 - (2.0 * c.cos_inner + c.cos_outer) / 3.0,
        });
        2.0 * PI * solid_angle
    }
}
