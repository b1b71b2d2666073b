//! The film that keeps contributions apart: by light, size bin and value node.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::{Layout, zeros};
use crate::{
    film::{Contribution, Film, Recorder, Region, RowRecorder},
    math::{self, NodeRgb},
};

/// Sums of the contributions of the replicates of a basis: of luminance for one replicate
/// at a time, of colour for all of them.
///
/// A pixel's own contributions are added in sample order. Those of light
/// subpaths are kept in the order of the rows that made them and added after the
/// render, row by row. So the sums do not depend on the number of threads.
#[derive(Debug)]
pub struct BasisFilm<'a, const N: usize> {
    layout: &'a Layout,
    /// [pixel][cell][node], of the present replicate.
    luminance: Vec<f32>,
    /// [pixel][cell][node][rgb], of all replicates.
    rgb: Vec<f32>,
    /// By the row that made them.
    splats: Vec<Vec<Splat<N>>>,
    non_finite: AtomicU64,
}

#[derive(Clone, Copy, Debug)]
struct Splat<const N: usize> {
    pixel: u32,
    deposit: Deposit,
    value: NodeRgb<N>,
}

/// Where a contribution goes: a cell and, with the rest, the next one.
#[derive(Clone, Copy, Debug)]
struct Deposit {
    cell: u32,
    next: f32,
}

/// Recorder of a row of a [`BasisFilm`].
#[derive(Debug)]
pub struct BasisRow<'a, const N: usize> {
    layout: &'a Layout,
    sums: Sums<'a>,
    splats: &'a mut Vec<Splat<N>>,
    non_finite: &'a AtomicU64,
    pixel: usize,
}

/// Sums of a row of pixels.
#[derive(Debug)]
struct Sums<'a> {
    n_cells: usize,
    n_nodes: usize,
    luminance: &'a mut [f32],
    rgb: &'a mut [f32],
}

impl Sums<'_> {
    fn add<const N: usize>(&mut self, pixel: usize, deposit: Deposit, value: &NodeRgb<N>) {
        let first = (pixel * self.n_cells + deposit.cell as usize) * self.n_nodes;
        let luminance = value.0.map(math::luminance);
        let rgb = value.0.map(|c| c.to_array());
        let mut into = |first: usize, share: f32| {
            let add = |sums: &mut [f32], values: &[f32]| {
                sums.iter_mut().zip(values).for_each(|(sum, v)| *sum += share * v);
            };
            add(&mut self.luminance[first..][..self.n_nodes], &luminance);
            add(&mut self.rgb[3 * first..][..3 * self.n_nodes], rgb.as_flattened());
        };
        into(first, 1.0 - deposit.next);
        if deposit.next > 0.0 {
            into(first + self.n_nodes, deposit.next);
        }
    }
}

/// The sums of a film, row by row.
fn rows_of_sums<'a>(
    layout: &Layout,
    luminance: &'a mut [f32],
    rgb: &'a mut [f32],
) -> impl Iterator<Item = Sums<'a>> + use<'a> {
    let (n_cells, n_nodes) = (layout.n_cells(), layout.nodes.len());
    let width = layout.size.x as usize * n_cells * n_nodes;
    let rows = luminance.chunks_mut(width).zip(rgb.chunks_mut(3 * width));
    rows.map(move |(luminance, rgb)| Sums { n_cells, n_nodes, luminance, rgb })
}

/// Pixels whose sums are spread over the tables' rows at a time: a cell of all of
/// them stays in the first cache level.
const TILE: usize = 128;

impl<'a, const N: usize> BasisFilm<'a, N> {
    /// An empty film.
    ///
    /// # Panics
    /// When the layout has another number of value nodes.
    #[must_use]
    pub fn new(layout: &'a Layout) -> Self {
        assert!(layout.nodes.len() <= N, "the film carries fewer value nodes than the layout has");
        let n = layout.n_pixels() * layout.n_rows();
        Self {
            layout,
            luminance: zeros(n),
            rgb: zeros(3 * n),
            splats: vec![Vec::new(); layout.size.y as usize],
            non_finite: AtomicU64::new(0),
        }
    }

    /// Adds what light subpaths left, and empties their lists.
    fn add_splats(&mut self) {
        let Self { layout, luminance, rgb, splats, .. } = self;
        let width = layout.size.x;
        splats.par_iter_mut().for_each(|of_row| of_row.sort_by_key(|s| s.pixel));
        let rows: Vec<Sums> = rows_of_sums(layout, luminance, rgb).collect();
        rows.into_par_iter().enumerate().for_each(|(y, mut row)| {
            let (begin, end) = (y as u32 * width, (y as u32 + 1) * width);
            for of_row in &*splats {
                let from = of_row.partition_point(|s| s.pixel < begin);
                for s in of_row[from..].iter().take_while(|s| s.pixel < end) {
                    row.add((s.pixel - begin) as usize, s.deposit, &s.value);
                }
            }
        });
        splats.iter_mut().for_each(Vec::clear);
    }

