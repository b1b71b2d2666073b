//! Materials: what a surface is made of.

use std::{collections::HashMap, sync::Arc};

use glam::Vec2;

use super::texture::{ScalarMap, Texture};
use crate::{
    bsdf::{
        Blend, Bsdf, Coat, Conductor, Diffuse, Facets, Glass, GlassTint, Layer, Plastic, Thin,
        microfacet::Ggx, thin::average_reflectance,
    },
    math::{Rgb, luminance},
};

/// Scattering model of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// Lambertian reflection; the base colour is the albedo.
    Diffuse,
    /// Metal; the base colour is the reflectance at normal incidence.
    Conductor,
    /// Glass: specular or rough reflection and transmission; without base colour, but for its tint.
    Dielectric,
    /// Lambertian base under a dielectric coat.
    Plastic,
    /// A thin sheet of glass, both faces at once: nothing is refracted; the base colour tints what passes.
    Thin,
}

impl Model {
    /// Whether light enters the surface and leaves it on the other side. Such a surface has neither a
    /// share of metal nor, unless the sidecar gives one, an opacity.
    #[must_use]
    pub fn transmits(self) -> bool {
        match self {
            Self::Dielectric | Self::Thin => true,
            Self::Diffuse | Self::Conductor | Self::Plastic => false,
        }
    }
}

/// A surface material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the scene file.
    pub name: String,
    params: MaterialParams,
    /// GGX slope α where no image varies it; `None` for a smooth surface.
    alpha: Option<f32>,
    tables: Tables,
}

/// Parameters of a [`Material`]: a model whose numbers images may vary.
#[derive(Clone, Debug)]
pub struct MaterialParams {
    /// Scattering model.
    pub model: Model,
    /// Linear Rec.709 albedo or metal reflectance, in [0, 1].
    pub base_color: Rgb,
    /// Image that multiplies the base colour.
    pub texture: Option<Arc<Texture>>,
    /// Perceptual roughness in [0, 1]; the GGX slope is its square.
    pub roughness: f32,
    /// Image that multiplies the roughness.
    pub roughness_map: Option<ScalarMap>,
    /// Index of refraction of a dielectric or of a coat, relative to air.
    pub ior: f32,
    /// Tint of a body of glass.
    pub glass_tint: GlassTint,
    /// Reflectance of a [`Model::Conductor`] at 82 degrees over Schlick's, in [0, 1].
    pub edge_tint: Rgb,
    /// Weight in [0, 1] of a plastic with its coat; the rest is the bare diffuse base.
    pub specular: f32,
    /// Image that multiplies the weight of the coat.
    pub specular_map: Option<ScalarMap>,
    /// Weight in [0, 1] of a metal of the same base colour and roughness, for an opaque model.
    pub metallic: f32,
    /// Image that multiplies the weight of the metal.
    pub metallic_map: Option<ScalarMap>,
    /// Probability in [0, 1] that a ray does not pass straight through.
    pub opacity: f32,
    /// Image that multiplies the opacity.
    pub opacity_map: Option<ScalarMap>,
    /// Threshold below which an opacity counts as 0, and from which on as 1; `None` for none.
    pub opacity_cutoff: Option<f32>,
    /// Image that tilts the shading normal.
    pub relief: Option<Relief>,
    /// Radiance emitted by the front side, W·m⁻²·sr⁻¹, linear Rec.709.
    pub emission: Rgb,
    /// Image that multiplies the emission.
    pub emission_texture: Option<Arc<Texture>>,
    /// Whether the back side emits too.
    pub emission_two_sided: bool,
}

/// An image that tilts the shading normal.
#[derive(Clone, Debug)]
pub enum Relief {
    /// Tangent-space normals n, x right, y up, stored as (n + 1)/2.
    NormalMap {
        /// Image of the normals, linear.
        texture: Arc<Texture>,
        /// Factor on x and y of the normals.
        scale: f32,
    },
    /// Heights above the surface.
    BumpMap {
        /// Image of the heights.
        height: ScalarMap,
        /// Height of the value 1, in widths of the image on the surface.
        scale: f32,
    },
}

impl Default for MaterialParams {
    /// Diffuse grey of albedo 0.8; with other models roughness 0.5 and an index of refraction of 1.5.
    fn default() -> Self {
        Self {
            model: Model::Diffuse,
            base_color: Rgb::splat(0.8),
            texture: None,
            roughness: 0.5,
            roughness_map: None,
            ior: 1.5,
            glass_tint: GlassTint::CLEAR,
            edge_tint: Rgb::ONE,
            specular: 1.0,
            specular_map: None,
            metallic: 0.0,
            metallic_map: None,
            opacity: 1.0,
            opacity_map: None,
            opacity_cutoff: None,
            relief: None,
            emission: Rgb::ZERO,
            emission_texture: None,
            emission_two_sided: false,
        }
    }
}

