//! One-sided rectangle and disk, with an optional cone (a spot).

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec2, Vec3};

use super::{Crossing, LightLeSample, LightLiSample, LightPoint, Outline, Resizable, SizeDensity};
use crate::math::{AreaPdf, Frame, Rgb, SolidAnglePdf, warp};

/// Cone to which emission is limited, with a soft edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Cosine of the angle from the axis within which emission is full.
    pub cos_inner: f32,
    /// Cosine of the angle from the axis beyond which nothing is emitted.
    pub cos_outer: f32,
    /// How emission falls off from the inner to the outer cosine.
    pub edge: Edge,
}

/// How the emission of a [`Cone`] falls off over its edge, where x rises from 0 to 1 linearly in the
/// cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edge {
    /// x²·(3 − 2x), the smooth step of Blender's spots.
    #[default]
    Smooth,
    /// x², as `KHR_lights_punctual` recommends.
    Squared,
}

impl Edge {
    /// Emission relative to that along the axis at `x` in [0, 1].
    fn emission(self, x: f32) -> f32 {
        match self {
            Self::Smooth => x * x * (3.0 - 2.0 * x),
            Self::Squared => x * x,
        }
    }
}

impl Cone {
    /// A cone of half-angle `angle`, radians, at most a right angle, of which the share `softness` is soft edge.
    #[must_use]
    pub fn with_edge(angle: f32, softness: f32) -> Self {
        let cos = |a: f32| a.min(FRAC_PI_2).cos().max(0.0);
        Self { cos_inner: cos(angle * (1.0 - softness)), cos_outer: cos(angle), edge: Edge::Smooth }
    }

    /// Radiance relative to that along the axis, where `cos_theta` is the cosine of the angle from it.
    #[must_use]
    pub fn profile(&self, cos_theta: f32) -> f32 {
        let width = self.cos_inner - self.cos_outer;
        if width <= 0.0 {
            return if cos_theta >= self.cos_outer { 1.0 } else { 0.0 };
        }
        let x = ((cos_theta - self.cos_outer) / width).clamp(0.0, 1.0);
        self.edge.emission(x)
    }
}

/// A planar emitter that radiates from the side of `frame.n`.
#[derive(Clone, Copy, Debug)]
pub struct Planar {
    /// Centre, metres.
    pub center: Vec3,
    /// Axes of the plane; `n` points away from the emitting side.
    pub frame: Frame,
    /// Outline at unit size.
    pub outline: Outline,
    /// Cone about `n` to which emission is limited; `None` for the whole half-space.
    pub cone: Option<Cone>,
}

impl Planar {
    /// Size coordinate of a point of the plane, given by its coordinates along the frame's tangents,
    /// metres.
    #[must_use]
    pub fn rho(&self, x: Vec2) -> f32 {
        match self.outline {
            Outline::Rectangle { a, b } => (x.x.abs() / a).max(x.y.abs() / b),
            Outline::Disk { r } => x.length() / r,
        }
    }

    /// Point with size coordinate `rho`, uniform along its outline.
    fn point(&self, rho: f32, u: f32) -> Vec3 {
        let x = match self.outline {
            Outline::Rectangle { a, b } => {
                // A side uniformly, then along it.
                let side = (u * 4.0).min(3.999_999_8);
                let along = 2.0 * side.fract() - 1.0;
                match side as u32 {
                    0 => Vec2::new(a, b * along),
                    1 => Vec2::new(-a * along, b),
                    2 => Vec2::new(-a, -b * along),
                    _ => Vec2::new(a * along, -b),
                }
            }
            Outline::Disk { r } => {
                let (sin, cos) = (2.0 * PI * u).sin_cos();
                r * Vec2::new(cos, sin)
            }
        } * rho;
        self.center + self.frame.s * x.x + self.frame.t * x.y
    }

