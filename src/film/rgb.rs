//! The film of ordinary pictures: one of each light, in one lighting or in several, or one of each lighting.

use std::{
    io::{self, Write},
    sync::atomic::{AtomicU64, Ordering},
};

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::{Contribution, Film, Recorder, RowRecorder, SplatBuffer};
use crate::{files::parts::write_numbers, lighting::Lighting, math::Rgb};

/// A film that sums contributions into pictures: one of each light alone, for unit radiance, in one lighting
/// or in several, or one of each of several lightings.
#[derive(Debug)]
pub struct RgbFilm {
    /// Width and height, pixels.
    size: UVec2,
    /// Pictures that the contributions of a light go to, by light.
    routes: Vec<Vec<Route>>,
    /// Power of two by which the splats of a picture are multiplied when they are stored, so
    /// that display white is about 1, by picture.
    scales: Vec<f64>,
    /// Sums of the contributions with t ≥ 2, as `[pixel][picture][rgb]`.
    sums: Vec<f64>,
    splats: SplatBuffer,
    /// Number of contributions dropped because they were not finite.
    non_finite: AtomicU64,
}

/// The way of the contributions of a light into a picture.
#[derive(Clone, Copy, Debug)]
struct Route {
    picture: usize,
    /// Node of the background's value that the picture sees.
    node: usize,
    /// Size of the light in the picture.
    size: f32,
    /// Factor on the contributions: the light's radiance in the picture with its colour, or 1 for unit radiance.
    gain: Rgb,
}

/// Recorder of one row of an [`RgbFilm`].
#[derive(Debug)]
pub struct RgbRow<'a> {
    size: UVec2,
    routes: &'a [Vec<Route>],
    scales: &'a [f64],
    sums: &'a mut [f64],
    splats: &'a SplatBuffer,
    non_finite: &'a AtomicU64,
    /// Index of the current pixel in the row.
    pixel: usize,
}

/// A finished picture in linear Rec.709 radiance, row by row from the top.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Radiance of each pixel, the sum over the lights.
    pub rgb: Vec<[f32; 3]>,
    /// Radiance of each pixel that is due to one light, by light.
    pub lights: Vec<Vec<[f32; 3]>>,
}

impl Clone for RgbFilm {
    fn clone(&self) -> Self {
        let Self { size, routes, scales, sums, splats, non_finite } = self;
        Self {
            size: *size,
            routes: routes.clone(),
            scales: scales.clone(),
            sums: sums.clone(),
            splats: splats.clone(),
            non_finite: AtomicU64::new(non_finite.load(Ordering::Relaxed)),
        }
    }
}

impl Picture {
    /// The picture that the pictures of its lights add up to, of `size` columns and rows.
    #[must_use]
    pub fn of_lights([width, height]: [usize; 2], lights: Vec<Vec<[f32; 3]>>) -> Self {
        let sum = |p: usize, c: usize| lights.iter().map(|l| f64::from(l[p][c])).sum::<f64>() as f32;
        let rgb = (0..width * height).map(|p| std::array::from_fn(|c| sum(p, c))).collect();
        Self { width, height, rgb, lights }
    }
}

impl RgbFilm {
    /// A film of `size` pixels for a picture of each light at unit radiance, at its size in
    /// `lighting`, whose radiances and exposure only place the fixed-point scale of the splats.
    #[must_use]
    pub fn by_light(size: UVec2, lighting: &Lighting) -> Self {
        Self::by_light_in(size, &[(lighting, 0)])
    }

    /// A film of `size` pixels for a picture of each light at unit radiance in each of several lightings,
    /// otherwise as [`Self::by_light`]: the picture of light l in the k-th lighting is the
    /// (k · lights + l)-th. Each lighting comes with the node of the background's value that it sees.
    #[must_use]
    pub fn by_light_in(size: UVec2, lightings: &[(&Lighting, usize)]) -> Self {
        let n_lights = lightings.first().map_or(0, |(x, _)| x.n_lights());
        let route = |(k, &(x, node)): (usize, &(&Lighting, usize)), l: usize| Route {
            picture: k * n_lights + l,
            node,
            size: x.size[l] as f32,
            gain: Rgb::ONE,
        };
        let routes = (0..n_lights)
            .map(|l| lightings.iter().enumerate().map(|lighting| route(lighting, l)).collect())
            .collect();
        let whites =
            lightings.iter().flat_map(|(x, _)| x.radiance.iter().map(|&l| f64::from(l as f32) * x.exposure));
        Self::with_routes(size, routes, whites)
    }

