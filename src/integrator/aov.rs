//! Auxiliary pictures: mask, albedo, normal and depth of the first surface that the ray through each
//! pixel's centre meets. Lights are ignored.

use glam::{UVec2, Vec2};
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
