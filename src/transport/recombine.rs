//! Images of a lighting as sums over rows of the tables, and their exact derivatives.

use std::ops::Range;

use rayon::prelude::*;

use super::{
    TransportBasis, kernels,
    layout::{COLOURS, Layout},
};
use crate::{
    denoise::denoise_picture, film::Picture, integrator::aov::Features, light::LightColor,
    lighting::Lighting, math::display::LUMINANCE_WEIGHTS,
};

/// Weight of one row of the tables in an image, with its derivatives.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Row of the tables: cell times number of nodes plus node.
    row: usize,
    /// Light to which the row belongs.
    light: usize,
    /// Weight of the row.
    weight: f64,
    /// Derivative of the weight by the light's radiance.
    by_radiance: f64,
    /// Derivative of the weight by the light's size.
    by_size: f64,
    /// Derivative of the weight by the background's value.
    by_value: f64,
}

/// The image of a lighting as a weighted sum over rows of the tables.
#[derive(Clone, Debug)]
pub struct Recombination {
    /// Weights of the rows that are read, in the order of lights and rows.
    entries: Vec<Entry>,
    /// Radiance of each light.
    radiance: Vec<f64>,
    /// Factors on the channels of each light that is not seen in the colour with which it was recorded.
    factors: Vec<Option<[f64; 3]>>,
}

/// Derivatives of an image, one plane after the other, by everything that a lighting may vary.
#[derive(Clone, Debug, Default)]
pub struct Tangents {
    /// Derivatives by the radiance and by the size of each light. Of a light with factors on its channels, that by
    /// the radiance is of all planes, without the factors.
    lights: Vec<[Vec<f64>; 2]>,
    /// Derivatives by the background's value.
    value: Vec<f64>,
    /// Radiance of each light, and factors on its channels.
    colors: Vec<(f64, Option<[f64; 3]>)>,
}

/// Weights of the planes of a light as it was recorded, luminance, red and blue, in each plane of the same light
/// with these factors on its channels. Green follows from the luminance.
fn plane_weights([red, green, blue]: [f64; 3]) -> [[f64; 3]; 3] {
    let [of_red, _, of_blue] = LUMINANCE_WEIGHTS;
    [[green, of_red * (red - green), of_blue * (blue - green)], [0.0, red, 0.0], [0.0, 0.0, blue]]
}

/// Derivatives of [`plane_weights`] by the factors, which are linear in them.
fn plane_weight_slopes() -> [[[f64; 3]; 3]; 3] {
    [0, 1, 2].map(|c| plane_weights([0, 1, 2].map(|d| f64::from(u8::from(c == d)))))
}

/// Gradient of a number by everything that a lighting may vary; vectors are by light, in the scene's
/// order.
#[derive(Clone, Debug, PartialEq)]
pub struct LightingGradient {
    /// Derivative by each light's radiance.
    pub radiance: Vec<f64>,
    /// Derivative by each light's size; 0 for a size that is not free.
    pub size: Vec<f64>,
    /// Derivative by the background's value; 0 if that is not free.
    pub value: f64,
    /// Derivative by the exposure, of which a basis knows nothing: 0 where it was not added.
    pub exposure: f64,
    /// Derivative by the factor on each channel of each light; 0 where the light is seen as it was recorded.
    pub color: Vec<[f64; 3]>,
}

impl LightingGradient {
    /// Gradient of a number that depends on nothing, for `n` lights.
    #[must_use]
    pub fn zero(n: usize) -> Self {
        Self {
            radiance: vec![0.0; n],
            size: vec![0.0; n],
            value: 0.0,
            exposure: 0.0,
            color: vec![[0.0; 3]; n],
        }
    }
}

impl Tangents {
    /// Adds the gradient of Σ_p `adjoints[i][p]` · image(p), over the pixels of all planes, to `gradients[i]`, for
    /// every i.
    pub fn pull_back(&self, adjoints: &[&[f64]], gradients: &mut [LightingGradient]) {
        let mut sums = vec![0.0; adjoints.len()];
        let mut add = |tangent: &[f64], to: fn(&mut LightingGradient, usize) -> &mut f64, light: usize| {
            sums.fill(0.0);
            kernels::add_dots(tangent, adjoints, &mut sums);
            gradients.iter_mut().zip(&sums).for_each(|(gradient, sum)| *to(gradient, light) += sum);
        };
        for (l, [by_radiance, by_size]) in self.lights.iter().enumerate() {
            if self.colors[l].1.is_none() {
                add(by_radiance, |gradient, l| &mut gradient.radiance[l], l);
            }
            add(by_size, |gradient, l| &mut gradient.size[l], l);
        }
        add(&self.value, |gradient, _| &mut gradient.value, 0);
        for l in 0..self.lights.len() {
            self.pull_back_color(l, adjoints, gradients);
        }
    }