    /// The mean over `n_samples` per pixel, with each light at its radiance in `lighting`.
    #[must_use]
    pub fn develop(&self, lighting: &Lighting, n_samples: u32) -> Picture {
        let n_lights = self.scales.len();
        let inv = 1.0 / f64::from(n_samples.max(1));
        let mut rgb = vec![[0.0_f32; 3]; self.size.element_product() as usize];
        let mut lights = vec![rgb.clone(); n_lights];
        let gains: Vec<[f64; 3]> = (0..n_lights).map(|l| lighting.gain_of(l)).collect();
        for (i, out) in rgb.iter_mut().enumerate() {
            let mut total = [0.0_f64; 3];
            for (l, image) in lights.iter_mut().enumerate() {
                let sum = self.sum(i, l);
                let v: [f64; 3] = std::array::from_fn(|c| sum[c] * inv * gains[l][c]);
                image[i] = v.map(|v| v as f32);
                total = std::array::from_fn(|c| total[c] + v[c]);
            }
            *out = total.map(|v| v as f32);
        }
        Picture { width: self.size.x as usize, height: self.size.y as usize, rgb, lights }
    }

    /// Writes the sums so far, exactly.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write_sums(&self, out: &mut dyn Write) -> io::Result<()> {
        write_numbers(out, self.sums.iter().map(|sum| sum.to_le_bytes()))?;
        self.splats.write_sums(out)
    }

    /// Takes the sums of a film of the same pictures from the beginning of what [`Self::write_sums`] has
    /// written, and returns the rest; `None`, and the film is as before, where that is too short.
    #[must_use]
    pub fn read_sums<'b>(&mut self, bytes: &'b [u8]) -> Option<&'b [u8]> {
        let (sums, rest) = bytes.split_at_checked(8 * self.sums.len())?;
        let rest = self.splats.read_sums(rest)?;
        self.sums.iter_mut().zip(sums.as_chunks().0).for_each(|(sum, b)| *sum = f64::from_le_bytes(*b));
        Some(rest)
    }

    /// A film of `size` pixels for a picture of each of `lightings`; the k-th sees the background
    /// at the k-th node of the render.
    #[must_use]
    pub fn by_lighting(size: UVec2, lightings: &[&Lighting]) -> Self {
        let n_lights = lightings.first().map_or(0, |x| x.n_lights());
        let route = |(k, x): (usize, &&Lighting), l: usize| {
            let (radiance, size) = (x.radiance[l] as f32, x.size[l] as f32);
            let gain = radiance * x.color_of(l).gain().map_or(Rgb::ONE, Rgb::from_array);
            (radiance > 0.0).then_some(Route { picture: k, node: k, size, gain })
        };
        let routes = (0..n_lights)
            .map(|l| lightings.iter().enumerate().filter_map(|lighting| route(lighting, l)).collect())
            .collect();
        Self::with_routes(size, routes, lightings.iter().map(|x| x.exposure))
    }

    /// A film with these routes by light; `whites` are the factors that bring the values of
    /// each picture to the display's range.
    fn with_routes(size: UVec2, routes: Vec<Vec<Route>>, whites: impl Iterator<Item = f64>) -> Self {
        // Within 2^±60, so that extreme radiances make the scale neither 0 nor infinite.
        let scale =
            |white: f64| if white > 0.0 { white.log2().round().clamp(-60.0, 60.0).exp2() } else { 1.0 };
        let scales: Vec<f64> = whites.map(scale).collect();
        let n = size.element_product() as usize * scales.len();
        Self {
            size,
            routes,
            scales,
            sums: vec![0.0; 3 * n],
            splats: SplatBuffer::new(n),
            non_finite: AtomicU64::new(0),
        }
    }

    /// Adds the sums of the pixels' own samples to `own` and those of the splats to `splats`, both as
    /// `[pixel][picture][rgb]`, and leaves the film empty.
    ///
    /// # Panics
    /// When `own` or `splats` is of another length.
    pub fn move_onto(&mut self, own: &mut [f32], splats: &mut [f32]) {
        let fits = [own.len(), splats.len()].map(|n| n == self.sums.len());
        assert_eq!(fits, [true; 2], "sums of a film of the same pictures");
        let (pixel, scales) = (3 * self.scales.len(), &self.scales);
        let width = (self.size.x as usize * pixel).max(1);
        let rows = own.par_chunks_mut(width).zip(splats.par_chunks_mut(width));
        let from = self.sums.par_chunks_mut(width).zip(self.splats.par_chunks_mut(width));
        rows.zip(from).for_each(|((own, splats), (sums, mut parts))| {
            for (i, (own, sum)) in own.iter_mut().zip(sums).enumerate() {
                *own += std::mem::take(sum) as f32;
                splats[i] += parts.take(i, scales[i % pixel / 3]) as f32;
            }
        });
    }

    /// Sum over all samples of a pixel in a picture, splats included; pixels are counted row
    /// by row.
    #[must_use]
    pub fn sum(&self, pixel: usize, picture: usize) -> [f64; 3] {
        let [own, splats] = self.parts(pixel, picture);
        std::array::from_fn(|c| own[c] + splats[c])
    }

    /// The parts of [`Self::sum`]: the sum of the pixel's own samples and that of the splats.
    #[must_use]
    pub fn parts(&self, pixel: usize, picture: usize) -> [[f64; 3]; 2] {
        let cell = pixel * self.scales.len() + picture;
        let own = std::array::from_fn(|c| self.sums[3 * cell + c]);
        [own, self.splats.get(cell, self.scales[picture])]
    }
}

