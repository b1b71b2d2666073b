//! Products of a run: what they are made from, and how pictures and checks are kept while they grow.

use super::{
    Reporter, RunError,
    render::{Between, Budget, MeasuredPicture},
    setup::Stage,
};
use crate::{
    audit::products::Products,
    camera::Camera,
    film::RgbFilm,
    integrator::Observer,
    lighting::{Lighting, SamplingPlan},
};

/// Kind of the film of a picture.
const FILM: &str = "film";
/// Kind of a render with its replicates.
const RENDER: &str = "render";

/// Key of samples of a scene: what is seen, how samples are spread and how paths are traced.
pub(super) fn samples_key(stage: &Stage, camera: &Camera, plan: &SamplingPlan, seed: u64) -> u64 {
    let renderer = stage.renderer();
    let words = format!("{camera:?} {plan:?} {:?} {:?}", renderer.integrator, renderer.sampler);
    Products::key(&words, &[stage.fingerprint, seed])
}

/// A picture that grows pass by pass, and is kept so.
pub(super) struct GrowingPicture<'a, R> {
    /// Products of the run.
    pub products: &'a Products,
    /// Key of the whole picture.
    pub key: u64,
    /// Whether no more passes are to be made.
    pub is_over: &'a dyn Fn() -> bool,
    /// Observer, which is told what cannot be kept.
    pub reporter: &'a R,
}

impl<R: Reporter> Between for GrowingPicture<'_, R> {
    fn is_over(&self) -> bool {
        (self.is_over)()
    }

    fn take_up(&self, film: &mut RgbFilm) -> u32 {
        self.products.begin_growing();
        let Some(bytes) = self.products.load(self.key, FILM) else { return 0 };
        let Some((spp, sums)) = bytes.split_first_chunk() else { return 0 };
        film.read_sums(sums).map_or(0, |_| u32::from_le_bytes(*spp))
    }

    fn passed(&self, film: &RgbFilm, spp: u32, is_last: bool) {
        if is_last || self.products.is_due() || self.is_over() {
            self.products.save(
                self.key,
                FILM,
                |text| self.reporter.note(text),
                |out| {
                    out.write_all(&spp.to_le_bytes())?;
                    film.write_sums(out)
                },
            );
        }
    }
}

/// Key of a picture of a lighting.
pub(super) fn picture_key(
    stage: &Stage,
    lighting: &Lighting,
    plan: &SamplingPlan,
    camera: &Camera,
    budget: Budget,
) -> u64 {
    let Budget { seed, spp, n_replicates } = budget;
    let words = format!("{lighting:?} {spp} {n_replicates}");
    Products::key(&words, &[samples_key(stage, camera, plan, seed)])
}

impl Stage<'_> {
    /// Renders replicates of a working picture as [`Renderer::render`](super::render::Renderer::render) does,
    /// or takes what an earlier attempt has rendered.
    pub(super) fn render_once(
        &self,
        lighting: &Lighting,
        plan: &SamplingPlan,
        budget: Budget,
        reporter: &impl Reporter,
        observer: &impl Observer,
    ) -> Result<MeasuredPicture, RunError> {
        let renderer = self.renderer();
        let key = picture_key(self, lighting, plan, self.camera, budget);
        let kept = self.products.load(key, RENDER);
        if let Some(kept) =
            kept.and_then(|bytes| MeasuredPicture::read(&bytes, lighting.exposure, renderer.luminance))
        {
            return Ok(kept);
        }
        let rendered = renderer.render(self.view(), lighting, plan, budget, observer)?;
        self.products.save(key, RENDER, |text| reporter.note(text), |out| rendered.write(out));
        Ok(rendered)
    }
}
