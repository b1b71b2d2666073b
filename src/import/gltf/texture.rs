//! Images of materials and where they lie.

use std::{collections::HashMap, error::Error, iter, sync::Arc};

use glam::Vec2;
use gltf_json::{
    Image, Index, Texture as TextureJson,
    extensions::texture::TextureTransform,
    material::NormalTexture,
    texture::{Info, WrappingMode},
    validation::Checked,
};

use super::file::File;
use crate::{
    files::reach::MAX_PICTURE_BYTES,
    import::{error::ImportError, range, warnings::Warnings},
    math::Rgb,
    scene::texture::{Encoding, Texture, TextureLoader, Wrap},
};

/// Mapping from a mesh's texture coordinates to those of an image, both with v down:
/// `KHR_texture_transform`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMapping {
    /// Index of the set of texture coordinates, `TEXCOORD_n`.
    pub set: u32,
    offset: Vec2,
    /// Rotation in the image, counter-clockwise, radians.
    rotation: f32,
    scale: Vec2,
}

impl UvMapping {
    /// Coordinates in the image at `uv` of the mesh.
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let s = self.scale * uv;
        self.offset + Vec2::new(cos * s.x + sin * s.y, cos * s.y - sin * s.x)
    }
}

/// A material while it is read.
pub struct MaterialContext<'w> {
    /// Index in the file's list of materials.
    pub index: usize,
    /// Unique name.
    pub name: String,
    /// Mapping of the first image, which serves all; `None` before there is one.
    pub mapping: Option<UvMapping>,
    warnings: &'w mut Warnings,
}

impl<'w> MaterialContext<'w> {
    /// The context of a material without images so far.
    pub fn new(index: usize, name: String, warnings: &'w mut Warnings) -> Self {
        Self { index, name, mapping: None, warnings }
    }

    /// Adds a warning that names the material.
    pub fn warn(&mut self, message: impl std::fmt::Display) {
        self.warnings.about("material", &self.name, message.to_string());
    }

    /// The number at `key` of the material in its range; what is not in it is said.
    pub fn number(&mut self, key: &str, value: f32, range: [f32; 2]) -> f32 {
        range::clamped(key, value, range, |message| self.warn(message))
    }

    /// The colour at `key` of the material in its range; what is not in it is said.
    pub fn color(&mut self, key: &str, color: [f32; 3], range: [f32; 2]) -> Rgb {
        range::clamped_color(key, color, range, |message| self.warn(message))
    }
}

/// Reference of a material to a texture.
pub struct TextureRef<'a> {
    index: Index<TextureJson>,
    set: u32,
    transform: Option<TextureTransform>,
    /// Key of the reference within its material.
    key: &'a str,
}

impl<'a> TextureRef<'a> {
    /// The reference `info` at `key` of its material.
    pub fn new(key: &'a str, info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Self { index: info.index, set: info.tex_coord, transform, key }
    }

    /// The reference to a normal map at `key` of its material.
    pub fn normal(key: &'a str, normal: &NormalTexture) -> Self {
        let transform = normal.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
        let transform = transform.and_then(|t| serde_json::from_value(t.clone()).ok());
        Self { index: normal.index, set: normal.tex_coord, transform, key }
    }

    fn mapping(&self) -> UvMapping {
        let t = self.transform.clone().unwrap_or_default();
        UvMapping {
            set: t.tex_coord.unwrap_or(self.set),
            offset: t.offset.0.into(),
            rotation: t.rotation.0,
            scale: t.scale.0.into(),
        }
    }
}

/// The images of a file, each read once an encoding.
pub struct Textures<'a> {
    file: &'a File,
    read: HashMap<(usize, Encoding), Arc<Texture>>,
    loader: TextureLoader,
}

impl<'a> Textures<'a> {
    /// The images of `file`, none of them read yet.
    pub fn new(file: &'a File) -> Self {
        Self { file, read: HashMap::new(), loader: TextureLoader::default() }
    }

