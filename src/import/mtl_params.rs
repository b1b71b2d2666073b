//! What the materials of an MTL mean: the tables of `docs/formats.md`.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Affine2;

use super::{
    error::ImportError,
    mtl::{MapKind, MapSpec, MtlMaterial, Origin},
    range::{self, MAX_IOR, UNIT},
    warnings::Warnings,
    wavefront::name_before_comment,
};
use crate::{
    files::{
        number::Number,
        reach::{MAX_PICTURE_BYTES, Reach, ReachError},
    },
    math::Rgb,
    scene::{
        material::{MaterialParams, Model, Relief},
        texture::{self, Channel, Encoding, ScalarMap, TEXTURE_BUDGET, Texture, TextureLoader},
    },
};

/// IOR of a coat or glass whose file does not say: crown glass, as glTF has it.
const DEFAULT_IOR: f32 = 1.5;
/// Largest exponent `Ns`, of a highlight 0.1° wide; the format names no bound, and files have up to 10⁵.
const MAX_NS: f32 = 1e6;
/// Largest exponent `Ns` in files of Blender, whose old exporter has written up to 511 · 1.96.
const BLENDER_NS: f32 = 1002.0;
/// Illumination model of a material whose file does not say: a highlight where there is a `Ks`.
const DEFAULT_ILLUM: u8 = 2;
/// Roughness of a surface whose file does not say, as in Blender's principled shader.
const DEFAULT_ROUGHNESS: f32 = 0.5;
/// Albedo of a material whose file does not say, as in Blender's principled shader.
const DEFAULT_ALBEDO: f32 = 0.8;
/// Height of white over black of a bump map with `-bm` 1, in widths of the image.
/// MTL names no unit; in an image 1000 texels wide an edge of ten texels rises by 45 degrees.
const BUMP_HEIGHT: f32 = 0.01;
/// Texels that tell normals from heights, at most: the standard error of a mean of values in [0, 1] is
/// then below 0.004, a fortieth of the tolerances.
const MAX_SAMPLES: usize = 1 << 14;
/// Largest distance from 0.5 of the mean red and green of a normal map: a mean lean of 17°.
const MAX_LEAN: f32 = 0.15;
/// Least mean blue of a normal map: a mean z of 0.3.
const MIN_BLUE: f32 = 0.65;
/// Least mean excess of blue over red and green in a normal map; a grey map of heights has none.
const MIN_BLUE_EXCESS: f32 = 0.15;

/// Diffuse grey, for a material that no library defines.
pub fn grey() -> MaterialParams {
    let base_color = Rgb::splat(DEFAULT_ALBEDO);
    MaterialParams { base_color, ..MaterialParams::default() }
}

/// Interprets materials and loads the images they need, each once an encoding.
#[derive(Debug, Default)]
pub struct Reader {
    images: BTreeMap<(PathBuf, Encoding), Arc<Texture>>,
    loader: TextureLoader,
    /// What the images occupy, bytes.
    n_bytes: u64,
    /// The OBJ, for messages.
    scene: PathBuf,
    reach: Reach,
    /// What was left out or replaced.
    pub warnings: Warnings,
}

impl Reader {
    /// A reader of images within `reach` for the OBJ `scene` that appends to `warnings`.
    #[must_use]
    pub fn new(scene: &Path, reach: Reach, warnings: Warnings) -> Self {
        let (images, loader) = (BTreeMap::new(), TextureLoader::default());
        Self { images, loader, n_bytes: 0, scene: scene.into(), reach, warnings }
    }

    /// Names and parameters of all materials. The largest images are halved until all occupy no more
    /// than [`TEXTURE_BUDGET`].
    ///
    /// # Errors
    /// When the file of an image exists but cannot be decoded.
    pub fn read(&mut self, library: &[MtlMaterial]) -> Result<Vec<(String, MaterialParams)>, ImportError> {
        let mut out: Vec<(String, MaterialParams)> = Vec::new();
        for m in library {
            out.push((m.name.clone(), self.params(m)?));
            // At once, so that no more than one material's images come on top.
            if self.n_bytes > TEXTURE_BUDGET {
                let in_use = out.iter_mut().flat_map(|(_, p)| p.textures_mut());
                let mut textures: Vec<&mut Arc<Texture>> = in_use.chain(self.images.values_mut()).collect();
                texture::fit(&mut textures, TEXTURE_BUDGET).into_iter().for_each(|w| self.warnings.add(w));
                self.n_bytes = self.images.values().map(|image| image.n_bytes()).sum();
            }
        }
        Ok(out)
    }

