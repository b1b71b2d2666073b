//! Bounds of the sizes of lights, from the geometry.
//!
//! `s_max` is the largest size at which a light neither cuts a triangle nor
//! covers the main object in the picture; a sphere must not hold the camera
//! either, which makes its size coordinate exact.

use glam::{UVec2, Vec2};

use crate::{
    integrator::View,
    light::{Light, Resizable},
    scene::Mesh,
};

/// Largest size over that at which the light would touch a surface: the clearance trades size for noise,
/// since next-event estimation has unbounded contributions where a light touches what it lights.
const CLEARANCE: f32 = 0.95;
/// `s_min / s_max`: a range of twenty in size is 8.6 stops of flux at constant radiance. Smaller sizes
/// would need more knots and samples; set by reasoning, not measured.
const MIN_FRACTION: f32 = 0.05;
/// Largest half-extent of a light over the scene's diagonal. It bounds lights that touch nothing however
/// large, which would otherwise grow for ever; set by reasoning, not measured.
const MAX_EXTENT: f32 = 0.5;

/// Bounds `[s_min, s_max]` of a light's size that the geometry and the camera of a view set; `None` for a
/// light without size.
#[must_use]
pub fn size_range(view: View, light: &Light) -> Option<[f32; 2]> {
    let shape = light.resizable()?;
    let mesh = &view.scene.mesh;
    let limit = cutting_size(mesh, shape)
        .min(covering_size(view, light, shape))
        .min(shape.size_at_point(view.camera.position));
    let s_max = (CLEARANCE * limit).min(MAX_EXTENT * mesh.bounds().diagonal() / shape.outline().extent());
    Some([MIN_FRACTION * s_max, s_max])
}

/// Least size at which a light touches a triangle of the mesh.
fn cutting_size(mesh: &Mesh, shape: &dyn Resizable) -> f32 {
    let sizes = (0..mesh.indices.len()).map(|t| shape.size_at_triangle(mesh.corners(t)));
    sizes.fold(f32::INFINITY, f32::min)
}

/// Least size at which a light that the camera sees covers a part of the main object, over the rays
/// through the centres of the pixels.
fn covering_size(View { scene, camera }: View, light: &Light, shape: &dyn Resizable) -> f32 {
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
                least = least.min(shape.size_at_ray(camera.position, dir, hit.t));
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Sphere;

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
        let sphere = Sphere { center: Vec3::ZERO, radius: 0.25 };
        assert!((cutting_size(&mesh, &sphere) - 4.0).abs() < 1e-5);
    }
}
