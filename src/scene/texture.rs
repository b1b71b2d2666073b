//! Image textures.

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use crate::math::Rgb;

/// A texture could not be loaded.
#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot read the texture (`map_Kd` of material `{material}`)", path = path.display())]
pub struct TextureError {
    path: PathBuf,
    material: String,
    source: image::ImageError,
}

/// An RGB image with repeat addressing and bilinear filtering, decoded from
/// sRGB to linear.
#[derive(Clone, Debug)]
pub struct Texture {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

impl Texture {
    /// Reads an image file: BMP, HDR, JPEG, PNG, TGA, TIFF or WebP. 8- and
    /// 16-bit images are taken to be sRGB-encoded. `material` is for messages.
    ///
    /// # Errors
    /// When the file is missing or not an image.
    pub fn load(path: &Path, material: &str) -> Result<Self, TextureError> {
        let image = Self::decode(path).map_err(|source| TextureError {
            path: path.into(),
            material: material.into(),
            source,
        })?;
        let is_linear = matches!(image.color(), image::ColorType::Rgb32F | image::ColorType::Rgba32F);
        let rgb = image.into_rgb32f();
        let (width, height) = (rgb.width() as usize, rgb.height() as usize);
        let decode = |v: f32| if is_linear { v } else { srgb_decode(v) };
        let texels = rgb.pixels().map(|p| p.0.map(decode)).collect();
        Ok(Self { width, height, texels })
    }

    /// By content, else by extension.
    fn decode(path: &Path) -> Result<image::DynamicImage, image::ImageError> {
        let image = image::ImageReader::open(path)?.with_guessed_format()?.decode()?;
        if image.width() == 0 || image.height() == 0 {
            let empty = std::io::Error::new(std::io::ErrorKind::InvalidData, "the image has no pixels");
            return Err(image::ImageError::IoError(empty));
        }
        Ok(image)
    }

    /// Linear value at `uv` (v up, as in OBJ).
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Rgb {
        let x = uv.x * self.width as f32 - 0.5;
        let y = (1.0 - uv.y) * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let texel = |x: f32, y: f32| {
            let wrap = |v: f32, n: usize| (v as i64).rem_euclid(n as i64) as usize;
            Vec3::from_array(self.texels[wrap(y, self.height) * self.width + wrap(x, self.width)])
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

    /// Linear values, row-major from the top left.
    #[must_use]
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Largest channel of any texel.
    #[must_use]
    pub fn max_component(&self) -> f32 {
        self.texels.iter().flatten().fold(0.0, |m, &v| m.max(v))
    }
}

/// Inverse of the sRGB transfer function, IEC 61966-2-1.
fn srgb_decode(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