    /// Bound of the distance by which rounding may have put the point `p` off the panel, metres: one
    /// rounding of its coordinates, and a few of the frame's and of the place in it.
    #[must_use]
    pub fn rounding(&self, p: Vec3) -> f32 {
        let in_plane = (self.frame.s.abs() + self.frame.t.abs()) * p.distance(self.center);
        f32::EPSILON * self.frame.n.abs().dot(p.abs() + 2.0 * in_plane)
    }

    fn profile(&self, cos_theta: f32) -> f32 {
        if cos_theta <= 0.0 { 0.0 } else { self.cone.map_or(1.0, |c| c.profile(cos_theta)) }
    }

    fn sin2_max(&self) -> f32 {
        self.cone.map_or(1.0, |c| (1.0 - c.cos_outer * c.cos_outer).max(1e-12))
    }

    pub(super) fn crossing(&self, org: Vec3, dir: Vec3, t_max: f32, extent: f32) -> Option<Crossing> {
        let cos = -dir.dot(self.frame.n);
        if cos <= 0.0 {
            return None;
        }
        let t = (org - self.center).dot(self.frame.n) / cos;
        if !(t > 0.0 && t < t_max) {
            return None;
        }
        let p = org + dir * t;
        let d = p - self.center;
        let rho = self.rho(Vec2::new(d.dot(self.frame.s), d.dot(self.frame.t)));
        let radiance = Rgb::splat(self.profile(cos));
        let at = LightPoint { p, n: self.frame.n, rho, element: 0 };
        (rho <= extent && radiance.x > 0.0).then_some(Crossing { t, at, radiance })
    }

    /// Ray parameter at which the outline of size `s` is met, from either side.
    pub(super) fn stop(&self, org: Vec3, dir: Vec3, s: f32) -> Option<f32> {
        let t = (self.center - org).dot(self.frame.n) / dir.dot(self.frame.n);
        let d = org + dir * t - self.center;
        (self.rho(Vec2::new(d.dot(self.frame.s), d.dot(self.frame.t))) <= s).then_some(t)
    }

    /// Area density of a point with size coordinate `rho`: q(ρ)/A'(ρ).
    pub(super) fn pdf_pos(&self, q: &SizeDensity, rho: f32) -> AreaPdf {
        AreaPdf(match self.outline {
            Outline::Rectangle { a, b } => q.pdf_over_rho(rho) / (8.0 * a * b),
            Outline::Disk { r } => q.pdf_over_rho(rho) / (2.0 * PI * r * r),
        })
    }

    /// Density of an emitted direction: cosine-weighted within the cone.
    pub(super) fn pdf_dir(&self, dir: Vec3) -> SolidAnglePdf {
        let cos = dir.dot(self.frame.n);
        let sin2_max = self.sin2_max();
        if cos <= 0.0 || (self.cone.is_some() && 1.0 - cos * cos > sin2_max) {
            return SolidAnglePdf(0.0);
        }
        SolidAnglePdf(cos / (PI * sin2_max))
    }

    pub(super) fn sample_li(&self, reference: Vec3, q: &SizeDensity, u: Vec2) -> Option<LightLiSample> {
        let rho = q.sample(u.x);
        let p = self.point(rho, u.y);
        let d = p - reference;
        let d2 = d.length_squared();
        let wi = d / d2.sqrt();
        let cos = -wi.dot(self.frame.n);
        let radiance = Rgb::splat(self.profile(cos));
        if !(radiance.x > 0.0 && d2 > 0.0) {
            return None;
        }
        let pdf = self.pdf_pos(q, rho).to_solid_angle(d2, cos);
        let at = LightPoint { p, n: self.frame.n, rho, element: 0 };
        Some(LightLiSample { radiance, wi, pdf, at })
    }

