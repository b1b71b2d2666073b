//! Materials: what a surface is made of, and the background's value.

use std::{collections::HashMap, sync::Arc};

use glam::Vec2;

use super::texture::{ScalarMap, Texture};
use crate::{
    bsdf::{Bsdf, Coat, Conductor, Dielectric, Diffuse, Plastic, microfacet::Ggx},
    math::{Rgb, luminance},
};

/// The scattering model of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// Lambertian.
    Diffuse,
    /// Metal; the base colour is the reflectance at normal incidence.
    Conductor,
    /// Clear glass.
    Dielectric,
    /// Diffuse under a dielectric coat.
    Plastic,
}

/// A surface material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the scene file.
    pub name: String,
    model: Model,
    base_color: Rgb,
    texture: Option<Arc<Texture>>,
    /// GGX slope; `None` is smooth.
    alpha: Option<f32>,
    ior: f32,
    coat: Option<Arc<Coat>>,
    /// Factor on the base colour: 1, or the background's value.
    value: f32,
    /// Factor that sampling decisions use: the largest background value.
    sampling_value: f32,
    opacity: f32,
    emission: Rgb,
    emission_texture: Option<Arc<Texture>>,
    emission_two_sided: bool,
}

/// Parameters of a [`Material`]: a model whose numbers images may vary.
#[derive(Clone, Debug)]
pub struct MaterialParams {
    /// Scattering model.
    pub model: Model,
    /// Linear Rec.709 albedo or metal reflectance, in [0, 1].
    pub base_color: Rgb,
    /// Multiplies the base colour.
    pub texture: Option<Arc<Texture>>,
    /// Perceptual roughness in [0, 1]; the GGX slope is its square.
    pub roughness: f32,
    /// Multiplies the roughness.
    pub roughness_map: Option<ScalarMap>,
    /// IOR of a dielectric or of a coat, over that of air.
    pub ior: f32,
    /// Strength of a plastic's coat in [0, 1]: the rest is the bare diffuse base.
    pub specular: f32,
    /// Multiplies the strength of the coat.
    pub specular_map: Option<ScalarMap>,
    /// Share of a metal of the same base colour and roughness in [0, 1]; of an opaque model.
    pub metallic: f32,
    /// Multiplies the share of metal.
    pub metallic_map: Option<ScalarMap>,
    /// Probability in [0, 1] that a ray does not pass straight through.
    pub opacity: f32,
    /// Multiplies the opacity.
    pub opacity_map: Option<ScalarMap>,
    /// An opacity below it counts as 0, any other as 1.
    pub opacity_cutoff: Option<f32>,
    /// Relief.
    pub relief: Option<Relief>,
    /// Radiance emitted by the front side, W·m⁻²·sr⁻¹, linear Rec.709.
    pub emission: Rgb,
    /// Multiplies the emission.
    pub emission_texture: Option<Arc<Texture>>,
    /// Whether the back side emits too.
    pub emission_two_sided: bool,
}

/// An image that tilts the shading normal.
#[derive(Clone, Debug)]
pub enum Relief {
    /// Tangent-space normals, x right, y up, stored as (n + 1)/2; `scale` multiplies x and y.
    NormalMap {
        /// The image, linear.
        texture: Arc<Texture>,
        /// Factor on x and y.
        scale: f32,
    },
    /// Heights in units of the texture's width; `scale` multiplies them.
    BumpMap {
        /// The image.
        height: ScalarMap,
        /// Factor on the heights.
        scale: f32,
    },
}