    /// The image that a material refers to. The first of a material decides where all lie; one that
    /// should lie elsewhere is warned about.
    ///
    /// # Errors
    /// When the texture, its sampler or its image does not exist or cannot be decoded.
    pub fn get(
        &mut self,
        reference: &TextureRef,
        encoding: Encoding,
        material: &mut MaterialContext,
    ) -> Result<Arc<Texture>, ImportError> {
        let key = format!("materials[{}].{}", material.index, reference.key);
        let texture = self.file.get(&key, reference.index)?;
        let wrap = self.wrap(reference.index, texture)?;
        let mapping = reference.mapping();
        if *material.mapping.get_or_insert(mapping) != mapping {
            material.warn(format_args!(
                "`{}` is laid out as the first of its images, not by its own coordinates",
                reference.key
            ));
        }
        let key = format!("textures[{}].source", reference.index.value());
        let source = source(texture)
            .ok_or_else(|| self.file.error(&key, "is missing: it must be a PNG, JPEG or WebP image"))?;
        let image = match self.read.get(&(source.value(), encoding)) {
            Some(image) => image.clone(),
            None => {
                let role = format!("`{}` of material `{}`", reference.key, material.name);
                let image = Arc::new(self.load(&key, source, encoding, &role)?);
                self.loader.notes.drain(..).for_each(|note| material.warnings.add(note));
                self.read.insert((source.value(), encoding), image.clone());
                image
            }
        };
        Ok(if image.wrap() == wrap { image } else { Arc::new(image.wrapped(wrap)) })
    }

    /// What lies beyond the edges across and down; images repeat where the file does not say.
    fn wrap(&self, index: Index<TextureJson>, texture: &TextureJson) -> Result<[Wrap; 2], ImportError> {
        let Some(sampler) = texture.sampler else { return Ok([Wrap::Repeat; 2]) };
        let sampler = self.file.get(&format!("textures[{}].sampler", index.value()), sampler)?;
        Ok([&sampler.wrap_s, &sampler.wrap_t].map(|w| match w {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
        }))
    }

    fn load(
        &mut self,
        key: &str,
        index: Index<Image>,
        encoding: Encoding,
        role: &str,
    ) -> Result<Texture, ImportError> {
        let file = self.file;
        let image = file.get(key, index)?;
        let key = format!("images[{}]", index.value());
        let data;
        let bytes = if let Some(view) = image.buffer_view {
            file.view(&key, view)?
        } else if let Some(uri) = &image.uri {
            match file.data_uri(&key, uri) {
                Some(found) => {
                    data = found?;
                    &data
                }
                None => {
                    let path = file.path_of(&key, uri)?;
                    match file.reach.check(&path, MAX_PICTURE_BYTES) {
                        Err(e) if !e.is_missing() => return Err(file.unread(&key, e)),
                        _ => return Ok(self.loader.load_raw(&path, encoding, role)?),
                    }
                }
            }
        } else {
            return Err(file.error(key, "needs `uri` or `bufferView`"));
        };
        let name = format!("{}: {key}", file.path.display());
        self.loader.decode(bytes, encoding, name).map_err(|fault| {
            let causes: String =
                iter::successors(fault.source(), |&e| e.source()).map(|e| format!(": {e}")).collect();
            file.error(key, format!("cannot be decoded: {fault}{causes}"))
        })
    }
}

/// The image of a texture; with `EXT_texture_webp` that of the extension where there is no other.
fn source(texture: &TextureJson) -> Option<Index<Image>> {
    // gltf-json reads an absent `source` as the largest index.
    let plain = Some(texture.source).filter(|s| s.value() != u32::MAX as usize);
    plain.or_else(|| {
        let extension = texture.extensions.as_ref()?.others.get("EXT_texture_webp")?;
        Some(Index::new(u32::try_from(extension["source"].as_u64()?).ok()?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_turn_as_the_extension_says() {
        let mapping = UvMapping {
            set: 0,
            offset: Vec2::new(0.5, 0.25),
            rotation: std::f32::consts::FRAC_PI_2,
            scale: Vec2::new(2.0, 3.0),
        };
        // A quarter turn counter-clockwise, v down: right becomes up, down becomes right.
        assert!((mapping.apply(Vec2::X) - Vec2::new(0.5, -1.75)).length() < 1e-6);
        assert!((mapping.apply(Vec2::Y) - Vec2::new(3.5, 0.25)).length() < 1e-6);
    }
}
