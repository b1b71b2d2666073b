//! Image textures.
//!
//! Texels are kept as the file stores them, 8 or 16 bits a channel or floating
//! point, and decoded when they are looked up.

mod loader;

use std::{
    collections::HashMap,
    fmt,
    sync::{Arc, LazyLock},
};

use glam::{Affine2, Vec2, Vec4};

pub use loader::{TextureError, TextureLoader};

use crate::{
    math::{Rgb, hash::hash_bytes},
    picture::Samples,
};

/// What the images of a scene may occupy, bytes: 64 images of 2048² texels of 8
/// bits fit, and a machine that renders has it to spare.
pub const TEXTURE_BUDGET: u64 = 1 << 30;

/// What the numbers of an 8- or 16-bit image mean; floating-point images are linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Encoding {
    /// sRGB-encoded colour; alpha is linear.
    Srgb,
    /// Plain numbers: roughness, normals, opacity.
    Linear,
}

/// What lies beyond the edges of an image, along one of its axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The texels of its edge.
    Clamp,
    /// The image mirrored, then as it is, and so on.
    Mirror,
}

impl Wrap {
    /// The texel among `n` that stands at place `i`, which may lie beyond the image.
    fn texel(self, i: i64, n: usize) -> usize {
        let n = n as i64;
        (match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Clamp => i.clamp(0, n - 1),
            Self::Mirror => {
                let there_and_back = i.rem_euclid(2 * n);
                there_and_back.min(2 * n - 1 - there_and_back)
            }
        }) as usize
    }
}

/// An RGBA image with bilinear filtering of linear values, which repeats unless it is told otherwise.
#[derive(Clone, Debug)]
pub struct Texture {
    image: Arc<Image>,
    /// Transformation from the surface's texture coordinates to the image's, v up.
    transform: Affine2,
    /// What lies beyond the edges across and down.
    wrap: [Wrap; 2],
}

/// The texels of a texture.
#[derive(Clone)]
struct Image {
    name: String,
    width: usize,
    height: usize,
    encoding: Encoding,
    /// Interleaved channels of a texel: grey, grey and alpha, RGB, or RGB and alpha.
    channels: usize,
    /// As stored, row by row from the top.
    texels: Samples,
    /// Smallest and largest decoded value of each channel.
    range: [Vec4; 2],
}

impl fmt::Debug for Image {
    /// Size and encoding, and a hash for the texels.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hash = match &self.texels {
            Samples::U8(t) => hash_bytes(t.iter().copied()),
            Samples::U16(t) => hash_bytes(t.iter().flat_map(|v| v.to_le_bytes())),
            Samples::F32(t) => hash_bytes(t.iter().flat_map(|v| v.to_le_bytes())),
        };
        let Self { width, height, channels, encoding, .. } = self;
        write!(f, "Image({width} x {height} x {channels}, {encoding:?}, {hash:016x})")
    }
}

/// Width, height and bytes of a texel of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Extent {
    size: [usize; 2],
    texel: usize,
}

impl Extent {
    fn bytes(self) -> u64 {
        self.size.map(|n| n as u64).iter().product::<u64>() * self.texel as u64
    }

    fn halved(self) -> Self {
        Self { size: self.size.map(|n| n.div_ceil(2)), ..self }
    }
}

/// The numbers of one channel of an image.
#[derive(Clone, Debug)]
pub struct ScalarMap {
    /// Image that holds the numbers.
    pub texture: Arc<Texture>,
    /// Channel that holds the numbers.
    pub channel: Channel,
}

/// A channel of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Red.
    R,
    /// Green.
    G,
    /// Blue.
    B,
    /// Alpha.
    A,
}

impl ScalarMap {
    /// Value at `uv` (v up).
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> f32 {
        self.texture.sample_rgba(uv)[self.channel as usize]
    }

    /// Smallest and largest value of any texel.
    #[must_use]
    pub fn range(&self) -> [f32; 2] {
        self.texture.range().map(|v| v[self.channel as usize])
    }

    /// Derivatives of the value by u and by v (up) of the surface.
    #[must_use]
    pub fn gradient(&self, uv: Vec2) -> Vec2 {
        Vec2::from_array(self.texture.gradient(uv).map(|d| d[self.channel as usize]))
    }
}

