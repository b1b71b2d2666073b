//! Pictures in replicates, and their f_q with its error.

use std::{
    io::{self, Write},
    time::{Duration, Instant},
};

use crate::{
    denoise::denoise,
    film::{Picture, RgbFilm, image_file::LinearImage},
    integrator::{Integrator, Observer, Pilot, RenderError, Samples, View, aov::Features},
    lighting::{Lighting, SamplingPlan},
    math::Measure,
    objective::{
        Evaluation, JackknifeEstimate, LABELLINGS, Objective, ObjectiveError, Replicates, Smoothing,
    },
    sampler::SamplerKind,
};

/// Integrator, sampler and measure of luminance with which pictures are rendered and measured.
#[derive(Clone, Copy, Debug)]
pub struct Renderer {
    /// Integrator with its options.
    pub integrator: Integrator,
    /// Family of sample sequences.
    pub sampler: SamplerKind,
    /// Measure of luminance.
    pub measure: Measure,
}

/// Samples of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Seed of the scrambles.
    pub seed: u64,
    /// Samples per pixel over all replicates.
    pub spp: u32,
    /// Number of replicates, each of `spp / n_replicates` samples, at least 1.
    pub n_replicates: u32,
}

/// Independent replicates of one picture and their mean.
#[derive(Debug)]
pub struct MeasuredPicture {
    /// Mean over the replicates.
    pub picture: Picture,
    /// Linear radiance of each replicate, row by row.
    replicates: Vec<Vec<[f32; 3]>>,
    /// Factor on luminance before display encoding.
    exposure: f64,
    /// Measure of luminance.
    measure: Measure,
}

/// f_q of a picture, with and without its noise bias.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// f_q and terms of the mean picture, noise included.
    pub plain: Evaluation,
    /// f_q and terms corrected for noise bias, with their error.
    pub estimate: JackknifeEstimate,
}

impl Renderer {
    /// A sampling plan with the numbers of samples that suit a render of some lightings together, see [`Pilot`].
    #[must_use]
    pub fn suited(
        &self,
        plan: SamplingPlan,
        view: View,
        lightings: &[&Lighting],
        seed: u64,
        spp: u32,
    ) -> SamplingPlan {
        let Self { integrator, sampler, .. } = *self;
        let counts = Pilot { integrator, view, lightings, sampler, seed, spp }.choose(&plan);
        SamplingPlan { counts, ..plan }
    }

    /// Renders replicates of the picture of a lighting from independent scrambles.
    ///
    /// # Errors
    /// As [`Integrator::render`].
    pub fn render(
        &self,
        view: View,
        lighting: &Lighting,
        plan: &SamplingPlan,
        budget: Budget,
        observer: &impl Observer,
    ) -> Result<MeasuredPicture, RenderError> {
        let count = (budget.spp / budget.n_replicates).max(1);
        let samples = Samples { sampler: self.sampler, seed: budget.seed, first: 0, count };
        let pictures = (0..budget.n_replicates)
            .map(|r| {
                let mut film = RgbFilm::by_light(view.camera.size(), lighting);
                let samples = samples.replicate(u64::from(r));
                self.integrator.render(view, lighting, plan, &mut film, samples, observer)?;
                Ok(film.develop(lighting, count))
            })
            .collect::<Result<Vec<Picture>, RenderError>>()?;
        let images: Vec<&[[f32; 3]]> = pictures.iter().map(|p| p.rgb.as_slice()).collect();
        let picture = Picture {
            width: pictures[0].width,
            height: pictures[0].height,
            rgb: mean(&images),
            lights: (0..lighting.n_lights())
                .map(|l| mean(&pictures.iter().map(|p| p.lights[l].as_slice()).collect::<Vec<_>>()))
                .collect(),
        };
        Ok(MeasuredPicture {
            picture,
            replicates: pictures.into_iter().map(|p| p.rgb).collect(),
            exposure: lighting.exposure,
            measure: self.measure,
        })
    }
}

/// Time that a pass of a picture should take: an interrupt waits for no more.
const PASS: Duration = Duration::from_millis(700);
/// Time of one sample per pixel from which an interrupt does not wait for the end of a pass: the film is
/// then copied before each, which takes some hundredths of that time, and the memory of a film.
const SLOW: Duration = Duration::from_secs(1);

/// A picture that was rendered in passes.
#[derive(Debug)]
pub struct PassedPicture {
    /// The picture so far.
    pub picture: Picture,
    /// Samples per pixel that it has.
    pub spp: u32,
}