    /// The part of [`Self::pull_back`] by radiance and colour of a light with factors on its channels.
    fn pull_back_color(&self, l: usize, adjoints: &[&[f64]], gradients: &mut [LightingGradient]) {
        let (radiance, Some(factors)) = self.colors[l] else { return };
        let raw = &self.lights[l][0];
        let n = raw.len() / 3;
        let (weights, slopes) = (plane_weights(factors), plane_weight_slopes());
        let mut sums = vec![0.0; adjoints.len()];
        for (to, from) in [(0, 0), (0, 1), (0, 2), (1, 1), (2, 2)] {
            if (to + 1) * n > self.value.len() {
                continue;
            }
            let of_plane: Vec<&[f64]> = adjoints.iter().map(|adjoint| &adjoint[to * n..][..n]).collect();
            sums.fill(0.0);
            kernels::add_dots(&raw[from * n..][..n], &of_plane, &mut sums);
            for (gradient, sum) in gradients.iter_mut().zip(&sums) {
                gradient.radiance[l] += weights[to][from] * sum;
                for (by_factor, slopes) in gradient.color[l].iter_mut().zip(&slopes) {
                    *by_factor += radiance * slopes[to][from] * sum;
                }
            }
        }
    }
}

impl Recombination {
    /// Rows and weights of the lighting `x`.
    ///
    /// # Panics
    /// When the lighting has another number of lights than the layout.
    #[must_use]
    pub fn new(layout: &Layout, x: &Lighting) -> Self {
        assert_eq!(x.radiance.len(), layout.lights.len(), "one radiance a light");
        assert_eq!(x.size.len(), layout.lights.len(), "one size a light");
        let n_nodes = layout.nodes.len();
        let (value, value_slope) = layout.nodes.weights(x.value);
        let mut entries = Vec::new();
        for (light, cells) in layout.lights.iter().enumerate() {
            let radiance = x.radiance[light];
            let mut push = |cell: usize, share: f64, slope: f64| {
                for k in 0..n_nodes {
                    entries.push(Entry {
                        row: (cells.first_cell + cell) * n_nodes + k,
                        light,
                        weight: radiance * share * value[k],
                        by_radiance: share * value[k],
                        by_size: radiance * slope * value[k],
                        by_value: radiance * share * value_slope[k],
                    });
                }
            };
            match &cells.knots {
                None => push(0, 1.0, 0.0),
                Some(knots) => {
                    let w = knots.weights(x.size[light]);
                    for i in 0..3 {
                        if w.first + i < knots.len() {
                            push(w.first + i, w.value[i], w.slope[i]);
                        }
                    }
                }
            }
        }
        let factor =
            |l: usize| Some(x.color_of(l)).filter(|c| *c != LightColor::Recorded).map(LightColor::factor);
        let factors = (0..x.n_lights()).map(factor).collect();
        Self { entries, radiance: x.radiance.clone(), factors }
    }

    /// Planes and rows of tables of so many planes that make a plane of the image, with `scale` times their weights.
    ///
    /// # Panics
    /// When a light has factors on its channels, and the tables have no colour.
    fn weighted(&self, plane: usize, scale: f64, planes: usize) -> Weighted {
        let mut weighted = Weighted::default();
        for e in self.entries.iter().filter(|e| e.weight != 0.0) {
            let mut push = |from: usize, weight: f64| {
                weighted.0.push((from, e.row));
                weighted.1.push(weight * scale);
            };
            let Some(factors) = self.factors[e.light] else {
                push(plane, e.weight);
                continue;
            };
            assert_eq!(planes, 1 + COLOURS, "colours of lights need colour in every replicate");
            let weights = plane_weights(factors)[plane];
            (0..planes)
                .filter(|&from| weights[from] != 0.0)
                .for_each(|from| push(from, e.weight * weights[from]));
        }
        weighted
    }

    /// Cells of `layout` that are read.
    pub(super) fn cells(&self, layout: &Layout) -> impl Iterator<Item = usize> {
        let n_nodes = layout.nodes.len();
        self.entries.iter().step_by(n_nodes).map(move |e| e.row / n_nodes)
    }
}

