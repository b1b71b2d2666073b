//! Shading normals tilted by images.
//!
//! An image's axes run along ∂p/∂u and, v up, toward increasing v, both made
//! orthonormal to the interpolated normal; those of a normal map along the tangents
//! that the file gives, if it does (glTF 2.0 section 3.7.2.1). With `z` the interpolated normal, a
//! normal map gives the tilted one directly, a bump map by the derivatives of its
//! height, the derivative of the normal itself left out (Mitsuba's `normalmap` and
//! `bumpmap` with `flip_invalid_normals` and `use_shadowing_function` off; it takes
//! heights in units of length, and green toward decreasing v where an image is
//! mirrored). Seen from behind, a relief is
//! its own mould: the tilted normal is turned over as a whole.
//!
//! A direction on one side of the surface and on the other of the tilted one is
//! neither reflected nor transmitted, so that nothing leaks through: see
//! [`super::SurfaceInteraction::scatter`].

use glam::{Vec2, Vec3};

use super::{Mesh, material::Relief};

/// Derivatives of the position by u and by v over a triangle; `None` where the
/// texture coordinates do not span it.
fn derivatives(mesh: &Mesh, triangle: usize) -> Option<[Vec3; 2]> {
    let [a, b, c] = mesh.corners(triangle);
    let [ua, ub, uc] = mesh.indices[triangle].map(|i| mesh.uvs[i as usize]);
    let (p, q) = (ub - ua, uc - ua);
    let determinant = p.perp_dot(q);
    let derivatives =
        [((b - a) * q.y - (c - a) * p.y) / determinant, ((c - a) * p.x - (b - a) * q.x) / determinant];
    let is_basis = |[du, dv]: &[Vec3; 2]| du.cross(*dv).try_normalize().is_some();
    Some(derivatives).filter(|d| d.iter().all(|v| v.is_finite()) && is_basis(d))
}

/// A point of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Index of the triangle.
    pub triangle: usize,
    /// Weights of its corners at the point.
    pub weights: Vec3,
    /// Texture coordinates at the point, v up.
    pub uv: Vec2,
}

/// Axes of a normal map at a point of unit normal `n`, orthonormal to it: by the tangents of the corners
/// where all have one, else along the texture coordinates.
fn axes(mesh: &Mesh, at: &Place, n: Vec3) -> Option<[Vec3; 2]> {
    let upright = |v: Vec3| (v - n * n.dot(v)).try_normalize();
    let given = mesh.indices[at.triangle].map(|i| mesh.tangents.get(i as usize).copied().unwrap_or_default());
    if given.iter().all(|t| t.w != 0.0) {
        let [a, b, c] = given;
        let tangent = a * at.weights.x + b * at.weights.y + c * at.weights.z;
        if let Some(s) = upright(tangent.truncate()) {
            return Some([s, n.cross(s) * tangent.w.signum()]);
        }
    }
    let [du, dv] = derivatives(mesh, at.triangle)?;
    let s = upright(du)?;
    // Toward increasing v, whether or not the image is mirrored.
    Some([s, n.cross(s) * n.cross(s).dot(dv).signum()])
}

