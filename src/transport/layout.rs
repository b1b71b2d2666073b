//! What a basis keeps apart, and where it lies in the tables.

use glam::UVec2;

use super::{Knots, ValueNodes};

/// Channels in the table of colour: red and blue.
pub(super) const COLOURS: usize = 2;

/// The cells of a light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightCells {
    /// The first of its cells.
    pub first_cell: usize,
    /// Knots of a free size.
    pub knots: Option<Knots>,
    /// The size when it is not free.
    pub size: f32,
}

impl LightCells {
    /// Number of its cells.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.knots.as_ref().map_or(1, Knots::len)
    }
}

/// What a basis keeps apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Film size, pixels.
    pub size: UVec2,
    /// The lights, in the scene's order.
    pub lights: Vec<LightCells>,
    /// Nodes of the background's value.
    pub nodes: ValueNodes,
}

/// A light's size in a basis.
#[derive(Clone, Debug, PartialEq)]
pub enum SizeBins {
    /// Kept at a size.
    Fixed(f32),
    /// Free between the first and the last knot.
    Free(Knots),
}

impl Layout {
    /// A layout of a film for lights with these sizes.
    #[must_use]
    pub fn new(size: UVec2, sizes: Vec<SizeBins>, nodes: ValueNodes) -> Self {
        let mut first_cell = 0;
        let lights = sizes
            .into_iter()
            .map(|bins| {
                let light = match bins {
                    SizeBins::Fixed(size) => LightCells { first_cell, knots: None, size },
                    SizeBins::Free(knots) => {
                        let size = knots.sizes().last().copied().unwrap_or(0.0) as f32;
                        LightCells { first_cell, knots: Some(knots), size }
                    }
                };
                first_cell += light.n_cells();
                light
            })
            .collect();
        Self { size, lights, nodes }
    }

    /// Number of pixels.
    #[must_use]
    pub fn n_pixels(&self) -> usize {
        self.size.element_product() as usize
    }

    /// Number of cells of all lights.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.lights.iter().map(LightCells::n_cells).sum()
    }

    /// Rows of a table: cells times value nodes.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_cells() * self.nodes.len()
    }

    /// Memory of a basis of `replicates` replicates, bytes: a table of luminance each and the
    /// table of colour.
    #[must_use]
    pub fn table_memory(&self, replicates: usize) -> u64 {
        self.table_bytes() * (replicates + COLOURS) as u64
    }

    /// Memory of a table of one number per pixel, cell and node.
    fn table_bytes(&self) -> u64 {
        (self.n_rows() * self.n_pixels() * size_of::<f32>()) as u64
    }
}
