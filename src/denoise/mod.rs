//! Denoising that keeps sums.
//!
//! Around each pixel the light of a window is fitted by a weighted linear regression on noise-free features:
//! the place in the picture, albedo, normal and disparity of what the camera sees. The fit's value at the
//! pixel is what is shown: edges and textures that the features have are kept, noise is averaged out
//! \[Moon14\], \[Bitterli16\]. A neighbour's weight falls with the distance of its patch of pixels from the patch
//! around the pixel, in units of the noise \[Rousselle12\], in the beauty and in the picture of each
//! light: so the shadow of one light is kept where the sum is flat.
//!
//! The samples come in two halves. The weights with which one half is averaged are found in the other, so
//! that a pixel's own noise does not choose its weights, and the two results are averaged
//! \[Rousselle13\].
//!
//! Once the weights are known, the result is linear in the light, and the pictures of all lights are averaged
//! with the same weights: they add up to the denoised beauty, and a light of twice the radiance has twice the
//! denoised picture. The regression reproduces what is constant, also beside the border. Each light
//! keeps its mean over the picture.
//!
//! Bytes do not depend on the number of threads or on the instruction set.

mod guide;
mod kernels;
#[cfg(test)]
mod tests;
mod tile;

use rayon::prelude::*;

use crate::{film::Picture, integrator::aov::Features};
use guide::Guide;
use tile::{Frame, SIDE, Tile};

/// Radiance of a picture, linear Rec.709, row by row from the top.
pub type Layer = Vec<[f32; 3]>;

/// Pictures of all lights, denoised; they add up to the denoised beauty.
///
/// * `features`: what the camera sees in each pixel
/// * `halves`: pictures of the lights, in the same order, from independent halves of the samples, which are
///   weighed the same
///
/// The result is free of negative values, and each light has the same mean over the picture as in the mean
/// of both halves.
///
/// # Panics
/// When the halves do not have the same number of layers, or a layer not the number of pixels of the
/// features.
#[must_use]
pub fn denoise(features: &Features, halves: [&[Layer]; 2]) -> Vec<Layer> {
    let n_pixels = features.width * features.height;
    let n_layers = halves[0].len();
    assert_eq!(n_layers, halves[1].len(), "as many layers in both halves");
    assert!(halves.iter().all(|h| h.iter().all(|l| l.len() == n_pixels)), "layers of the features' size");
    let mut layers = vec![vec![[0.0; 3]; n_pixels]; n_layers];
    if n_layers == 0 || n_pixels == 0 {
        return layers;
    }
    let guide = Guide::new(halves, features);
    let frame = Frame { features, guide: &guide, halves };
    let across = features.width.div_ceil(SIDE);
    let tiles: Vec<Tile> = (0..across * features.height.div_ceil(SIDE))
        .into_par_iter()
        .map(|i| Tile::denoise(&frame, [i % across * SIDE, i / across * SIDE]))
        .collect();
    for tile in &tiles {
        tile.copy_to(&mut layers, features.width);
    }
    layers.iter_mut().enumerate().for_each(|(l, layer)| keep_mean(layer, halves.map(|half| &half[l])));
    layers
}

/// The picture of two that have independent halves of the samples, denoised with the pictures of its lights.
///
/// # Panics
/// As [`denoise`].
#[must_use]
pub fn denoise_picture(features: &Features, halves: &[Picture; 2]) -> Picture {
    let [a, b] = halves;
    Picture::of_lights([a.width, a.height], denoise(features, [&a.lights, &b.lights]))
}

/// Scales a layer to the mean of two: what is averaged with weights of its neighbours gives away a little more
/// light than it takes, up to four thousandths at eight samples.
fn keep_mean(layer: &mut Layer, halves: [&Layer; 2]) {
    let sum = |l: &Layer| l.as_flattened().iter().map(|&v| f64::from(v)).sum::<f64>();
    let (is, was) = (sum(layer), 0.5 * (sum(halves[0]) + sum(halves[1])));
    if is > 0.0 && was > 0.0 && was.is_finite() {
        let factor = was / is;
        layer.as_flattened_mut().iter_mut().for_each(|v| *v = (f64::from(*v) * factor) as f32);
    }
}
