//! Maps from the unit square to the domains that are sampled.

use std::f32::consts::{FRAC_PI_4, PI};

use glam::{Vec2, Vec3};

use super::SolidAnglePdf;

/// Uniform point of the unit disk, concentric map.
///
/// \[Shirley97\]; this form: \[PBRT4\] A.5.1.
#[must_use]
pub fn square_to_disk(u: Vec2) -> Vec2 {
    let o = 2.0 * u - Vec2::ONE;
    if o == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, theta) = if o.x.abs() > o.y.abs() {
        (o.x, FRAC_PI_4 * (o.y / o.x))
    } else {
        (o.y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (o.x / o.y))
    };
    r * Vec2::new(theta.cos(), theta.sin())
}

/// Barycentric coordinates of a uniform point of a triangle. \[Heitz19\]
#[must_use]
pub fn square_to_triangle(u: Vec2) -> Vec3 {
    let (a, b) = if u.x < u.y { (0.5 * u.x, u.y - 0.5 * u.x) } else { (u.x - 0.5 * u.y, 0.5 * u.y) };
    Vec3::new(a, b, (1.0 - a - b).max(0.0))
}

/// Direction of the upper hemisphere with density cos θ / π.
#[must_use]
pub fn square_to_cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = square_to_disk(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`square_to_cosine_hemisphere`].
#[must_use]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> SolidAnglePdf {
    SolidAnglePdf(cos_theta.max(0.0) / PI)
}

/// Uniform direction of the whole sphere.
#[must_use]
pub fn square_to_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let phi = 2.0 * PI * u.y;
    Vec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// Direction of the whole sphere by an octahedral map of equal area, \[Clarberg08\]: parts of the square of
/// equal area have equal solid angles, and neighbours are neighbours. The middle of the square is +z.
#[must_use]
pub fn square_to_sphere_octahedral(u: Vec2) -> Vec3 {
    let o = 2.0 * u - Vec2::ONE;
    let a = o.abs();
    let d = 1.0 - (a.x + a.y);
    let r = 1.0 - d.abs();
    let phi = FRAC_PI_4 * if r == 0.0 { 1.0 } else { (a.y - a.x) / r + 1.0 };
    let across = r * (2.0 - r * r).max(0.0).sqrt();
    let z = (1.0 - r * r).copysign(d);
    Vec3::new((across * phi.cos()).copysign(o.x), (across * phi.sin()).copysign(o.y), z)
}

/// Density of [`square_to_sphere`].
pub const UNIFORM_SPHERE_PDF: SolidAnglePdf = SolidAnglePdf(1.0 / (4.0 * PI));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_octahedral_square_have_equal_solid_angles() {
        // So many cells that those on the edge of a cap, counted whole or not at all, stay below what is allowed.
        const N: usize = 512;
        let at = |i: usize| Vec2::new((i % N) as f32 + 0.5, (i / N) as f32 + 0.5) / N as f32;
        let all: Vec<Vec3> = (0..N * N).map(|i| square_to_sphere_octahedral(at(i))).collect();
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-5));
        // A cap of height h about any axis has the share h/2 of the sphere.
        for axis in [Vec3::X, Vec3::NEG_Y, Vec3::Z, Vec3::new(0.6, -0.48, 0.64)] {
            for h in [0.1, 0.5, 1.0, 1.7] {
                let share = all.iter().filter(|d| d.dot(axis) > 1.0 - h).count() as f32 / (N * N) as f32;
                assert!((share - 0.5 * h).abs() < 2e-3, "{axis} {h}: {share}");
            }
        }
        // Neighbours in the square are neighbours on the sphere.
        let step = 4.0 / N as f32;
        for i in (0..N * N).filter(|i| i % N + 1 < N) {
            assert!(all[i].distance(all[i + 1]) < 2.0 * step, "{i}");
        }
        assert_eq!(square_to_sphere_octahedral(Vec2::splat(0.5)), Vec3::Z);
    }
}
