//! The transport basis: one render from which every lighting follows.
//!
//! Light transport is linear in a light's radiance L_l, an indicator in its size
//! s_l and a polynomial in the background's value v, so that every pixel is
//!
//! ```text
//! I(x) = Σ_l L_l Σ_k ℓ_k(v) C_{l,k}(s_l)
//! ```
//!
//! with ℓ_k of the [value nodes](nodes) and C of the [size knots](knots). Any
//! integrator fills the table through [`BasisFilm`]; images and their exact
//! derivatives are then sums over a few of its rows ([`Recombination`]).
//!
//! Replicates come from independent scrambles. Each has a table of luminance, for
//! the objective; colour is kept as their mean, or of each where the [view](crate::math::view) needs it. Tables
//! hold prefix sums over the
//! knots, layout `[y][cell][node][x]` (colour: `[y][cell][red or blue][node][x]`; green follows from
//! the luminance). The cells of a light are its knots; a light whose size is not free has a single
//! cell.

mod brought;
pub mod compact;
mod film;
mod kernels;
pub mod knots;
mod layout;
mod linearised;
pub mod nodes;
mod recombine;
pub mod store;

use rayon::prelude::*;

use crate::{
    integrator::{Integrator, Observer, RenderError, Samples, Values, View},
    lighting::SamplingPlan,
    sampler::SamplerKind,
};

pub use brought::Brought;
pub use film::{BasisFilm, splat_memory};
pub use knots::Knots;
use layout::COLOURS;
pub use layout::{Layout, LightCells, SizeBins};
pub use linearised::Linearised;
pub use nodes::ValueNodes;
pub use recombine::{LightingGradient, Recombination, Tables, Tangents};

/// A rendered transport basis: for every pixel the light of each light source, by size knot and by
/// node of the background's value, at unit radiance.
///
/// ```
/// use lightopt_embree::{
///     import,
///     integrator::{Integrator, View},
///     light::SizeDensity,
///     lighting::{Lighting, SamplingPlan},
///     sampler::SamplerKind,
///     transport::{Knots, Layout, SizeBins, Source, TransportBasis, ValueNodes},
/// };
///
/// let scene = import::load("tests/mitsuba/scenes/cornell.obj".as_ref())?.scene;
/// let camera = scene.camera.resized((16, 12).into());
/// let lighting = Lighting::authored(&scene);
///
/// // The lamp at any size between a tenth and the whole of its own; samples go to all of them.
/// let range = [0.1, 1.0];
/// let bins = SizeBins::Free(Knots::geometric(0.1, 1.0, 8));
/// let layout = Layout::new(camera.size(), vec![bins], ValueNodes::new(1.0, 1));
/// let plan = SamplingPlan {
///     sizes: vec![SizeDensity::any_size(range)],
///     ..SamplingPlan::uniform(&lighting)
/// };
///
/// // Rendered once, in two replicates; then any lighting follows, without another ray.
/// let mut basis = TransportBasis::new(layout, 2);
/// let source = Source {
///     view: View { scene: &scene, camera: &camera },
///     plan: &plan,
///     integrator: &Integrator::default(),
///     sampler: SamplerKind::Sobol,
///     seed: 0,
/// };
/// basis.render(source, 4, &())?;
/// let bright = |x: &Lighting| basis.picture(x).rgb.iter().map(|c| c[1]).sum::<f32>();
/// let small = Lighting { size: vec![0.5], ..lighting.clone() };
/// assert!(0.0 < bright(&small) && bright(&small) < bright(&lighting));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct TransportBasis {
    layout: Layout,
    /// Sums of luminance over the samples, a table for each replicate.
    luminance: Vec<Vec<f32>>,
    /// Tables of red and blue: one of the sums over the samples of all replicates, or one for each replicate
    /// where pictures have [planes](Layout::planes) of colour; none without colour.
    colour: Vec<Vec<f32>>,
    /// Samples per pixel of each replicate in the tables, counted with their weights.
    n_samples: u32,
    /// Weight with which the next samples count; it doubles with every [`Self::fade`].
    weight: u32,
    /// Samples taken of the present sequence.
    taken: u32,
}

/// Everything that a basis is rendered from.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Scene and camera.
    pub view: View<'a>,
    /// Sampling plan.
    pub plan: &'a SamplingPlan,
    /// Integrator with its options.
    pub integrator: &'a Integrator,
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Seed of the scrambles of all replicates.
    pub seed: u64,
}