impl Default for MaterialParams {
    /// Diffuse grey.
    fn default() -> Self {
        Self {
            model: Model::Diffuse,
            base_color: Rgb::splat(0.8),
            texture: None,
            roughness: 0.5,
            roughness_map: None,
            ior: 1.5,
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

/// Coats by IOR and GGX slope: materials that are alike share their table.
#[derive(Debug, Default)]
pub struct Coats(HashMap<(u32, Option<u32>), Arc<Coat>>);

impl Coats {
    fn get(&mut self, ior: f32, alpha: Option<f32>) -> Arc<Coat> {
        let key = (ior.to_bits(), alpha.map(f32::to_bits));
        self.0.entry(key).or_insert_with(|| Arc::new(Coat::new(ior, alpha))).clone()
    }
}

impl Material {
    /// Builds a material; its coat, if any, is looked up or tabulated.
    #[must_use]
    pub fn new(name: String, params: MaterialParams, coats: &mut Coats) -> Self {
        let alpha = params.roughness * params.roughness;
        let alpha = (alpha >= Ggx::MIN_ALPHA).then_some(alpha);
        Self {
            name,
            model: params.model,
            base_color: params.base_color,
            texture: params.texture,
            alpha,
            ior: params.ior,
            coat: (params.model == Model::Plastic).then(|| coats.get(params.ior, alpha)),
            value: 1.0,
            sampling_value: 1.0,
            opacity: params.opacity,
            emission: params.emission,
            emission_texture: params.emission_texture,
            emission_two_sided: params.emission_two_sided,
        }
    }

    /// Scattering model.
    #[must_use]
    pub fn model(&self) -> Model {
        self.model
    }

    /// GGX slope; `None` is smooth.
    #[must_use]
    pub fn alpha(&self) -> Option<f32> {
        self.alpha
    }

    /// IOR of a dielectric or of a coat, over that of air.
    #[must_use]
    pub fn ior(&self) -> f32 {
        self.ior
    }

    /// Base colour without its texture, value included.
    #[must_use]
    pub fn tint(&self) -> Rgb {
        self.base_color * self.value
    }

    /// Image that multiplies the tint.
    #[must_use]
    pub fn texture(&self) -> Option<&Texture> {
        self.texture.as_deref()
    }

    /// Sets the factor on the base colour, and the largest it will ever take.
    pub fn set_value(&mut self, value: f32, largest: f32) {
        self.value = value;
        self.sampling_value = largest;
    }

    /// Base colour at `uv`, value included.
    #[must_use]
    pub fn color(&self, uv: Vec2) -> Rgb {
        self.unscaled_color(uv) * self.value
    }

    /// Base colour at `uv` at value 1.
    fn unscaled_color(&self, uv: Vec2) -> Rgb {
        self.base_color * self.texture.as_ref().map_or(Rgb::ONE, |t| t.sample(uv))
    }

    /// Largest channel the base colour takes at value 1.
    #[must_use]
    pub fn max_albedo(&self) -> f32 {
        self.base_color.max_element() * self.texture.as_ref().map_or(1.0, |t| t.max_component())
    }

    /// Whether the base colour has an effect that a value can scale.
    #[must_use]
    pub fn has_value(&self) -> bool {
        self.model != Model::Dielectric && self.max_albedo() > 0.0
    }

    /// Whether a ray may pass straight through some of the surface.
    #[must_use]
    pub fn is_translucent(&self) -> bool {
        self.opacity < 1.0
    }

    /// Probability that a ray does not pass straight through at `uv`.
    #[must_use]
    pub fn opacity(&self, _uv: Vec2) -> f32 {
        self.opacity
    }

    /// Whether the surface emits.
    #[must_use]
    pub fn is_emissive(&self) -> bool {
        self.emission != Rgb::ZERO
    }

    /// Whether the back side emits too.
    #[must_use]
    pub fn emits_from_both_sides(&self) -> bool {
        self.emission_two_sided
    }

    /// Radiance emitted without its texture, W·m⁻²·sr⁻¹.
    #[must_use]
    pub fn emission_tint(&self) -> Rgb {
        self.emission
    }

    /// Image that multiplies the emission.
    #[must_use]
    pub fn emission_texture(&self) -> Option<&Texture> {
        self.emission_texture.as_deref()
    }

    /// Radiance emitted at `uv`, W·m⁻²·sr⁻¹.
    #[must_use]
    pub fn emission(&self, uv: Vec2) -> Rgb {
        self.emission * self.emission_texture.as_ref().map_or(Rgb::ONE, |t| t.sample(uv))
    }

    /// The scattering function at `uv`.
    #[must_use]
    pub fn bsdf(&self, uv: Vec2) -> Bsdf<'_> {
        let ggx = self.alpha.map(Ggx::new);
        let base = if self.model == Model::Dielectric { Rgb::ONE } else { self.unscaled_color(uv) };
        let color = base * self.value;
        match (&self.coat, self.model) {
            (Some(coat), _) => {
                let sampling_albedo = luminance(base) * self.sampling_value;
                Bsdf::Plastic(Plastic { albedo: color, sampling_albedo, coat })
            }
            (None, Model::Conductor) => Bsdf::Conductor(Conductor { f0: color, ggx }),
            (None, Model::Dielectric) => Bsdf::Dielectric(Dielectric { eta: self.ior, ggx }),
            (None, _) => Bsdf::Diffuse(Diffuse { albedo: color }),
        }
    }
}