impl MaterialParams {
    /// All images, for [`super::texture::fit`] to halve.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut Arc<Texture>> {
        let maps =
            [&mut self.roughness_map, &mut self.specular_map, &mut self.metallic_map, &mut self.opacity_map];
        let relief = self.relief.as_mut().map(|r| match r {
            Relief::NormalMap { texture, .. } => texture,
            Relief::BumpMap { height, .. } => &mut height.texture,
        });
        let colors = [&mut self.texture, &mut self.emission_texture];
        let maps = maps.into_iter().flatten().map(|m| &mut m.texture);
        maps.chain(colors.into_iter().flatten()).chain(relief)
    }
}

/// What is tabulated of a material's surface.
#[derive(Clone, Debug)]
enum Tables {
    /// Nothing: it is bare, without metal or of smooth metal.
    None,
    /// Facets of a metal without coat.
    Facets(Arc<Facets>),
    Coat(Arc<Coat>),
    Glass(Arc<Glass>),
    /// A sheet of glass: its facets unless it is smooth, and its mean reflectance.
    Sheet {
        facets: Option<Arc<Facets>>,
        average: f32,
    },
}

/// Coats, facets and glass by IOR and GGX slope: materials that are alike share their tables.
#[derive(Debug, Default)]
pub struct Coats {
    facets: HashMap<Roughness, Arc<Facets>>,
    coats: HashMap<(u32, Roughness), Arc<Coat>>,
    glass: HashMap<(u32, Roughness), Arc<Glass>>,
}

/// Roughness of a surface: smooth, the bits of a GGX slope, or varying.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Roughness {
    Smooth,
    Slope(u32),
    Any,
}

impl Coats {
    /// Facets; `None` when smooth.
    fn facets(&mut self, roughness: Roughness) -> Option<Arc<Facets>> {
        let tabulate = || match roughness {
            Roughness::Slope(bits) => Facets::new(f32::from_bits(bits)),
            _ => Facets::of_any_slope(),
        };
        (roughness != Roughness::Smooth)
            .then(|| self.facets.entry(roughness).or_insert_with(|| Arc::new(tabulate())).clone())
    }

    fn coat(&mut self, ior: f32, roughness: Roughness) -> Arc<Coat> {
        let facets = self.facets(roughness);
        let tabulate = || Arc::new(facets.map_or_else(|| Coat::smooth(ior), |f| Coat::rough(ior, f)));
        self.coats.entry((ior.to_bits(), roughness)).or_insert_with(tabulate).clone()
    }

    fn glass(&mut self, ior: f32, roughness: Roughness) -> Arc<Glass> {
        let tabulate = || match roughness {
            Roughness::Smooth => Glass::smooth(ior),
            Roughness::Slope(bits) => Glass::rough(ior, f32::from_bits(bits)),
            Roughness::Any => Glass::of_any_slope(ior),
        };
        self.glass.entry((ior.to_bits(), roughness)).or_insert_with(|| Arc::new(tabulate())).clone()
    }
}

/// A number times what its image says.
fn scaled(factor: f32, map: Option<&ScalarMap>, uv: Vec2) -> f32 {
    map.map_or(factor, |m| (factor * m.sample(uv)).clamp(0.0, 1.0))
}

/// The range that an image gives a number.
fn range_of(factor: f32, map: Option<&ScalarMap>) -> [f32; 2] {
    map.map_or([factor; 2], |m| m.range().map(|v| (factor * v).clamp(0.0, 1.0)))
}

impl Tables {
    fn new(params: &MaterialParams, roughness: Roughness, coats: &mut Coats) -> Self {
        if params.model == Model::Dielectric {
            return Self::Glass(coats.glass(params.ior, roughness));
        }
        if params.model == Model::Thin {
            let average = average_reflectance(params.ior);
            return Self::Sheet { facets: coats.facets(roughness), average };
        }
        let metallic = range_of(params.metallic, params.metallic_map.as_ref());
        let is_coated = params.model == Model::Plastic
            && range_of(params.specular, params.specular_map.as_ref())[1] > 0.0
            && metallic[0] < 1.0;
        let is_metal = params.model == Model::Conductor || metallic[1] > 0.0;
        if is_coated {
            return Self::Coat(coats.coat(params.ior, roughness));
        }
        is_metal.then(|| coats.facets(roughness)).flatten().map_or(Self::None, Self::Facets)
    }
}