impl TransportBasis {
    /// A basis without samples.
    #[must_use]
    pub fn new(layout: Layout, replicates: usize) -> Self {
        let n = layout.n_rows() * layout.n_pixels();
        let (luminance, colour) = rayon::join(
            || (0..replicates).into_par_iter().map(|_| vec![0.0; n]).collect(),
            || (0..layout.n_colour_tables(replicates)).map(|_| vec![0.0; COLOURS * n]).collect(),
        );
        Self { luminance, colour, n_samples: 0, weight: 1, taken: 0, layout }
    }

    /// A basis without samples for searches, without the colour of all replicates.
    #[must_use]
    pub fn for_search(layout: Layout, replicates: usize) -> Self {
        let n = layout.n_rows() * layout.n_pixels();
        let tables =
            |channels: usize| (0..replicates).into_par_iter().map(|_| vec![0.0; channels * n]).collect();
        let colour = if layout.planes == 1 { Vec::new() } else { tables(COLOURS) };
        Self { luminance: tables(1), colour, n_samples: 0, weight: 1, taken: 0, layout }
    }

    /// The basis of some of its lights, in the order in which they are given, without the colour of all replicates.
    #[must_use]
    pub fn of_lights(&self, lights: &[usize]) -> Self {
        let layout = self.layout.of_lights(lights);
        let length = self.layout.nodes.len() * self.width();
        let cells: Vec<usize> = lights.iter().flat_map(|&l| self.layout.lights[l].cells()).collect();
        let select = |table: &Vec<f32>, channels: usize| {
            let (length, n) = (channels * length, channels * layout.n_rows() * layout.n_pixels());
            let mut out = Vec::with_capacity(n);
            for y in 0..layout.size.y as usize {
                let line = self.line(table, channels, y);
                cells.iter().for_each(|cell| out.extend_from_slice(&line[cell * length..][..length]));
            }
            out
        };
        let luminance = self.luminance.iter().map(|table| select(table, 1)).collect();
        let of_each = if layout.planes == 1 { &[][..] } else { &self.colour };
        let colour = of_each.iter().map(|table| select(table, COLOURS)).collect();
        Self { luminance, colour, layout, ..*self }
    }

