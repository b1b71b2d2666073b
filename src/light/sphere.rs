//! Sphere emitting outward, resized by its closest-approach coordinate.
//!
//! A line meets the ball of radius sR exactly when it passes the centre within
//! sR. The light is therefore the sphere of its extent, whose emission is
//! limited to directions with ρ = extent·sin θ ≤ s.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{
    Crossing, LightLeSample, LightLiSample, LightPoint, Outline, Resizable, SizeDensity,
    resize::point_triangle_distance,
};
use crate::math::{AreaPdf, Frame, Rgb, SolidAnglePdf, warp};

/// A sphere that emits outward.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Centre, metres.
    pub center: Vec3,
    /// Radius at unit size, metres.
    pub radius: f32,
}

impl Sphere {
    /// Bound of the distance by which rounding may have put the point `p` off the sphere, metres: some
    /// roundings of its coordinates and of the radius.
    pub(super) fn rounding(&self, p: Vec3) -> f32 {
        4.0 * f32::EPSILON * p.abs().max(self.center.abs()).max_element()
    }

    pub(super) fn crossing(&self, org: Vec3, dir: Vec3, t_max: f32, extent: f32) -> Option<Crossing> {
        let r = self.radius * extent;
        let oc = org - self.center;
        let b = -oc.dot(dir);
        // Closest approach from the perpendicular itself: no cancellation far away.
        let perpendicular = oc + b * dir;
        let approach = perpendicular.length();
        if b <= 0.0 || approach > r || oc.length_squared() <= r * r {
            return None;
        }
        let half = (r * r - approach * approach).sqrt();
        let t = b - half;
        if !(t > 0.0 && t < t_max) {
            return None;
        }
        // Not from the point, whose rounding may be more than a small radius.
        let n = (perpendicular - half * dir) / r;
        let at = LightPoint { p: org + dir * t, n, rho: approach / self.radius, element: 0 };
        Some(Crossing { t, at, radiance: Rgb::ONE })
    }

    pub(super) fn sample_li(&self, reference: Vec3, q: &SizeDensity, u: Vec2) -> Option<LightLiSample> {
        let to_center = self.center - reference;
        let d2 = to_center.length_squared();
        let r = self.radius * q.extent();
        if d2 <= r * r {
            return None;
        }
        let d = d2.sqrt();
        let rho = q.sample(u.x);
        let sin = rho * self.radius / d;
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (2.0 * PI * u.y).sin_cos();
        let frame = Frame::from_normal(to_center / d);
        let wi = frame.to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos));
        // From the centre to the ray's closest approach, whose unit vector is ∂wi/∂(angle from the axis).
        let perpendicular = frame.to_world(Vec3::new(cos * cos_phi, cos * sin_phi, -sin));
        let approach = rho * self.radius;
        let half = (r * r - approach * approach).max(0.0).sqrt();
        let n = (approach * perpendicular - half * wi) / r;
        let at = LightPoint { p: reference + wi * (d * cos - half), n, rho, element: 0 };
        Some(LightLiSample { radiance: Rgb::ONE, wi, pdf: self.pdf_li(reference, q, rho), at })
    }

    /// p_ω = q·d²cos α/(2πR²ρ), sin α = ρR/d.
    pub(super) fn pdf_li(&self, reference: Vec3, q: &SizeDensity, rho: f32) -> SolidAnglePdf {
        let d2 = self.center.distance_squared(reference);
        let r2 = self.radius * self.radius;
        let cos = (1.0 - rho * rho * r2 / d2).max(0.0).sqrt();
        SolidAnglePdf(q.pdf_over_rho(rho) * d2 * cos / (2.0 * PI * r2))
    }

    pub(super) fn sample_le(&self, q: &SizeDensity, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        let n = warp::square_to_sphere(u_pos);
        let rho = q.sample(u_dir.x);
        let sin = rho / q.extent();
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (2.0 * PI * u_dir.y).sin_cos();
        let dir = Frame::from_normal(n).to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos));
        let (pdf_pos, pdf_dir) = self.pdf_le(q, n, dir, rho);
        (pdf_dir.0 > 0.0).then(|| LightLeSample {
            radiance: Rgb::ONE,
            at: LightPoint { p: self.center + n * (self.radius * q.extent()), n, rho, element: 0 },
            dir,
            pdf_pos,
            pdf_dir,
        })
    }

    /// p_A = 1/(4πR²s_max²), p_ω = q·s_max²cos θ/(2πρ), sin θ = ρ/s_max.
    pub(super) fn pdf_le(&self, q: &SizeDensity, n: Vec3, dir: Vec3, rho: f32) -> (AreaPdf, SolidAnglePdf) {
        let s2 = q.extent() * q.extent();
        (
            AreaPdf(1.0 / (4.0 * PI * self.radius * self.radius * s2)),
            SolidAnglePdf(q.pdf_over_rho(rho) * s2 * n.dot(dir).max(0.0) / (2.0 * PI)),
        )
    }

    /// First ray parameter at which the ball of size `s` is entered or left.
    pub(super) fn stop(&self, org: Vec3, dir: Vec3, s: f32) -> Option<f32> {
        let r2 = (self.radius * s).powi(2);
        let oc = org - self.center;
        let b = -oc.dot(dir);
        let half = (r2 - (oc + b * dir).length_squared()).max(-1.0);
        if half < 0.0 {
            return None;
        }
        let half = half.sqrt();
        if b - half > 0.0 { Some(b - half) } else { Some(b + half) }
    }

    /// Power at unit radiance and size `s`, W.
    pub(super) fn power(&self, s: f32) -> f32 {
        4.0 * PI * PI * (self.radius * s).powi(2)
    }
}

