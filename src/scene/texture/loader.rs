//! Images of files as textures.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Affine2;

use super::{Encoding, Extent, Image, TEXTURE_BUDGET, Texture, Wrap, fitting};
use crate::picture::{Alpha, Fault, Picture, PictureError, Purpose, Reading, Samples, Transfer, budget};

/// A texture could not be loaded.
#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot read the texture ({role})", path = path.display())]
pub struct TextureError {
    path: PathBuf,
    role: String,
    source: Fault,
}

/// Loads the images of a scene one by one. Each is reduced at once as far as those before it make
/// necessary, so that in all no more than twice [`TEXTURE_BUDGET`] is kept before
/// [`super::fit`] has the last word.
#[derive(Debug, Default)]
pub struct TextureLoader {
    /// Textures loaded so far, as their files have them.
    extents: Vec<Extent>,
    /// Facts about images that a user should hear of.
    pub notes: Vec<String>,
}

impl TextureLoader {
    /// Reads an image file. `role` says in messages what the image is for.
    ///
    /// # Errors
    /// When the file is missing, not an image, or larger than a picture may be.
    pub fn load(&mut self, path: &Path, encoding: Encoding, role: &str) -> Result<Texture, TextureError> {
        let purpose = match encoding {
            Encoding::Srgb => Purpose::Texture,
            Encoding::Linear => Purpose::RawTexture,
        };
        self.load_for(path, encoding, purpose, role)
    }

    /// As [`Self::load`], but what the file says about its colours does not count, as glTF wants
    /// it.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_raw(&mut self, path: &Path, encoding: Encoding, role: &str) -> Result<Texture, TextureError> {
        self.load_for(path, encoding, Purpose::RawTexture, role)
    }

    fn load_for(
        &mut self,
        path: &Path,
        encoding: Encoding,
        purpose: Purpose,
        role: &str,
    ) -> Result<Texture, TextureError> {
        let error = |source| TextureError { path: path.into(), role: role.into(), source };
        let picture =
            Picture::read(path, &Reading::of(purpose)).map_err(|PictureError { fault, .. }| error(fault))?;
        self.texture(picture, encoding, path.display().to_string()).map_err(error)
    }

    /// The image of a file's content, called `name` in messages; what it says about its colours
    /// does not count.
    ///
    /// # Errors
    /// When it is not an image, or larger than a picture may be.
    pub fn decode(&mut self, bytes: &[u8], encoding: Encoding, name: String) -> Result<Texture, Fault> {
        self.texture(Picture::decode(bytes, &Reading::of(Purpose::RawTexture))?, encoding, name)
    }

    fn texture(&mut self, picture: Picture, encoding: Encoding, name: String) -> Result<Texture, Fault> {
        self.notes.extend(picture.notes.iter().map(|note| format!("{name}: {note}")));
        let size = [picture.width, picture.height];
        let channels = picture.channels;
        let (mut texels, encoding) = texels(picture, encoding)?;
        if let Samples::F32(values) = &mut texels {
            for note in sanitised(values, channels, size[0]).into_iter().flatten() {
                self.notes.push(format!("{name}: {note}"));
            }
        }
        let mut image = Arc::new(Image::new(name, size, encoding, channels, texels));
        self.extents.push(image.extent());
        let fitting = fitting(self.extents.clone(), TEXTURE_BUDGET);
        if let Some(to) = fitting.last().filter(|to| to.size != size) {
            image = Image::halved_to(image, to.size);
            self.notes.push(image.reduction(size, TEXTURE_BUDGET));
        }
        Ok(Texture { image, transform: Affine2::IDENTITY, wrap: [Wrap::Repeat; 2] })
    }
}

/// The texels of a picture, as stored where a texture can decode them, else linear.
fn texels(picture: Picture, encoding: Encoding) -> Result<(Samples, Encoding), Fault> {
    let is_straight = picture.alpha == Alpha::Straight || !picture.has_alpha();
    let is_float = matches!(picture.samples, Samples::F32(_));
    let expected = if is_float { Transfer::Linear } else { Transfer::Srgb };
    let is_known = picture.colour.is_plain() && picture.colour.transfer == expected && is_straight;
    if encoding == Encoding::Linear || is_known {
        let encoding = if is_float { Encoding::Linear } else { encoding };
        return Ok((picture.samples, encoding));
    }
    let channels = picture.channels;
    let size = [picture.width as u64, picture.height as u64];
    let per_pixel = channels * (picture.samples.width() + size_of::<f32>());
    budget::check(size, per_pixel as u64)?;
    let mut linear = Vec::with_capacity(picture.samples.len());
    for i in 0..picture.n_pixels() {
        let [r, g, b, a] = picture.straight(i);
        match channels {
            1 => linear.push(r),
            2 => linear.extend([r, a]),
            3 => linear.extend([r, g, b]),
            _ => linear.extend([r, g, b, a]),
        }
    }
    Ok((Samples::F32(linear), Encoding::Linear))
}

/// Puts 0 in the place of numbers that no material can have; says how many are not finite and how
/// many negative, and where the first is.
fn sanitised(values: &mut [f32], channels: usize, width: usize) -> [Option<String>; 2] {
    let mut strange: [(usize, Option<(usize, f32)>); 2] = [(0, None); 2];
    for (i, v) in values.iter_mut().enumerate() {
        let kind = match *v {
            v if !v.is_finite() => 0,
            v if v < 0.0 => 1,
            _ => continue,
        };
        strange[kind].0 += 1;
        strange[kind].1.get_or_insert((i / channels, *v));
        *v = 0.0;
    }
    let note = |what: &str, (count, first): (usize, Option<(usize, f32)>)| {
        let (pixel, value) = first?;
        let number = if count == 1 { "number is" } else { "numbers are" };
        let (x, y) = (pixel % width, pixel / width);
        Some(format!("{count} {number} {what} and read as 0; the first, {value}, is at column {x}, row {y}"))
    };
    [note("not finite", strange[0]), note("negative", strange[1])]
}
