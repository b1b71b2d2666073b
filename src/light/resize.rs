//! Lights that can be resized: outlines, and the sizes at which they meet geometry, points and rays.

use glam::Vec3;

/// Outline of a light at unit size, as seen from where it shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// Rectangle, by its half-extents along the frame's tangents.
    Rectangle {
        /// Half-extent along the tangent `s`, metres.
        a: f32,
        /// Half-extent along the tangent `t`, metres.
        b: f32,
    },
    /// Disk, by its radius.
    Disk {
        /// Radius, metres.
        r: f32,
    },
}

impl Outline {
    /// Larger half-extent of a rectangle, radius of a disk, metres.
    #[must_use]
    pub fn extent(&self) -> f32 {
        match *self {
            Self::Rectangle { a, b } => a.max(b),
            Self::Disk { r } => r,
        }
    }
}

/// A light whose size s, a factor on its unit extents, may vary.
pub trait Resizable {
    /// Outline at unit size as seen from where it shines.
    fn outline(&self) -> Outline;

    /// Least size at which the light touches a triangle; infinite if it never does.
    fn size_at_triangle(&self, corners: [Vec3; 3]) -> f32;

    /// Least size at which the light reaches the point `p`, where points inside it would make its size
    /// coordinate inexact; infinite for a light whose coordinate is exact whatever surrounds it.
    fn size_at_point(&self, p: Vec3) -> f32;

    /// Least size at which the ray from `org` along unit `dir` meets the light within `(0, t_max)`;
    /// infinite if it never does.
    fn size_at_ray(&self, org: Vec3, dir: Vec3, t_max: f32) -> f32;
}

/// Distance of a point from a triangle. \[Ericson04\] 5.1.5.
pub(super) fn point_triangle_distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.length();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.length();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (ap - ab * (d1 / (d1 - d3))).length();
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.length();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (ap - ac * (d2 / (d2 - d6))).length();
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return (bp - (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))).length();
    }
    let denom = 1.0 / (va + vb + vc);
    (ap - ab * (vb * denom) - ac * (vc * denom)).length()
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::*;
    use crate::sampler::{Sampler, SamplerKind};

    pub fn random(sampler: &mut Sampler) -> Vec3 {
        let a = sampler.next_2d();
        Vec3::new(a.x, a.y, sampler.next_1d()) * 2.0 - Vec3::ONE
    }

    /// Barycentric grid over a triangle.
    fn points([a, b, c]: [Vec3; 3], n: usize) -> impl Iterator<Item = Vec3> {
        (0..=n).flat_map(move |i| {
            (0..=n - i).map(move |j| {
                let (u, v) = (i as f32 / n as f32, j as f32 / n as f32);
                a + (b - a) * u + (c - a) * v
            })
        })
    }

    #[test]
    fn distances_to_triangles_equal_a_dense_search() {
        let mut sampler = Sampler::new(SamplerKind::Sobol, 1);
        for i in 0..200 {
            sampler.start(UVec2::ZERO, i);
            let t = [random(&mut sampler), random(&mut sampler), random(&mut sampler)];
            let p = random(&mut sampler) * 1.5;
            let exact = point_triangle_distance(p, t);
            let dense = points(t, 60).map(|q| q.distance(p)).fold(f32::INFINITY, f32::min);
            assert!(exact <= dense + 1e-5 && dense - exact < 0.05, "{exact} {dense}");
        }
    }
}