/// Tables from which images are recombined: luminance, and red and blue where the layout has these planes.
pub trait Tables: Sync {
    /// Film size, cells and nodes of the tables.
    fn layout(&self) -> &Layout;

    /// Number of replicates.
    fn n_replicates(&self) -> usize;

    /// Samples per pixel of each replicate, counted with their weights.
    fn n_samples(&self) -> u32;

    /// Sums of a plane of a replicate along the row `y` of pixels, in the cell and at the node of `row`.
    fn row(&self, replicate: usize, plane: usize, row: usize, y: usize) -> &[f32];

    /// Writes the linear luminance of a replicate, pixel by pixel, to `out`, and as many of its other planes as
    /// there is room for.
    fn luminance(&self, replicate: usize, r: &Recombination, out: &mut [f64]) {
        self.luminances(replicate, &[r], &mut [out]);
    }

    /// [Writes](Self::luminance) planes of a replicate under several lightings to `out`. Similar lightings
    /// read the same rows, which are then fetched from memory once.
    fn luminances(&self, replicate: usize, lightings: &[&Recombination], out: &mut [&mut [f64]]) {
        let scale = 1.0 / f64::from(self.n_samples().max(1));
        let (width, height) = (self.layout().size.x as usize, self.layout().size.y as usize);
        let mut lines = Vec::new();
        let room = out.first().map_or(0, |out| out.len());
        for plane in 0..room / self.layout().n_pixels().max(1) {
            let weighted: Vec<Weighted> =
                lightings.iter().map(|r| r.weighted(plane, scale, self.layout().planes)).collect();
            for y in 0..height {
                for ((rows, weights), out) in weighted.iter().zip(&mut *out) {
                    lines.clear();
                    lines.extend(rows.iter().map(|&(from, row)| self.row(replicate, from, row, y)));
                    kernels::combine(&lines, weights, &mut out[(plane * height + y) * width..][..width]);
                }
            }
        }
    }

    /// [Writes](Self::luminance) planes of a replicate to `out` and their derivatives to `tangents`.
    fn differentiate(&self, replicate: usize, r: &Recombination, out: &mut [f64], tangents: &mut Tangents) {
        let scale = 1.0 / f64::from(self.n_samples().max(1));
        let (width, height) = (self.layout().size.x as usize, self.layout().size.y as usize);
        tangents.lights.resize_with(r.radiance.len(), Default::default);
        tangents.value.clear();
        tangents.value.resize(out.len(), 0.0);
        tangents.colors = r.radiance.iter().copied().zip(r.factors.iter().copied()).collect();
        out.fill(0.0);
        let (mut first, mut lines) = (0, Vec::new());
        for (l, images) in tangents.lights.iter_mut().enumerate() {
            let n = r.entries[first..].iter().take_while(|e| e.light == l).count();
            let entries = &r.entries[first..first + n];
            first += n;
            if let Some(factors) = r.factors[l] {
                let (value, images) = (&mut tangents.value, (&mut *out, images));
                differentiate_colored(self, replicate, entries, (r.radiance[l], factors), value, images);
                continue;
            }
            images.iter_mut().for_each(|image| image.resize(out.len(), 0.0));
            let weights: Vec<[f64; 3]> =
                entries.iter().map(|e| [e.by_radiance, e.by_size, e.by_value].map(|w| scale * w)).collect();
            let [by_radiance, by_size] = &mut *images;
            let [by_radiance, by_size, by_value] =
                [by_radiance, by_size, &mut tangents.value].map(|image| image.chunks_mut(width));
            let rows = plane_rows(out.len() / self.layout().n_pixels().max(1), height);
            for ((plane, y), ((a, b), c)) in rows.zip(by_radiance.zip(by_size).zip(by_value)) {
                lines.clear();
                lines.extend(entries.iter().map(|e| self.row(replicate, plane, e.row, y)));
                kernels::combine_thrice(&lines, &weights, [a, b, c]);
            }
            // Light is linear in each radiance.
            for (y, d) in out.iter_mut().zip(&images[0]) {
                *y += r.radiance[l] * d;
            }
        }
    }
}

/// Planes and rows of the tables with their weights.
type Weighted = (Vec<(usize, usize)>, Vec<f64>);

