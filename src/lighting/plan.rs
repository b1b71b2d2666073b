//! Where samples go.

use super::Lighting;
use crate::light::{LightSampler, SizeDensity};

/// What steers the samples of a render. No choice here biases a picture, as long as every light
/// that shines may be chosen and every size that it has may be sampled.
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
    /// Chooses lights.
    pub lights: LightSampler,
    /// Distribution of the size coordinate per light; its extent is the largest size recorded.
    pub sizes: Vec<SizeDensity>,
    /// Largest value of the background that is recorded: lobes and survival follow it.
    pub largest_value: f32,
    /// Numbers of samples within a path.
    pub counts: SampleCounts,
}

/// How many light samples and light subpaths a camera path takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleCounts {
    /// Samples of the lights at the first vertex of a camera path, at least 1.
    pub first_light_samples: u32,
    /// Samples of the lights at every vertex that follows, at least 1.
    pub light_samples: u32,
    /// Camera subpaths for each light subpath, at least 1; more than one where light subpaths find
    /// little that next-event estimation does not. Only the bidirectional integrator has them.
    pub camera_subpaths: u32,
}

impl Default for SampleCounts {
    /// What is seen directly gets the most light samples: on the fruit basket six and then three
    /// take as long as four everywhere and leave three quarters of the variance.
    fn default() -> Self {
        Self { first_light_samples: 6, light_samples: 3, camera_subpaths: 1 }
    }
}

/// Weight with which a light that is off is chosen, beside 1 of one that shines: its share in a
/// picture is zero, but no light may be left out, so that the plan stays unbiased for its layer.
const DARK_LIGHT: f32 = 0.01;

impl SamplingPlan {
    /// Chooses every light as often, and samples each at its size in `lighting`.
    #[must_use]
    pub fn uniform(lighting: &Lighting) -> Self {
        Self {
            lights: LightSampler::new(&vec![1.0; lighting.n_lights()]),
            sizes: lighting.size.iter().map(|&s| SizeDensity::uniform_area(s as f32)).collect(),
            largest_value: lighting.value as f32,
            counts: SampleCounts::default(),
        }
    }

    /// As [`Self::uniform`], but hardly ever chooses the lights that are off.
    #[must_use]
    pub fn for_picture(lighting: &Lighting) -> Self {
        let weight = |&l: &f64| if l as f32 > 0.0 { 1.0 } else { DARK_LIGHT };
        let weights: Vec<f32> = lighting.radiance.iter().map(weight).collect();
        Self { lights: LightSampler::new(&weights), ..Self::uniform(lighting) }
    }
}