impl Resizable for Sphere {
    fn outline(&self) -> Outline {
        Outline::Disk { r: self.radius }
    }

    fn size_at_triangle(&self, corners: [Vec3; 3]) -> f32 {
        point_triangle_distance(self.center, corners) / self.radius
    }

    fn size_at_point(&self, p: Vec3) -> f32 {
        self.center.distance(p) / self.radius
    }

    fn size_at_ray(&self, org: Vec3, dir: Vec3, t_max: f32) -> f32 {
        let oc = self.center - org;
        let t = oc.dot(dir);
        if t <= 0.0 || t >= t_max {
            return f32::INFINITY;
        }
        (oc - dir * t).length() / self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_are_exact_however_small_the_sphere() {
        let center = Vec3::new(-0.8, 1.2, 0.7);
        let q = SizeDensity::uniform_area(1.0);
        for radius in [0.3, 1e-4, 1e-8, 1e-12] {
            let sphere = Sphere { center, radius };
            for i in 0..64 {
                let reference = Vec3::new(0.3 * (i % 5) as f32, 0.1, 0.2 * (i % 3) as f32);
                let u = Vec2::new((i as f32 + 0.5) / 64.0, (i as f32 * 0.618).fract());
                let s = sphere.sample_li(reference, &q, u).unwrap();
                assert!((s.at.n.length() - 1.0).abs() < 1e-5, "{radius}: {}", s.at.n);
                // The sine between normal and ray is ρ: it is the closest approach over the radius.
                let sin = s.at.n.cross(s.wi).length();
                assert!(
                    s.at.n.dot(s.wi) < 0.0 && (sin - s.at.rho).abs() < 1e-4,
                    "{radius}: {sin} {}",
                    s.at.rho
                );
                if radius < 0.1 {
                    continue;
                }
                let radial = (s.at.p - center) / radius;
                assert!(radial.distance(s.at.n) < 1e-5);
                let hit = sphere.crossing(reference, s.wi, f32::INFINITY, 1.0).unwrap();
                assert!(hit.at.n.distance(s.at.n) < 1e-3, "{} {}", hit.at.n, s.at.n);
            }
        }
    }
}
