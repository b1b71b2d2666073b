//! A basis linearised around one value of the background.

use rayon::prelude::*;

use super::{Layout, Recombination, Tables, TransportBasis, ValueNodes, kernels};
use crate::lighting::Lighting;

/// A basis to the first order around one value of the background: the polynomials in the value are
/// evaluated once for each cell that is asked for, not for every picture. Pictures of lightings with
/// that value, and their derivatives, equal those of the basis up to rounding.
#[derive(Debug)]
pub struct Linearised<'b> {
    of: &'b TransportBasis,
    value: f64,
    layout: Layout,
    /// Value and value plus slope at every pixel, by cell, then by replicate and plane, each as
    /// `[node][y][x]`; empty for cells that were not asked for.
    cells: Vec<Vec<Vec<f32>>>,
}

impl<'b> Linearised<'b> {
    /// The basis `of` around `value`, without any cell yet.
    #[must_use]
    pub fn new(of: &'b TransportBasis, value: f64) -> Self {
        let layout = Layout { nodes: ValueNodes::tangent(value), ..of.layout.clone() };
        Self { of, value, cells: vec![Vec::new(); layout.n_cells()], layout }
    }

    /// Value of the background around which the basis is linearised.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Evaluates the cells that the picture of the lighting `x`, of this value, reads.
    pub fn prepare(&mut self, x: &Lighting) {
        let missing: Vec<usize> = Recombination::new(&self.layout, x)
            .cells(&self.layout)
            .filter(|&c| self.cells[c].is_empty())
            .collect();
        let made: Vec<Vec<Vec<f32>>> = missing.par_iter().map(|&cell| self.make(cell)).collect();
        for (cell, images) in missing.into_iter().zip(made) {
            self.cells[cell] = images;
        }
    }

    fn make(&self, cell: usize) -> Vec<Vec<f32>> {
        let (n_nodes, n_pixels) = (self.of.layout.nodes.len(), self.layout.n_pixels());
        let width = self.layout.size.x as usize;
        let (values, slopes) = self.of.layout.nodes.weights(self.value);
        // At the second node: along the tangent by 1.
        let ahead: Vec<f64> = values.iter().zip(slopes).map(|(v, slope)| v + slope).collect();
        let mut sum = vec![0.0; width];
        let planes = self.layout.planes;
        let of_plane = |i: usize| {
            let mut images = vec![0.0; 2 * n_pixels];
            let (here, further) = images.split_at_mut(n_pixels);
            for (y, to) in here.chunks_mut(width).zip(further.chunks_mut(width)).enumerate() {
                let rows = cell * n_nodes..(cell + 1) * n_nodes;
                let rows: Vec<&[f32]> = rows.map(|row| self.of.row(i / planes, i % planes, row, y)).collect();
                for (weights, to) in [(&values, to.0), (&ahead, to.1)] {
                    kernels::combine(&rows, weights, &mut sum);
                    to.iter_mut().zip(&sum).for_each(|(to, &v)| *to = v as f32);
                }
            }
            images
        };
        (0..self.of.n_replicates() * planes).map(of_plane).collect()
    }
}

impl Tables for Linearised<'_> {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn n_replicates(&self) -> usize {
        self.of.n_replicates()
    }

    fn n_samples(&self) -> u32 {
        self.of.n_samples()
    }

    fn row(&self, replicate: usize, plane: usize, row: usize, y: usize) -> &[f32] {
        let width = self.layout.size.x as usize;
        &self.cells[row / 2][replicate * self.layout.planes + plane]
            [row % 2 * self.layout.n_pixels() + y * width..][..width]
    }
}