impl Renderer {
    /// Renders the picture of a lighting in passes, of `budget.spp` samples per pixel in all or, once
    /// `is_over` says so between two of them, of those so far. The passes do not change the picture:
    /// its samples are added in the same order. Where the observer cancels a pass, the picture is that of
    /// the passes before it.
    ///
    /// # Errors
    /// As [`Integrator::render`]; cancelled only where there is no picture yet.
    pub fn render_in_passes(
        &self,
        view: View,
        lighting: &Lighting,
        plan: &SamplingPlan,
        budget: Budget,
        is_over: &dyn Fn() -> bool,
        observer: &impl Observer,
    ) -> Result<PassedPicture, RenderError> {
        let mut film = RgbFilm::by_light(view.camera.size(), lighting);
        let all = Samples { sampler: self.sampler, seed: budget.seed, first: 0, count: budget.spp.max(1) };
        let (mut spp, mut count) = (0, 1);
        let mut before: Option<RgbFilm> = None;
        while spp < all.count && !(spp > 0 && is_over()) {
            let clock = Instant::now();
            let samples = Samples { first: spp, count: count.min(all.count - spp), ..all.replicate(0) };
            let may_stop = spp == 0 || before.is_some();
            let each = EachSample { observer, count: u64::from(samples.count), may_stop };
            match self.integrator.render(view, lighting, plan, &mut film, samples, &each) {
                Err(RenderError::Cancelled) if spp > 0 => {
                    film = before.unwrap_or(film);
                    break;
                }
                other => _ = other?,
            }
            spp += samples.count;
            let per_sample = clock.elapsed().as_secs_f64() / f64::from(samples.count);
            count = (PASS.as_secs_f64() / per_sample.max(1e-9)).clamp(1.0, 1e6) as u32;
            drop(before.take());
            before = (per_sample > SLOW.as_secs_f64() && spp < all.count).then(|| film.clone());
        }
        Ok(PassedPicture { picture: film.develop(lighting, spp), spp })
    }
}

/// An observer that counts a row once for each sample.
struct EachSample<'a, O> {
    observer: &'a O,
    /// Samples per pixel of the pass.
    count: u64,
    /// Whether the observer may cancel the pass.
    may_stop: bool,
}

impl<O: Observer> Observer for EachSample<'_, O> {
    fn advance(&self, rows: u64) {
        self.observer.advance(rows * self.count);
    }
    fn cancelled(&self) -> bool {
        self.may_stop && self.observer.cancelled()
    }
}

/// Mean of pictures, pixel by pixel.
fn mean(images: &[&[[f32; 3]]]) -> Vec<[f32; 3]> {
    let n = images.len() as f64;
    (0..images[0].len())
        .map(|p| std::array::from_fn(|c| (images.iter().map(|i| f64::from(i[p][c])).sum::<f64>() / n) as f32))
        .collect()
}

impl MeasuredPicture {
    /// Writes the picture and its replicates, exactly.
    ///
    /// # Errors
    /// When `out` cannot be written to.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let Picture { width, height, rgb, lights } = &self.picture;
        for n in [*width, *height, lights.len(), self.replicates.len()] {
            out.write_all(&(n as u64).to_le_bytes())?;
        }
        for image in [rgb].into_iter().chain(lights).chain(&self.replicates) {
            let bytes: Vec<u8> = image.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Reads what [`Self::write`] has written, of a lighting's exposure; `None` where it is too short.
    #[must_use]
    pub fn read(bytes: &[u8], exposure: f64, measure: Measure) -> Option<Self> {
        let (numbers, mut rest) = bytes.split_at_checked(32)?;
        let numbers = numbers.as_chunks().0.iter().map(|b| usize::try_from(u64::from_le_bytes(*b)).ok());
        let numbers: Option<Vec<usize>> = numbers.collect();
        let [width, height, n_lights, n_replicates] = numbers?[..] else { return None };
        let length = width.checked_mul(height)?.checked_mul(12)?;
        let mut image = || {
            let (image, after) = rest.split_at_checked(length)?;
            rest = after;
            let value = |b: &[u8; 12]| {
                std::array::from_fn(|c| f32::from_le_bytes(std::array::from_fn(|i| b[4 * c + i])))
            };
            Some(image.as_chunks::<12>().0.iter().map(value).collect::<Vec<[f32; 3]>>())
        };
        let rgb = image()?;
        let lights = (0..n_lights).map(|_| image()).collect::<Option<_>>()?;
        let replicates = (0..n_replicates).map(|_| image()).collect::<Option<_>>()?;
        Some(Self { picture: Picture { width, height, rgb, lights }, replicates, exposure, measure })
    }

    /// The mean picture for people to look at, denoised where there are features to do it by and replicates
    /// for two halves.
    #[must_use]
    pub fn shown(&self, features: Option<&Features>) -> LinearImage {
        let Picture { width, height, ref rgb, .. } = self.picture;
        let (first, second) = self.replicates.split_at(self.replicates.len() / 2);
        let denoised = features.filter(|_| !first.is_empty()).map(|features| {
            let [a, b] =
                [first, second].map(|half| [mean(&half.iter().map(Vec::as_slice).collect::<Vec<_>>())]);
            denoise(features, [&a, &b]).remove(0)
        });
        LinearImage { width, height, rgb: denoised.unwrap_or_else(|| rgb.clone()) }
    }

    /// Display luminance of the mean picture.
    #[must_use]
    pub fn display(&self) -> Vec<f64> {
        self.measure.encode_image(&self.picture.rgb, self.exposure)
    }

    /// Smoothed f_q of the mean picture.
    #[must_use]
    pub fn smoothed(&self, objective: &Objective, smoothing: &Smoothing) -> f64 {
        objective.evaluate_smooth(&self.display(), smoothing, None).f_q
    }

    /// f_q of the mean picture, with and without its noise bias.
    ///
    /// # Errors
    /// With fewer than two replicates.
    pub fn measure(&self, objective: &Objective) -> Result<Measurement, ObjectiveError> {
        let Self { measure, exposure, .. } = *self;
        let linear: Vec<Vec<f64>> = self.replicates.iter().map(|rgb| measure.planes(rgb)).collect();
        let estimate = Replicates { linear: &linear, measure, exposure }.measure(objective, LABELLINGS)?;
        Ok(Measurement { plain: objective.evaluate(&self.display()), estimate })
    }
}
