//! A small copy of a basis, from which a page in a browser makes pictures.
//!
//! It has the mean of the replicates alone. Every value is kept as the logarithm of its luminance in steps of
//! 1/[`STEPS`] stop, with the shares of red and blue in it, so that each is exact to a hundredth however
//! dark it is: noise of single pixels is kept, too, which a sum of few pictures would lose. Neighbouring cells
//! and nodes are alike, so that their differences are small numbers, which deflate well.
//!
//! Between the nodes of the background's value a polynomial of lower degree than the basis has stands in. All its
//! coefficients are that of light that met the background so many times, which falls fast.

use std::{
    f64::consts::PI,
    io::{self, Read, Write},
};

use flate2::{Compression, read::ZlibDecoder, write::ZlibEncoder};
use glam::UVec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Knots, Tables, TransportBasis, ValueNodes};
use crate::{
    lighting::Lighting,
    math::{Measure, display::LUMINANCE_WEIGHTS},
};

/// Steps of a logarithm a stop: half of one is .9 % of light, of which a display that does not encode shows as much,
/// and one that does half.
pub const STEPS: f64 = 40.0;
/// Code of the light 1; 0 is no light, and 1 is 2^-51.
pub const ONE: u16 = 2049;
/// Steps of the share of red in the luminance: half of one is 2 % of the red of white light. What pixels of one
/// colour have in common is not rounded alike: rounding is moved by a share of a step that differs from pixel to pixel.
pub const RED_STEPS: f64 = 128.0;
/// Steps of the share of blue: half of one is 1.4 % of the blue of white light.
pub const BLUE_STEPS: f64 = 512.0;
/// Nodes of the background's value at most. On the fruit basket four leave errors of .06 in display luminance
/// for single pixels in random lightings, five .02, and eight no less.
const MAX_NODES: usize = 5;
/// Bytes of codes at most; of a larger basis the pictures are halved. In Base64 they are 11 MB of a page.
const MAX_BYTES: usize = 8 << 20;

/// Bytes at most that deflate makes of one.
const MOST_INFLATED: usize = 1032;

/// What stands in a small copy of a basis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// Pixels of the basis along each side of one of these.
    pub reduction: u32,
    /// Sizes of each light.
    pub lights: Vec<Sizes>,
    /// Nodes of the background's value.
    pub nodes: Vec<f64>,
    /// Samples per pixel, over all replicates.
    pub samples: u32,
    /// Lengths of the codes of each light, bytes.
    pub bytes: Vec<usize>,
}

impl Header {
    /// Whether the numbers make sense: those of a file may be anything.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let of_light = |sizes: &Sizes| match sizes {
            Sizes::Fixed(size) => size.is_finite(),
            Sizes::Free(knots) => knots.is_sound(),
        };
        let descend = self.nodes.windows(2).all(|pair| pair[0] > pair[1]);
        let nodes = !self.nodes.is_empty() && descend && self.nodes.iter().all(|v| v.is_finite());
        nodes && self.size.iter().all(|&n| n > 0) && self.lights.iter().all(of_light)
    }
}

/// Sizes of a light in a small copy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sizes {
    /// A single size.
    Fixed(f32),
    /// All sizes up to the last knot.
    Free(Knots),
}

impl Sizes {
    fn n_cells(&self) -> usize {
        match self {
            Self::Fixed(_) => 1,
            Self::Free(knots) => knots.len(),
        }
    }

    /// Weights of the cells at a size.
    fn weights(&self, size: f64) -> Vec<(usize, f64)> {
        match self {
            Self::Fixed(_) => vec![(0, 1.0)],
            Self::Free(knots) => {
                let w = knots.weights(size);
                let all = w.value.into_iter().enumerate().map(|(i, v)| (w.first + i, v));
                all.filter(|&(cell, v)| cell < knots.len() && v != 0.0).collect()
            }
        }
    }
}

/// A small copy of a basis.
#[derive(Clone, Debug, PartialEq)]
pub struct Compact {
    /// What stands in it.
    pub header: Header,
    /// Codes of each light, deflated.
    pub codes: Vec<Vec<u8>>,
}

/// Codes of a light: luminance, share of red, share of blue; each by node, cell, pixel.
type Planes = [Vec<u16>; 3];

