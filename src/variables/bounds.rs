//! Bounds of light sizes from the geometry.
//!
//! `s_max` is the largest size at which a light neither cuts a triangle nor
//! covers the main object in the picture; a sphere must not hold the camera
//! either, which makes its size coordinate exact.

use glam::{UVec2, Vec2, Vec3};

use crate::{
    camera::Camera,
    integrator::View,
    light::{Light, Outline, Planar, Shape},
    scene::Mesh,
};

/// Kept clear between a light at its largest and what bounds it.
const CLEARANCE: f32 = 0.95;
/// `s_min / s_max`.
const MIN_FRACTION: f32 = 0.05;
/// A light grows at most to this share of the scene's diagonal.
const MAX_EXTENT: f32 = 0.5;

/// The sizes a light may take, before the sidecar's own limits.
///
/// `[s_min, s_max]`; `None` for a light without size.
#[must_use]
pub fn size_range(view: View, light: &Light) -> Option<[f32; 2]> {
    let View { scene, camera } = view;
    let unit = unit_extent(light).filter(|_| light.has_size())?;
    let diagonal = scene_diagonal(&scene.mesh);
    let limit =
        cutting_size(&scene.mesh, light).min(covering_size(view, light)).min(camera_size(camera, light));
    let s_max = (CLEARANCE * limit).min(MAX_EXTENT * diagonal / unit);
    Some([MIN_FRACTION * s_max, s_max])
}

/// Largest half-extent at size 1, metres; `None` without size.
fn unit_extent(light: &Light) -> Option<f32> {
    match &light.shape {
        Shape::Planar(p) => Some(match p.outline {
            Outline::Rectangle { a, b } => a.max(b),
            Outline::Disk { r } => r,
        }),
        Shape::Sphere(s) => Some(s.radius),
        Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => None,
    }
}

fn scene_diagonal(mesh: &Mesh) -> f32 {
    let (lo, hi) = mesh
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    (hi - lo).length()
}

/// The size at which the light first touches a triangle.
#[must_use]
pub fn cutting_size(mesh: &Mesh, light: &Light) -> f32 {
    (0..mesh.indices.len())
        .map(|t| match &light.shape {
            Shape::Planar(p) => planar_size(p, mesh.corners(t)),
            Shape::Sphere(s) => point_triangle_distance(s.center, mesh.corners(t)) / s.radius,
            _ => f32::INFINITY,
        })
        .fold(f32::INFINITY, f32::min)
}

/// The size at which a sphere reaches the camera.
fn camera_size(camera: &Camera, light: &Light) -> f32 {
    match &light.shape {
        Shape::Sphere(s) => s.center.distance(camera.position) / s.radius,
        _ => f32::INFINITY,
    }
}

/// The size at which the light first stands before the main object in the
/// picture, over the pixel-centre rays.
fn covering_size(View { scene, camera }: View, light: &Light) -> f32 {
    if !light.camera_visible {
        return f32::INFINITY;
    }
    let UVec2 { x: width, y: height } = camera.size();
    let mut least = f32::INFINITY;
    for y in 0..height {
        for x in 0..width {
            let dir = camera.direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
            let Some(hit) = scene.intersect(camera.position, dir) else { continue };
            if scene.is_main[hit.si.triangle as usize] {
                least = least.min(ray_size(light, camera.position, dir, hit.t));
            }
        }
    }
    least
}

/// The size from which the light is seen by a ray within `(0, t_max)`.
fn ray_size(light: &Light, org: Vec3, dir: Vec3, t_max: f32) -> f32 {
    match &light.shape {
        Shape::Planar(p) => {
            let cos = -dir.dot(p.frame.n);
            let t = (org - p.center).dot(p.frame.n) / cos;
            if cos <= 0.0 || t <= 0.0 || t >= t_max {
                return f32::INFINITY;
            }
            let d = org + dir * t - p.center;
            p.rho(Vec2::new(d.dot(p.frame.s), d.dot(p.frame.t)))
        }
        Shape::Sphere(s) => {
            let oc = s.center - org;
            let t = oc.dot(dir);
            if t <= 0.0 || t >= t_max {
                return f32::INFINITY;
            }
            (oc - dir * t).length() / s.radius
        }
        _ => f32::INFINITY,
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

/// Distance of a point from a triangle. \[Ericson04\] 5.1.5.
fn point_triangle_distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
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
    use super::*;
    use crate::{
        light::{Sphere, look_frame},
        sampler::{Sampler, SamplerKind},
    };

    fn random(sampler: &mut Sampler) -> Vec3 {
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

    #[test]
    fn a_sphere_grows_to_the_nearest_triangle() {
        let mesh = Mesh {
            positions: vec![
                Vec3::new(-9.0, -1.0, -9.0),
                Vec3::new(9.0, -1.0, -9.0),
                Vec3::new(0.0, -1.0, 9.0),
            ],
            indices: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let light = Light {
            name: String::new(),
            shape: Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 0.25 }),
            color: Vec3::ONE,
            radiance: 1.0,
            size: 1.0,
            camera_visible: true,
            occludes: false,
        };
        assert!((cutting_size(&mesh, &light) - 4.0).abs() < 1e-5);
    }
}
