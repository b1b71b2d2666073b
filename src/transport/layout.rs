//! Layout of the tables of a basis.

use glam::UVec2;

use super::{Knots, ValueNodes};

/// Channels of a table of colour: red and blue, since green follows from the luminance.
pub(super) const COLOURS: usize = 2;

/// Cells of a light in the tables.
#[derive(Clone, Debug, PartialEq)]
pub struct LightCells {
    /// Index of the light's first cell among those of all lights.
    pub first_cell: usize,
    /// Knots of a free size; `None` for a light whose size is not free.
    pub knots: Option<Knots>,
    /// Size of a light whose size is not free, largest size of another.
    pub size: f32,
}

impl LightCells {
    /// Number of the light's cells.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.knots.as_ref().map_or(1, Knots::len)
    }

    /// Indices of the light's cells among those of all lights.
    #[must_use]
    pub fn cells(&self) -> std::ops::Range<usize> {
        self.first_cell..self.first_cell + self.n_cells()
    }
}

/// Film size, cells and nodes of the tables of a basis: what it keeps apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Film size, pixels.
    pub size: UVec2,
    /// Cells of each light, in the scene's order.
    pub lights: Vec<LightCells>,
    /// Nodes of the background's value.
    pub nodes: ValueNodes,
    /// Planes of the pictures of a replicate: 1, luminance; or 3, luminance, red and blue, for views that need
    /// colour.
    pub planes: usize,
}

/// Sizes of a light that a basis holds.
#[derive(Clone, Debug, PartialEq)]
pub enum SizeBins {
    /// A single size.
    Fixed(f32),
    /// All sizes up to the last knot.
    Free(Knots),
}

impl Layout {
    /// Layout of a film of `size` pixels, for lights of these sizes in the scene's order.
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
        Self { size, lights, nodes, planes: 1 }
    }

    /// The same layout with pictures of so many planes.
    ///
    /// # Panics
    /// When they are neither 1 nor 3.
    #[must_use]
    pub fn with_planes(self, planes: usize) -> Self {
        assert!(planes == 1 || planes == 1 + COLOURS, "luminance, or luminance with red and blue");
        Self { planes, ..self }
    }

    /// Number of the tables of colour of a basis: one of all replicates, or one of each.
    #[must_use]
    pub fn n_colour_tables(&self, replicates: usize) -> usize {
        if self.planes == 1 { 1 } else { replicates }
    }

    /// Layout for some of the lights, in the order in which they are given.
    #[must_use]
    pub fn of_lights(&self, lights: &[usize]) -> Self {
        let mut first_cell = 0;
        let chosen = lights.iter().map(|&l| {
            let cells = LightCells { first_cell, ..self.lights[l].clone() };
            first_cell += cells.n_cells();
            cells
        });
        Self { lights: chosen.collect(), nodes: self.nodes.clone(), ..*self }
    }

    /// Layout with the lights of another one of the same size and nodes after its own; `None` where these differ.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Option<Self> {
        if (self.size, &self.nodes, self.planes) != (other.size, &other.nodes, other.planes) {
            return None;
        }
        let n = self.n_cells();
        let added = other.lights.iter().cloned();
        let added = added.map(|cells| LightCells { first_cell: n + cells.first_cell, ..cells });
        Some(Self { lights: self.lights.iter().cloned().chain(added).collect(), ..self.clone() })
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

    /// Number of rows of a table for each pixel: cells times nodes.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_cells() * self.nodes.len()
    }

    /// Memory of the tables of a basis of `replicates` replicates, bytes: a table of luminance for each
    /// and the tables of colour.
    #[must_use]
    pub fn table_memory(&self, replicates: usize) -> u64 {
        self.table_bytes() * (replicates + COLOURS * self.n_colour_tables(replicates)) as u64
    }

    /// Memory of the tables of a basis of `replicates` replicates for searches, bytes.
    #[must_use]
    pub fn search_memory(&self, replicates: usize) -> u64 {
        self.table_bytes() * (replicates * self.planes) as u64
    }

    /// Memory of a table with one number per pixel, cell and node, bytes.
    fn table_bytes(&self) -> u64 {
        (self.n_rows() * self.n_pixels() * size_of::<f32>()) as u64
    }
}