/// The part of [`Tables::differentiate`] of a light of a radiance and with factors on its channels, whose rows are
/// the `entries`: the image and its derivatives by the background's value are added to, those by radiance and
/// size, `tangents`, are written.
fn differentiate_colored<T: Tables + ?Sized>(
    tables: &T,
    replicate: usize,
    entries: &[Entry],
    (radiance, factors): (f64, [f64; 3]),
    value: &mut [f64],
    (out, tangents): (&mut [f64], &mut [Vec<f64>; 2]),
) {
    let layout = tables.layout();
    assert_eq!(layout.planes, 1 + COLOURS, "colours of lights need colour in every replicate");
    let scale = 1.0 / f64::from(tables.n_samples().max(1));
    let (width, n) = (layout.size.x as usize, layout.n_pixels());
    let [by_radiance, by_size] = tangents;
    by_radiance.resize(layout.planes * n, 0.0);
    by_size.clear();
    by_size.resize(out.len(), 0.0);
    let weights: Vec<[f64; 3]> =
        entries.iter().map(|e| [e.by_radiance, e.by_size, e.by_value].map(|w| scale * w)).collect();
    let planes = plane_weights(factors);
    let [mut size_line, mut value_line] = [(); 2].map(|()| vec![0.0; width]);
    let mut lines = Vec::new();
    for (plane, y) in plane_rows(layout.planes, layout.size.y as usize) {
        lines.clear();
        lines.extend(entries.iter().map(|e| tables.row(replicate, plane, e.row, y)));
        value_line.fill(0.0);
        let line = &mut by_radiance[plane * n + y * width..][..width];
        kernels::combine_thrice(&lines, &weights, [&mut *line, &mut size_line, &mut value_line]);
        for (to, weights) in planes.iter().enumerate().take(out.len() / n) {
            let weight = weights[plane];
            if weight == 0.0 {
                continue;
            }
            let at = to * n + y * width;
            for (to, from) in [
                (&mut *out, (radiance * weight, &*line)),
                (&mut *by_size, (weight, &size_line)),
                (&mut *value, (weight, &value_line)),
            ] {
                let (weight, from) = from;
                to[at..][..width].iter_mut().zip(from).for_each(|(to, from)| *to += weight * from);
            }
        }
    }
}

impl Tables for TransportBasis {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn n_replicates(&self) -> usize {
        self.luminance.len()
    }

    fn n_samples(&self) -> u32 {
        self.n_samples
    }

    fn row(&self, replicate: usize, plane: usize, row: usize, y: usize) -> &[f32] {
        let (line, row) = match plane.checked_sub(1) {
            None => (self.line(&self.luminance[replicate], 1, y), row),
            Some(colour) => {
                (self.line(&self.colour[replicate], COLOURS, y), colour_row(&self.layout, row, colour))
            }
        };
        &line[row * self.width()..][..self.width()]
    }
}

/// Planes and rows of pixels of an image, in the order of its values.
fn plane_rows(planes: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..planes).flat_map(move |plane| (0..height).map(move |y| (plane, y)))
}

/// Row of a table of colour that belongs to a row of those of luminance; `colour` is 0 for red, 1 for blue.
fn colour_row(layout: &Layout, row: usize, colour: usize) -> usize {
    let n_nodes = layout.nodes.len();
    (row / n_nodes * COLOURS + colour) * n_nodes + row % n_nodes
}

impl TransportBasis {
    pub(super) fn width(&self) -> usize {
        self.layout.size.x as usize
    }

    /// Share of each light in the mean luminance of the picture of a lighting; all 0 for a black picture.
    #[must_use]
    pub fn shares(&self, x: &Lighting) -> Vec<f64> {
        let r = Recombination::new(&self.layout, x);
        let mut sums = vec![0.0_f64; x.radiance.len()];
        for e in &r.entries {
            let of = |replicate, plane| -> f64 {
                let rows = 0..self.layout.size.y as usize;
                rows.map(|y| kernels::sum(self.row(replicate, plane, e.row, y))).sum()
            };
            let of_all = |plane| (0..self.n_replicates()).map(|replicate| of(replicate, plane)).sum::<f64>();
            let planes = self.layout.planes;
            sums[e.light] += match r.factors[e.light].filter(|_| planes > 1) {
                None => e.weight * of_all(0),
                Some(factors) => {
                    let weights = plane_weights(factors)[0];
                    (0..planes).map(|plane| e.weight * weights[plane] * of_all(plane)).sum::<f64>()
                }
            };
        }
        sums.iter_mut().for_each(|s| *s = s.max(0.0));
        let total: f64 = sums.iter().sum();
        sums.into_iter().map(|s| if total > 0.0 { s / total } else { 0.0 }).collect()
    }

    /// The picture of a lighting, the mean over the replicates, with the part that is due to each light.
    #[must_use]
    pub fn picture(&self, x: &Lighting) -> Picture {
        let all = 0..self.n_replicates();
        let [picture] = self.pictures(x, [all]);
        picture
    }

