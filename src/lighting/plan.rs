//! Sampling plans: probabilities, densities and numbers of samples.

use super::Lighting;
use crate::light::{LightSampler, SizeDensity};

/// Probabilities, densities and numbers that steer the samples of a render. No choice here biases a
/// picture, as long as every light that shines may be chosen and every size that it has may be
/// sampled.
///
/// ```
/// use lightopt_embree::{import, lighting::{Lighting, SampleCounts, SamplingPlan}};
///
/// let scene = import::load("tests/mitsuba/scenes/cornell.obj".as_ref())?.scene;
/// let lighting = Lighting::authored(&scene);
/// // More samples of the lights where the camera sees, everything else as usual.
/// let counts = SampleCounts { first_light_samples: 12, ..SampleCounts::default() };
/// let plan = SamplingPlan { counts, ..SamplingPlan::for_picture(&lighting) };
/// assert_eq!(plan.lights.pmf(0).0, 1.0);
/// # Ok::<(), import::ImportError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SamplingPlan {
    /// Distribution from which lights are chosen.
    pub lights: LightSampler,
    /// Density of each light's size coordinate; its extent is the largest size that is sampled.
    pub sizes: Vec<SizeDensity>,
    /// Largest value of the background that is recorded: lobes are chosen and paths survive by it.
    pub largest_value: f32,
    /// Numbers of light samples and light subpaths of a camera subpath.
    pub counts: SampleCounts,
}

/// Numbers of light samples and light subpaths of a camera subpath.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleCounts {
    /// Light samples at the first surface of a camera subpath, at least 1.
    pub first_light_samples: u32,
    /// Light samples at every later surface of a camera subpath, at least 1.
    pub light_samples: u32,
    /// Camera subpaths for each light subpath of the bidirectional integrator, at least 1; more than
    /// one saves time where light subpaths find little that next-event estimation does not.
    pub camera_subpaths: u32,
}

impl Default for SampleCounts {
    /// Six light samples where the camera sees and three at later surfaces: on the fruit basket these
    /// take as long as four everywhere and leave three quarters of the noise correction of f_q.
    fn default() -> Self {
        Self { first_light_samples: 6, light_samples: 3, camera_subpaths: 1 }
    }
}

/// Weight with which a light that is off is chosen, where one that shines has weight 1: small, since
/// such a light adds nothing to a picture; not zero, since a plan must not leave out a light.
const DARK_LIGHT: f32 = 0.01;

impl SamplingPlan {
    /// A plan that chooses all lights with the same probability and samples each up to its size in
    /// `lighting`.
    #[must_use]
    pub fn uniform(lighting: &Lighting) -> Self {
        Self {
            lights: LightSampler::new(&vec![1.0; lighting.n_lights()]),
            sizes: lighting.size.iter().map(|&s| SizeDensity::uniform_area(s as f32)).collect(),
            largest_value: lighting.value as f32,
            counts: SampleCounts::default(),
        }
    }

    /// As [`Self::uniform`], but the lights that are off are hardly ever chosen.
    #[must_use]
    pub fn for_picture(lighting: &Lighting) -> Self {
        let weight = |&l: &f64| if l as f32 > 0.0 { 1.0 } else { DARK_LIGHT };
        let weights: Vec<f32> = lighting.radiance.iter().map(weight).collect();
        Self { lights: LightSampler::new(&weights), ..Self::uniform(lighting) }
    }
}