    fn warn(&mut self, m: &MtlMaterial, message: impl std::fmt::Display) {
        self.warnings.about("material", &m.name, message.to_string());
    }

    fn params(&mut self, m: &MtlMaterial) -> Result<MaterialParams, ImportError> {
        let texture = self.image(m, MapKind::Kd, Encoding::Srgb)?;
        let default = if texture.is_some() { 1.0 } else { DEFAULT_ALBEDO };
        // Blender's images stand for the numbers. Its old exporter writes these too: what
        // the shader has below the image. Others write black there.
        let is_blender = m.origin != Origin::Other;
        let is_replaced = |kd: [f32; 3]| texture.is_some() && (is_blender || kd == [0.0; 3]);
        let kd = m.kd.filter(|&kd| !is_replaced(kd)).unwrap_or([default; 3]);
        let base_color = self.color(m, "Kd", kd, UNIT);
        let emission_texture = self.image(m, MapKind::Ke, Encoding::Srgb)?;
        let default = if emission_texture.is_some() { 1.0 } else { 0.0 };
        let ke = m.ke.filter(|&ke| ke != [0.0; 3]).unwrap_or([default; 3]);
        let emission = self.color(m, "Ke", ke, [0.0, f32::INFINITY]);
        let ior = m.ni.filter(|&n| n > 1.0).map_or(DEFAULT_IOR, |n| n.min(MAX_IOR));
        let common = MaterialParams {
            base_color,
            texture,
            ior,
            emission,
            emission_texture,
            // As Blender's emission; elsewhere the front alone, as in other renderers.
            emission_two_sided: is_blender,
            relief: self.relief(m)?,
            ..MaterialParams::default()
        };
        let params = match m.origin {
            Origin::Other => self.plain(m, common)?,
            Origin::Blender | Origin::OldBlender => self.blender(m, common)?,
        };
        self.report_refraction(m, &params);
        if params.model.transmits() {
            return Ok(params);
        }
        let opacity_map = self.opacity_map(m)?;
        let opacity = match (known(m, m.d), m.tr) {
            // Not invisible: programs write it for what they do not know.
            (Some(-1.0), _) => {
                self.warn(m, "`d` -1 is not in [0, 1]: 1 is taken");
                1.0
            }
            (Some(d), _) => self.number(m, "d", d, UNIT),
            (None, Some(tr)) => 1.0 - self.number(m, "Tr", tr, UNIT),
            (None, None) => 1.0,
        };
        if opacity == 0.0 {
            let key = if m.d.is_some() { "d" } else { "Tr" };
            self.warn(m, format_args!("is invisible, says its `{key}`"));
        }
        Ok(MaterialParams { opacity, opacity_map, ..params })
    }

    /// Warns of an index of refraction, or a filter of glass, that is not followed. An index of 1 is what
    /// programs write for a surface without: only glass could have it.
    fn report_refraction(&mut self, m: &MtlMaterial, params: &MaterialParams) {
        let is_glass = params.model.transmits();
        let is_coated = params.model == Model::Plastic;
        let ni = known(m, m.ni).filter(|_| is_glass || is_coated);
        if let Some(ni) = ni.filter(|&n| is_glass && n <= 1.0 || n < 1.0) {
            self.warn(m, format_args!("`Ni` {} is not above 1: {DEFAULT_IOR} is taken", Number(ni)));
        }
        if let Some(ni) = ni.filter(|&n| n > 1.0) {
            self.number(m, "Ni", ni, [1.0, MAX_IOR]);
        }
        if let Some(tf) = m.tf.filter(|_| is_glass && m.origin == Origin::Other) {
            self.color(m, "Tf", tf, UNIT);
        }
    }

