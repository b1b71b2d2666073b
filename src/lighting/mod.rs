//! Lighting, which pictures of a scene vary, and sampling plans, which steer their samples.
//!
//! A [`Lighting`] decides what a picture shows, a [`SamplingPlan`] only how noisy it is. Both are
//! plain values beside a [`Scene`] that does not change, so that pictures of many lightings may be
//! rendered side by side.

mod plan;

use serde::{Deserialize, Serialize};

use crate::{files::number::Number, light::LightColor, scene::Scene};

pub use plan::{SampleCounts, SamplingPlan};

/// Largest exposure, and inverse of the least: what lies beyond leaves no f32 to compute with.
pub const MAX_EXPOSURE: f32 = 1e12;
/// Largest radiance of a light, in the light's own unit; that of the sun's disc is 2e7. Films sum in
/// units of display white, which at larger radiances leave the range of f32.
pub const MAX_RADIANCE: f32 = 1e15;

/// The radiance of a light, if it is in the range that can be computed with; otherwise what is allowed.
///
/// # Errors
/// When it is negative, larger than [`MAX_RADIANCE`], or no number.
pub fn radiance(given: f64) -> Result<f32, String> {
    let radiance = given as f32;
    if (0.0..=MAX_RADIANCE).contains(&radiance) {
        return Ok(radiance);
    }
    Err(format!("must be >= 0 and at most {MAX_RADIANCE:e}, got {}", Number(given)))
}

/// The exposure, if it is in the range that can be computed with; otherwise what is allowed.
///
/// # Errors
/// When it is less than 1 / [`MAX_EXPOSURE`], larger than [`MAX_EXPOSURE`], or no number.
pub fn exposure(given: f64) -> Result<f32, String> {
    let (exposure, least) = (given as f32, 1.0 / MAX_EXPOSURE);
    if (least..=MAX_EXPOSURE).contains(&exposure) {
        return Ok(exposure);
    }
    Err(format!("must be from {least:e} to {MAX_EXPOSURE:e}, got {}", Number(given)))
}

/// Values of everything that varies between pictures of a scene. Vectors are by light, in the scene's
/// order.
///
/// ```
/// use lightopt_embree::{import, lighting::Lighting};
///
/// let scene = import::load("tests/mitsuba/scenes/cornell.obj".as_ref())?.scene;
/// let authored = Lighting::authored(&scene);
/// assert_eq!((authored.radiance[0], authored.size[0]), (6.0, 1.0));
///
/// // Another picture of the same scene: a lamp half as large with the same flux.
/// let hard = Lighting { radiance: vec![24.0], size: vec![0.5], ..authored.clone() };
/// assert_eq!((hard.n_lights(), hard.exposure), (1, authored.exposure));
/// # Ok::<(), import::ImportError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lighting {
    /// Radiance of each light, per unit of its colour: W·m⁻²·sr⁻¹, for a point light its intensity in
    /// W·sr⁻¹, for a distant light its irradiance in W·m⁻².
    pub radiance: Vec<f64>,
    /// Size of each light, a factor on its unit extents; without effect for a light that has no size.
    pub size: Vec<f64>,
    /// Value of the background: a factor on the base colour of its materials.
    pub value: f64,
    /// Exposure: a factor on luminance before display encoding.
    pub exposure: f64,
    /// Colour of each light; empty where all have the colour with which they are recorded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub color: Vec<LightColor>,
}

impl Lighting {
    /// The lighting that the scene's author gave it, the background at value 1.
    #[must_use]
    pub fn authored(scene: &Scene) -> Self {
        Self {
            radiance: scene.lights.iter().map(|l| f64::from(l.radiance)).collect(),
            size: scene.lights.iter().map(|l| f64::from(l.size)).collect(),
            value: 1.0,
            exposure: f64::from(scene.exposure),
            color: if scene.lights.iter().all(|l| l.picture_color == LightColor::Recorded) {
                Vec::new()
            } else {
                scene.lights.iter().map(|l| l.picture_color).collect()
            },
        }
    }

    /// Colour of a light.
    #[must_use]
    pub fn color_of(&self, light: usize) -> LightColor {
        self.color.get(light).copied().unwrap_or_default()
    }

    /// Factors by which a light's contributions at unit radiance enter a picture, by channel, with the digits
    /// with which pictures are rendered.
    #[must_use]
    pub fn gain_of(&self, light: usize) -> [f64; 3] {
        let radiance = self.radiance[light] as f32;
        let factors = self.color_of(light).gain().unwrap_or([1.0; 3]);
        factors.map(|factor| f64::from(factor) * f64::from(radiance))
    }

    /// The lighting of some of the lights, in the order in which they are given.
    #[must_use]
    pub fn of_lights(&self, lights: &[usize]) -> Self {
        let color = if self.color.is_empty() { &[][..] } else { lights };
        Self {
            radiance: lights.iter().map(|&l| self.radiance[l]).collect(),
            size: lights.iter().map(|&l| self.size[l]).collect(),
            color: color.iter().map(|&l| self.color[l]).collect(),
            ..*self
        }
    }

    /// Colour of a light, to be changed.
    pub fn color_mut(&mut self, light: usize) -> &mut LightColor {
        if self.color.is_empty() {
            self.color = vec![LightColor::Recorded; self.radiance.len()];
        }
        &mut self.color[light]
    }

    /// The same lighting with every light at radiance 1.
    #[must_use]
    pub fn at_unit_radiance(&self) -> Self {
        Self { radiance: vec![1.0; self.radiance.len()], ..self.clone() }
    }

    /// Number of lights.
    #[must_use]
    pub fn n_lights(&self) -> usize {
        self.radiance.len()
    }
}
