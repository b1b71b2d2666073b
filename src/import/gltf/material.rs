//! Materials and their images.

use std::{
    collections::{BTreeMap, HashMap},
    io::Cursor,
    sync::Arc,
};

use glam::Vec2;
use gltf_json::{
    Index, Material, Texture as TextureJson,
    extensions::{material::PbrSpecularGlossiness, texture::TextureTransform},
    material::{AlphaMode, NormalTexture},
    texture::{Info, WrappingMode},
    validation::Checked,
};

use super::{Notes, file::File, unique};
use crate::{
    import::ImportError,
    math::Rgb,
    scene::{
        material::{MaterialParams, Model, Relief},
        texture::{Channel, Encoding, ScalarMap, Texture},
    },
};

/// Name of the material of primitives without one.
const NO_NAME: &str = "(none)";
/// Transmission from which a material is glass.
const GLASS: f32 = 0.5;
/// Opacity of `MASK` that counts as opaque by default; glTF 2.0 section 5.19.
const DEFAULT_CUTOFF: f32 = 0.5;
/// IORs that a coat or glass may have.
const IORS: (f32, f32) = (1.001, 4.0);

/// Where on a surface an image lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Which texture coordinates.
    pub set: u32,
    offset: Vec2,
    rotation: f32,
    scale: Vec2,
    /// Whether the image repeats outside the unit square.
    pub repeats: bool,
}

impl Placement {
    /// Coordinates of an image at `uv`, both with v down.
    ///
    /// `KHR_texture_transform`; counter-clockwise in the image.
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let s = self.scale * uv;
        self.offset + Vec2::new(cos * s.x + sin * s.y, cos * s.y - sin * s.x)
    }
}

/// The materials that triangles use, read when they are first met.
pub struct Materials<'a> {
    file: &'a File,
    names: Vec<String>,
    ids: HashMap<Option<usize>, u32>,
    /// Names and parameters.
    pub list: Vec<(String, MaterialParams)>,
    placements: Vec<Option<Placement>>,
    textures: HashMap<(usize, Encoding), Arc<Texture>>,
    /// Extensions that were met and not read, with the materials.
    ignored: BTreeMap<String, Vec<String>>,
}

/// A use of an image.
struct Use<'a> {
    index: Index<TextureJson>,
    set: u32,
    transform: Option<TextureTransform>,
    /// Name of the reference within its material.
    key: &'a str,
}

impl<'a> Use<'a> {
    fn of_info(key: &'a str, info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Self { index: info.index, set: info.tex_coord, transform, key }
    }

    fn of_normal(key: &'a str, normal: &NormalTexture) -> Self {
        let transform = normal.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
        let transform = transform.and_then(|t| serde_json::from_value(t.clone()).ok());
        Self { index: normal.index, set: normal.tex_coord, transform, key }
    }
}

/// A material while it is read: its index, and where its images lie.
struct Reading<'n> {
    index: usize,
    name: String,
    placement: Option<Placement>,
    notes: &'n mut Notes,
}

impl<'a> Materials<'a> {
    /// None yet of a file.
    pub fn new(file: &'a File) -> Self {
        let mut names: Vec<String> = Vec::new();
        for (i, m) in file.root.materials.iter().enumerate() {
            let given = m.name.as_deref().map(str::trim).filter(|n| !n.is_empty());
            let name = given.map_or_else(|| format!("material_{i}"), str::to_owned);
            names.push(unique(name, &names));
        }
        Self {
            file,
            names,
            ids: HashMap::new(),
            list: Vec::new(),
            placements: Vec::new(),
            textures: HashMap::new(),
            ignored: BTreeMap::new(),
        }
    }

    /// Number of a material in [`Self::list`].
    ///
    /// # Errors
    /// When it does not exist or an image of it cannot be read.
    pub fn id(
        &mut self,
        key: &str,
        material: Option<Index<Material>>,
        notes: &mut Notes,
    ) -> Result<u32, ImportError> {
        let index = material.map(|m| m.value());
        if let Some(&id) = self.ids.get(&index) {
            return Ok(id);
        }
        let (name, params, placement) = match material {
            None => (NO_NAME.to_owned(), MaterialParams::default(), None),
            Some(m) => {
                let json = self.file.get(key, m)?;
                let name = self.names[m.value()].clone();
                let mut reading = Reading { index: m.value(), name: name.clone(), placement: None, notes };
                let params = self.params(json, &mut reading)?;
                (name, params, reading.placement)
            }
        };
        let id = self.list.len() as u32;
        self.list.push((name, params));
        self.placements.push(placement);
        self.ids.insert(index, id);
        Ok(id)
    }