impl<const N: usize> Film<N> for RgbFilm {
    type Row<'a> = RgbRow<'a>;

    fn size(&self) -> UVec2 {
        self.size
    }

    fn rows(&mut self) -> Vec<RgbRow<'_>> {
        let width = (self.size.x as usize * self.scales.len() * 3).max(1);
        let (size, routes, scales, splats, non_finite) =
            (self.size, &self.routes, &self.scales, &self.splats, &self.non_finite);
        self.sums
            .chunks_mut(width)
            .map(|sums| RgbRow { size, routes, scales, sums, splats, non_finite, pixel: 0 })
            .collect()
    }

    fn defects(&self) -> (u64, u64) {
        (self.non_finite.load(Ordering::Relaxed), self.splats.overflows())
    }
}

impl<'a> RgbRow<'a> {
    /// The routes of a contribution into pictures in which its light is large enough to emit
    /// it; none for a contribution that is not finite, which is counted.
    fn routes<const N: usize>(&self, c: &Contribution<N>) -> impl Iterator<Item = Route> + use<'a, N> {
        let (is_number, rho) = (c.value.is_radiance(), c.at.rho);
        if !is_number {
            self.non_finite.fetch_add(1, Ordering::Relaxed);
        }
        let routes = if is_number { self.routes[c.light as usize].as_slice() } else { &[] };
        routes.iter().filter(move |route| rho <= route.size).copied()
    }
}

impl<const N: usize> Recorder<N> for RgbRow<'_> {
    fn add(&mut self, c: &Contribution<N>) {
        let first = self.pixel * self.scales.len();
        for Route { picture, node, gain, .. } in self.routes(c) {
            let value = c.value.at(node) * gain;
            let cell = &mut self.sums[3 * (first + picture)..][..3];
            cell.iter_mut().zip(value.to_array()).for_each(|(sum, v)| *sum += f64::from(v));
        }
    }

    fn splat(&mut self, raster: Vec2, c: &Contribution<N>) {
        let routes = self.routes(c);
        let UVec2 { x, y } = raster.as_uvec2();
        let pixel = (y * self.size.x + x) as usize;
        for Route { picture, node, gain, .. } in routes {
            self.splats.add(
                pixel * self.scales.len() + picture,
                c.value.at(node) * gain,
                self.scales[picture],
            );
        }
    }
}

impl<const N: usize> RowRecorder<N> for RgbRow<'_> {
    fn set_pixel(&mut self, i: usize) {
        self.pixel = i;
    }
}