impl Compact {
    /// The copy of a basis.
    ///
    /// # Errors
    /// When codes cannot be deflated, which takes memory alone.
    pub fn new(basis: &TransportBasis) -> io::Result<Self> {
        let mut reduction = 1;
        loop {
            let copy = Self::reduced(basis, reduction)?;
            let n: usize = copy.header.bytes.iter().sum();
            let may_shrink = copy.header.size.iter().all(|&n| n >= 2);
            if n <= MAX_BYTES || !may_shrink {
                return Ok(copy);
            }
            reduction *= 2;
        }
    }

    fn reduced(basis: &TransportBasis, reduction: u32) -> io::Result<Self> {
        let layout = basis.layout();
        let lights: Vec<Sizes> = layout
            .lights
            .iter()
            .map(|light| light.knots.clone().map_or(Sizes::Fixed(light.size), Sizes::Free))
            .collect();
        let nodes = nodes(&layout.nodes);
        let codes = layout.lights.par_iter().map(|light| {
            let rows = Rows { basis, nodes: &nodes, reduction };
            let n_pixels = (layout.size / reduction).element_product() as usize;
            deflated(&rows.planes(light.cells()), [nodes.len(), light.n_cells(), n_pixels])
        });
        let codes = codes.collect::<io::Result<Vec<_>>>()?;
        let header = Header {
            size: (layout.size / reduction).to_array(),
            reduction,
            lights,
            nodes,
            samples: basis.n_samples() * basis.n_replicates() as u32,
            bytes: codes.iter().map(Vec::len).collect(),
        };
        Ok(Self { header, codes })
    }

    /// The copy with its codes inflated, ready for pictures.
    ///
    /// # Errors
    /// When the codes are none of such a copy.
    pub fn open(&self) -> io::Result<Open> {
        let n_pixels = self.header.size.iter().map(|&n| n as usize).product::<usize>();
        let lights = self
            .header
            .lights
            .par_iter()
            .zip(&self.codes)
            .map(|(sizes, codes)| inflated(codes, [self.header.nodes.len(), sizes.n_cells(), n_pixels]));
        Ok(Open { header: self.header.clone(), lights: lights.collect::<io::Result<_>>()? })
    }
}

/// A small copy of a basis, ready for pictures.
#[derive(Clone, Debug)]
pub struct Open {
    header: Header,
    lights: Vec<Planes>,
}

/// Difference between pictures of a copy and of its basis, in display luminance from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CopyError {
    /// Largest difference of a pixel.
    pub largest: f64,
    /// Largest root mean square of a picture.
    pub rms: f64,
    /// Number of lightings that were compared.
    pub lightings: usize,
}

impl Open {
    /// The picture of a lighting.
    #[must_use]
    pub fn picture(&self, x: &Lighting) -> Vec<[f32; 3]> {
        let n = self.header.size.iter().map(|&n| n as usize).product();
        let by_value = ValueNodes::at(self.header.nodes.clone()).weights(x.value).0;
        let mut sum = vec![[0.0_f64; 3]; n];
        for (l, (planes, sizes)) in self.lights.iter().zip(&self.header.lights).enumerate() {
            let mut light = vec![[0.0_f64; 3]; n];
            for (node, &by_value) in by_value.iter().enumerate() {
                for (cell, by_size) in sizes.weights(x.size[l]) {
                    let first = (node * sizes.n_cells() + cell) * n;
                    let weight = by_value * by_size;
                    for (p, light) in light.iter_mut().enumerate() {
                        let rgb = decoded(planes.each_ref().map(|plane| plane[first + p]), p);
                        light.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += weight * v);
                    }
                }
            }
            let gain = x.gain_of(l);
            // As the basis does: weights of both signs may leave less than nothing.
            for (sum, light) in sum.iter_mut().zip(light) {
                sum.iter_mut().zip(light).zip(gain).for_each(|((sum, v), gain)| *sum += gain * v.max(0.0));
            }
        }
        sum.into_iter().map(|rgb| rgb.map(|v| v as f32)).collect()
    }

    /// Difference from the pictures of the basis of which this is the copy.
    #[must_use]
    pub fn error(&self, basis: &TransportBasis, lightings: &[Lighting], measure: Measure) -> CopyError {
        let mut error = CopyError { lightings: lightings.len(), ..CopyError::default() };
        for x in lightings {
            let truth = averaged(&basis.picture(x).rgb, basis.layout().size, self.header.reduction);
            let [a, b] = [truth, self.picture(x)].map(|rgb| measure.encode_image(&rgb, x.exposure));
            let square: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
            error.rms = error.rms.max((square / a.len() as f64).sqrt());
            error.largest = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(error.largest, f64::max);
        }
        error
    }
}

