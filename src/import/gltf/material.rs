//! Materials; the mapping is that of [`super`].

use std::collections::HashMap;

use gltf_json::{
    Index, Material,
    extensions::material::{
        Material as Extensions, PbrSpecularGlossiness, Specular as SpecularJson, Transmission,
    },
    material::{AlphaMode, PbrMetallicRoughness},
    validation::Checked,
};

use serde_json::Value;

use super::{
    file::File,
    texture::{MaterialContext, TextureRef, Textures, UvMapping},
};
use crate::{
    import::{
        error::ImportError,
        imported::UniqueNames,
        range::{MAX_IOR, UNIT},
        sheets,
        warnings::Warnings,
    },
    math::Rgb,
    scene::{
        Mesh,
        material::{MaterialParams, Model, Relief},
        texture::{Channel, Encoding, ScalarMap},
    },
};

/// Name of the material of primitives without one.
const NO_NAME: &str = "(none)";
/// Transmission from which a material is glass: there is no model between glass and opaque, and the
/// nearer of the two is off by half at most.
const GLASS: f32 = 0.5;
/// Opacity of `MASK` that counts as opaque by default; glTF 2.0 section 5.19.
const DEFAULT_CUTOFF: f32 = 0.5;
/// Least index of refraction of a coat or glass: at 1 it would neither reflect nor bend.
const MIN_IOR: f32 = 1.001;
/// Range of a factor that the format bounds below only.
const NOT_NEGATIVE: [f32; 2] = [0.0, f32::INFINITY];
/// Extension that makes glass solid.
const VOLUME: &str = "KHR_materials_volume";

/// The materials that triangles use, each read when it is first met.
pub struct Materials<'a> {
    file: &'a File,
    /// Unique names of all materials of the file.
    names: Vec<String>,
    /// Positions in `list` by the index in the file, `None` for the default material.
    ids: HashMap<Option<usize>, u32>,
    /// Names and parameters of the materials in use.
    pub list: Vec<(String, MaterialParams)>,
    uv_mappings: Vec<Option<UvMapping>>,
    /// Whether the file leaves open if a material in use is a body of glass or a sheet.
    may_be_thin: Vec<bool>,
    /// Names of the materials whose shader the exporter dropped.
    pub lost: Vec<String>,
    textures: Textures<'a>,
}

impl<'a> Materials<'a> {
    /// The materials of `file`, none of them in use yet.
    pub fn new(file: &'a File) -> Self {
        let (mut names, mut unique) = (Vec::new(), UniqueNames::default());
        for (i, m) in file.root.materials.iter().enumerate() {
            let given = m.name.as_deref().map(str::trim).filter(|n| !n.is_empty());
            let name = given.map_or_else(|| format!("material_{i}"), str::to_owned);
            names.push(unique.take(name));
        }
        Self {
            file,
            names,
            ids: HashMap::new(),
            list: Vec::new(),
            uv_mappings: Vec::new(),
            may_be_thin: Vec::new(),
            lost: Vec::new(),
            textures: Textures::new(file),
        }
    }

    /// Position of a material in [`Self::list`], where it is added if it is new.
    ///
    /// # Errors
    /// When it does not exist or an image of it cannot be read.
    pub fn id(
        &mut self,
        key: &str,
        material: Option<Index<Material>>,
        warnings: &mut Warnings,
    ) -> Result<u32, ImportError> {
        let index = material.map(|m| m.value());
        if let Some(&id) = self.ids.get(&index) {
            return Ok(id);
        }
        let (name, params, mapping) = match material {
            None => (NO_NAME.to_owned(), MaterialParams::default(), None),
            Some(m) => {
                let json = self.file.get(key, m)?;
                let name = self.names[m.value()].clone();
                let mut context = MaterialContext::new(m.value(), name, warnings);
                let params = self.params(json, &mut context)?;
                (context.name, params, context.mapping)
            }
        };
        let id = self.list.len() as u32;
        self.list.push((name, params));
        self.uv_mappings.push(mapping);
        let json = material.and_then(|m| self.file.root.materials.get(m.value()));
        self.may_be_thin.push(json.is_some_and(|m| thickness_of(m).is_none()));
        self.ids.insert(index, id);
        Ok(id)
    }

