//! The film of a basis, which keeps contributions apart by light, size bin and value node.

use std::sync::{
    Mutex,
    atomic::{AtomicU64, Ordering},
};

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::{
    kernels,
    layout::{COLOURS, Layout},
};
use crate::{
    film::{Contribution, Film, Recorder, RowRecorder},
    math::NodeRgb,
};

/// A film that sums contributions into the tables of a basis: luminance for each replicate, colour for
/// all of them or for each.
///
/// A row of pixels is summed in memory of its own, small enough for the caches, and goes to
/// the tables when its samples are done. A pixel's own contributions are added in sample
/// order; those of light subpaths are kept in the order of the rows that made them and added
/// after the render, row by row. So the sums do not depend on the number of threads.
#[derive(Debug)]
pub struct BasisFilm<'a, const N: usize> {
    layout: &'a Layout,
    /// Tables of luminance, one for each replicate.
    luminance: &'a mut [Vec<f32>],
    /// Tables of colour: none if colour is not kept, one of all replicates, or one for each.
    colour: &'a mut [Vec<f32>],
    /// Whether the tables hold nothing yet and are written without being read.
    is_first: bool,
    /// Weight with which a sample counts.
    weight: u32,
    /// Memory of rows that are done, to be used by others.
    spare: Mutex<Vec<Sums>>,
    /// Contributions of light subpaths, as `[row of pixels that made them][replicate]`.
    splats: Vec<Vec<Splat<N>>>,
    /// Number of contributions dropped because they were not finite.
    non_finite: AtomicU64,
}

/// Upper bound of the memory, bytes, that a render of a basis keeps until its end for the
/// contributions of `n_subpaths` light subpaths, each of at most `max_depth` vertices that see the
/// lens.
#[must_use]
pub fn splat_memory(layout: &Layout, n_subpaths: u64, max_depth: usize) -> u64 {
    let size = match layout.nodes.len() {
        1 => size_of::<Splat<1>>(),
        2..=8 => size_of::<Splat<8>>(),
        9..=16 => size_of::<Splat<16>>(),
        _ => size_of::<Splat<32>>(),
    };
    n_subpaths * max_depth as u64 * size as u64
}

/// A contribution of a light subpath to the pixel of an index.
#[derive(Clone, Copy, Debug)]
struct Splat<const N: usize> {
    pixel: u32,
    deposit: Deposit,
    value: NodeRgb<N>,
}

/// Cells of a contribution: `cell` gets the share 1 − `next` of it, the cell above the share `next`.
#[derive(Clone, Copy, Debug)]
struct Deposit {
    cell: u32,
    next: f32,
}

/// Recorder of one row of pixels of a [`BasisFilm`].
#[derive(Debug)]
pub struct BasisRow<'a, const N: usize> {
    layout: &'a Layout,
    tables: RowTables<'a>,
    is_first: bool,
    weight: u32,
    spare: &'a Mutex<Vec<Sums>>,
    /// Sums of the row, while it is open.
    sums: Sums,
    /// Contributions of light subpaths, by replicate.
    splats: &'a mut [Vec<Splat<N>>],
    replicate: usize,
    pixel: usize,
    non_finite: &'a AtomicU64,
}

/// Sums of the contributions to a row of pixels.
#[derive(Debug, Default)]
struct Sums {
    /// Weight with which a sample counts.
    weight: f32,
    n_cells: usize,
    n_nodes: usize,
    /// Sums of luminance of the present replicate, as `[pixel][cell][node]`.
    luminance: Vec<f32>,
    /// Sums of colour, of all replicates so far or of the present one, as `[pixel][cell][red or blue][node]`.
    colour: Vec<f32>,
}

/// Parts of the tables that belong to a row of pixels.
#[derive(Debug)]
struct RowTables<'a> {
    /// Parts of the tables of luminance, by replicate.
    luminance: Vec<&'a mut [f32]>,
    /// Parts of the tables of colour.
    colour: Vec<&'a mut [f32]>,
}