/// The unit normal `n` of a point, tilted.
#[must_use]
pub fn tilt(relief: &Relief, mesh: &Mesh, at: &Place, n: Vec3) -> Vec3 {
    let tilted = match relief {
        Relief::NormalMap { texture, scale } => {
            let Some([s, t]) = axes(mesh, at, n) else { return n };
            let m = texture.sample(at.uv) * 2.0 - Vec3::ONE;
            s * (m.x * scale) + t * (m.y * scale) + n * m.z
        }
        Relief::BumpMap { height, scale } => {
            let Some([du, dv]) = derivatives(mesh, at.triangle) else { return n };
            let uv = at.uv;
            let slope = height.gradient(uv) * (scale * du.length());
            let along = |d: Vec3, slope: f32| d + n * (slope - n.dot(d));
            let tilted = along(du, slope.x).cross(along(dv, slope.y));
            tilted * tilted.dot(n).signum()
        }
    };
    tilted.try_normalize().unwrap_or(n)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Affine2;

    use super::*;
    use crate::picture::Samples;
    use crate::scene::texture::{Channel, Encoding, ScalarMap, Texture};

    /// A triangle in the plane z = 0 whose u runs along `du` and whose v along `dv`.
    fn triangle(du: Vec2, dv: Vec2) -> Mesh {
        let positions = [Vec2::ZERO, du, dv].map(|p| p.extend(0.0)).to_vec();
        Mesh {
            positions,
            normals: vec![Vec3::Z; 3],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
            indices: vec![[0, 1, 2]],
            materials: vec![0],
            objects: vec![0],
            ..Mesh::default()
        }
    }

    fn at(uv: f32) -> Place {
        Place { triangle: 0, weights: Vec3::splat(1.0 / 3.0), uv: Vec2::splat(uv) }
    }

    fn image(f: impl Fn(u32, u32) -> [u16; 3]) -> Arc<Texture> {
        let image = image::ImageBuffer::from_fn(8, 8, |x, y| image::Rgb(f(x, y)));
        let texels = Samples::U16(image.into_raw());
        Arc::new(Texture::from_samples([8, 8], 3, texels, Encoding::Linear))
    }

    fn encoded(n: Vec3) -> [u16; 3] {
        ((n + Vec3::ONE) / 2.0 * 65535.0).to_array().map(|v| v.round() as u16)
    }

    #[test]
    fn a_normal_map_leans_along_the_image_even_if_it_is_mirrored() {
        let m = Vec3::new(0.3, 0.5, 0.8).normalize();
        let relief = |scale| Relief::NormalMap { texture: image(|_, _| encoded(m)), scale };
        let tilted = |mesh: &Mesh, scale| tilt(&relief(scale), mesh, &at(0.3), Vec3::Z);
        let upright = tilted(&triangle(Vec2::X, Vec2::Y), 1.0);
        assert!((upright - m).length() < 1e-4, "{upright}");
        let mirrored = tilted(&triangle(-Vec2::X * 3.0, Vec2::Y), 1.0);
        assert!((mirrored - Vec3::new(-m.x, m.y, m.z)).length() < 1e-4, "{mirrored}");
        let turned = tilted(&triangle(Vec2::Y, -Vec2::X), 1.0);
        assert!((turned - Vec3::new(-m.y, m.x, m.z)).length() < 1e-4, "{turned}");
        let flat = tilted(&triangle(Vec2::X, Vec2::Y), 0.0);
        assert!((flat - Vec3::Z).length() < 1e-6, "{flat}");
        // Tangents of the file come first, and the sign says which way the other axis runs.
        for sign in [1.0, -1.0] {
            let tangents = vec![Vec3::Y.extend(sign); 3];
            let n = tilted(&Mesh { tangents, ..triangle(Vec2::X, Vec2::Y) }, 1.0);
            assert!((n - Vec3::new(-m.y * sign, m.x, m.z)).length() < 1e-4, "{sign}: {n}");
        }
        let some = vec![Vec3::Y.extend(1.0); 2];
        let n = tilted(&Mesh { tangents: some, ..triangle(Vec2::X, Vec2::Y) }, 1.0);
        assert!((n - m).length() < 1e-4, "{n}");
    }

    #[test]
    fn a_bump_map_is_the_normal_of_its_heights_whatever_the_scale_and_the_axes() {
        // Height rises by 0.4 of the width along u, and by 0.2 along v.
        let ramp = image(|x, y| [(20_000.0 + 65_535.0 * (0.4 * x as f32 - 0.2 * y as f32) / 8.0) as u16; 3]);
        let relief = |texture: &Arc<Texture>| Relief::BumpMap {
            height: ScalarMap { texture: texture.clone(), channel: Channel::R },
            scale: 1.0,
        };
        let tilted = |mesh: &Mesh| tilt(&relief(&ramp), mesh, &at(0.4), Vec3::Z);
        let expected = Vec3::new(-0.4, -0.2, 1.0).normalize();
        for size in [0.01, 1.0, 50.0] {
            let n = tilted(&triangle(Vec2::X * size, Vec2::Y * size));
            assert!((n - expected).length() < 1e-3, "{size}: {n}");
        }
        let n = tilted(&triangle(-Vec2::X, Vec2::Y));
        assert!((n - expected * Vec3::new(-1.0, 1.0, 1.0)).length() < 1e-3, "{n}");
        // Twice as many images across: twice as steep, each half as wide and as high.
        let halved = Arc::new(ramp.transformed(Affine2::from_scale(Vec2::splat(0.5))));
        let n = tilt(&relief(&halved), &triangle(Vec2::X, Vec2::Y), &at(0.8), Vec3::Z);
        assert!((n - Vec3::new(-0.2, -0.1, 1.0).normalize()).length() < 1e-3, "{n}");
    }

    #[test]
    fn without_texture_coordinates_the_normal_stays() {
        let relief = Relief::NormalMap { texture: image(|_, _| encoded(Vec3::X)), scale: 1.0 };
        let n = Vec3::new(0.6, 0.0, 0.8);
        for uvs in [[Vec2::ZERO; 3], [Vec2::ZERO, Vec2::X, Vec2::X * 2.0]] {
            let mesh = Mesh { uvs: uvs.to_vec(), ..triangle(Vec2::X, Vec2::Y) };
            assert_eq!(tilt(&relief, &mesh, &at(0.0), n), n);
        }
    }
}
