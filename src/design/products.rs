//! Products of a run: what they are made from, and how pictures and checks are kept while they grow.

use super::{
    Reporter, RunError,
    growing::{Between, Grown, Wanted},
    render::{Budget, MeasuredPicture},
    setup::Stage,
};
use crate::{
    audit::products::Products,
    camera::Camera,
    integrator::Observer,
    lighting::{Lighting, SamplingPlan},
};

/// Kind of the pictures that grow together.
const PICTURES: &str = "pictures";
/// Kind of a render with its replicates.
const RENDER: &str = "render";

/// Key of samples of a scene: what is seen, how samples are spread and how paths are traced.
pub(super) fn samples_key(stage: &Stage, camera: &Camera, plan: &SamplingPlan, seed: u64) -> u64 {
    let renderer = stage.renderer();
    let words = format!("{camera:?} {plan:?} {:?} {:?}", renderer.integrator, renderer.sampler);
    Products::key(&words, &[stage.fingerprint, seed])
}

/// Pictures that grow pass by pass, and are kept so.
pub(super) struct GrowingPictures<'a, R> {
    /// Products of the run.
    pub products: &'a Products,
    /// Key of the pictures.
    pub key: u64,
    /// Whether no more passes are to be made.
    pub is_over: &'a (dyn Fn() -> bool + Sync),
    /// Called after a round, as [`Between::next_round`].
    pub next_round: &'a (dyn Fn(&Grown) -> Option<Vec<u32>> + Sync),
    /// Observer, which is told what cannot be kept.
    pub reporter: &'a R,
}

impl<R: Reporter> Between for GrowingPictures<'_, R> {
    fn is_over(&self) -> bool {
        (self.is_over)()
    }

    fn kept(&self) -> Option<Vec<u8>> {
        self.products.begin_growing();
        self.products.load(self.key, PICTURES)
    }

    fn passed(&self, grown: &Grown, is_last: bool) {
        if is_last || self.products.is_due() {
            let say = |text: &str| self.reporter.note(text);
            self.products.save(self.key, PICTURES, say, |out| grown.write(out));
        }
    }

    fn next_round(&self, grown: &Grown) -> Option<Vec<u32>> {
        (self.next_round)(grown)
    }
}

/// Key of pictures that grow together.
pub(super) fn growing_key(stage: &Stage, wanted: &Wanted) -> u64 {
    let Wanted { view, lightings, plan, seed, spp } = wanted;
    Products::key(&format!("{lightings:?} {spp}"), &[samples_key(stage, view.camera, plan, *seed)])
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
            kept.and_then(|bytes| MeasuredPicture::read(&bytes, lighting.exposure, renderer.measure))
        {
            return Ok(kept);
        }
        let rendered = renderer.render(self.view(), lighting, plan, budget, observer)?;
        self.products.save(key, RENDER, |text| reporter.note(text), |out| rendered.write(out));
        Ok(rendered)
    }
}