/// The four values of a texel: grey is all colours, and what has no alpha is opaque.
fn rgba<T: Copy>(texel: &[T], opaque: T) -> [T; 4] {
    match *texel {
        [v] => [v, v, v, opaque],
        [v, a] => [v, v, v, a],
        [r, g, b] => [r, g, b, opaque],
        [r, g, b, a] => [r, g, b, a],
        _ => unreachable!("a texel has one to four channels"),
    }
}

impl Image {
    fn new(name: String, size: [usize; 2], encoding: Encoding, channels: usize, texels: Samples) -> Self {
        let [width, height] = size;
        let mut image = Self { name, width, height, encoding, channels, texels, range: [Vec4::ZERO; 2] };
        let (mut lo, mut hi) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
        for i in 0..width * height {
            let t = image.decoded(i);
            (lo, hi) = (lo.min(t), hi.max(t));
        }
        image.range = [lo, hi];
        image
    }

    fn extent(&self) -> Extent {
        Extent { size: [self.width, self.height], texel: self.channels * self.texels.width() }
    }

    /// Linear values of a texel by its index.
    fn decoded(&self, i: usize) -> Vec4 {
        let at = i * self.channels..(i + 1) * self.channels;
        match (&self.texels, self.encoding) {
            (Samples::U8(t), Encoding::Srgb) => {
                let ([r, g, b, a], table) = (rgba(&t[at], u8::MAX), &*SRGB_8);
                let c = |v: u8| table[usize::from(v)];
                Vec4::new(c(r), c(g), c(b), f32::from(a) / 255.0)
            }
            (Samples::U8(t), Encoding::Linear) => {
                Vec4::from_array(rgba(&t[at], u8::MAX).map(|v| f32::from(v) / 255.0))
            }
            (Samples::U16(t), Encoding::Srgb) => {
                let ([r, g, b, a], table) = (rgba(&t[at], u16::MAX), &*SRGB_16);
                let c = |v: u16| table[usize::from(v)];
                Vec4::new(c(r), c(g), c(b), f32::from(a) / 65535.0)
            }
            (Samples::U16(t), Encoding::Linear) => {
                Vec4::from_array(rgba(&t[at], u16::MAX).map(|v| f32::from(v) / 65535.0))
            }
            (Samples::F32(t), _) => Vec4::from_array(rgba(&t[at], 1.0)),
        }
    }

    /// The image at half the width and height, at least 1: means of linear values.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mean = |i: usize| {
            let (x, y) = (i % width * 2, i / width * 2);
            let at = |x: usize, y: usize| {
                self.decoded(y.min(self.height - 1) * self.width + x.min(self.width - 1))
            };
            (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0
        };
        let encoded = |i: usize| {
            let m = mean(i);
            // Ties, which sums of four make, are rounded to even: rounded up they would brighten.
            match self.encoding {
                Encoding::Linear => m,
                Encoding::Srgb => m.truncate().map(srgb_encode).extend(m.w),
            }
        };
        // The channels that are kept, of four.
        let kept: &[usize] = match self.channels {
            1 => &[0],
            2 => &[0, 3],
            3 => &[0, 1, 2],
            _ => &[0, 1, 2, 3],
        };
        let n = width * height;
        let texels = match &self.texels {
            Samples::U8(_) => {
                let texel = |i| (encoded(i) * 255.0).to_array().map(|v| v.round_ties_even() as u8);
                Samples::U8((0..n).flat_map(|i| selected(texel(i), kept)).collect())
            }
            Samples::U16(_) => {
                let texel = |i| (encoded(i) * 65535.0).to_array().map(|v| v.round_ties_even() as u16);
                Samples::U16((0..n).flat_map(|i| selected(texel(i), kept)).collect())
            }
            Samples::F32(_) => {
                Samples::F32((0..n).flat_map(|i| selected(mean(i).to_array(), kept)).collect())
            }
        };
        Self::new(self.name.clone(), [width, height], self.encoding, self.channels, texels)
    }

    /// The image halved until it is of `size`.
    fn halved_to(image: Arc<Self>, size: [usize; 2]) -> Arc<Self> {
        let mut image = image;
        while [image.width, image.height] != size && image.width * image.height > 1 {
            image = Arc::new(image.halved());
        }
        image
    }

    fn reduction(&self, [width, height]: [usize; 2], budget: u64) -> String {
        let allowed = budget >> 20;
        format!(
            "{}: reduced from {width} x {height} to {} x {} texels: the textures of a scene may occupy \
             {allowed} MiB",
            self.name, self.width, self.height
        )
    }
}