    /// The basis with the lights of another one of the same pictures after its own; `None` where size, nodes or
    /// replicates differ.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Option<Self> {
        let layout = self.layout.joined(&other.layout)?;
        if self.n_replicates() != other.n_replicates() || self.colour.len() != other.colour.len() {
            return None;
        }
        // Tables are sums over the samples.
        let factor = f64::from(self.n_samples) / f64::from(other.n_samples);
        let join = |(table, added): (&Vec<f32>, &Vec<f32>), channels: usize| {
            let mut out = Vec::with_capacity(table.len() + added.len());
            for y in 0..layout.size.y as usize {
                out.extend_from_slice(self.line(table, channels, y));
                let scaled = |v: &f32| (f64::from(*v) * factor) as f32;
                out.extend(other.line(added, channels, y).iter().map(scaled));
            }
            out
        };
        let luminance = self.luminance.iter().zip(&other.luminance).map(|tables| join(tables, 1)).collect();
        let colour = self.colour.iter().zip(&other.colour).map(|tables| join(tables, COLOURS)).collect();
        Some(Self { luminance, colour, layout, ..*self })
    }

    /// Film size, cells and nodes of the tables.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Number of replicates.
    #[must_use]
    pub fn n_replicates(&self) -> usize {
        self.luminance.len()
    }

    /// Whether another basis has tables of the same meaning.
    #[must_use]
    pub fn is_alike(&self, other: &Self) -> bool {
        self.layout == other.layout && self.n_replicates() == other.n_replicates()
    }

    /// Samples per pixel of each replicate, counted with their weights.
    #[must_use]
    pub fn n_samples(&self) -> u32 {
        self.n_samples
    }

    /// Samples per pixel of all replicates, in units of the weight of the next sample.
    #[must_use]
    pub fn effective_samples(&self) -> u32 {
        self.n_samples * self.n_replicates() as u32 / self.weight
    }

    /// Halves the weight of the samples so far relative to that of the next ones, which must come from
    /// another seed. Both are unbiased, and so is their weighted mean.
    pub fn fade(&mut self) {
        self.weight *= 2;
        self.taken = 0;
    }

    /// Adds `count` samples per pixel to every replicate, each continuing its own sequence.
    ///
    /// # Errors
    /// As [`Integrator::render`]; the basis is then of no use.
    pub fn render(
        &mut self,
        source: Source,
        count: u32,
        observer: &impl Observer,
    ) -> Result<(), RenderError> {
        match self.layout.nodes.len() {
            1 => self.render_nodes::<1>(source, count, observer),
            2..=8 => self.render_nodes::<8>(source, count, observer),
            9..=16 => self.render_nodes::<16>(source, count, observer),
            _ => self.render_nodes::<32>(source, count, observer),
        }
    }

    fn render_nodes<const N: usize>(
        &mut self,
        source: Source,
        count: u32,
        observer: &impl Observer,
    ) -> Result<(), RenderError> {
        let Self { layout, luminance, colour, n_samples, weight, taken } = self;
        let node = |k: usize| layout.nodes.values().get(k).map_or(0.0, |&v| v as f32);
        let nodes = Values::<N>(std::array::from_fn(node));
        let samples = Samples { sampler: source.sampler, seed: source.seed, first: *taken, count };
        let replicates: Vec<Samples> = (0..luminance.len() as u64).map(|r| samples.replicate(r)).collect();
        let mut film = BasisFilm::<N>::new(layout, luminance, colour, *n_samples == 0, *weight);
        let Source { view, plan, integrator, .. } = source;
        integrator.render_values(view, &nodes, plan, &mut film, &replicates, observer)?;
        film.finish();
        *taken += count;
        *n_samples += *weight * count;
        Ok(())
    }

    /// The same samples in two replicates, without the colour of all of them: the sums of every other
    /// replicate. A basis with an odd number of replicates keeps them all.
    #[must_use]
    pub fn halves(&self) -> Self {
        let n = self.n_replicates();
        // The table of all replicates is of no use without pictures.
        let colour = if self.layout.planes == 1 { &[][..] } else { &self.colour };
        if !n.is_multiple_of(2) {
            let (layout, luminance) = (self.layout.clone(), self.luminance.clone());
            return Self { layout, luminance, colour: colour.to_vec(), ..*self };
        }
        let half = |of: &[Vec<f32>], first: usize| {
            let tables: Vec<&Vec<f32>> = of[first..].iter().step_by(2).collect();
            let mut sum = vec![0.0; tables[0].len()];
            sum.par_chunks_mut(1 << 16).enumerate().for_each(|(i, part)| {
                part.copy_from_slice(&tables[0][i << 16..][..part.len()]);
                for table in &tables[1..] {
                    part.iter_mut().zip(&table[i << 16..]).for_each(|(s, v)| *s += v);
                }
            });
            sum
        };
        Self {
            luminance: vec![half(&self.luminance, 0), half(&self.luminance, 1)],
            colour: if colour.is_empty() { Vec::new() } else { vec![half(colour, 0), half(colour, 1)] },
            n_samples: self.n_samples * (n / 2) as u32,
            layout: self.layout.clone(),
            ..*self
        }
    }

    /// The basis of the picture reduced by averaging blocks of `factor` × `factor` pixels, without
    /// the colour of all replicates. Pixels that fill no block are left out.
    #[must_use]
    pub fn reduced(&self, factor: u32) -> Self {
        let size = self.layout.size / factor;
        let layout = Layout { size, ..self.layout.clone() };
        let (f, n_rows) = (factor as usize, layout.n_rows());
        let [wide, narrow] = [self.layout.size.x, size.x].map(|x| x as usize);
        let reduce = |table: &Vec<f32>, n_rows: usize| -> Vec<f32> {
            let mut out = vec![0.0; n_rows * layout.n_pixels()];
            if out.is_empty() {
                return out;
            }
            let lines = out.chunks_exact_mut(n_rows * narrow).zip(table.chunks(f * n_rows * wide));
            for (to, from) in lines {
                for from in from.chunks_exact(n_rows * wide) {
                    for (to, from) in to.chunks_exact_mut(narrow).zip(from.chunks_exact(wide)) {
                        for (to, block) in to.iter_mut().zip(from.chunks_exact(f)) {
                            *to += block.iter().sum::<f32>() / (f * f) as f32;
                        }
                    }
                }
            }
            out
        };
        let luminance = self.luminance.par_iter().map(|table| reduce(table, n_rows)).collect();
        let of_each = if layout.planes == 1 { &[][..] } else { &self.colour };
        let colour = of_each.par_iter().map(|table| reduce(table, COLOURS * n_rows)).collect();
        Self { luminance, colour, layout, ..*self }
    }

    /// The part of a table with `channels` numbers per pixel, cell and node that belongs to the row `y` of
    /// pixels.
    fn line<'t>(&self, table: &'t [f32], channels: usize, y: usize) -> &'t [f32] {
        let n = self.layout.n_rows() * channels * self.layout.size.x as usize;
        &table[y * n..][..n]
    }
}
