//! Pictures of surroundings.

use std::path::{Path, PathBuf};

use glam::Vec3;

use crate::{
    film::image_file::LinearImage,
    light::RadianceMap,
    picture::{Picture, PictureError, Purpose, Reading},
};

/// Widest picture of surroundings that is not reduced, texels. Memory against sharpness: 4096 × 2048
/// texels take 96 MiB, and the sun (0.53°) is 6 texels wide.
pub const MAX_MAP_WIDTH: usize = 4096;

/// A picture is not one of surroundings.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum MapError {
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error("{path}: {message}", path = path.display())]
    Values { path: PathBuf, message: String },
}

/// Reads a map of radiance in all directions, with 0 for negative values, halved until it is at most `most_wide`
/// texels wide or a side is odd; returns it with what is worth a warning besides, each with the path.
///
/// # Errors
/// When the picture cannot be read, or holds values that are no radiance.
pub fn read(path: &Path, most_wide: usize) -> Result<(RadianceMap, Vec<String>), MapError> {
    let reading = Reading { kept: LinearImage::PIXEL, ..Reading::of(Purpose::Light) };
    let picture = Picture::read(path, &reading)?;
    let wrong = |message: String| MapError::Values { path: path.into(), message };
    let mut image = LinearImage::of(&picture);
    let negative = image.make_radiance().map_err(|bad| wrong(bad.to_string()))?;
    let notes = picture.notes.iter().map(ToString::to_string).chain(negative);
    let mut warnings: Vec<String> = notes.map(|note| format!("{}: {note}", path.display())).collect();
    drop(picture);
    let LinearImage { mut width, mut height, rgb: mut texels } = image;
    let original = width;
    while width > most_wide && width % 2 == 0 && height % 2 == 0 {
        texels = halve(&texels, width);
        (width, height) = (width / 2, height / 2);
    }
    if width != original {
        warnings.push(format!("{}: reduced to {width} x {height} pixels", path.display()));
    }
    let map = RadianceMap::new(width, height, texels);
    Ok((map.ok_or_else(|| wrong("needs values >= 0, not all 0".into()))?, warnings))
}

/// An image of half the width and height, both even: means over 2 × 2 pixels.
fn halve(texels: &[[f32; 3]], width: usize) -> Vec<[f32; 3]> {
    let height = texels.len() / width;
    let at = |x: usize, y: usize| Vec3::from_array(texels[y * width + x]);
    (0..height / 2 * (width / 2))
        .map(|i| {
            let (x, y) = (2 * (i % (width / 2)), 2 * (i / (width / 2)));
            ((at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0).to_array()
        })
        .collect()
}