fn selected<T: Copy>(texel: [T; 4], kept: &[usize]) -> impl Iterator<Item = T> {
    kept.iter().map(move |&c| texel[c])
}

/// The four texels that bilinear filtering mixes at a point.
struct Footprint {
    /// Top left, top right, bottom left, bottom right.
    texels: [Vec4; 4],
    /// Position of the point between them, from the left and from the top, in [0, 1).
    at: Vec2,
}

impl Texture {
    /// A texture of the given width and height whose texels have 1 to 4 interleaved channels: grey,
    /// grey and alpha, RGB, or RGB and alpha.
    ///
    /// # Panics
    /// When the samples do not fill the size.
    #[must_use]
    pub fn from_samples(size: [usize; 2], channels: usize, texels: Samples, encoding: Encoding) -> Self {
        assert!(
            (1..=4).contains(&channels) && texels.len() == size[0] * size[1] * channels && !texels.is_empty(),
            "the samples must fill the image"
        );
        let image = Image::new("image".into(), size, encoding, channels, texels);
        Self { image: Arc::new(image), transform: Affine2::IDENTITY, wrap: [Wrap::Repeat; 2] }
    }

    /// The same image where the surface's texture coordinates (v up) pass
    /// through `transform` first.
    #[must_use]
    pub fn transformed(&self, transform: Affine2) -> Self {
        Self { transform: transform * self.transform, ..self.clone() }
    }

    /// The same image with other surroundings, across and down.
    #[must_use]
    pub fn wrapped(&self, wrap: [Wrap; 2]) -> Self {
        Self { wrap, ..self.clone() }
    }

    /// What lies beyond the edges of the image, across and down.
    #[must_use]
    pub fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }

    /// Maps texture coordinates of the surface to those of the image, v up.
    #[must_use]
    pub fn transform(&self) -> Affine2 {
        self.transform
    }

    /// Linear colour at `uv` (v up, as in OBJ).
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Rgb {
        self.sample_rgba(uv).truncate()
    }

    /// Linear colour and alpha at `uv` (v up, as in OBJ).
    #[must_use]
    pub fn sample_rgba(&self, uv: Vec2) -> Vec4 {
        let Footprint { texels: [a, b, c, d], at } = self.footprint(uv);
        a.lerp(b, at.x).lerp(c.lerp(d, at.x), at.y)
    }

    /// Derivatives of the linear values by u and by v (up) of the surface.
    #[must_use]
    pub fn gradient(&self, uv: Vec2) -> [Vec4; 2] {
        let Footprint { texels: [a, b, c, d], at } = self.footprint(uv);
        let du = (b - a).lerp(d - c, at.y) * self.image.width as f32;
        let dv = (a - c).lerp(b - d, at.x) * self.image.height as f32;
        let m = self.transform.matrix2;
        [du * m.x_axis.x + dv * m.x_axis.y, du * m.y_axis.x + dv * m.y_axis.y]
    }

    fn footprint(&self, uv: Vec2) -> Footprint {
        let Image { width, height, .. } = *self.image;
        let uv = self.transform.transform_point2(uv);
        let x = uv.x * width as f32 - 0.5;
        let y = (1.0 - uv.y) * height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let [across, down] = self.wrap;
        let (left, right) = (across.texel(x0 as i64, width), across.texel((x0 + 1.0) as i64, width));
        let (top, bottom) = (down.texel(y0 as i64, height), down.texel((y0 + 1.0) as i64, height));
        let (top, bottom) = (top * width, bottom * width);
        Footprint {
            texels: [top + left, top + right, bottom + left, bottom + right].map(|i| self.image.decoded(i)),
            at: Vec2::new(x - x0, y - y0),
        }
    }

    /// What the texels occupy, bytes.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.image.extent().bytes()
    }

    /// Width and height, texels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.image.width, self.image.height]
    }

    /// Linear colour and alpha of a texel, counted from the top left.
    #[must_use]
    pub fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        self.image.decoded(y * self.image.width + x).to_array()
    }

    /// Largest colour channel of any texel.
    #[must_use]
    pub fn max_component(&self) -> f32 {
        self.image.range[1].truncate().max_element()
    }

    /// Smallest and largest value of each channel of any texel.
    #[must_use]
    pub fn range(&self) -> [Vec4; 2] {
        self.image.range
    }
}

