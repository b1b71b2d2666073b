//! The film that keeps contributions apart: by light, size bin and value node.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::{Layout, zeros};
use crate::{
    film::{Contribution, Film, Recorder, Region, RowRecorder},
    math::NodeRgb,
};

/// Sums of the contributions of one render of one replicate.
///
/// A pixel's own contributions are added in sample order. Those of light
/// subpaths are kept in the order of the rows that made them and added after the
/// render, row by row. So the sums do not depend on the number of threads.
#[derive(Debug)]
pub struct BasisFilm<'a, const N: usize> {
    layout: &'a Layout,
    /// [pixel][cell][node][rgb]
    sums: Vec<f32>,
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
    sums: &'a mut [f32],
    splats: &'a mut Vec<Splat<N>>,
    non_finite: &'a AtomicU64,
    pixel: usize,
}

impl<'a, const N: usize> BasisFilm<'a, N> {
    /// An empty film.
    ///
    /// # Panics
    /// When the layout has another number of value nodes.
    #[must_use]
    pub fn new(layout: &'a Layout) -> Self {
        assert!(layout.nodes.len() <= N, "the film carries fewer value nodes than the layout has");
        Self {
            layout,
            sums: zeros(layout.n_pixels() * layout.n_cells() * layout.nodes.len() * 3),
            splats: vec![Vec::new(); layout.size.y as usize],
            non_finite: AtomicU64::new(0),
        }
    }

    /// Adds what was rendered to a replicate's table of luminance and to the
    /// table of colour, as prefix sums over each light's knots, and empties the film.
    pub fn commit(&mut self, luminance: &mut [f32], rgb: &mut [f32]) {
        let layout = self.layout;
        let (n_nodes, n_cells) = (layout.nodes.len(), layout.n_cells());
        let width = layout.size.x as usize;
        let per_pixel = n_cells * n_nodes * 3;
        for splats in &mut self.splats {
            splats.sort_by_key(|s| s.pixel);
        }
        let splats = &self.splats;
        self.sums.par_chunks_mut(width * per_pixel).enumerate().for_each(|(y, row)| {
            let (begin, end) = ((y * width) as u32, ((y + 1) * width) as u32);
            for of_row in splats {
                let from = of_row.partition_point(|s| s.pixel < begin);
                for s in of_row[from..].iter().take_while(|s| s.pixel < end) {
                    let pixel = (s.pixel - begin) as usize;
                    add(&mut row[pixel * per_pixel..][..per_pixel], n_nodes, s.deposit, &s.value);
                }
            }
            // Prefix sums over the knots.
            for pixel in row.chunks_exact_mut(per_pixel) {
                for cells in &layout.lights {
                    let cells = cells.first_cell..cells.first_cell + cells.n_cells();
                    let light = &mut pixel[cells.start * n_nodes * 3..cells.end * n_nodes * 3];
                    for i in n_nodes * 3..light.len() {
                        light[i] += light[i - n_nodes * 3];
                    }
                }
            }
        });
        let n_pixels = layout.n_pixels();
        let sums = &self.sums;
        let cells = luminance.par_chunks_mut(n_nodes * n_pixels);
        cells.zip(rgb.par_chunks_mut(n_nodes * 3 * n_pixels)).enumerate().for_each(|(cell, (y, rgb))| {
            for first in (0..n_pixels).step_by(TILE) {
                let tile = first..(first + TILE).min(n_pixels);
                for k in 0..n_nodes {
                    let at = |p: usize| &sums[p * per_pixel + (cell * n_nodes + k) * 3..][..3];
                    let y = &mut y[k * n_pixels..][tile.clone()];
                    for (y, p) in y.iter_mut().zip(tile.clone()) {
                        let c = at(p);
                        *y += 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
                    }
                    for i in 0..3 {
                        let channel = &mut rgb[(k * 3 + i) * n_pixels..][tile.clone()];
                        for (v, p) in channel.iter_mut().zip(tile.clone()) {
                            *v += at(p)[i];
                        }
                    }
                }
            }
        });
        self.sums.par_chunks_mut(1 << 16).for_each(|s| s.fill(0.0));
        self.splats.iter_mut().for_each(Vec::clear);
    }
}

/// Pixels whose sums are spread over the tables' rows at a time: a cell of all of
/// them stays in the first cache level.
const TILE: usize = 128;

fn add<const N: usize>(pixel: &mut [f32], n_nodes: usize, deposit: Deposit, value: &NodeRgb<N>) {
    let stride = 3 * n_nodes;
    let first = deposit.cell as usize * stride;
    let mut into = |first: usize, share: f32| {
        for (cell, c) in pixel[first..first + stride].chunks_exact_mut(3).zip(&value.0) {
            cell[0] += share * c.x;
            cell[1] += share * c.y;
            cell[2] += share * c.z;
        }
    };
    into(first, 1.0 - deposit.next);
    if deposit.next > 0.0 {
        into(first + stride, deposit.next);
    }
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
        let layout = self.layout;
        let width = layout.size.x as usize * layout.n_cells() * layout.nodes.len() * 3;
        let non_finite = &self.non_finite;
        self.sums
            .chunks_mut(width)
            .zip(&mut self.splats)
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
        let n_nodes = self.layout.nodes.len();
        let per_pixel = self.layout.n_cells() * n_nodes * 3;
        add(&mut self.sums[self.pixel * per_pixel..][..per_pixel], n_nodes, deposit, &c.value);
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
