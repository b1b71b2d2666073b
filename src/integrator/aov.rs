//! Auxiliary pictures: mask, albedo, normal and depth of the first surface that the ray through each
//! pixel's centre meets. Lights are ignored.

use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::View;

/// Auxiliary pictures of a film, with a value for each pixel, row by row from the top.
#[derive(Clone, Debug)]
pub struct Aovs {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Mask of the main object: true where the pixel's ray meets it first.
    pub mask: Vec<bool>,
    /// Base colour, linear Rec.709, with the background's value multiplied in; black where there is no
    /// surface.
    pub albedo: Vec<[f32; 3]>,
    /// Unit shading normal in world space; zero where there is no surface.
    pub normal: Vec<[f32; 3]>,
    /// Distance from the camera along the ray, metres; infinite where there is no surface.
    pub depth: Vec<f32>,
}

/// Traces the auxiliary pictures of a view at a value of the background.
#[must_use]
pub fn trace(view: View, value: f32) -> Aovs {
    let View { scene, camera } = view;
    let UVec2 { x: width, y: height } = camera.size();
    let pixels: Vec<_> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let raster = Vec2::new((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let dir = camera.direction(raster);
            match scene.intersect(camera.position, dir) {
                None => (false, [0.0; 3], [0.0; 3], f32::INFINITY),
                Some(hit) => (
                    scene.is_main[hit.si.triangle as usize],
                    scene.base_color(&hit, value).to_array(),
                    hit.si.frame.n.to_array(),
                    hit.t,
                ),
            }
        })
        .collect();
    Aovs {
        width: width as usize,
        height: height as usize,
        mask: pixels.iter().map(|p| p.0).collect(),
        albedo: pixels.iter().map(|p| p.1).collect(),
        normal: pixels.iter().map(|p| p.2).collect(),
        depth: pixels.iter().map(|p| p.3).collect(),
    }
}

/// Number of rays along each side of the grid of a pixel's [`Features`].
const FEATURE_GRID: u32 = 3;

/// What the camera sees of surfaces, free of the noise of light transport: averages over a regular grid of
/// rays in each pixel, row by row from the top. A pixel that an edge crosses has the mean of both sides,
/// as its light has.
#[derive(Clone, Debug)]
pub struct Features {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Base colour, linear Rec.709, at the background's value 1; black where there is no surface.
    pub albedo: Vec<[f32; 3]>,
    /// Shading normal in world space, of unit length or, as an average, shorter; zero where there is no
    /// surface.
    pub normal: Vec<[f32; 3]>,
    /// Reciprocal of the distance from the camera, m⁻¹, which on a plane is linear in the pixel's
    /// place; zero where there is no surface.
    pub disparity: Vec<f32>,
}

impl Features {
    /// Traces the features of a view.
    #[must_use]
    pub fn trace(view: View) -> Self {
        let View { scene, camera } = view;
        let UVec2 { x: width, y: height } = camera.size();
        let n = FEATURE_GRID * FEATURE_GRID;
        let pixels: Vec<_> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let corner = Vec2::new((i % width) as f32, (i / width) as f32);
                let (mut albedo, mut normal, mut disparity) = (Vec3::ZERO, Vec3::ZERO, 0.0);
                for k in 0..n {
                    let cell = UVec2::new(k % FEATURE_GRID, k / FEATURE_GRID).as_vec2() + 0.5;
                    let dir = camera.direction(corner + cell / FEATURE_GRID as f32);
                    if let Some(hit) = scene.intersect(camera.position, dir) {
                        albedo += Vec3::from(scene.base_color(&hit, 1.0).to_array());
                        normal += hit.si.frame.n;
                        disparity += 1.0 / hit.t.max(f32::MIN_POSITIVE);
                    }
                }
                let mean = 1.0 / n as f32;
                ((albedo * mean).to_array(), (normal * mean).to_array(), disparity * mean)
            })
            .collect();
        Self {
            width: width as usize,
            height: height as usize,
            albedo: pixels.iter().map(|p| p.0).collect(),
            normal: pixels.iter().map(|p| p.1).collect(),
            disparity: pixels.iter().map(|p| p.2).collect(),
        }
    }
}