    /// A material of any program but Blender.
    fn plain(&mut self, m: &MtlMaterial, common: MaterialParams) -> Result<MaterialParams, ImportError> {
        let specular = self.color(m, "Ks", m.ks.unwrap_or_default(), UNIT);
        let metallic_map = self.scalar(m, MapKind::Pm)?;
        let roughness_map = self.scalar(m, MapKind::Pr)?;
        if let Some(map) = m.maps.get(&MapKind::Ns).or(m.maps.get(&MapKind::Refl)) {
            self.warn(m, format_args!("`{}` is ignored", map.keyword));
        }
        let metallic = match m.pm {
            _ if metallic_map.is_some() => 1.0,
            Some(pm) => self.number(m, "Pm", pm, UNIT),
            None => 0.0,
        };
        let illum = m.illum.unwrap_or(DEFAULT_ILLUM);
        let mut params = MaterialParams { metallic, metallic_map, roughness_map, ..common };
        let has_specular =
            specular.max_element() > 0.0 || m.ks.is_none() && m.maps.contains_key(&MapKind::Ks);
        if matches!(illum, 4 | 6 | 7 | 9) && metallic < 0.5 {
            params.model = Model::Dielectric;
        } else if illum == 3 && params.base_color == Rgb::ZERO && has_specular {
            params.model = Model::Conductor;
            params.texture = self.image(m, MapKind::Ks, Encoding::Srgb)?;
            params.base_color = if m.ks.is_some() { specular } else { Rgb::ONE };
        } else if has_specular {
            params.model = Model::Plastic;
            params.specular_map = self.scalar(m, MapKind::Ks)?;
        }
        let slope_from_ns = |ns: f32| (2.0 / (ns + 2.0)).sqrt();
        params.roughness = match (m.pr, m.ns) {
            _ if params.roughness_map.is_some() => 1.0,
            (Some(pr), _) => self.number(m, "Pr", pr, UNIT),
            (None, _) if params.model.transmits() => 0.0,
            (None, Some(ns)) => slope_from_ns(self.number(m, "Ns", ns, [0.0, MAX_NS])).sqrt(),
            (None, None) => DEFAULT_ROUGHNESS,
        };
        Ok(as_metal(params))
    }

    /// A material as Blender's exporters mean it: the inverse of what they do
    /// to the parameters of its principled shader.
    fn blender(&mut self, m: &MtlMaterial, common: MaterialParams) -> Result<MaterialParams, ImportError> {
        let mean = |c: [f32; 3]| c.iter().sum::<f32>() / 3.0;
        let transmission = self.known_number(m, "Tf", m.tf.map(mean), UNIT).unwrap_or(0.0);
        if transmission > 0.0 && transmission < 1.0 {
            let taken = if transmission < 0.5 { "opaque" } else { "clear" };
            self.warn(m, format_args!("transmission `Tf` {transmission} is partial: it is taken as {taken}"));
        }
        let metallic_map = match self.scalar(m, MapKind::Pm)? {
            None => self.scalar(m, MapKind::Refl)?,
            map => map,
        };
        let roughness_map = match self.scalar(m, MapKind::Pr)? {
            None => self.scalar(m, MapKind::Ns)?,
            map => map,
        };
        // `Ka` holds the metal where something is reflected, otherwise a constant.
        let from_ka = || if matches!(m.illum, Some(3..=8)) { mean(m.ka.unwrap_or([1.0; 3])) } else { 0.0 };
        let metallic = match metallic_map {
            Some(_) => 1.0,
            None => self.known_number(m, "Pm", m.pm, UNIT).unwrap_or_else(from_ka).clamp(0.0, 1.0),
        };
        let full = if m.origin == Origin::OldBlender { 900.0 } else { 1000.0 };
        let from_ns = |ns: f32| 1.0 - (ns / full).min(1.0).sqrt();
        let roughness = match known(m, m.pr) {
            _ if roughness_map.is_some() => 1.0,
            Some(pr) => self.number(m, "Pr", pr, UNIT),
            None => self.known_number(m, "Ns", m.ns, [0.0, BLENDER_NS]).map_or(DEFAULT_ROUGHNESS, from_ns),
        };
        // A specular level of 0.5 is the reflectance that the IOR says.
        let specular_map = self.scalar(m, MapKind::Ks)?;
        let specular = match specular_map {
            Some(_) => 2.0,
            None => (2.0 * self.known_number(m, "Ks", m.ks.map(mean), UNIT).unwrap_or(0.5)).min(1.0),
        };
        let model = match specular {
            _ if transmission >= 0.5 => Model::Dielectric,
            0.0 => Model::Diffuse,
            _ => Model::Plastic,
        };
        Ok(as_metal(MaterialParams {
            model,
            roughness,
            roughness_map,
            specular,
            specular_map,
            metallic,
            metallic_map,
            ..common
        }))
    }

    /// The number of a keyword in its range; what is not in it is said.
    fn number(&mut self, m: &MtlMaterial, key: &str, value: f32, range: [f32; 2]) -> f32 {
        range::clamped(key, value, range, |message| self.warn(m, message))
    }

    /// As [`Self::number`], if it is there and the program that wrote the file knew it.
    fn known_number(
        &mut self,
        m: &MtlMaterial,
        key: &str,
        value: Option<f32>,
        range: [f32; 2],
    ) -> Option<f32> {
        known(m, value).map(|value| self.number(m, key, value, range))
    }