impl Sums {
    fn new(layout: &Layout, with_colour: bool, weight: u32) -> Self {
        let n = layout.size.x as usize * layout.n_rows();
        let colour = vec![0.0; if with_colour { COLOURS * n } else { 0 }];
        let (n_cells, n_nodes) = (layout.n_cells(), layout.nodes.len());
        Self { weight: weight as f32, n_cells, n_nodes, luminance: vec![0.0; n], colour }
    }

    fn add<const N: usize>(&mut self, pixel: usize, deposit: Deposit, value: &NodeRgb<N>) {
        let Self { weight, n_cells, n_nodes, .. } = *self;
        let first = (pixel * n_cells + deposit.cell as usize) * n_nodes;
        let luminance = value.luminance();
        let add = |sums: &mut [f32], values: &[f32], share: f32| {
            sums.iter_mut().zip(values).for_each(|(sum, v)| *sum += share * v);
        };
        let mut into = |first: usize, share: f32| {
            add(&mut self.luminance[first..][..n_nodes], &luminance, share);
            if !self.colour.is_empty() {
                let sums = self.colour[COLOURS * first..][..COLOURS * n_nodes].chunks_exact_mut(n_nodes);
                sums.zip([&value.0[0], &value.0[2]]).for_each(|(sums, channel)| add(sums, channel, share));
            }
        };
        into(first, weight * (1.0 - deposit.next));
        if deposit.next > 0.0 {
            into(first + n_nodes, weight * deposit.next);
        }
    }
}

/// Parts of the tables for each row of pixels, first row first.
fn row_tables<'a>(
    layout: &Layout,
    luminance: &'a mut [Vec<f32>],
    colour: &'a mut [Vec<f32>],
) -> impl Iterator<Item = RowTables<'a>> {
    let width = layout.size.x as usize * layout.n_rows();
    let mut luminance: Vec<_> = luminance.iter_mut().map(|table| table.chunks_mut(width)).collect();
    let mut colour: Vec<_> = colour.iter_mut().map(|table| table.chunks_mut(COLOURS * width)).collect();
    (0..layout.size.y).map(move |_| RowTables {
        luminance: luminance.iter_mut().filter_map(Iterator::next).collect(),
        colour: colour.iter_mut().filter_map(Iterator::next).collect(),
    })
}

/// The table that the sums of colour go to when a replicate of several is done: its own, or after the last
/// that of all.
fn colour_of<'t>(tables: &'t mut [&mut [f32]], replicate: usize, n: usize) -> Option<&'t mut [f32]> {
    match tables {
        [] => None,
        [of_all] => (replicate + 1 == n).then_some(&mut **of_all),
        of_each => Some(&mut *of_each[replicate]),
    }
}

/// Moves sums `[pixel][cell][node][channel]` of a row of pixels to its part of a table,
/// `[cell][node][channel][pixel]`, as prefix sums over each light's knots: writes them there
/// if `is_first`, else adds them.
fn flush(layout: &Layout, sums: &mut [f32], table: &mut [f32], is_first: bool) {
    let width = layout.size.x as usize;
    let per_pixel = sums.len() / width;
    let per_cell = per_pixel / layout.n_cells();
    for pixel in sums.chunks_exact_mut(per_pixel) {
        for cells in &layout.lights {
            let light = &mut pixel[cells.first_cell * per_cell..][..cells.n_cells() * per_cell];
            for i in 1..cells.n_cells() {
                let (below, above) = light.split_at_mut(i * per_cell);
                let below = &below[(i - 1) * per_cell..];
                above[..per_cell].iter_mut().zip(below).for_each(|(sum, v)| *sum += v);
            }
        }
    }
    kernels::transpose(sums, width, table, is_first);
    sums.fill(0.0);
}