    /// Two pictures of a lighting from the replicates of either half; `None` from fewer than two replicates.
    /// The luminance of each light is that of the half, its hue that of all samples.
    #[must_use]
    pub fn half_pictures(&self, x: &Lighting) -> Option<[Picture; 2]> {
        let n = self.n_replicates();
        (n >= 2).then(|| self.pictures(x, [0..n / 2, n / 2..n]))
    }

    /// The picture of a lighting without its noise; `None` from fewer than two replicates.
    #[must_use]
    pub fn denoised(&self, x: &Lighting, features: &Features) -> Option<Picture> {
        Some(denoise_picture(features, &self.half_pictures(x)?))
    }

    /// The picture of a lighting for people to look at: without its noise where there are features to tell it by.
    #[must_use]
    pub fn shown(&self, x: &Lighting, features: Option<&Features>) -> Picture {
        features.and_then(|features| self.denoised(x, features)).unwrap_or_else(|| self.picture(x))
    }

    /// Pictures of a lighting, each the mean over one of the `parts` of the replicates.
    fn pictures<const N: usize>(&self, x: &Lighting, parts: [Range<usize>; N]) -> [Picture; N] {
        let layout = self.layout();
        let n = layout.n_pixels();
        let r = Recombination::new(layout, x);
        let scale = 1.0 / (f64::from(self.n_samples().max(1)) * self.n_replicates() as f64);
        let of_light = |light: usize| {
            let entries: Vec<&Entry> =
                r.entries.iter().filter(|e| e.light == light && e.weight != 0.0).collect();
            let weights: Vec<f64> = entries.iter().map(|e| e.weight * scale).collect();
            let rows: Vec<usize> = entries.iter().map(|e| e.row).collect();
            let factors = r.factors[light].unwrap_or([1.0; 3]);
            let width = self.width();
            let mut pictures = [(); N].map(|()| vec![[0.0_f32; 3]; n]);
            let [mut red, mut blue, mut one] = std::array::from_fn(|_| vec![0.0; width]);
            let mut sums = [(); N].map(|()| vec![0.0; width]);
            for y in 0..layout.size.y as usize {
                for (channel, out) in [&mut red, &mut blue].into_iter().enumerate() {
                    let lines = self.colour.iter().flat_map(|table| {
                        let colours = self.line(table, COLOURS, y);
                        rows.iter().map(move |&r| &colours[colour_row(layout, r, channel) * width..][..width])
                    });
                    kernels::combine(&lines.collect::<Vec<_>>(), &weights.repeat(self.colour.len()), out);
                }
                for (sum, part) in sums.iter_mut().zip(&parts) {
                    sum.fill(0.0);
                    for replicate in part.clone() {
                        let lines: Vec<&[f32]> =
                            rows.iter().map(|&row| self.row(replicate, 0, row, y)).collect();
                        kernels::combine(&lines, &weights, &mut one);
                        sum.iter_mut().zip(&one).for_each(|(sum, v)| *sum += v);
                    }
                }
                let [to_red, to_green, to_blue] = LUMINANCE_WEIGHTS;
                for x in 0..width {
                    let total: f64 = sums.iter().map(|sum| sum[x]).sum();
                    let green = (total - to_red * red[x] - to_blue * blue[x]) / to_green;
                    // Weights of both signs: rounding may leave less than nothing.
                    let rgb = [red[x], green, blue[x]].map(|v| v.max(0.0));
                    for ((picture, sum), part) in pictures.iter_mut().zip(&sums).zip(&parts) {
                        let of_all = self.n_replicates() as f64 / part.len() as f64;
                        let factor =
                            if N == 1 || total <= 0.0 { 1.0 } else { sum[x].max(0.0) / total * of_all };
                        picture[y * width + x] =
                            std::array::from_fn(|c| (rgb[c] * factor * factors[c]) as f32);
                    }
                }
            }
            pictures
        };
        let lights: Vec<[Vec<[f32; 3]>; N]> =
            (0..layout.lights.len()).into_par_iter().map(of_light).collect();
        let mut by_part: [Vec<Vec<[f32; 3]>>; N] = [(); N].map(|()| Vec::new());
        for pictures in lights {
            by_part.iter_mut().zip(pictures).for_each(|(lights, picture)| lights.push(picture));
        }
        by_part.map(|lights| Picture::of_lights(layout.size.to_array().map(|n| n as usize), lights))
    }
}