    /// The colour of a keyword in its range; what is not in it is said.
    fn color(&mut self, m: &MtlMaterial, key: &str, color: [f32; 3], range: [f32; 2]) -> Rgb {
        range::clamped_color(key, color, range, |message| self.warn(m, message))
    }

    /// The image of a map; `None` where the material has none or its file is missing.
    fn image(
        &mut self,
        m: &MtlMaterial,
        kind: MapKind,
        encoding: Encoding,
    ) -> Result<Option<Arc<Texture>>, ImportError> {
        let Some(map) = m.maps.get(&kind) else { return Ok(None) };
        let refused = |source| ImportError::Reach {
            path: self.scene.clone(),
            key: format!("{}: {}", m.name, map.keyword),
            source,
        };
        let mut found = find(&m.directory, &map.file, &self.reach).map_err(refused)?;
        if let (None, Some(file)) = (&found, name_before_comment(&map.file)) {
            found = find(&m.directory, file, &self.reach).map_err(refused)?;
        }
        let Some(path) = found else {
            let message = format!(
                "`{}`: no file `{}`; the map is left out",
                map.keyword,
                m.directory.join(map.file.replace('\\', "/")).display()
            );
            self.warn(m, message);
            return Ok(None);
        };
        self.reach.check(&path, MAX_PICTURE_BYTES).map_err(refused)?;
        let key = (path, encoding);
        let image = match self.images.get(&key) {
            Some(image) => image.clone(),
            None => {
                let role = format!("`{}` of material `{}`", map.keyword, m.name);
                let image = Arc::new(self.loader.load(&key.0, encoding, &role)?);
                self.loader.notes.drain(..).for_each(|note| self.warnings.add(note));
                self.n_bytes += image.n_bytes();
                self.images.insert(key, image.clone());
                image
            }
        };
        if map.transform == Affine2::IDENTITY && map.wrap == image.wrap()[0] {
            return Ok(Some(image));
        }
        Ok(Some(Arc::new(image.transformed(map.transform).wrapped([map.wrap; 2]))))
    }

    /// The map of a scalar: the channel that it names, else green.
    fn scalar(&mut self, m: &MtlMaterial, kind: MapKind) -> Result<Option<ScalarMap>, ImportError> {
        let channel = m.maps.get(&kind).and_then(|map| map.channel).unwrap_or(Channel::G);
        Ok(self.image(m, kind, Encoding::Linear)?.map(|texture| ScalarMap { texture, channel }))
    }

    /// `map_d`: the alpha of an image whose alpha varies, otherwise its red.
    fn opacity_map(&mut self, m: &MtlMaterial) -> Result<Option<ScalarMap>, ImportError> {
        let Some(map) = m.maps.get(&MapKind::D) else { return Ok(None) };
        let varies = |t: &Texture| t.range()[0].w < t.range()[1].w;
        // Alpha is the same in an image that is already there as a colour.
        let is_color =
            |kd: &MapSpec| kd.file == map.file && kd.transform == map.transform && kd.wrap == map.wrap;
        if map.channel.is_none()
            && m.maps.get(&MapKind::Kd).is_some_and(is_color)
            && let Some(texture) = self.image(m, MapKind::Kd, Encoding::Srgb)?
            && varies(&texture)
        {
            return Ok(Some(ScalarMap { texture, channel: Channel::A }));
        }
        Ok(self.image(m, MapKind::D, Encoding::Linear)?.map(|texture| {
            let default = if varies(&texture) { Channel::A } else { Channel::R };
            ScalarMap { channel: map.channel.unwrap_or(default), texture }
        }))
    }

    fn relief(&mut self, m: &MtlMaterial) -> Result<Option<Relief>, ImportError> {
        for kind in [MapKind::Norm, MapKind::Bump] {
            let Some(texture) = self.image(m, kind, Encoding::Linear)? else { continue };
            let map = &m.maps[&kind];
            let scale = map.multiplier.unwrap_or(1.0);
            if scale == 0.0 {
                return Ok(None);
            }
            let is_normals = kind == MapKind::Norm || map.channel.is_none() && holds_normals(&texture);
            return Ok(Some(if is_normals {
                Relief::NormalMap { texture, scale }
            } else {
                let height = ScalarMap { texture, channel: map.channel.unwrap_or(Channel::G) };
                Relief::BumpMap { height, scale: BUMP_HEIGHT * scale }
            }));
        }
        Ok(None)
    }
}

