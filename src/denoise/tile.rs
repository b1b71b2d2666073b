//! Tiles of a picture with a margin, laid out plane by plane for vector instructions.

use super::{
    Layer,
    guide::Guide,
    kernels::{self, LANES},
};
use crate::integrator::aov::Features;

/// Side of a tile, pixels: the weights of all its windows stay in the second cache level (500 kB).
pub const SIDE: usize = 32;
/// Pixels of a window on each side of its pixel. Windows of 15 × 15 pixels have up to 21 % more error in
/// pictures of 160 × 120 pixels, and take nearly three times the time.
pub const RADIUS: usize = 5;
/// Pixels of a patch on each side of its pixel.
pub const PATCH: usize = 1;
/// Margin of a tile.
pub const MARGIN: usize = RADIUS + PATCH;
/// Number of rows of a tile with its margins.
pub const ROWS: usize = SIDE + 2 * MARGIN;
/// Length of a row of a tile with its margins, so that vectors that begin within it end within it.
pub const STRIDE: usize = (ROWS + LANES).next_multiple_of(LANES);
/// Number of pixels of a window.
pub const WINDOW: usize = (2 * RADIUS + 1) * (2 * RADIUS + 1);
/// Number of features beside the place: albedo, normal, disparity.
pub const N_FEATURES: usize = 7;

/// A number for each pixel of a tile with its margins.
pub type Plane = Vec<f32>;

/// Everything that is known of a picture to be denoised.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// What the camera sees.
    pub features: &'a Features,
    /// What weights are found from.
    pub guide: &'a Guide,
    /// Pictures of the lights, of both halves.
    pub halves: [&'a [Layer]; 2],
}

/// A denoised tile.
#[derive(Debug)]
pub struct Tile {
    /// Column and row of the first pixel.
    corner: [usize; 2],
    /// Columns and rows.
    size: [usize; 2],
    /// Denoised light, a plane of SIDE × SIDE pixels for each channel of each layer.
    planes: Vec<Vec<f32>>,
}

/// Part of a picture as seen from a tile.
struct Cutout<'a> {
    frame: &'a Frame<'a>,
    corner: [usize; 2],
}

impl Cutout<'_> {
    /// Plane of a value of the picture's pixels; zero beside the picture.
    fn plane(&self, value: impl Fn(usize) -> f32) -> Plane {
        let Features { width, height, .. } = *self.frame.features;
        let mut plane = vec![0.0; ROWS * STRIDE];
        for (row, out) in plane.chunks_exact_mut(STRIDE).enumerate() {
            let Some(y) = (self.corner[1] + row).checked_sub(MARGIN).filter(|&y| y < height) else {
                continue;
            };
            let first = MARGIN.saturating_sub(self.corner[0]);
            let end = ROWS.min(width + MARGIN - self.corner[0]);
            for (column, out) in out.iter_mut().enumerate().take(end).skip(first) {
                *out = value(y * width + self.corner[0] + column - MARGIN);
            }
        }
        plane
    }
}

impl Tile {
    /// Denoises the tile whose first pixel is `corner`.
    pub fn denoise(frame: &Frame, corner: [usize; 2]) -> Self {
        let Features { width, height, albedo, normal, disparity } = frame.features;
        let cutout = Cutout { frame, corner };
        let size = [SIDE.min(width - corner[0]), SIDE.min(height - corner[1])];
        let inside = cutout.plane(|_| 1.0);
        let features: [Plane; N_FEATURES] = std::array::from_fn(|k| match k {
            0..3 => cutout.plane(|i| albedo[i][k]),
            3..6 => cutout.plane(|i| normal[i][k - 3]),
            _ => cutout.plane(|i| disparity[i]),
        });
        let mut planes = vec![vec![0.0; SIDE * SIDE]; 3 * frame.halves[0].len()];
        let mut weights = vec![0.0; WINDOW * SIDE * SIDE];
        for (half, layers) in frame.halves.iter().enumerate() {
            // The weights come from the other half.
            let groups: Vec<kernels::Group> = (frame.guide.groups.iter())
                .map(|group| kernels::Group {
                    threshold: group.threshold,
                    channels: (group.channels.iter())
                        .map(|c| [&c.values[1 - half], &c.variance].map(|v| cutout.plane(|i| v[i])))
                        .collect(),
                })
                .collect();
            kernels::weights(&groups, &inside, &features, &mut weights);
            let light: Vec<Plane> =
                layers.iter().flat_map(|l| (0..3).map(|c| cutout.plane(|i| l[i][c]))).collect();
            kernels::regress(&weights, &features, &light, &mut planes);
        }
        Self { corner, size, planes }
    }

    /// Copies the tile to its place in a picture of `width` columns.
    pub fn copy_to(&self, layers: &mut [Layer], width: usize) {
        let ([x, y], [columns, rows]) = (self.corner, self.size);
        for (layer, planes) in layers.iter_mut().zip(self.planes.chunks_exact(3)) {
            for row in 0..rows {
                let out = &mut layer[(y + row) * width + x..][..columns];
                for (column, out) in out.iter_mut().enumerate() {
                    // Light is never negative, though a fit may be.
                    *out = std::array::from_fn(|c| planes[c][row * SIDE + column].max(0.0));
                }
            }
        }
    }
}