/// Averages blocks of `factor` × `factor` pixels; those that fill no block are left out.
#[must_use]
pub fn averaged(rgb: &[[f32; 3]], size: UVec2, factor: u32) -> Vec<[f32; 3]> {
    if factor == 1 {
        return rgb.to_vec();
    }
    let (f, wide, small) = (factor as usize, size.x as usize, size / factor);
    let block = |i: usize| {
        let (x, y) = (i % small.x as usize * f, i / small.x as usize * f);
        let mut sum = [0.0_f64; 3];
        for k in 0..f * f {
            let pixel = rgb[(y + k / f) * wide + x + k % f];
            sum.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += f64::from(v));
        }
        sum.map(|v| (v / (f * f) as f64) as f32)
    };
    (0..small.element_product() as usize).map(block).collect()
}

/// Nodes of the copy: 0, and the roots of Chebyshev's polynomial stretched so that the first is the largest
/// value. With 0 among them the error of a picture is relative to the light that meets the background.
fn nodes(of: &ValueNodes) -> Vec<f64> {
    let largest = of.values()[0];
    let n = of.len().min(MAX_NODES);
    if n < 2 {
        return vec![largest];
    }
    let root = |k: usize| 0.5 * (1.0 + (PI * (k as f64 + 0.5) / (n - 1) as f64).cos());
    (0..n - 1).map(|k| largest * root(k) / root(0)).chain([0.0]).collect()
}

/// Parts of a step, from -1/2 to 1/2, by which the codes of the shares of red and blue in the pixel `p` are moved:
/// where many pixels have the same shares, as on a wall of one colour, their errors differ then, and the mean has none.
/// The two are a sequence of low discrepancy, by the powers of the plastic ratio.
fn moved(p: usize) -> [f64; 2] {
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (p as f64 * step).fract() - 0.5)
}

/// Light, red first, of the codes of the pixel `p`.
fn decoded([y, red, blue]: [u16; 3], p: usize) -> [f64; 3] {
    if y == 0 {
        return [0.0; 3];
    }
    let luminance = ((f64::from(y) - f64::from(ONE)) / STEPS).exp2();
    let [of_red, of_green, of_blue] = LUMINANCE_WEIGHTS;
    let share = |code: u16, moved: f64, steps: f64| ((f64::from(code) + moved) / steps).max(0.0);
    let [by_red, by_blue] = moved(p);
    let (red, blue) = (share(red, by_red, RED_STEPS), share(blue, by_blue, BLUE_STEPS));
    let green = (1.0 - red - blue).max(0.0);
    [red / of_red, green / of_green, blue / of_blue].map(|share| share * luminance)
}

/// Codes of the light of the pixel `p` with the luminance `y`, and as much red and blue.
fn encoded([y, red, blue]: [f64; 3], p: usize) -> [u16; 3] {
    let code = (y.log2() * STEPS).round() + f64::from(ONE);
    if y <= 0.0 || code < 1.0 {
        return [0; 3];
    }
    let [of_red, _, of_blue] = LUMINANCE_WEIGHTS;
    let share =
        |part: f64, moved: f64, steps: f64| (part.clamp(0.0, 1.0) * steps - moved).round().max(0.0) as u16;
    let [by_red, by_blue] = moved(p);
    let code = code.min(f64::from(u16::MAX)) as u16;
    [code, share(of_red * red / y, by_red, RED_STEPS), share(of_blue * blue / y, by_blue, BLUE_STEPS)]
}

/// The rows of a basis that are copied.
struct Rows<'a> {
    basis: &'a TransportBasis,
    nodes: &'a [f64],
    reduction: u32,
}

