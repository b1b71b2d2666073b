//! Derivatives by the pixels of a picture, summed over the terms.

use multiversion::multiversion;

use super::chroma::{Axis, histogram};
use super::picture::Picture;
use super::region::{Region, Regions};

/// The adjoint picture `∂f/∂l` while terms add to it.
///
/// Derivatives of means and variances are affine in the luminance of a pixel, with one line for each
/// region. Lines are collected and drawn in one pass over the picture, before anything that is added
/// later to single pixels.
pub(super) struct Adjoint<'a> {
    /// The picture by which is differentiated.
    pub(super) picture: &'a Picture<'a>,
    /// Lines that are not drawn yet, in the order of [`Region`].
    lines: Option<[Line; 2]>,
    out: &'a mut [f64],
}

/// The function `constant + slope · l` of a pixel's luminance.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    constant: f64,
    slope: f64,
}

impl<'a> Adjoint<'a> {
    /// An adjoint that adds to `out`, which has the size of the picture.
    ///
    /// # Panics
    /// When `out` has another size.
    pub(super) fn new(picture: &'a Picture<'a>, out: &'a mut [f64]) -> Self {
        let n = picture.l.len();
        assert!(out.len() == n || out.len() == 3 * n, "the adjoint must have the picture's size");
        Self { picture, lines: None, out }
    }

    /// Adds `d · ∂mean/∂l` of a region.
    pub(super) fn add_mean(&mut self, region: Region, d: f64) {
        let count = self.picture.regions.count(region);
        self.line(region).constant += d / count;
    }

    /// Adds `d · ∂σ²/∂l` of a region whose mean is `mean`; the mean's own dependence on `l` drops out.
    pub(super) fn add_variance(&mut self, region: Region, d: f64, mean: f64) {
        let slope = 2.0 * d / self.picture.regions.count(region);
        let line = self.line(region);
        line.constant -= slope * mean;
        line.slope += slope;
    }

    /// The adjoint picture with all lines drawn, to which more may be added pixel by pixel.
    pub(super) fn pixels(&mut self) -> &mut [f64] {
        if let Some([object, background]) = self.lines.take() {
            let out = &mut self.out[..self.picture.l.len()];
            draw_lines(self.picture.l, self.picture.regions, object, background, out);
        }
        &mut self.out[..self.picture.l.len()]
    }

    /// Adds `d · ∂mean/∂chroma` of an axis over a region.
    pub(super) fn add_chroma_mean(&mut self, axis: Axis, region: Region, d: f64) {
        self.add_chroma_line(
            axis,
            region,
            Line { constant: d / self.picture.regions.count(region), slope: 0.0 },
        );
    }

    /// Adds `d · ∂σ²/∂chroma` of an axis over a region where its mean is `mean`.
    pub(super) fn add_chroma_variance(&mut self, axis: Axis, region: Region, d: f64, mean: f64) {
        let slope = 2.0 * d / self.picture.regions.count(region);
        self.add_chroma_line(axis, region, Line { constant: -slope * mean, slope });
    }

    fn add_chroma_line(&mut self, axis: Axis, region: Region, line: Line) {
        let plane = self.picture.chroma(axis);
        let n = plane.len();
        let nothing = Line::default();
        let [object, background] = if region == Region::Object { [line, nothing] } else { [nothing, line] };
        let out = &mut self.out[axis.plane() * n..][..n];
        draw_lines(plane, self.picture.regions, object, background, out);
    }

    /// Adds `Σ_i d_i · ∂share_i/∂chroma` of the joint histogram.
    pub(super) fn add_chroma_histogram(&mut self, d: &[f64]) {
        let planes = Axis::ALL.map(|axis| self.picture.chroma(axis));
        let n = planes[0].len();
        let (by_a, by_b) = self.out[n..].split_at_mut(n);
        histogram::add_adjoint(planes, d, [by_a, by_b]);
    }

    /// Draws the lines that are left.
    pub(super) fn finish(mut self) {
        self.pixels();
    }

    fn line(&mut self, region: Region) -> &mut Line {
        &mut self.lines.get_or_insert_default()[region as usize]
    }
}

/// Adds to `out` the lines of object and background at `l`, by the share of each pixel in them.
fn draw_lines(l: &[f64], regions: &Regions, object: Line, background: Line, out: &mut [f64]) {
    let Some(weights) = regions.weights() else {
        return add_lines(l, regions.mask(), object, background, out);
    };
    for ((out, &l), &w) in out.iter_mut().zip(l).zip(weights) {
        *out += w * (object.constant + object.slope * l)
            + (1.0 - w) * (background.constant + background.slope * l);
    }
}

/// Adds to `out` the object's or the background's line at `l`.
#[multiversion(targets = "simd")]
fn add_lines(l: &[f64], mask: &[bool], object: Line, background: Line, out: &mut [f64]) {
    for ((out, &l), &on_object) in out.iter_mut().zip(l).zip(mask) {
        let line = if on_object { object } else { background };
        *out += line.constant + line.slope * l;
    }
}