    /// Where the images of a material lie; `None` when it has none.
    pub fn placement(&self, id: u32) -> Option<Placement> {
        self.placements[id as usize]
    }

    /// Says which extensions were not read.
    pub fn report(&self, notes: &mut Notes) {
        for (extension, materials) in &self.ignored {
            let names: Vec<String> = materials.iter().take(3).map(|n| format!("`{n}`")).collect();
            let more = if materials.len() > names.len() { ", …" } else { "" };
            notes.add(format!("{extension} of material {}{more} is ignored", names.join(", ")));
        }
    }

    fn params(&mut self, m: &Material, reading: &mut Reading) -> Result<MaterialParams, ImportError> {
        let pbr = &m.pbr_metallic_roughness;
        let extensions = m.extensions.as_ref();
        for extension in extensions.iter().flat_map(|e| e.others.keys()) {
            self.ignored.entry(extension.clone()).or_default().push(reading.name.clone());
        }
        let [r, g, b, alpha] = pbr.base_color_factor.0;
        let mut out = MaterialParams {
            model: Model::Plastic,
            base_color: Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE),
            roughness: pbr.roughness_factor.0.clamp(0.0, 1.0),
            metallic: pbr.metallic_factor.0.clamp(0.0, 1.0),
            opacity: alpha.clamp(0.0, 1.0),
            ..MaterialParams::default()
        };
        if let Some(info) = &pbr.base_color_texture {
            let used = Use::of_info("pbrMetallicRoughness.baseColorTexture", info);
            out.texture = Some(self.texture(&used, Encoding::Srgb, reading)?);
        }
        if let Some(info) = &pbr.metallic_roughness_texture {
            let used = Use::of_info("pbrMetallicRoughness.metallicRoughnessTexture", info);
            let texture = self.texture(&used, Encoding::Linear, reading)?;
            let channel = |channel| Some(ScalarMap { texture: texture.clone(), channel });
            out.roughness_map = channel(Channel::G).filter(|_| out.roughness > 0.0);
            out.metallic_map = channel(Channel::B).filter(|_| out.metallic > 0.0);
        }
        if let Some(old) = extensions.and_then(|e| e.pbr_specular_glossiness.as_ref()) {
            self.specular_glossiness(old, &mut out, reading)?;
        } else if out.metallic == 1.0 && out.metallic_map.is_none() {
            out.model = Model::Conductor;
        }
        if let Some(ior) = extensions.and_then(|e| e.ior.as_ref()) {
            // 0 stands for infinity, to look like specular-glossiness.
            let ior = if ior.ior.0 == 0.0 { IORS.1 } else { ior.ior.0 };
            out.ior = ior.clamp(IORS.0, IORS.1);
        }
        if let Some(specular) = extensions.and_then(|e| e.specular.as_ref()) {
            out.specular = specular.specular_factor.0.clamp(0.0, 1.0);
            if let Some(info) = &specular.specular_texture {
                let used = Use::of_info("extensions.KHR_materials_specular.specularTexture", info);
                let texture = self.texture(&used, Encoding::Linear, reading)?;
                out.specular_map = Some(ScalarMap { texture, channel: Channel::A });
            }
            if specular.specular_color_factor.0 != [1.0; 3] || specular.specular_color_texture.is_some() {
                let name = &reading.name;
                reading
                    .notes
                    .add(format!("material `{name}`: the colour of its specular reflection is ignored"));
            }
        }
        if let Some(transmission) = extensions.and_then(|e| e.transmission.as_ref()) {
            let share = transmission.transmission_factor.0;
            let name = &reading.name;
            if share >= GLASS {
                out.model = Model::Dielectric;
                if share < 1.0 || transmission.transmission_texture.is_some() {
                    reading
                        .notes
                        .add(format!("material `{name}`: is wholly glass, its transmission only partly"));
                }
                if out.base_color.min_element() < 0.9 || out.texture.is_some() {
                    reading.notes.add(format!("material `{name}`: the colour of its glass is ignored"));
                }
            } else if share > 0.0 {
                reading.notes.add(format!("material `{name}`: its transmission below {GLASS} is ignored"));
            }
        }
        if extensions.is_some_and(|e| e.unlit.is_some()) {
            out.model = Model::Diffuse;
            let name = &reading.name;
            reading.notes.add(format!("material `{name}`: is unlit, which is read as diffuse"));
        }
        if out.model != Model::Plastic {
            (out.metallic, out.metallic_map) = (0.0, None);
        }
        if let Some(normal) = &m.normal_texture {
            let texture =
                self.texture(&Use::of_normal("normalTexture", normal), Encoding::Linear, reading)?;
            out.relief = Some(Relief::NormalMap { texture, scale: normal.scale });
        }
        self.emission(m, &mut out, reading)?;
        self.opacity(m, &mut out, reading)?;
        Ok(out)
    }

    fn emission(
        &mut self,
        m: &Material,
        out: &mut MaterialParams,
        reading: &mut Reading,
    ) -> Result<(), ImportError> {
        let strength = m.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |s| s.emissive_strength.0);
        out.emission = Rgb::from_array(m.emissive_factor.0).max(Rgb::ZERO) * strength.max(0.0);
        if !out.emission.is_finite() {
            let key = format!("materials[{}].emissiveFactor", reading.index);
            return Err(self.file.error(key, "must be finite"));
        }
        out.emission_two_sided = m.double_sided;
        if let Some(info) = m.emissive_texture.as_ref().filter(|_| out.emission != Rgb::ZERO) {
            let texture = self.texture(&Use::of_info("emissiveTexture", info), Encoding::Srgb, reading)?;
            if texture.max_component() > 0.0 {
                out.emission_texture = Some(texture);
            } else {
                out.emission = Rgb::ZERO;
            }
        }
        Ok(())
    }

    fn opacity(
        &mut self,
        m: &Material,
        out: &mut MaterialParams,
        reading: &mut Reading,
    ) -> Result<(), ImportError> {
        out.opacity_cutoff = match m.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => {
                out.opacity = 1.0;
                return Ok(());
            }
            Checked::Valid(AlphaMode::Mask) => Some(m.alpha_cutoff.map_or(DEFAULT_CUTOFF, |c| c.0)),
            Checked::Valid(AlphaMode::Blend) => None,
            Checked::Invalid => {
                let key = format!("materials[{}].alphaMode", reading.index);
                return Err(self.file.error(key, "must be OPAQUE, MASK or BLEND"));
            }
        };
        let varies = |t: &Texture| {
            let [w, h] = t.size();
            (0..h).any(|y| (0..w).any(|x| t.texel(x, y)[Channel::A as usize] < 1.0))
        };
        let texture = out.texture.clone().filter(|t| varies(t));
        out.opacity_map = texture.map(|texture| ScalarMap { texture, channel: Channel::A });
        Ok(())
    }

    /// The archived `KHR_materials_pbrSpecularGlossiness`, roughly.
    fn specular_glossiness(
        &mut self,
        old: &PbrSpecularGlossiness,
        out: &mut MaterialParams,
        reading: &mut Reading,
    ) -> Result<(), ImportError> {
        let [r, g, b, alpha] = old.diffuse_factor.0;
        let f0 = Rgb::from_array(old.specular_factor.0).clamp(Rgb::ZERO, Rgb::ONE);
        out.base_color = Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE);
        out.opacity = alpha.clamp(0.0, 1.0);
        out.roughness = 1.0 - old.glossiness_factor.0.clamp(0.0, 1.0);
        (out.metallic, out.roughness_map, out.metallic_map) = (0.0, None, None);
        out.texture = match &old.diffuse_texture {
            None => None,
            Some(info) => {
                let key = "extensions.KHR_materials_pbrSpecularGlossiness.diffuseTexture";
                Some(self.texture(&Use::of_info(key, info), Encoding::Srgb, reading)?)
            }
        };
        let mut missing = "";
        if old.specular_glossiness_texture.is_some() {
            out.roughness = out.roughness.max(MaterialParams::default().roughness);
            missing = ", without its map";
        } else if out.base_color == Rgb::ZERO {
            (out.model, out.base_color) = (Model::Conductor, f0);
        } else {
            // Fresnel at normal incidence: F0 = ((n - 1)/(n + 1))².
            let root = f0.max_element().sqrt();
            out.ior = ((1.0 + root) / (1.0 - root)).clamp(IORS.0, IORS.1);
        }
        let name = &reading.name;
        reading.notes.add(format!("material `{name}`: specular-glossiness is read roughly{missing}"));
        Ok(())
    }

    /// The image of a texture; the first of a material decides where all lie.
    fn texture(
        &mut self,
        used: &Use,
        encoding: Encoding,
        reading: &mut Reading,
    ) -> Result<Arc<Texture>, ImportError> {
        let key = format!("materials[{}].{}", reading.index, used.key);
        let texture = self.file.get(&key, used.index)?;
        let wraps = match texture.sampler {
            None => [WrappingMode::Repeat; 2],
            Some(s) => {
                let sampler = self.file.get(&format!("textures[{}].sampler", used.index.value()), s)?;
                [&sampler.wrap_s, &sampler.wrap_t].map(|w| match w {
                    Checked::Valid(w) => *w,
                    Checked::Invalid => WrappingMode::Repeat,
                })
            }
        };
        let t = used.transform.clone().unwrap_or_default();
        let placement = Placement {
            set: t.tex_coord.unwrap_or(used.set),
            offset: t.offset.0.into(),
            rotation: t.rotation.0,
            scale: t.scale.0.into(),
            repeats: wraps == [WrappingMode::Repeat; 2],
        };
        let first = reading.placement.get_or_insert(placement);
        if (Placement { repeats: first.repeats, ..placement }) != *first {
            let name = &reading.name;
            reading.notes.add(format!(
                "material `{name}`: `{}` is laid out as the first of its images, not by its own coordinates",
                used.key
            ));
        }
        first.repeats &= placement.repeats;
        let webp =
            texture.extensions.as_ref().and_then(|e| e.others.get("EXT_texture_webp")?["source"].as_u64());
        let source = Some(texture.source).filter(|s| s.value() != u32::MAX as usize);
        let source = source.or_else(|| Some(Index::new(u32::try_from(webp?).ok()?)));
        let key = format!("textures[{}].source", used.index.value());
        let source = source
            .ok_or_else(|| self.file.error(&key, "is missing: it must be a PNG, JPEG or WebP image"))?;
        if let Some(texture) = self.textures.get(&(source.value(), encoding)) {
            return Ok(texture.clone());
        }
        let texture = Arc::new(self.image(&key, source, encoding, used, reading)?);
        self.textures.insert((source.value(), encoding), texture.clone());
        Ok(texture)
    }

    fn image(
        &self,
        key: &str,
        index: Index<gltf_json::Image>,
        encoding: Encoding,
        used: &Use,
        reading: &Reading,
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
                    let role = format!("`{}` of material `{}`", used.key, reading.name);
                    return Ok(Texture::load(&file.path_of(&key, uri)?, encoding, &role)?);
                }
            }
        } else {
            return Err(file.error(key, "needs `uri` or `bufferView`"));
        };
        image::ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(image::ImageError::IoError)
            .and_then(image::ImageReader::decode)
            .and_then(|image| Texture::from_image(image, encoding))
            .map(|texture| texture.named(format!("{}: {key}", file.path.display())))
            .map_err(|e| file.error(key, format!("cannot be decoded: {e}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_turn_as_the_extension_says() {
        let p = Placement {
            set: 0,
            offset: Vec2::new(0.5, 0.25),
            rotation: std::f32::consts::FRAC_PI_2,
            scale: Vec2::new(2.0, 3.0),
            repeats: true,
        };
        // A quarter turn counter-clockwise, v down: right becomes up, down becomes right.
        assert!((p.apply(Vec2::X) - Vec2::new(0.5, -1.75)).length() < 1e-6);
        assert!((p.apply(Vec2::Y) - Vec2::new(3.5, 0.25)).length() < 1e-6);
    }
}
