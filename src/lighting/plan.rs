//! Sampling plans: probabilities, densities and numbers of samples.

use std::fmt;

use serde::Serialize;

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

/// Numbers of light samples and light subpaths of a camera subpath, and where its roulette begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SampleCounts {
    /// Light samples at the first surface of a camera subpath, at least 1.
    pub first_light_samples: u32,
    /// Light samples at every later surface of a camera subpath, at least 1.
    pub light_samples: u32,
    /// Camera subpaths for each light subpath of the bidirectional integrator, at least 1; more than
    /// one saves time where light subpaths find little that next-event estimation does not.
    pub camera_subpaths: u32,
    /// Edges of a subpath after which Russian roulette begins, at least 1.
    pub first_roulette: u32,
}

impl fmt::Display for SampleCounts {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "light samples: {} at the first surface, {} at later ones; a light subpath for every {} camera subpaths; \
             Russian roulette from edge {}",
            self.first_light_samples, self.light_samples, self.camera_subpaths, self.first_roulette
        )
    }
}

impl Default for SampleCounts {
    /// Six light samples where the camera sees and three at later surfaces: on the fruit basket these
    /// take as long as four everywhere and leave three quarters of the noise correction of f_q. Russian roulette
    /// before the third edge took 10 % less time there and left more noise.
    fn default() -> Self {
        Self { first_light_samples: 6, light_samples: 3, camera_subpaths: 1, first_roulette: 3 }
    }
}

/// Numbers of samples where several lightings share a render, most of it denoised. The square of the noise that
/// was told times the processors' time, at 64 samples a pixel of 320 × 240, was 2.8 on the fruit basket, 6.1 before a
/// caustic, 1.5 with rough glass and 1.1 with a glossy floor; 3.4, 10.7, 1.5 and 1.3 with twice the light samples
/// and as many light subpaths as camera subpaths; 2.6, 4.9, 1.7 and 1.0 with half as many light subpaths.
const SHARED: SampleCounts =
    SampleCounts { first_light_samples: 6, light_samples: 3, camera_subpaths: 2, first_roulette: 3 };

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

    /// Upper bound of the lightings of [`Self::for_pictures`].
    pub const MAX_TOGETHER: usize = SizeDensity::MAX_LIKELY;

    /// A plan for pictures of several lightings from one render. Each comes with a weight for every light: the
    /// share of the samples that its picture would have the light be chosen for, best as its noise there. The
    /// size of a light is drawn from a mixture of the densities of [`Self::for_picture`] for the lightings in
    /// which it shines.
    ///
    /// # Panics
    /// Without lightings, or with more than [`Self::MAX_TOGETHER`].
    #[must_use]
    pub fn for_pictures(lightings: &[(&Lighting, &[f32])]) -> Self {
        let (first, _) = lightings[0];
        let sum: f32 = lightings.iter().flat_map(|(_, weights)| *weights).sum();
        let mean = (sum / first.n_lights().max(1) as f32).max(f32::MIN_POSITIVE);
        let light = |l: usize| {
            let size = |x: &Lighting| x.size[l] as f32;
            let shining =
                lightings.iter().filter(|(x, weights)| x.radiance[l] as f32 > 0.0 && weights[l] > 0.0);
            let mut sizes: Vec<(f32, f32)> = Vec::new();
            for (x, weights) in shining {
                match sizes.iter_mut().find(|(s, _)| *s == size(x)) {
                    Some((_, of_both)) => *of_both += weights[l],
                    None => sizes.push((size(x), weights[l])),
                }
            }
            match sizes[..] {
                [] => (DARK_LIGHT * mean, SizeDensity::uniform_area(size(first))),
                [(size, weight)] => (weight, SizeDensity::uniform_area(size)),
                _ => (sizes.iter().map(|(_, weight)| weight).sum(), SizeDensity::one_of(&sizes)),
            }
        };
        let (weights, sizes): (Vec<f32>, Vec<SizeDensity>) = (0..first.n_lights()).map(light).unzip();
        Self {
            lights: LightSampler::new(&weights),
            sizes,
            largest_value: lightings.iter().fold(0.0, |most, (x, _)| x.value.max(most)) as f32,
            counts: if lightings.len() == 1 { SampleCounts::default() } else { SHARED },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lighting(radiance: [f64; 3], size: [f64; 3], value: f64) -> Lighting {
        Lighting { radiance: radiance.into(), size: size.into(), value, exposure: 1.0, color: Vec::new() }
    }

    #[test]
    fn one_picture_is_sampled_as_by_itself() {
        let x = lighting([2.0, 3.0, 1.0], [0.5, 1.0, 2.0], 0.7);
        let (alone, one) = (SamplingPlan::for_picture(&x), SamplingPlan::for_pictures(&[(&x, &[0.5; 3])]));
        assert_eq!(format!("{alone:?}"), format!("{one:?}"));
    }

    #[test]
    fn pictures_share_the_samples_of_lights_by_their_weights() {
        let a = lighting([2.0, 0.0, 0.0], [0.5, 1.0, 3.0], 0.7);
        let b = lighting([3.0, 1.0, 0.0], [1.0, 2.0, 3.0], 1.2);
        let plan = SamplingPlan::for_pictures(&[(&a, &[0.5, 0.4, 0.1]), (&b, &[1.0, 1.5, 0.5])]);
        assert_eq!(plan.largest_value, 1.2);
        // A third of the samples for the small one, and of the rest what falls into it.
        assert!((plan.sizes[0].below(0.5) - (1.0 / 3.0 + 2.0 / 3.0 * 0.25)).abs() < 1e-6);
        // Where it is off, its size does not count.
        assert_eq!(plan.sizes[1], SizeDensity::uniform_area(2.0));
        assert_eq!(plan.sizes[2].extent(), 3.0);
        // Where it is off, its weight does not count.
        assert_eq!(plan.lights.pmf(0), plan.lights.pmf(1));
        assert!(plan.lights.pmf(2).0 > 0.0 && plan.lights.pmf(2).0 < 0.01);
    }
}