/// Halves images by a box filter, the largest first, until all together occupy
/// at most `budget` bytes; says which. Textures that share an image still do.
pub fn fit(textures: &mut [&mut Arc<Texture>], budget: u64) -> Vec<String> {
    let mut images: Vec<Arc<Image>> = Vec::new();
    let mut ids: HashMap<*const Image, usize> = HashMap::new();
    let of: Vec<usize> = textures
        .iter()
        .map(|t| {
            *ids.entry(Arc::as_ptr(&t.image)).or_insert_with(|| {
                images.push(t.image.clone());
                images.len() - 1
            })
        })
        .collect();
    let extents: Vec<Extent> = images.iter().map(|i| i.extent()).collect();
    let fitting = fitting(extents.clone(), budget);
    let images: Vec<Arc<Image>> =
        images.into_iter().zip(&fitting).map(|(image, to)| Image::halved_to(image, to.size)).collect();
    for (texture, &i) in textures.iter_mut().zip(&of) {
        if !Arc::ptr_eq(&texture.image, &images[i]) {
            let image = images[i].clone();
            **texture = Arc::new(Texture { image, ..texture.as_ref().clone() });
        }
    }
    let reduced = images.iter().zip(&extents).filter(|(i, from)| i.extent() != **from);
    reduced.map(|(i, from)| i.reduction(from.size, budget)).collect()
}

/// The extents when the largest are halved, first of equals first, until all together take at
/// most `budget` bytes.
fn fitting(mut extents: Vec<Extent>, budget: u64) -> Vec<Extent> {
    while extents.iter().map(|e| e.bytes()).sum::<u64>() > budget {
        // The first of the largest: the result does not depend on anything else.
        let largest = extents.iter_mut().rev().max_by_key(|e| e.bytes());
        let Some(extent) = largest.filter(|e| e.size != [1, 1]) else { break };
        *extent = extent.halved();
    }
    extents
}

/// Decoded 8-bit values.
static SRGB_8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| srgb_decode(i as f32 / 255.0)));

/// Decoded 16-bit values.
static SRGB_16: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..=u16::MAX).map(|i| srgb_decode(f32::from(i) / 65535.0)).collect());