impl Material {
    /// Builds a material; what is tabulated of its surface is looked up or made.
    #[must_use]
    pub fn new(name: String, mut params: MaterialParams, coats: &mut Coats) -> Self {
        // Images whose numbers are all the same are numbers.
        for (factor, map) in [
            (&mut params.roughness, &mut params.roughness_map),
            (&mut params.specular, &mut params.specular_map),
            (&mut params.metallic, &mut params.metallic_map),
            (&mut params.opacity, &mut params.opacity_map),
        ] {
            if let [lo, hi] = range_of(*factor, map.as_ref())
                && lo == hi
            {
                (*factor, *map) = (lo.clamp(0.0, 1.0), None);
            }
        }
        let alpha = params.roughness * params.roughness;
        let alpha = (alpha >= Ggx::MIN_ALPHA).then_some(alpha);
        let roughness = match alpha {
            _ if params.roughness_map.is_some() => Roughness::Any,
            Some(alpha) => Roughness::Slope(alpha.to_bits()),
            None => Roughness::Smooth,
        };
        let tables = Tables::new(&params, roughness, coats);
        Self { name, params, alpha, tables }
    }

    /// Scattering model.
    #[must_use]
    pub fn model(&self) -> Model {
        self.params.model
    }

    /// GGX slope α where no image varies it; `None` for a smooth surface.
    #[must_use]
    pub fn alpha(&self) -> Option<f32> {
        self.alpha
    }

    /// Perceptual roughness without its image.
    #[must_use]
    pub fn roughness(&self) -> f32 {
        self.params.roughness
    }

    /// Image that multiplies the roughness. The slope is then at least
    /// [`Ggx::MIN_ALPHA`] everywhere.
    #[must_use]
    pub fn roughness_map(&self) -> Option<&ScalarMap> {
        self.params.roughness_map.as_ref()
    }

    /// Index of refraction of a dielectric or of a coat, relative to air.
    #[must_use]
    pub fn ior(&self) -> f32 {
        self.params.ior
    }

    /// Tint of a body of glass.
    #[must_use]
    pub fn glass_tint(&self) -> GlassTint {
        self.params.glass_tint
    }

    /// Reflectance of a [`Model::Conductor`] at 82 degrees over Schlick's, in [0, 1].
    #[must_use]
    pub fn edge_tint(&self) -> Rgb {
        self.params.edge_tint
    }

    /// Weight of a plastic's coat without its image.
    #[must_use]
    pub fn specular(&self) -> f32 {
        self.params.specular
    }

    /// Image that multiplies the weight of the coat.
    #[must_use]
    pub fn specular_map(&self) -> Option<&ScalarMap> {
        self.params.specular_map.as_ref()
    }

    /// Weight of the metal in an opaque model that is none itself, without its image.
    #[must_use]
    pub fn metallic(&self) -> f32 {
        self.params.metallic
    }

    /// Image that multiplies the weight of the metal.
    #[must_use]
    pub fn metallic_map(&self) -> Option<&ScalarMap> {
        self.params.metallic_map.as_ref()
    }

    /// Opacity without its image and cutoff.
    #[must_use]
    pub fn opacity_factor(&self) -> f32 {
        self.params.opacity
    }

    /// Image that multiplies the opacity.
    #[must_use]
    pub fn opacity_map(&self) -> Option<&ScalarMap> {
        self.params.opacity_map.as_ref()
    }

    /// Threshold below which an opacity counts as 0, and from which on as 1; `None` for none.
    #[must_use]
    pub fn opacity_cutoff(&self) -> Option<f32> {
        self.params.opacity_cutoff
    }

    /// Image that tilts the shading normal.
    #[must_use]
    pub fn relief(&self) -> Option<&Relief> {
        self.params.relief.as_ref()
    }

    /// Base colour without its texture, linear Rec.709.
    #[must_use]
    pub fn tint(&self) -> Rgb {
        self.params.base_color
    }

    /// Image that multiplies the tint.
    #[must_use]
    pub fn texture(&self) -> Option<&Texture> {
        self.params.texture.as_deref()
    }

    /// Base colour at `uv`, linear Rec.709 in [0, 1].
    #[must_use]
    pub fn color(&self, uv: Vec2) -> Rgb {
        // A floating-point image may exceed 1, an albedo may not.
        let texel = self.params.texture.as_ref().map_or(Rgb::ONE, |t| t.sample(uv).min(Rgb::ONE));
        self.params.base_color * texel
    }