impl<'a, const N: usize> BasisFilm<'a, N> {
    /// A film that fills the tables `luminance`, one for each replicate, and those of `colour`: none, one of
    /// all replicates, or one for each. With `is_first` it overwrites what they hold. A sample counts `weight` times.
    ///
    /// # Panics
    /// When the layout has another number of value nodes.
    #[must_use]
    pub fn new(
        layout: &'a Layout,
        luminance: &'a mut [Vec<f32>],
        colour: &'a mut [Vec<f32>],
        is_first: bool,
        weight: u32,
    ) -> Self {
        assert!(layout.nodes.len() <= N, "the film carries fewer value nodes than the layout has");
        Self {
            splats: vec![Vec::new(); layout.size.y as usize * luminance.len()],
            layout,
            luminance,
            colour,
            is_first,
            weight,
            spare: Mutex::default(),
            non_finite: AtomicU64::new(0),
        }
    }

    /// Adds the contributions of light subpaths to the tables.
    pub fn finish(self) {
        let Self { layout, luminance, colour, weight, mut splats, .. } = self;
        let (width, n_replicates, with_colour) = (layout.size.x, luminance.len(), !colour.is_empty());
        splats.par_iter_mut().for_each(|of_row| of_row.sort_by_key(|s| s.pixel));
        let rows: Vec<RowTables> = row_tables(layout, luminance, colour).collect();
        rows.into_par_iter().enumerate().for_each_init(
            || Sums::new(layout, with_colour, weight),
            |sums, (y, mut tables)| {
                let (begin, end) = (y as u32 * width, (y as u32 + 1) * width);
                for (r, table) in tables.luminance.iter_mut().enumerate() {
                    for of_row in splats[r..].iter().step_by(n_replicates) {
                        let from = of_row.partition_point(|s| s.pixel < begin);
                        for s in of_row[from..].iter().take_while(|s| s.pixel < end) {
                            sums.add((s.pixel - begin) as usize, s.deposit, &s.value);
                        }
                    }
                    flush(layout, &mut sums.luminance, table, false);
                    if let Some(table) = colour_of(&mut tables.colour, r, n_replicates) {
                        flush(layout, &mut sums.colour, table, false);
                    }
                }
            },
        );
    }
}

impl<const N: usize> Film<N> for BasisFilm<'_, N> {
    type Row<'a>
        = BasisRow<'a, N>
    where
        Self: 'a;

    fn size(&self) -> UVec2 {
        self.layout.size
    }

    fn rows(&mut self) -> Vec<BasisRow<'_, N>> {
        let Self { layout, is_first, weight, spare, non_finite, .. } = self;
        let n_replicates = self.luminance.len();
        row_tables(layout, self.luminance, self.colour)
            .zip(self.splats.chunks_mut(n_replicates))
            .map(|(tables, splats)| BasisRow {
                layout,
                tables,
                is_first: *is_first,
                weight: *weight,
                spare,
                sums: Sums::default(),
                splats,
                replicate: 0,
                pixel: 0,
                non_finite,
            })
            .collect()
    }

    fn defects(&self) -> (u64, u64) {
        (self.non_finite.load(Ordering::Relaxed), 0)
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
        self.splats[self.replicate].push(Splat { pixel, deposit, value: c.value });
    }
}

impl<const N: usize> RowRecorder<N> for BasisRow<'_, N> {
    fn open(&mut self) {
        let spare = self.spare.lock().ok().and_then(|mut spare| spare.pop());
        self.sums =
            spare.unwrap_or_else(|| Sums::new(self.layout, !self.tables.colour.is_empty(), self.weight));
    }

    fn set_pixel(&mut self, i: usize) {
        self.pixel = i;
    }

    fn end_replicate(&mut self) {
        let n_replicates = self.tables.luminance.len();
        let table = &mut *self.tables.luminance[self.replicate];
        flush(self.layout, &mut self.sums.luminance, table, self.is_first);
        if let Some(table) = colour_of(&mut self.tables.colour, self.replicate, n_replicates) {
            flush(self.layout, &mut self.sums.colour, table, self.is_first);
        }
        self.replicate += 1;
    }

    fn close(&mut self) {
        if let Ok(mut spare) = self.spare.lock() {
            spare.push(std::mem::take(&mut self.sums));
        }
    }
}