impl Rows<'_> {
    /// Codes of some cells.
    fn planes(&self, cells: std::ops::Range<usize>) -> Planes {
        let layout = self.basis.layout();
        let weights: Vec<Vec<f64>> = self.nodes.iter().map(|&v| layout.nodes.weights(v).0).collect();
        let n_cells = cells.len();
        let n_pixels = (layout.size / self.reduction).element_product() as usize;
        let mut planes: Planes = std::array::from_fn(|_| vec![0; self.nodes.len() * n_cells * n_pixels]);
        for (i, cell) in cells.enumerate() {
            let of_nodes: Vec<[Vec<f64>; 3]> =
                (0..layout.nodes.len()).map(|node| self.light(cell * layout.nodes.len() + node)).collect();
            for (k, weights) in weights.iter().enumerate() {
                let first = (k * n_cells + i) * n_pixels;
                for p in 0..n_pixels {
                    let at = |c: usize| -> f64 {
                        weights.iter().zip(&of_nodes).map(|(w, planes)| w * planes[c][p]).sum()
                    };
                    let codes = encoded([at(0), at(1), at(2)], p);
                    planes.iter_mut().zip(codes).for_each(|(plane, code)| plane[first + p] = code);
                }
            }
        }
        planes
    }

    /// Luminance, red and blue of a row, the mean over the replicates.
    fn light(&self, row: usize) -> [Vec<f64>; 3] {
        let basis = self.basis;
        let (size, f) = (basis.layout().size, self.reduction);
        let small = size / f;
        let area = f64::from(f * f);
        let scale = 1.0 / (f64::from(basis.n_samples().max(1)) * basis.n_replicates() as f64 * area);
        std::array::from_fn(|plane| {
            let mut out = vec![0.0; small.element_product() as usize];
            // A table of colour may be that of all replicates.
            let replicates = if plane == 0 { basis.n_replicates() } else { basis.colour.len() };
            for replicate in 0..replicates {
                for y in 0..small.y * f {
                    let line = basis.row(replicate, plane, row, y as usize);
                    let to = &mut out[(y / f * small.x) as usize..][..small.x as usize];
                    for (to, block) in to.iter_mut().zip(line.chunks_exact(f as usize)) {
                        *to += scale * block.iter().map(|&v| f64::from(v)).sum::<f64>();
                    }
                }
            }
            out
        })
    }
}

/// Differences of codes along the cells, and of those from node to node, as numbers that are small when the
/// differences are, deflated: of each plane all high bytes, then all low ones. `shape` counts nodes, cells and
/// pixels.
fn deflated(planes: &Planes, shape: [usize; 3]) -> io::Result<Vec<u8>> {
    let mut out = ZlibEncoder::new(Vec::new(), Compression::default());
    for plane in planes {
        let differences: Vec<u16> = (0..plane.len())
            .map(|i| {
                let around = neighbours(i, shape).map(|at| at.map_or(0, |at| plane[at]));
                folded(plane[i].wrapping_sub(predicted(around)))
            })
            .collect();
        for shift in [8, 0] {
            out.write_all(&differences.iter().map(|d| (d >> shift) as u8).collect::<Vec<u8>>())?;
        }
    }
    out.finish()
}

/// Planes of [`deflated`] codes.
fn inflated(codes: &[u8], shape: [usize; 3]) -> io::Result<Planes> {
    let n = shape.iter().try_fold(1_usize, |n, &m| n.checked_mul(m));
    // Whoever claims more than can be in there gets no memory for it.
    let most = codes.len().saturating_mul(MOST_INFLATED) / (2 * 3);
    let n = n.filter(|&n| n <= most).ok_or_else(|| io::Error::from(io::ErrorKind::InvalidData))?;
    let mut from = ZlibDecoder::new(codes);
    let mut planes: Planes = std::array::from_fn(|_| Vec::new());
    for plane in &mut planes {
        let [mut high, mut low] = [vec![0; n], vec![0; n]];
        from.read_exact(&mut high)?;
        from.read_exact(&mut low)?;
        plane.reserve(n);
        for (i, (high, low)) in high.into_iter().zip(low).enumerate() {
            let around = neighbours(i, shape).map(|at| at.map_or(0, |at| plane[at]));
            plane.push(predicted(around).wrapping_add(unfolded(u16::from_be_bytes([high, low]))));
        }
    }
    Ok(planes)
}