/// Inverse of the sRGB transfer function, IEC 61966-2-1.
fn srgb_decode(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB transfer function, IEC 61966-2-1.
fn srgb_encode(v: f32) -> f32 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(width: u32, height: u32) -> image::RgbaImage {
        image::RgbaImage::from_fn(width, height, |x, y| {
            image::Rgba((crate::math::hash::mix64(u64::from(y * width + x)) as u32).to_be_bytes())
        })
    }

    fn texture(image: image::RgbaImage, encoding: Encoding) -> Arc<Texture> {
        let size = [image.width() as usize, image.height() as usize];
        Arc::new(Texture::from_samples(size, 4, Samples::U8(image.into_raw()), encoding))
    }

    #[test]
    fn bits_of_a_texel_do_not_matter() {
        let image = noise(5, 3);
        let wide = image::DynamicImage::ImageRgba8(image.clone()).into_rgba16();
        for encoding in [Encoding::Srgb, Encoding::Linear] {
            let a = texture(image.clone(), encoding);
            let samples = Samples::U16(wide.as_raw().clone());
            let b = Texture::from_samples([5, 3], 4, samples, encoding);
            for i in 0..100 {
                let uv = Vec2::new(i as f32 * 0.37 - 9.0, i as f32 * 0.23 - 7.0);
                assert!((a.sample_rgba(uv) - b.sample_rgba(uv)).abs().max_element() < 1e-6);
            }
        }
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_samples_under_any_transform() {
        let turned = Affine2::from_scale_angle_translation(Vec2::new(2.0, -0.5), 0.6, Vec2::new(0.3, 0.1));
        let plain = texture(noise(7, 4), Encoding::Linear);
        let h = 1e-3;
        for t in [plain.as_ref().clone(), plain.transformed(turned)] {
            let mut n = 0;
            for i in 0..400 {
                let uv = Vec2::new(i as f32 * 0.377 % 1.0, i as f32 * 0.233 % 1.0);
                for (k, step) in [Vec2::X * h, Vec2::Y * h].into_iter().enumerate() {
                    let (a, b, c) = (t.sample_rgba(uv - step), t.sample_rgba(uv), t.sample_rgba(uv + step));
                    // Not across the edge between two bilinear patches.
                    if (a + c - 2.0 * b).abs().max_element() > 1e-4 {
                        continue;
                    }
                    n += 1;
                    let slope = (c - a) / (2.0 * h);
                    let error = (t.gradient(uv)[k] - slope).abs().max_element();
                    assert!(error < 0.06, "{uv} {slope} {}", t.gradient(uv)[k]);
                }
            }
            assert!(n > 400, "{n}");
        }
    }

    #[test]
    fn what_lies_beyond_the_edges_is_as_each_axis_says() {
        // Texel x + 10 y, in red, of 4 × 3 texels.
        let numbers = image::RgbaImage::from_fn(4, 3, |x, y| image::Rgba([(x + 10 * y) as u8, 0, 0, 255]));
        let plain = texture(numbers, Encoding::Linear);
        let at = |wrap: [Wrap; 2], x: i32, y: i32| {
            let uv = Vec2::new((x as f32 + 0.5) / 4.0, 1.0 - (y as f32 + 0.5) / 3.0);
            (plain.wrapped(wrap).sample(uv).x * 255.0).round()
        };
        let row = |across: Wrap| (-5..9).map(|x| at([across, Wrap::Repeat], x, 0)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [3., 0., 1., 2., 3., 0., 1., 2., 3., 0., 1., 2., 3., 0.]);
        assert_eq!(row(Wrap::Clamp), [0., 0., 0., 0., 0., 0., 1., 2., 3., 3., 3., 3., 3., 3.]);
        assert_eq!(row(Wrap::Mirror), [3., 3., 2., 1., 0., 0., 1., 2., 3., 3., 2., 1., 0., 0.]);
        let column = |down: Wrap| (-2..5).map(|y| at([Wrap::Repeat, down], 5, y) - 1.0).collect::<Vec<_>>();
        assert_eq!(column(Wrap::Repeat), [10., 20., 0., 10., 20., 0., 10.]);
        assert_eq!(column(Wrap::Clamp), [0., 0., 0., 10., 20., 20., 20.]);
        assert_eq!(column(Wrap::Mirror), [10., 0., 0., 10., 20., 20., 10.]);
        // Half a texel beyond a clamped edge nothing is mixed in from the other side.
        let edge = plain.wrapped([Wrap::Clamp; 2]).sample(Vec2::new(1.0, 0.5));
        assert!((edge.x * 255.0 - 13.0).abs() < 1e-4, "{edge}");
    }

    #[test]
    fn images_are_halved_until_they_fit_and_keep_their_linear_mean() {
        let (mut big, mut small) =
            (texture(noise(64, 32), Encoding::Srgb), texture(noise(8, 8), Encoding::Srgb));
        let mut shared = Arc::new(big.transformed(Affine2::from_scale(Vec2::splat(2.0))));
        let before = big.clone();
        let bytes = |w: u64, h: u64| 4 * w * h;
        let warnings = fit(&mut [&mut big, &mut small, &mut shared], bytes(16, 8) + bytes(8, 8));
        assert_eq!((big.size(), small.size(), shared.size()), ([16, 8], [8, 8], [16, 8]));
        assert!(Arc::ptr_eq(&big.image, &shared.image) && shared.transform != big.transform);
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("from 64 x 32 to 16 x 8"), "{warnings:?}");
        let mean = |t: &Texture| {
            let [w, h] = t.size();
            (0..w * h).map(|i| Vec4::from_array(t.texel(i % w, i / w))).sum::<Vec4>() / (w * h) as f32
        };
        // Rounded to 8 bits twice: at most half a step of the encoding each, and at random.
        let error = (mean(&before) - mean(&big)).abs().max_element();
        assert!(error < 1e-3, "{error}");
        assert!(fit(&mut [&mut big, &mut small, &mut shared], 1 << 20).is_empty());
    }
}