    pub(super) fn sample_le(&self, q: &SizeDensity, u_pos: Vec2, u_dir: Vec2) -> Option<LightLeSample> {
        let rho = q.sample(u_pos.x);
        let disk = warp::square_to_disk(u_dir) * self.sin2_max().sqrt();
        let cos = (1.0 - disk.length_squared()).max(0.0).sqrt();
        let dir = self.frame.to_world(disk.extend(cos));
        let radiance = Rgb::splat(self.profile(cos));
        (radiance.x > 0.0).then(|| LightLeSample {
            radiance,
            at: LightPoint { p: self.point(rho, u_pos.y), n: self.frame.n, rho, element: 0 },
            dir,
            pdf_pos: self.pdf_pos(q, rho),
            pdf_dir: SolidAnglePdf(cos / (PI * self.sin2_max())),
        })
    }

    /// Area at size `s`, m².
    #[must_use]
    pub fn area(&self, s: f32) -> f32 {
        s * s
            * match self.outline {
                Outline::Rectangle { a, b } => 4.0 * a * b,
                Outline::Disk { r } => PI * r * r,
            }
    }

    /// Power at unit radiance and size `s`, W.
    pub(super) fn power(&self, s: f32) -> f32 {
        let projected = match self.cone {
            None => PI,
            Some(Cone { cos_inner, cos_outer, edge }) => {
                let width = cos_inner - cos_outer;
                PI * (1.0
                    - match edge {
                        // ∫ profile(c)·c dc by parts: the smooth step's derivative is symmetric
                        // about the middle of the edge, where its second moment is width²/20.
                        Edge::Smooth => {
                            let mid = 0.5 * (cos_inner + cos_outer);
                            mid * mid + width * width / 20.0
                        }
                        // ∫ x² (cos_outer + x width) width dx from 0 to 1.
                        Edge::Squared => {
                            cos_inner * cos_inner - 2.0 * width * (cos_outer / 3.0 + width / 4.0)
                        }
                    })
            }
        };
        projected * self.area(s)
    }
}

impl Resizable for Planar {
    fn outline(&self) -> Outline {
        self.outline
    }

    fn size_at_triangle(&self, corners: [Vec3; 3]) -> f32 {
        planar_size(self, corners)
    }

    fn size_at_point(&self, _p: Vec3) -> f32 {
        f32::INFINITY
    }

    fn size_at_ray(&self, org: Vec3, dir: Vec3, t_max: f32) -> f32 {
        let cos = -dir.dot(self.frame.n);
        let t = (org - self.center).dot(self.frame.n) / cos;
        if cos <= 0.0 || t <= 0.0 || t >= t_max {
            return f32::INFINITY;
        }
        let d = org + dir * t - self.center;
        self.rho(Vec2::new(d.dot(self.frame.s), d.dot(self.frame.t)))
    }
}

/// Least size coordinate among the points that a triangle shares with the
/// light's plane; infinite when it does not meet the plane.
fn planar_size(p: &Planar, corners: [Vec3; 3]) -> f32 {
    let local = corners.map(|c| p.frame.to_local(c - p.center));
    let xy = local.map(|c| Vec2::new(c.x, c.y));
    let z = local.map(|c| c.z);
    if z.iter().all(|&z| z > 0.0) || z.iter().all(|&z| z < 0.0) {
        return f32::INFINITY;
    }
    if z == [0.0; 3] {
        let inside = {
            let side = |a: Vec2, b: Vec2| (b - a).perp_dot(-a);
            let s = [side(xy[0], xy[1]), side(xy[1], xy[2]), side(xy[2], xy[0])];
            s.iter().all(|&v| v >= 0.0) || s.iter().all(|&v| v <= 0.0)
        };
        return if inside {
            0.0
        } else {
            (0..3).map(|i| segment_size(p, xy[i], xy[(i + 1) % 3])).fold(f32::INFINITY, f32::min)
        };
    }
    // The segment that the triangle cuts out of the plane.
    let mut ends = [Vec2::ZERO; 2];
    let mut n = 0;
    for i in 0..3 {
        let j = (i + 1) % 3;
        if (z[i] <= 0.0) != (z[j] <= 0.0) && n < 2 {
            ends[n] = xy[i].lerp(xy[j], z[i] / (z[i] - z[j]));
            n += 1;
        }
    }
    match n {
        2 => segment_size(p, ends[0], ends[1]),
        _ => (0..3).filter(|&i| z[i] == 0.0).map(|i| p.rho(xy[i])).fold(f32::INFINITY, f32::min),
    }
}