    /// Largest channel that the base colour takes anywhere.
    #[must_use]
    pub fn max_albedo(&self) -> f32 {
        let texel = self.params.texture.as_ref().map_or(Rgb::ONE, |t| t.range()[1].truncate().min(Rgb::ONE));
        (self.params.base_color * texel).max_element()
    }

    /// Whether the base colour has an effect that a value can scale.
    #[must_use]
    pub fn has_value(&self) -> bool {
        !self.params.model.transmits() && self.max_albedo() > 0.0
    }

    /// Whether a ray may pass straight through some of the surface.
    #[must_use]
    pub fn is_translucent(&self) -> bool {
        let [least, _] = range_of(self.params.opacity, self.params.opacity_map.as_ref());
        least < self.params.opacity_cutoff.unwrap_or(1.0)
    }

    /// Probability that a ray does not pass straight through at `uv`.
    #[must_use]
    pub fn opacity(&self, uv: Vec2) -> f32 {
        let opacity = scaled(self.params.opacity, self.params.opacity_map.as_ref(), uv);
        match self.params.opacity_cutoff {
            None => opacity,
            Some(cutoff) => f32::from(opacity >= cutoff),
        }
    }

    /// Whether the surface emits.
    #[must_use]
    pub fn is_emissive(&self) -> bool {
        let brightest = self.params.emission_texture.as_ref().map_or(1.0, |t| t.max_component());
        self.params.emission != Rgb::ZERO && brightest > 0.0
    }

    /// Whether the back side emits too.
    #[must_use]
    pub fn emits_from_both_sides(&self) -> bool {
        self.params.emission_two_sided
    }

    /// Radiance emitted without its texture, W·m⁻²·sr⁻¹.
    #[must_use]
    pub fn emission_tint(&self) -> Rgb {
        self.params.emission
    }

    /// Image that multiplies the emission.
    #[must_use]
    pub fn emission_texture(&self) -> Option<&Texture> {
        self.params.emission_texture.as_deref()
    }

