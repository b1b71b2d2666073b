//! The ordinary film: one picture per light.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec2;

use super::{Contribution, Film, Recorder, Region, RowRecorder, SplatBuffer};
use crate::math::Rgb;

/// Radiance and size of a light while a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightState {
    /// Radiance L.
    pub radiance: f32,
    /// Size s: contributions with ρ > s are not the light's.
    pub size: f32,
}

/// Sums the contributions of each light into a picture of its own, for unit
/// radiance.
#[derive(Debug)]
pub struct RgbFilm {
    region: Region,
    sizes: Vec<f32>,
    /// Power of two per light that brings unit-radiance splats near display white.
    scales: Vec<f64>,
    /// [pixel][light][rgb]
    sums: Vec<f64>,
    splats: SplatBuffer,
    non_finite: AtomicU64,
}

/// Recorder of a row of an [`RgbFilm`].
#[derive(Debug)]
pub struct RgbRow<'a> {
    region: Region,
    sizes: &'a [f32],
    scales: &'a [f64],
    sums: &'a mut [f64],
    splats: &'a SplatBuffer,
    non_finite: &'a AtomicU64,
    pixel: usize,
}

/// A finished picture: linear radiance, row by row.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Sum over the lights.
    pub rgb: Vec<[f32; 3]>,
    /// The share of each light, its radiance included.
    pub lights: Vec<Vec<[f32; 3]>>,
}

impl RgbFilm {
    /// A film for lights in the given states; `exposure` only places the
    /// fixed-point scale of the splats.
    #[must_use]
    pub fn new(region: Region, lights: &[LightState], exposure: f32) -> Self {
        let scales = lights
            .iter()
            .map(|l| {
                let white = f64::from(l.radiance) * f64::from(exposure);
                if white > 0.0 { white.log2().round().clamp(-60.0, 60.0).exp2() } else { 1.0 }
            })
            .collect();
        let n = region.n_pixels() * lights.len();
        Self {
            region,
            sizes: lights.iter().map(|l| l.size).collect(),
            scales,
            sums: vec![0.0; 3 * n],
            splats: SplatBuffer::new(n),
            non_finite: AtomicU64::new(0),
        }
    }

    /// The mean over `n_samples` per pixel, with each light at its radiance.
    #[must_use]
    pub fn develop(&self, radiance: &[f32], n_samples: u32) -> Picture {
        let n_lights = self.sizes.len();
        let inv = 1.0 / f64::from(n_samples.max(1));
        let mut rgb = vec![[0.0_f32; 3]; self.region.n_pixels()];
        let mut lights = vec![rgb.clone(); n_lights];
        for (i, out) in rgb.iter_mut().enumerate() {
            let mut total = [0.0_f64; 3];
            for l in 0..n_lights {
                let cell = i * n_lights + l;
                let splat = self.splats.get(cell, self.scales[l]);
                for c in 0..3 {
                    let v = (self.sums[3 * cell + c] + splat[c]) * inv * f64::from(radiance[l]);
                    lights[l][i][c] = v as f32;
                    total[c] += v;
                }
            }
            *out = total.map(|v| v as f32);
        }
        let size = self.region.size();
        Picture { width: size.x as usize, height: size.y as usize, rgb, lights }
    }
}

impl Film for RgbFilm {
    type Row<'a> = RgbRow<'a>;

    fn region(&self) -> Region {
        self.region
    }

    fn rows(&mut self) -> Vec<RgbRow<'_>> {
        let width = (self.region.size().x as usize * self.sizes.len() * 3).max(1);
        let (region, sizes, scales, splats, non_finite) =
            (self.region, &self.sizes, &self.scales, &self.splats, &self.non_finite);
        self.sums
            .chunks_mut(width)
            .map(|sums| RgbRow { region, sizes, scales, sums, splats, non_finite, pixel: 0 })
            .collect()
    }

    fn defects(&self) -> (u64, u64) {
        (self.non_finite.load(Ordering::Relaxed), self.splats.overflows())
    }

    fn outside(&self) -> RgbRow<'_> {
        RgbRow {
            region: self.region,
            sizes: &self.sizes,
            scales: &self.scales,
            sums: &mut [],
            splats: &self.splats,
            non_finite: &self.non_finite,
            pixel: 0,
        }
    }
}

impl RgbRow<'_> {
    /// Whether the contribution counts: emitted at the present size, and a number.
    fn accepts(&self, c: &Contribution) -> bool {
        if c.at.rho > self.sizes[c.light as usize] {
            return false;
        }
        let is_number = c.value.is_radiance();
        if !is_number {
            self.non_finite.fetch_add(1, Ordering::Relaxed);
        }
        is_number
    }
}

impl Recorder for RgbRow<'_> {
    fn add(&mut self, c: &Contribution) {
        if self.accepts(c) && !self.sums.is_empty() {
            let i = 3 * (self.pixel * self.sizes.len() + c.light as usize);
            let Rgb { x, y, z } = c.value.largest();
            self.sums[i] += f64::from(x);
            self.sums[i + 1] += f64::from(y);
            self.sums[i + 2] += f64::from(z);
        }
    }

    fn splat(&mut self, raster: Vec2, c: &Contribution) {
        if !self.accepts(c) {
            return;
        }
        if let Some(i) = self.region.index(raster.as_uvec2()) {
            let l = c.light as usize;
            self.splats.add(i * self.sizes.len() + l, c.value.largest(), self.scales[l]);
        }
    }
}

impl RowRecorder for RgbRow<'_> {
    fn set_pixel(&mut self, i: usize) {
        self.pixel = i;
    }
}