/// A number, if the program that wrote the file knew it: what Blender does not know it writes as −1.
fn known(m: &MtlMaterial, value: Option<f32>) -> Option<f32> {
    value.filter(|&v| m.origin == Origin::Other || v != -1.0)
}

/// Gives a sheet of glass the colour of what it lets pass: the filter `Tf`; in Blender's files, where that is
/// a share, the base colour.
pub fn tint_sheet(m: &MtlMaterial, params: &mut MaterialParams) {
    if m.origin == Origin::Other {
        params.base_color = m.tf.map_or(Rgb::ONE, Rgb::from_array).clamp(Rgb::ZERO, Rgb::ONE);
        params.texture = None;
    }
}

/// Tints a body of glass, and returns what is to be said of a colour that it loses. What goes through it is of
/// the colour that a sheet would have ([`tint_sheet`]), of which each face has the root.
pub fn tint_body(m: &MtlMaterial, params: &mut MaterialParams) -> Option<String> {
    if params.model != Model::Dielectric {
        return None;
    }
    let mut sheet = params.clone();
    tint_sheet(m, &mut sheet);
    params.glass_tint.transmitted = sheet.base_color.map(f32::sqrt);
    sheet.texture.is_some().then(|| "the image of the colour of its glass is ignored".into())
}

/// The parameters with the pure model of a metal, if the surface is metal everywhere.
fn as_metal(params: MaterialParams) -> MaterialParams {
    let is_metal = !params.model.transmits() && params.metallic >= 1.0 && params.metallic_map.is_none();
    if !is_metal {
        return params;
    }
    MaterialParams { model: Model::Conductor, metallic: 0.0, specular: 1.0, specular_map: None, ..params }
}

/// Whether an image looks like normals of a tangent space: bluish, for they point
/// up, and lean to all sides alike. Exporters write those as bump maps too.
fn holds_normals(texture: &Texture) -> bool {
    let [width, height] = texture.size();
    let n = width * height;
    let step = n.div_ceil(MAX_SAMPLES);
    let sum = (0..n).step_by(step).fold([0.0; 3], |s, i| {
        let t = texture.texel(i % width, i / width);
        [s[0] + t[0], s[1] + t[1], s[2] + t[2]]
    });
    let [r, g, b] = sum.map(|s| s / n.div_ceil(step) as f32);
    let is_even = |v: f32| (v - 0.5).abs() < MAX_LEAN;
    is_even(r) && is_even(g) && b > MIN_BLUE && b - r.max(g) > MIN_BLUE_EXCESS
}

/// Folders beside the MTL in which images are sought too: archives of models put them there.
const IMAGE_FOLDERS: [&str; 2] = ["textures", "../textures"];

/// Finds an image as exporters name it: relative to the MTL, absolute, in quotes,
/// or as it was on another machine, of which the last parts are sought beside the
/// MTL and in [`IMAGE_FOLDERS`], if need be in other letter case.
///
/// # Errors
/// When the file as it is named is out of reach, and none in its place is within.
fn find(directory: &Path, file: &str, reach: &Reach) -> Result<Option<PathBuf>, ReachError> {
    let file = file.trim_matches('"').replace('\\', "/");
    let parts: Vec<&str> = file.split('/').filter(|p| !p.is_empty()).collect();
    let Some(name) = parts.last().copied() else { return Ok(None) };
    let ends = (0..parts.len()).map(|i| directory.join(parts[i..].join("/")));
    let in_folders = || IMAGE_FOLDERS.iter().map(|f| directory.join(f));
    let given = directory.join(&file);
    let candidates = std::iter::once(given.clone()).chain(ends).chain(in_folders().map(|f| f.join(name)));
    let is_there = |p: &PathBuf| reach.has_file(p);
    let found = candidates.into_iter().find(is_there).or_else(|| {
        let beside = given.parent().map(Path::to_path_buf).into_iter().chain([directory.to_path_buf()]);
        beside.chain(in_folders()).filter(|d| reach.admits(&d.join(name))).find_map(|d| {
            let entries = fs::read_dir(d).ok()?.flatten().map(|e| e.path());
            let is_same = |p: &PathBuf| {
                p.file_name().is_some_and(|n| n.to_string_lossy().eq_ignore_ascii_case(name)) && is_there(p)
            };
            entries.filter(is_same).min()
        })
    });
    if found.is_none() && !reach.admits(&given) {
        return Err(ReachError::Outside { path: given });
    }
    Ok(found)
}