/// Least size coordinate along a segment of the light's plane.
fn segment_size(p: &Planar, a: Vec2, b: Vec2) -> f32 {
    let d = b - a;
    let mut at = vec![0.0, 1.0];
    match p.outline {
        Outline::Disk { .. } => at.push(-a.dot(d) / d.length_squared()),
        // max(|u|/a, |v|/b) is convex and piecewise linear: its least value is
        // at an end, at a zero of a coordinate, or where the two are equal.
        Outline::Rectangle { a: ea, b: eb } => {
            let (scaled, slope) = (a / Vec2::new(ea, eb), d / Vec2::new(ea, eb));
            at.push(-scaled.x / slope.x);
            at.push(-scaled.y / slope.y);
            at.push((scaled.y - scaled.x) / (slope.x - slope.y));
            at.push(-(scaled.y + scaled.x) / (slope.x + slope.y));
        }
    }
    at.iter().filter(|t| (0.0..=1.0).contains(*t)).map(|&t| p.rho(a + d * t)).fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::*;
    use crate::{
        light::look_frame,
        sampler::{Sampler, SamplerKind},
    };

    fn random(sampler: &mut Sampler) -> Vec3 {
        let a = sampler.next_2d();
        Vec3::new(a.x, a.y, sampler.next_1d()) * 2.0 - Vec3::ONE
    }

    #[test]
    fn planar_sizes_equal_a_dense_search() {
        let mut sampler = Sampler::new(SamplerKind::Sobol, 2);
        let mut met = 0;
        for i in 0..300 {
            sampler.start(UVec2::ZERO, i);
            let t = [random(&mut sampler), random(&mut sampler), random(&mut sampler)];
            let normal = random(&mut sampler).normalize();
            let outline =
                if i % 2 == 0 { Outline::Disk { r: 0.7 } } else { Outline::Rectangle { a: 0.5, b: 0.2 } };
            let p = Planar {
                center: random(&mut sampler) * 0.5,
                frame: look_frame(normal, Vec3::Y),
                outline,
                cone: None,
            };
            let exact = planar_size(&p, t);
            // Where lines from each corner to the opposite side cross the plane, by bisection.
            let height = |q: Vec3| (q - p.center).dot(p.frame.n);
            let mut dense = f32::INFINITY;
            for corner in 0..3 {
                let [a, b, c] = [t[corner], t[(corner + 1) % 3], t[(corner + 2) % 3]];
                for k in 0..=400 {
                    let (mut lo, mut hi) = (a, b.lerp(c, k as f32 / 400.0));
                    if (height(lo) > 0.0) == (height(hi) > 0.0) {
                        continue;
                    }
                    for _ in 0..40 {
                        let mid = (lo + hi) * 0.5;
                        if (height(mid) > 0.0) == (height(lo) > 0.0) { lo = mid } else { hi = mid }
                    }
                    let q = p.frame.to_local(lo - p.center);
                    dense = dense.min(p.rho(Vec2::new(q.x, q.y)));
                }
            }
            if exact.is_finite() {
                met += 1;
                // The grid of lines can only miss the least point, by a little.
                assert!(exact <= dense + 1e-3 && dense - exact < 0.05, "{i}: {exact} {dense}");
            } else {
                let z = t.map(|c| p.frame.to_local(c - p.center).z);
                assert!(z.iter().all(|z| *z > 0.0) || z.iter().all(|z| *z < 0.0));
            }
        }
        assert!(met > 50);
    }
}