    /// Mapping of the images of the material at a position in [`Self::list`]; `None` when it has none.
    pub fn uv_mapping(&self, id: u32) -> Option<UvMapping> {
        self.uv_mappings[id as usize]
    }

    /// Makes the glass of open surfaces thin where the file leaves it open, and tints bodies: a face lets the root
    /// of the base colour pass, so that a body is of the colour that a sheet would be. Blender renders it so. An
    /// image of it is lost, and said to be.
    pub fn finish_glass(&mut self, mesh: &mut Mesh, warnings: &mut Warnings) {
        let may_be_thin = std::mem::take(&mut self.may_be_thin);
        sheets::make_thin(mesh, &mut self.list, |m| may_be_thin[m], |_, _| {}, warnings);
        for (name, params) in self.list.iter_mut().filter(|(_, p)| p.model == Model::Dielectric) {
            params.glass_tint.transmitted = params.base_color.map(f32::sqrt);
            if params.texture.is_some() {
                warnings.about("material", name, "the image of the colour of its glass is ignored".into());
            }
        }
    }

    fn params(&mut self, m: &Material, context: &mut MaterialContext) -> Result<MaterialParams, ImportError> {
        let extensions = m.extensions.as_ref();
        let ignored = extensions.iter().flat_map(|e| e.others.keys()).filter(|name| *name != VOLUME);
        ignored.for_each(|extension| context.warn(format_args!("its {extension} is ignored")));
        let mut out = self.metallic_roughness(&m.pbr_metallic_roughness, context)?;
        if self.is_dropped(m, context.index) {
            out = MaterialParams::default();
            self.lost.push(context.name.clone());
        } else if let Some(old) = extensions.and_then(|e| e.pbr_specular_glossiness.as_ref()) {
            self.specular_glossiness(old, &mut out, context)?;
        } else if out.metallic == 1.0 && out.metallic_map.is_none() {
            out.model = Model::Conductor;
        }
        if let Some(extensions) = extensions {
            self.extended(extensions, &mut out, context)?;
        }
        match out.model {
            Model::Plastic => {}
            Model::Diffuse | Model::Conductor | Model::Dielectric | Model::Thin => {
                (out.metallic, out.metallic_map) = (0.0, None);
            }
        }
        if let Some(normal) = &m.normal_texture {
            let reference = TextureRef::normal("normalTexture", normal);
            let texture = self.textures.get(&reference, Encoding::Linear, context)?;
            out.relief = Some(Relief::NormalMap { texture, scale: normal.scale });
        }
        self.emission(m, &mut out, context)?;
        self.opacity(m, &mut out, context)?;
        Ok(out)
    }

    /// Whether Blender's exporter dropped the shader of a material: of other nodes than its principled one
    /// it writes a bare name, with normals or emission at most. By the format that is a rough white metal.
    fn is_dropped(&self, m: &Material, index: usize) -> bool {
        let says_more = |e: &Extensions| {
            e.pbr_specular_glossiness.is_some() || e.unlit.is_some() || e.transmission.is_some()
        };
        self.file.is_of_blender()
            && !self.file.has_pbr(index)
            && !m.extensions.as_ref().is_some_and(says_more)
    }