/// Places of the codes of the cell before, the node before, and of the cell before at the node before.
fn neighbours(i: usize, [_, n_cells, n_pixels]: [usize; 3]) -> [Option<usize>; 3] {
    let (cell, node) = (i / n_pixels % n_cells, i / (n_pixels * n_cells));
    let (before, above) = (cell > 0, node > 0);
    let (line, block) = (n_pixels, n_pixels * n_cells);
    [before.then(|| i - line), above.then(|| i - block), (before && above).then(|| i - line - block)]
}

/// What a code is expected to be.
fn predicted([cell, node, both]: [u16; 3]) -> u16 {
    cell.wrapping_add(node).wrapping_sub(both)
}

/// A difference as a number that is small when its modulus is.
fn folded(difference: u16) -> u16 {
    let d = difference as i16;
    ((d << 1) ^ (d >> 15)) as u16
}

/// The difference that was [`folded`].
fn unfolded(code: u16) -> u16 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        light::LightColor,
        math::display::luminance,
        transport::{Layout, SizeBins},
    };

    /// A basis whose light is a known function of size and value: each pixel has some light that met the
    /// background k times, in a colour of its own.
    fn basis(size: UVec2) -> TransportBasis {
        let bins = vec![SizeBins::Free(Knots::geometric(0.1, 2.0, 8)), SizeBins::Fixed(1.0)];
        let layout = Layout::new(size, bins, ValueNodes::new(1.5, 8));
        let mut basis = TransportBasis::new(layout.clone(), 2);
        basis.n_samples = 3;
        let n = layout.n_pixels();
        for row in 0..layout.n_rows() {
            let (cell, node) = (row / 8, row % 8);
            let value = layout.nodes.values()[node] / 1.5;
            for p in 0..n {
                let met = |k: i32| (0.3 / f64::from(k + 1)) * value.powi(k) * (1.0 + (p as f64).sin().abs());
                let light = (0..8).map(met).sum::<f64>() * (1.0 + cell as f64) * (p as f64 - 3.0).exp2();
                let (x, y) = (p % size.x as usize, p / size.x as usize);
                let wide = size.x as usize;
                let at = (y * layout.n_rows() + row) * wide + x;
                basis.luminance[0][at] = (light * 1.2) as f32;
                basis.luminance[1][at] = (light * 0.8) as f32;
                let colour = |c: usize| ((y * layout.n_cells() + cell) * 2 + c) * 8 * wide + node * wide + x;
                basis.colour[0][colour(0)] = (2.0 * light * 1.3) as f32;
                basis.colour[0][colour(1)] = (2.0 * light * 0.4) as f32;
            }
        }
        basis
    }

    fn lightings() -> Vec<Lighting> {
        let of = |radiance: [f64; 2], size: f64, value: f64| Lighting {
            radiance: radiance.to_vec(),
            size: vec![size, 1.0],
            value,
            exposure: 0.2,
            color: Vec::new(),
        };
        vec![
            of([1.0, 0.0], 0.3, 1.5),
            of([0.0, 2.0], 0.1, 0.07),
            of([0.5, 0.5], 2.0, 0.8),
            of([1.0, 1.0], 1.1, 0.0),
        ]
    }

    #[test]
    fn pictures_of_the_copy_are_those_of_the_basis_to_a_hundredth() {
        let basis = basis((5, 4).into());
        let copy = Compact::new(&basis).unwrap();
        let error = copy.open().unwrap().error(&basis, &lightings(), Measure::default());
        assert!(error.largest < 0.01 && error.largest > 0.0, "{error:?}");
        for x in lightings() {
            for (a, b) in copy.open().unwrap().picture(&x).iter().zip(basis.picture(&x).rgb) {
                // Half a step of the luminance, and of the share of red or blue; weights of both signs, of entries
                // that differ by some tenths, may double that.
                let (y, step) = (luminance(b), 0.5 * 2_f64.ln() / STEPS);
                let [of_red, of_green, of_blue] = LUMINANCE_WEIGHTS;
                let shares = [0.5 / RED_STEPS, 0.5 / RED_STEPS + 0.5 / BLUE_STEPS, 0.5 / BLUE_STEPS];
                for (c, (share, of)) in shares.into_iter().zip([of_red, of_green, of_blue]).enumerate() {
                    let allowed = 2.0 * (step * f64::from(b[c]) + share / of * y) + 1e-9;
                    assert!(f64::from((a[c] - b[c]).abs()) < allowed, "{a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn a_wall_of_one_colour_keeps_its_mean_colour() {
        let colour = [0.35, 0.21, 0.13];
        let n = 4096;
        let y: f64 = colour.iter().zip(LUMINANCE_WEIGHTS).map(|(c, w)| c * w).sum();
        let mut mean = [0.0; 3];
        for p in 0..n {
            let rgb = decoded(encoded([y, colour[0], colour[2]], p), p);
            // Up to the step of the luminance, which is the same everywhere.
            let scale = y / rgb.iter().zip(LUMINANCE_WEIGHTS).map(|(c, w)| c * w).sum::<f64>();
            mean.iter_mut().zip(rgb).for_each(|(mean, v)| *mean += scale * v / n as f64);
        }
        assert!((0..3).all(|c| (mean[c] / colour[c] - 1.0).abs() < 1e-4), "{mean:?}");
    }

    #[test]
    fn lights_of_the_copy_take_the_colours_of_a_lighting() {
        let basis = basis((5, 4).into());
        let open = Compact::new(&basis).unwrap().open().unwrap();
        let warm = LightColor::Temperature { kelvin: 2500.0, tint: 0.0 };
        let color = vec![warm, LightColor::Rgb([0.1, 0.9, 0.4])];
        for x in lightings().into_iter().map(|x| Lighting { color: color.clone(), ..x }) {
            for (a, b) in open.picture(&x).iter().zip(basis.picture(&x).rgb) {
                let y = luminance(b);
                assert!((0..3).all(|c| f64::from((a[c] - b[c]).abs()) < 0.12 * y + 1e-9), "{a:?} {b:?}");
            }
            // In their recorded colours the picture is another one, by more than is allowed above.
            let recorded = basis.picture(&Lighting { color: Vec::new(), ..x.clone() }).rgb;
            let differs = |(a, b): (&[f32; 3], &[f32; 3])| {
                (0..3).any(|c| f64::from((a[c] - b[c]).abs()) > 0.15 * luminance(*b))
            };
            assert!(open.picture(&x).iter().zip(&recorded).any(differs));
        }
    }

    #[test]
    fn what_is_deflated_comes_back_exactly() {
        let shape = [2, 3, 4];
        let planes: Planes =
            std::array::from_fn(|c| (0..24_u16).map(|i| i.wrapping_mul(7919 * (c as u16 + 1))).collect());
        assert_eq!(inflated(&deflated(&planes, shape).unwrap(), shape).unwrap(), planes);
        assert!(inflated(&deflated(&planes, shape).unwrap()[..20], shape).is_err());
    }

    #[test]
    fn numbers_that_make_no_sense_are_none_of_a_copy() {
        let copy = Compact::new(&basis((3, 2).into())).unwrap();
        assert!(copy.header.is_sound());
        let broken = |change: &dyn Fn(&mut Header)| {
            let mut header = copy.header.clone();
            change(&mut header);
            !header.is_sound()
        };
        assert!(broken(&|h| h.nodes = vec![]) && broken(&|h| h.nodes[1] = h.nodes[0]));
        assert!(broken(&|h| h.nodes[0] = f64::NAN) && broken(&|h| h.size[1] = 0));
        assert!(broken(&|h| h.lights[1] = Sizes::Fixed(f32::INFINITY)));
        // Of an enormous picture there is no code, and no memory is taken for it.
        let mut huge = copy.clone();
        huge.header.size = [u32::MAX, u32::MAX];
        assert!(huge.open().is_err());
    }

    #[test]
    fn differences_fold_to_small_numbers_and_back() {
        assert_eq!([0, 1, u16::MAX, 2, u16::MAX - 1].map(folded), [0, 2, 1, 4, 3]);
        assert!((0..=u16::MAX).all(|d| unfolded(folded(d)) == d));
    }

    #[test]
    fn a_reduced_copy_has_the_mean_of_each_block() {
        let basis = basis((6, 4).into());
        let copy = Compact::reduced(&basis, 2).unwrap();
        assert_eq!(copy.header.size, [3, 2]);
        let error = copy.open().unwrap().error(&basis, &lightings(), Measure::default());
        assert!(error.largest < 0.01, "{error:?}");
    }
}
