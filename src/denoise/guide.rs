//! What weights are found from: the values of both halves, and the variance of their noise.

use crate::{
    integrator::aov::Features,
    math::{Rgb, luminance},
};

use super::Layer;

/// Distance of the patches of one light from which it lowers a weight, in units of the distance at which the
/// weight falls to 1/e. Lights are many, and the largest of several noisy distances is large by chance: .5 has
/// 5 % more error than 2 on the fruit basket with three lights at 128 samples.
const LIGHT_THRESHOLD: f32 = 2.0;

/// Albedo below which less than the light is left by dividing it out: reflections show on black things too.
/// Error on a textured scene at 8, 16, 32 and 128 samples, as a share of the noisy picture's: .080, .098, .134,
/// .272 with .02; .079, .098, .134, .272 with .1; .083, .104, .137, .224 with .3; .096, .117, .154, .234 with
/// nothing divided out. So it is better at few samples and worse at many.
const LEAST_ALBEDO: f32 = 0.1;

/// Values of both halves with the variance of their noise, row by row.
#[derive(Debug)]
pub struct Channel {
    /// Value of each pixel in each half, where 1 is the mean of the group.
    pub values: [Vec<f32>; 2],
    /// Variance of the noise of each value.
    pub variance: Vec<f32>,
}

/// Channels of which the mean distance counts.
#[derive(Debug)]
pub struct Group {
    /// Values of the two halves and their variances, by channel.
    pub channels: Vec<Channel>,
    /// Distance from which the group lowers a weight.
    pub threshold: f32,
}

/// Groups of channels of which the largest distance counts: the colours of the beauty and, where there are
/// several lights, the luminance of each.
#[derive(Debug)]
pub struct Guide {
    /// Groups, the beauty first.
    pub groups: Vec<Group>,
}

impl Guide {
    /// Guide of two halves of the pictures of all lights. Albedo is divided out, so that patches on a texture
    /// are told apart by their light alone.
    pub fn new(halves: [&[Layer]; 2], features: &Features) -> Self {
        let size = [features.width, features.height];
        let albedo = |i: usize| features.albedo[i].map(|a| a.max(LEAST_ALBEDO));
        let beauty = halves.map(|layers| {
            let sum = |i: usize| layers.iter().fold([0.0; 3], |s, l| std::array::from_fn(|c| s[c] + l[i][c]));
            (0..size[0] * size[1]).map(sum).collect::<Layer>()
        });
        let colour = |layer: &Layer, c: usize| {
            layer.iter().enumerate().map(|(i, v)| v[c] / albedo(i)[c]).collect::<Vec<f32>>()
        };
        let colours = (0..3).map(|c| beauty.each_ref().map(|layer| colour(layer, c)));
        let mut groups = vec![Group::new(colours.collect(), size, 0.0)];
        if halves[0].len() > 1 {
            let grey = |layer: &Layer| {
                let grey = |v: [f32; 3]| luminance(Rgb::from_array(v));
                let value = |(i, &v): (usize, &[f32; 3])| grey(v) / grey(albedo(i));
                layer.iter().enumerate().map(value).collect::<Vec<f32>>()
            };
            groups.extend(
                (0..halves[0].len())
                    .map(|l| Group::new(vec![halves.map(|half| grey(&half[l]))], size, LIGHT_THRESHOLD)),
            );
        }
        Self { groups }
    }
}

impl Group {
    /// A group of channels, each with its values in both halves.
    fn new(channels: Vec<[Vec<f32>; 2]>, size: [usize; 2], threshold: f32) -> Self {
        let values = channels.iter().flatten().flatten();
        let mean =
            values.map(|&v| f64::from(v)).sum::<f64>() / (2 * channels.len() * size[0] * size[1]) as f64;
        let scale = if mean > 0.0 && mean.is_finite() { (1.0 / mean) as f32 } else { 0.0 };
        let scaled = |pair: [Vec<f32>; 2]| {
            let values = pair.map(|half| half.into_iter().map(|v| v * scale).collect::<Vec<f32>>());
            // Of two values with the same distribution: their variance.
            let pairs = values[0].iter().zip(&values[1]);
            let spread: Vec<f32> = pairs.map(|(a, b)| 0.5 * (a - b) * (a - b)).collect();
            Channel { values, variance: smooth(&spread, size) }
        };
        Self { channels: channels.into_iter().map(scaled).collect(), threshold }
    }
}

/// Mean over the 3 × 3 pixels around each, of those within the picture.
fn smooth(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| {
            let rows = near(y, height).flat_map(|v| &values[v * width..][near(x, width)]);
            rows.clone().sum::<f32>() / rows.count() as f32
        })
        .collect()
}