    fn metallic_roughness(
        &mut self,
        pbr: &PbrMetallicRoughness,
        context: &mut MaterialContext,
    ) -> Result<MaterialParams, ImportError> {
        let [r, g, b, alpha] = pbr.base_color_factor.0;
        let mut out = MaterialParams {
            model: Model::Plastic,
            base_color: context.color("baseColorFactor", [r, g, b], UNIT),
            roughness: context.number("roughnessFactor", pbr.roughness_factor.0, UNIT),
            metallic: context.number("metallicFactor", pbr.metallic_factor.0, UNIT),
            opacity: context.number("alpha of baseColorFactor", alpha, UNIT),
            ..MaterialParams::default()
        };
        if let Some(info) = &pbr.base_color_texture {
            let reference = TextureRef::new("pbrMetallicRoughness.baseColorTexture", info);
            out.texture = Some(self.textures.get(&reference, Encoding::Srgb, context)?);
        }
        if let Some(info) = &pbr.metallic_roughness_texture {
            let reference = TextureRef::new("pbrMetallicRoughness.metallicRoughnessTexture", info);
            let texture = self.textures.get(&reference, Encoding::Linear, context)?;
            let channel = |channel| Some(ScalarMap { texture: texture.clone(), channel });
            out.roughness_map = channel(Channel::G).filter(|_| out.roughness > 0.0);
            out.metallic_map = channel(Channel::B).filter(|_| out.metallic > 0.0);
        }
        Ok(out)
    }

    /// The extensions that change coat and model.
    fn extended(
        &mut self,
        extensions: &Extensions,
        out: &mut MaterialParams,
        context: &mut MaterialContext,
    ) -> Result<(), ImportError> {
        match extensions.ior.as_ref().map(|ior| ior.ior.0) {
            None => {}
            Some(0.0) => {
                out.ior = MAX_IOR;
                context.warn(format_args!("its ior 0, which reflects everything, is taken as {MAX_IOR}"));
            }
            Some(ior) => out.ior = context.number("ior", ior, [1.0, MAX_IOR]).max(MIN_IOR),
        }
        if let Some(specular) = &extensions.specular {
            self.specular(specular, out, context)?;
        }
        if let Some(transmission) = &extensions.transmission {
            self.transmit(transmission, out, context);
        }
        if extensions.others.contains_key(VOLUME) && !out.model.transmits() {
            context.warn(format_args!("its {VOLUME} is ignored: it is not glass"));
        }
        if extensions.unlit.is_some() {
            out.model = Model::Diffuse;
            context.warn("is unlit, which is read as diffuse");
        }
        Ok(())
    }

    /// `KHR_materials_transmission`: glass from [`GLASS`] on. Without a volume it is thin by the format;
    /// Blender writes none, and renders what is closed as a body.
    fn transmit(&self, transmission: &Transmission, out: &mut MaterialParams, context: &mut MaterialContext) {
        let share = context.number("transmissionFactor", transmission.transmission_factor.0, UNIT);
        if share >= GLASS {
            let material = self.file.root.materials.get(context.index);
            let has_volume = material.and_then(thickness_of).is_some();
            let is_body = has_volume || self.file.is_of_blender();
            out.model = if is_body { Model::Dielectric } else { Model::Thin };
            if has_volume && material.is_some_and(attenuates) {
                context.warn(format_args!(
                    "the attenuation of its {VOLUME} is ignored; it is solid and refracts"
                ));
            }
            if share < 1.0 || transmission.transmission_texture.is_some() {
                context.warn("is wholly glass, its transmission only partly");
            }
        } else if share > 0.0 {
            context.warn(format_args!("its transmission below {GLASS} is ignored"));
        }
    }

    /// `KHR_materials_specular`: the strength of the coat.
    fn specular(
        &mut self,
        specular: &SpecularJson,
        out: &mut MaterialParams,
        context: &mut MaterialContext,
    ) -> Result<(), ImportError> {
        out.specular = context.number("specularFactor", specular.specular_factor.0, UNIT);
        if let Some(info) = &specular.specular_texture {
            let reference = TextureRef::new("extensions.KHR_materials_specular.specularTexture", info);
            let texture = self.textures.get(&reference, Encoding::Linear, context)?;
            out.specular_map = Some(ScalarMap { texture, channel: Channel::A });
        }
        if specular.specular_color_factor.0 != [1.0; 3] || specular.specular_color_texture.is_some() {
            context.warn("the colour of its specular reflection is ignored");
        }
        Ok(())
    }

