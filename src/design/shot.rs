//! A picture measured: replicates, their mean, and f_q with its error.

use crate::{
    film::{LightState, Picture, Region, RgbFilm},
    integrator::{Integrator, Observer, RenderError, Sampling},
    math::display::{LuminanceMode, luminance},
    objective::{
        Evaluation, JackknifeEstimate, LABELLINGS, Objective, ObjectiveError, Replicates, Smoothing,
    },
    sampler::SamplerKind,
    scene::Scene,
};

/// How pictures are taken.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Light transport.
    pub integrator: Integrator,
    /// Sample sequences.
    pub sampler: SamplerKind,
    /// Measure of luminance.
    pub luminance: LuminanceMode,
}

/// Independent replicates of one picture and their mean.
#[derive(Debug)]
pub struct Shot {
    /// Mean over the replicates.
    pub picture: Picture,
    replicates: Vec<Vec<[f32; 3]>>,
    exposure: f64,
    luminance: LuminanceMode,
}

/// f_q of a shot.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Of the mean picture.
    pub plain: Evaluation,
    /// Freed of noise bias, with its error.
    pub estimate: JackknifeEstimate,
}

impl Camera {
    /// Renders `n_replicates` pictures of `spp / n_replicates` samples (at
    /// least one) from independent scrambles of `seed`, with the scene's
    /// present lights.
    ///
    /// # Errors
    /// Those of [`Integrator::render`].
    pub fn shoot(
        &self,
        scene: &Scene,
        seed: u64,
        spp: u32,
        n_replicates: u32,
        observer: &impl Observer,
    ) -> Result<Shot, RenderError> {
        let states: Vec<LightState> =
            scene.lights.iter().map(|l| LightState { radiance: l.radiance, size: l.size }).collect();
        let radiance: Vec<f32> = states.iter().map(|s| s.radiance).collect();
        let count = (spp / n_replicates).max(1);
        let sampling = Sampling { sampler: self.sampler, seed, first: 0, count };
        let pictures = (0..n_replicates)
            .map(|r| {
                let mut film = RgbFilm::new(Region::full(scene.camera.size()), &states, scene.exposure);
                self.integrator.render(scene, &mut film, sampling.replicate(u64::from(r)), observer)?;
                Ok(film.develop(&radiance, count))
            })
            .collect::<Result<Vec<Picture>, RenderError>>()?;
        let images: Vec<&[[f32; 3]]> = pictures.iter().map(|p| p.rgb.as_slice()).collect();
        let picture = Picture {
            width: pictures[0].width,
            height: pictures[0].height,
            rgb: mean(&images),
            lights: (0..states.len())
                .map(|l| mean(&pictures.iter().map(|p| p.lights[l].as_slice()).collect::<Vec<_>>()))
                .collect(),
        };
        Ok(Shot {
            picture,
            replicates: pictures.into_iter().map(|p| p.rgb).collect(),
            exposure: f64::from(scene.exposure),
            luminance: self.luminance,
        })
    }
}

/// Mean of the pictures.
fn mean(images: &[&[[f32; 3]]]) -> Vec<[f32; 3]> {
    let n = images.len() as f64;
    (0..images[0].len())
        .map(|p| std::array::from_fn(|c| (images.iter().map(|i| f64::from(i[p][c])).sum::<f64>() / n) as f32))
        .collect()
}

impl Shot {
    /// Display luminance of the mean picture.
    #[must_use]
    pub fn display(&self) -> Vec<f64> {
        self.luminance.encode_image(&self.picture.rgb, self.exposure)
    }

    /// f_q and terms of the mean picture, smoothed.
    #[must_use]
    pub fn smoothed(&self, objective: &Objective, smoothing: &Smoothing) -> f64 {
        objective.evaluate_smooth(&self.display(), smoothing, None).f_q
    }

    /// Measures the shot.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn measure(&self, objective: &Objective) -> Result<Measurement, ObjectiveError> {
        let linear = |rgb: &Vec<[f32; 3]>| rgb.iter().map(|&c| luminance(c)).collect();
        let linear: Vec<Vec<f64>> = self.replicates.iter().map(linear).collect();
        let Self { luminance, exposure, .. } = *self;
        let estimate = Replicates { linear: &linear, luminance, exposure }.measure(objective, LABELLINGS)?;
        Ok(Measurement { plain: objective.evaluate(&self.display()), estimate })
    }
}