    /// Ends a replicate: adds its luminance to its table, as prefix sums over each
    /// light's knots.
    pub fn commit_luminance(&mut self, table: &mut [f32]) {
        self.add_splats();
        spread(self.layout, 1, &mut self.luminance, table);
        self.luminance.par_chunks_mut(1 << 16).for_each(|s| s.fill(0.0));
    }

    /// Adds the colour of all replicates to its table, as prefix sums over each light's
    /// knots.
    pub fn commit_rgb(mut self, table: &mut [f32]) {
        spread(self.layout, 3, &mut self.rgb, table);
    }
}

/// Adds sums `[pixel][cell][node][channel]` to a table `[cell][node][channel][pixel]`,
/// as prefix sums over each light's knots.
fn spread(layout: &Layout, n_channels: usize, sums: &mut [f32], table: &mut [f32]) {
    let per_cell = layout.nodes.len() * n_channels;
    let per_pixel = layout.n_cells() * per_cell;
    let n_pixels = layout.n_pixels();
    sums.par_chunks_mut(TILE * per_pixel).flat_map_iter(|tile| tile.chunks_exact_mut(per_pixel)).for_each(
        |pixel| {
            for cells in &layout.lights {
                let light = &mut pixel[cells.first_cell * per_cell..][..cells.n_cells() * per_cell];
                for i in per_cell..light.len() {
                    light[i] += light[i - per_cell];
                }
            }
        },
    );
    let sums = &*sums;
    table.par_chunks_mut(per_cell * n_pixels).enumerate().for_each(|(cell, rows)| {
        for first in (0..n_pixels).step_by(TILE) {
            let tile = first..(first + TILE).min(n_pixels);
            for (i, row) in rows.chunks_exact_mut(n_pixels).enumerate() {
                for (v, p) in row[tile.clone()].iter_mut().zip(tile.clone()) {
                    *v += sums[p * per_pixel + cell * per_cell + i];
                }
            }
        }
    });
}

impl<const N: usize> Film<N> for BasisFilm<'_, N> {
    type Row<'a>
        = BasisRow<'a, N>
    where
        Self: 'a;

    fn region(&self) -> Region {
        Region::full(self.layout.size)
    }

    fn rows(&mut self) -> Vec<BasisRow<'_, N>> {
        let Self { layout, luminance, rgb, splats, non_finite } = self;
        rows_of_sums(layout, luminance, rgb)
            .zip(splats)
            .map(|(sums, splats)| BasisRow { layout, sums, splats, non_finite, pixel: 0 })
            .collect()
    }

    fn defects(&self) -> (u64, u64) {
        (self.non_finite.load(Ordering::Relaxed), 0)
    }

    fn outside(&self) -> BasisRow<'_, N> {
        unreachable!("a basis film keeps the whole picture")
    }
}

impl<const N: usize> BasisRow<'_, N> {
    fn deposit(&self, c: &Contribution<N>) -> Option<Deposit> {
        if !c.value.is_radiance() {
            self.non_finite.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        let light = &self.layout.lights[c.light as usize];
        match &light.knots {
            None => (c.at.rho <= light.size).then_some(Deposit { cell: light.first_cell as u32, next: 0.0 }),
            Some(knots) => {
                let (knot, next) = knots.deposit(c.at.rho);
                Some(Deposit { cell: (light.first_cell + knot) as u32, next })
            }
        }
    }
}

impl<const N: usize> Recorder<N> for BasisRow<'_, N> {
    fn add(&mut self, c: &Contribution<N>) {
        let Some(deposit) = self.deposit(c) else { return };
        self.sums.add(self.pixel, deposit, &c.value);
    }

    fn splat(&mut self, raster: Vec2, c: &Contribution<N>) {
        let UVec2 { x, y } = raster.as_uvec2();
        let Some(deposit) = self.deposit(c) else { return };
        let pixel = y * self.layout.size.x + x;
        self.splats.push(Splat { pixel, deposit, value: c.value });
    }
}

impl<const N: usize> RowRecorder<N> for BasisRow<'_, N> {
    fn set_pixel(&mut self, i: usize) {
        self.pixel = i;
    }
}