    fn emission(
        &mut self,
        m: &Material,
        out: &mut MaterialParams,
        context: &mut MaterialContext,
    ) -> Result<(), ImportError> {
        let strength = m.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
        let strength =
            strength.map_or(1.0, |s| context.number("emissiveStrength", s.emissive_strength.0, NOT_NEGATIVE));
        out.emission = context.color("emissiveFactor", m.emissive_factor.0, NOT_NEGATIVE) * strength;
        if !out.emission.is_finite() {
            let key = format!("materials[{}].emissiveFactor", context.index);
            return Err(self.file.error(key, "must be finite"));
        }
        out.emission_two_sided = m.double_sided;
        if let Some(info) = m.emissive_texture.as_ref().filter(|_| out.emission != Rgb::ZERO) {
            let reference = TextureRef::new("emissiveTexture", info);
            let texture = self.textures.get(&reference, Encoding::Srgb, context)?;
            if texture.max_component() > 0.0 {
                out.emission_texture = Some(texture);
            } else {
                out.emission = Rgb::ZERO;
            }
        }
        Ok(())
    }

    fn opacity(
        &self,
        m: &Material,
        out: &mut MaterialParams,
        context: &mut MaterialContext,
    ) -> Result<(), ImportError> {
        out.opacity_cutoff = match m.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => {
                out.opacity = 1.0;
                return Ok(());
            }
            Checked::Valid(AlphaMode::Mask) => {
                let cutoff = m.alpha_cutoff.map_or(DEFAULT_CUTOFF, |c| c.0);
                Some(context.number("alphaCutoff", cutoff, NOT_NEGATIVE))
            }
            Checked::Valid(AlphaMode::Blend) => None,
            Checked::Invalid => {
                let key = format!("materials[{}].alphaMode", context.index);
                return Err(self.file.error(key, "must be OPAQUE, MASK or BLEND"));
            }
        };
        let texture = out.texture.clone().filter(|t| t.range()[0].w < 1.0);
        out.opacity_map = texture.map(|texture| ScalarMap { texture, channel: Channel::A });
        Ok(())
    }

    /// The archived `KHR_materials_pbrSpecularGlossiness` as the nearest model here.
    fn specular_glossiness(
        &mut self,
        old: &PbrSpecularGlossiness,
        out: &mut MaterialParams,
        context: &mut MaterialContext,
    ) -> Result<(), ImportError> {
        let [r, g, b, alpha] = old.diffuse_factor.0;
        let f0 = context.color("specularFactor", old.specular_factor.0, UNIT);
        out.base_color = context.color("diffuseFactor", [r, g, b], UNIT);
        out.opacity = context.number("alpha of diffuseFactor", alpha, UNIT);
        out.roughness = 1.0 - context.number("glossinessFactor", old.glossiness_factor.0, UNIT);
        (out.metallic, out.roughness_map, out.metallic_map) = (0.0, None, None);
        out.texture = match &old.diffuse_texture {
            None => None,
            Some(info) => {
                let key = "extensions.KHR_materials_pbrSpecularGlossiness.diffuseTexture";
                Some(self.textures.get(&TextureRef::new(key, info), Encoding::Srgb, context)?)
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
            out.ior = ((1.0 + root) / (1.0 - root)).clamp(MIN_IOR, MAX_IOR);
        }
        context.warn(format_args!("specular-glossiness is read roughly{missing}"));
        Ok(())
    }
}

/// What a material says of the volume below its surface.
fn volume_of(m: &Material) -> Option<&Value> {
    m.extensions.as_ref()?.others.get(VOLUME)
}

/// Thickness of the volume below a surface, metres; `None` for a thin sheet.
fn thickness_of(m: &Material) -> Option<f64> {
    volume_of(m)?["thicknessFactor"].as_f64().filter(|&t| t > 0.0)
}

/// Whether the volume of a material takes light away: it has a colour, and a distance at which light has it.
fn attenuates(m: &Material) -> bool {
    let volume = volume_of(m);
    let color = volume.and_then(|v| v["attenuationColor"].as_array());
    let is_colored = color.is_some_and(|color| color.iter().any(|c| c.as_f64() != Some(1.0)));
    is_colored && volume.is_some_and(|v| v["attenuationDistance"].is_number())
}
