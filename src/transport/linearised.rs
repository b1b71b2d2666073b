//! A basis around one value of the background.

use rayon::prelude::*;

use super::{Layout, LightingPoint, Recombination, TransportBasis, ValueNodes, kernels};

/// What a basis is to the first order around one value of the background: light's polynomials are
/// evaluated once, for the cells that are asked for, and not in every picture. Pictures of lightings
/// of that value, and their derivatives there, are those of the basis to rounding.
#[derive(Debug)]
pub struct Linearised<'b> {
    of: &'b TransportBasis,
    value: f64,
    basis: TransportBasis,
    /// By cell.
    known: Vec<bool>,
}

impl<'b> Linearised<'b> {
    /// Around `value`, without any cell yet.
    #[must_use]
    pub fn new(of: &'b TransportBasis, value: f64) -> Self {
        let layout = Layout { nodes: ValueNodes::tangent(value), ..of.layout.clone() };
        let table = || vec![0.0; layout.n_rows() * layout.n_pixels()];
        let luminance = of.luminance.iter().map(|_| table()).collect();
        let known = vec![false; layout.n_cells()];
        Self { value, basis: TransportBasis { luminance, colour: Vec::new(), layout, ..*of }, known, of }
    }

    /// The value.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// The basis for such lightings, which must be of its value; without colour.
    pub fn for_lightings<'x>(
        &mut self,
        lightings: impl Iterator<Item = &'x LightingPoint>,
    ) -> &TransportBasis {
        let mut missing = Vec::new();
        for x in lightings {
            for cell in Recombination::new(&self.basis.layout, x).cells(&self.basis.layout) {
                if !std::mem::replace(&mut self.known[cell], true) {
                    missing.push(cell);
                }
            }
        }
        if !missing.is_empty() {
            self.add(&missing);
        }
        &self.basis
    }

    fn add(&mut self, cells: &[usize]) {
        let Self { of, value, basis, .. } = self;
        let (width, n_rows) = (basis.width(), basis.layout.n_rows());
        let n_nodes = of.layout.nodes.len();
        let (values, slopes) = of.layout.nodes.weights(*value);
        // At the second node: along the tangent by 1.
        let ahead: Vec<f64> = values.iter().zip(slopes).map(|(v, slope)| v + slope).collect();
        for (table, of_table) in basis.luminance.iter_mut().zip(&of.luminance) {
            let lines = table.par_chunks_exact_mut(n_rows * width).enumerate();
            lines.for_each_init(
                || vec![0.0; width],
                |sum, (y, line)| {
                    let from = of.line(of_table, 1, y);
                    for &cell in cells {
                        let rows: Vec<usize> = (cell * n_nodes..(cell + 1) * n_nodes).collect();
                        let to = line[2 * cell * width..][..2 * width].chunks_exact_mut(width);
                        for (weights, to) in [&values, &ahead].into_iter().zip(to) {
                            kernels::combine(from, &rows, weights, sum);
                            to.iter_mut().zip(&*sum).for_each(|(to, &v)| *to = v as f32);
                        }
                    }
                },
            );
        }
    }
}