    /// The scattering function at `uv` for the base colour as it is; `sampling_value` is the
    /// factor on it for which lobes are chosen.
    #[must_use]
    pub fn bsdf(&self, uv: Vec2, sampling_value: f32) -> Bsdf<'_> {
        let p = &self.params;
        // An image must not switch between a perfect mirror and a lobe.
        let alpha = p.roughness_map.as_ref().map(|m| {
            let roughness = scaled(p.roughness, Some(m), uv);
            (roughness * roughness).max(Ggx::MIN_ALPHA)
        });
        // Tables of one slope know it.
        let alpha = alpha.or(self.alpha).unwrap_or(Ggx::MIN_ALPHA);
        let layer = match &self.tables {
            Tables::Glass(glass) => return Bsdf::Dielectric(glass.at(alpha).tinted(p.glass_tint)),
            Tables::Sheet { facets, average } => {
                let facets = facets.as_ref().map(|f| f.at(alpha));
                return Bsdf::Thin(Thin { eta: p.ior, average: *average, tint: self.color(uv), facets });
            }
            Tables::Coat(coat) => Layer::Coat(coat.at(alpha)),
            Tables::Facets(facets) => Layer::Facets(facets.at(alpha)),
            Tables::None => Layer::Bare,
        };
        let base = self.color(uv);
        let sampling_color = luminance(base) * sampling_value;
        let metallic = scaled(p.metallic, p.metallic_map.as_ref(), uv);
        if p.model == Model::Conductor || metallic >= 1.0 {
            let edge = if p.model == Model::Conductor { p.edge_tint } else { Rgb::ONE };
            return Bsdf::Conductor(Conductor::tinted(base, edge, sampling_color, layer.facets()));
        }
        let specular =
            if layer.coat().is_some() { scaled(p.specular, p.specular_map.as_ref(), uv) } else { 0.0 };
        match layer {
            _ if metallic == 0.0 && specular == 0.0 => Bsdf::Diffuse(Diffuse { albedo: base }),
            Layer::Coat(coat) if metallic == 0.0 && specular == 1.0 => {
                Bsdf::Plastic(Plastic { albedo: base, sampling_albedo: sampling_color, coat })
            }
            _ => Bsdf::Blend(Blend { color: base, sampling_color, metallic, specular, layer }),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::picture::Samples;
    use crate::scene::texture::{Channel, Encoding};

    /// Texels 0 and 1 side by side in red, 0.5 and 0.5 in green.
    fn map(channel: Channel) -> Option<ScalarMap> {
        let texels = Samples::U8(vec![0, 51, 0, 255, 255, 51, 0, 255]);
        let texture = Texture::from_samples([2, 1], 4, texels, Encoding::Linear);
        Some(ScalarMap { texture: Arc::new(texture), channel })
    }

    fn material(params: MaterialParams) -> Material {
        Material::new("m".into(), params, &mut Coats::default())
    }

    /// Centres of both texels, and between.
    const UV: [Vec2; 3] = [Vec2::new(0.25, 0.5), Vec2::new(0.75, 0.5), Vec2::new(0.5, 0.5)];

    #[test]
    fn mixtures_are_pure_where_their_weights_are() {
        let p = MaterialParams { model: Model::Plastic, ..MaterialParams::default() };
        let m = material(MaterialParams { metallic: 1.0, metallic_map: map(Channel::R), ..p.clone() });
        let [none, full, half] = UV.map(|uv| m.bsdf(uv, 1.0));
        assert!(matches!((none, full, half), (Bsdf::Plastic(_), Bsdf::Conductor(_), Bsdf::Blend(_))));
        let m = material(MaterialParams { specular_map: map(Channel::R), ..p.clone() });
        let [none, full, half] = UV.map(|uv| m.bsdf(uv, 1.0));
        assert!(matches!((none, full, half), (Bsdf::Diffuse(_), Bsdf::Plastic(_), Bsdf::Blend(_))));
        // An image of one number is a number; no coat, no table.
        let m = material(MaterialParams { specular_map: map(Channel::B), ..p.clone() });
        assert!(m.specular() == 0.0 && m.specular_map().is_none() && matches!(m.tables, Tables::None));
        let m = material(MaterialParams { specular: 2.0, specular_map: map(Channel::G), ..p });
        assert!((m.specular() - 0.4).abs() < 1e-6);
    }

    #[test]
    fn an_image_makes_no_perfect_mirror() {
        for model in [Model::Conductor, Model::Dielectric] {
            let p = MaterialParams {
                model,
                roughness: 1.0,
                roughness_map: map(Channel::R),
                ..MaterialParams::default()
            };
            let m = material(p);
            assert!(UV.iter().all(|&uv| m.bsdf(uv, 1.0).has_non_delta()));
        }
        let m =
            material(MaterialParams { model: Model::Conductor, roughness: 0.0, ..MaterialParams::default() });
        assert!(!m.bsdf(Vec2::ZERO, 1.0).has_non_delta());
    }

    #[test]
    fn opacity_follows_factor_image_and_cutoff() {
        let p = MaterialParams { opacity: 0.8, opacity_map: map(Channel::R), ..MaterialParams::default() };
        let m = material(p.clone());
        assert!(m.is_translucent());
        assert_eq!(UV.map(|uv| m.opacity(uv)), [0.0, 0.8, 0.4]);
        let m = material(MaterialParams { opacity_cutoff: Some(0.5), ..p.clone() });
        assert_eq!(UV.map(|uv| m.opacity(uv)), [0.0, 1.0, 0.0]);
        assert!(m.is_translucent());
        let m = material(MaterialParams { opacity_cutoff: Some(0.0), ..p });
        assert!(!m.is_translucent() && UV.iter().all(|&uv| m.opacity(uv) == 1.0));
        assert!(!material(MaterialParams::default()).is_translucent());
    }

    #[test]
    fn the_largest_albedo_holds_tint_and_image() {
        let texture = map(Channel::R).map(|m| m.texture);
        let p = MaterialParams { base_color: Rgb::new(0.3, 0.9, 0.9), texture, ..MaterialParams::default() };
        let m = material(p.clone());
        assert!((m.max_albedo() - 0.3).abs() < 1e-6 && m.has_value());
        assert!(!material(MaterialParams { model: Model::Dielectric, ..p.clone() }).has_value());
        assert!(!material(MaterialParams { base_color: Rgb::Z, ..p }).has_value());
    }

    #[test]
    fn lobes_are_chosen_for_the_largest_value() {
        let (wo, wi) = (Vec3::new(0.342, 0.0, 0.94), Vec3::new(0.468, 0.729, 0.5));
        for (metallic, specular) in [(0.0, 1.0), (0.3, 0.6), (1.0, 1.0)] {
            let color = Rgb::new(0.6, 0.3, 0.1);
            let m = material(MaterialParams {
                model: Model::Plastic,
                base_color: color,
                roughness: 0.6,
                metallic,
                specular,
                ..MaterialParams::default()
            });
            let of = |largest: f32| m.bsdf(Vec2::ZERO, largest).pdf(wo, wi);
            assert_ne!(of(0.2), of(1.5));
        }
    }
}
