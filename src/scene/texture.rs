//! Image textures.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{Vec2, Vec4};

use crate::math::Rgb;

/// A texture could not be loaded.
#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot read the texture ({role})", path = path.display())]
pub struct TextureError {
    path: PathBuf,
    role: String,
    source: image::ImageError,
}

/// What the numbers of an 8- or 16-bit image mean; floating-point images are linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// sRGB-encoded colour; alpha is linear.
    Srgb,
    /// Plain numbers: roughness, normals, opacity.
    Linear,
}

/// An RGBA image with repeat addressing and bilinear filtering of linear values.
#[derive(Clone, Debug)]
pub struct Texture {
    width: usize,
    height: usize,
    texels: Vec<[f32; 4]>,
}

/// The numbers of one channel of an image.
#[derive(Clone, Debug)]
pub struct ScalarMap {
    /// The image.
    pub texture: Arc<Texture>,
    /// Which channel.
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
}

impl Texture {
    /// Reads an image file: BMP, HDR, JPEG, PNG, TGA, TIFF or WebP. `role` says
    /// in messages what the image is for.
    ///
    /// # Errors
    /// When the file is missing or not an image.
    pub fn load(path: &Path, encoding: Encoding, role: &str) -> Result<Self, TextureError> {
        let error = |source| TextureError { path: path.into(), role: role.into(), source };
        let image = image::ImageReader::open(path)
            .and_then(image::ImageReader::with_guessed_format)
            .map_err(image::ImageError::IoError)
            .and_then(image::ImageReader::decode)
            .map_err(error)?;
        Self::from_image(image, encoding).map_err(error)
    }

    /// A texture of a decoded image.
    ///
    /// # Errors
    /// When it has no pixels.
    pub fn from_image(image: image::DynamicImage, encoding: Encoding) -> Result<Self, image::ImageError> {
        if image.width() == 0 || image.height() == 0 {
            let empty = std::io::Error::new(std::io::ErrorKind::InvalidData, "the image has no pixels");
            return Err(image::ImageError::IoError(empty));
        }
        let is_float = matches!(image.color(), image::ColorType::Rgb32F | image::ColorType::Rgba32F);
        let decode = |v: f32| if is_float || encoding == Encoding::Linear { v } else { srgb_decode(v) };
        let rgba = image.into_rgba32f();
        let (width, height) = (rgba.width() as usize, rgba.height() as usize);
        let texels = rgba.pixels().map(|p| [decode(p[0]), decode(p[1]), decode(p[2]), p[3]]).collect();
        Ok(Self { width, height, texels })
    }

    /// Linear colour at `uv` (v up, as in OBJ).
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Rgb {
        self.sample_rgba(uv).truncate()
    }

    /// Linear colour and alpha at `uv` (v up, as in OBJ).
    #[must_use]
    pub fn sample_rgba(&self, uv: Vec2) -> Vec4 {
        let x = uv.x * self.width as f32 - 0.5;
        let y = (1.0 - uv.y) * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let texel = |x: f32, y: f32| {
            let wrap = |v: f32, n: usize| (v as i64).rem_euclid(n as i64) as usize;
            Vec4::from_array(self.texels[wrap(y, self.height) * self.width + wrap(x, self.width)])
        };
        let top = texel(x0, y0).lerp(texel(x0 + 1.0, y0), fx);
        let bottom = texel(x0, y0 + 1.0).lerp(texel(x0 + 1.0, y0 + 1.0), fx);
        top.lerp(bottom, fy)
    }

    /// Width and height, texels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Linear colour and alpha of a texel, counted from the top left.
    #[must_use]
    pub fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        self.texels[y * self.width + x]
    }

    /// Largest colour channel of any texel.
    #[must_use]
    pub fn max_component(&self) -> f32 {
        self.texels.iter().flat_map(|t| &t[..3]).fold(0.0, |m, &v| m.max(v))
    }
}

/// Inverse of the sRGB transfer function, IEC 61966-2-1.
fn srgb_decode(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
