//! The transport basis of a run: planning, rendering, aiming and storing it.

use std::{
    path::{Path, PathBuf},
    sync::OnceLock,
};

use serde_json::Value;

use super::{
    Reporter, RunError,
    evaluator::Evaluator,
    observer::Unstoppable,
    products::samples_key,
    seeds::{Purpose, seed_for},
    setup::{Setup, Stage},
    small_copy,
};
use crate::{
    audit::{
        picture,
        products::Products,
        stored::{About, StoredFeatures},
    },
    files::number::Bytes,
    film::{Picture, image_file::LinearImage},
    integrator::{RenderError, aov::Features},
    light::{LightSampler, SizeDensity},
    lighting::{Lighting, SamplingPlan},
    math::{
        hash::{hash_bytes, hash_words},
        measure::COLOUR_PLANES,
    },
    objective::Objective,
    scene::Scene,
    transport::{Brought, Knots, Layout, SizeBins, Source, TransportBasis, ValueNodes, splat_memory},
    variables::BasisRanges,
};

/// Upper bound of the looks that are sought together: each has sizes of its own among the likely ones of
/// a light's density.
pub const MAX_TOGETHER: usize = SizeDensity::MAX_LIKELY;
/// Replicates of a basis and of a check, from which errors are estimated. Each costs a table; since
/// errors are averaged over relabellings of the replicates, four do what six did before. In a check of 16
/// samples per pixel (high-key) the noise correction was .0067 with 4, .0083 with 8, .0115 with 16.
pub const REPLICATES: usize = 4;
/// Replicates that [`TransportBasis::halves`] leaves.
const HALVES: usize = 2;
/// Samples per pixel of the first basis, if none are asked for; by them the next ones are aimed. True f_q
/// of high-key on the fruit basket, mean of 24 seeds: .1359 with 8, .1356 with 12; with 4 some seeds
/// ended at .145.
const FIRST_SAMPLES: u32 = 8;
/// Knots of a light's size. 14 make the tables two fifths smaller than 24. True f_q
/// on the fruit basket, mean (worst): high-key .1362 (.1388) over 24 seeds, with 24 knots .1354 (.1373)
/// over 12; low-key .5850 (.5859), with 24 knots .5857 (.5888).
const KNOTS: usize = 14;
/// Knots of a light's size in a basis that is kept, which other looks and scans will use: with sizes in
/// a range of 20 they are 15 % apart, with [`KNOTS`] 28 %.
const KEPT_KNOTS: usize = 24;
/// Lower bound of the knots where memory is short: with sizes in a range of 20 they are 65 % apart, and
/// the edge of a light is feathered by as much.
const MIN_KNOTS: usize = 8;
/// Knots of a light's size in a basis around the lights found: half for the whole range, and as many
/// within [`FOCUS`] of each size found, 10 % of it apart.
const FOCUS_KNOTS: usize = 16;
/// Relative distance from a size found within which knots and samples are dense: more lets the search
/// move farther on dense knots, less makes them denser. Raised from .15 and .2 as bases got fewer
/// samples; not measured apart from that.
const FOCUS: f64 = 0.35;
/// Weight with which a light that contributes nothing is chosen, where one that contributes everything
/// has about 1: the search may still turn it on, with noisy estimates; a larger weight takes samples from
/// the others. Set by reasoning.
const FAINT_LIGHT: f64 = 0.05;
/// Least share of a light's samples within a size, for sizes that a search may ask for. Below it most
/// pixels have no sample of the light, all replicates agree in that, and no jackknife shows the error.
/// Eight seeds of the fruit bowl without background, both looks: 3 checks disagreed with the basis, 13
/// without the bound.
const MIN_SHARE_WITHIN: f32 = 0.1;
/// Samples of a replicate that are rendered at a time. An interrupt waits for them, so that the basis it
/// leaves is whole; fewer would add to every table more often. Set by reasoning.
const BATCH: u32 = 8;
/// Share of the memory allowed, as its inverse, that contributions of light subpaths may take during a
/// batch before the batch is made smaller: smaller batches cost time, fewer knots precision. Set by
/// reasoning.
const BATCH_SHARE: u64 = 4;
/// Factor by which the picture on which starts are screened is smaller in both directions: 256 starts
/// then cost as much as 16 on the whole picture. A factor of 2 was slower and ended no better (high-key
/// .1387 on the fruit basket).
pub const REDUCTION: u32 = 4;

/// Plan of a basis: ranges of what varies, knots and batches within the memory allowed.
#[derive(Clone, Debug)]
pub struct BasisPlan {
    /// Ranges of the sizes and of the background's value that vary.
    ranges: BasisRanges,
    /// Knots of each free size.
    knots: usize,
    /// Samples of a replicate that are rendered at a time.
    batch: u32,
    /// Lighting of everything that does not vary.
    fixed: Lighting,
}

/// A lighting around which samples and knots of a basis are dense.
#[derive(Clone, Debug)]
pub struct Focus {
    /// The lighting.
    pub lighting: Lighting,
    /// Weight with which each light is chosen for this lighting.
    pub weights: Vec<f32>,
}

impl Focus {
    /// Weight with which each light is chosen for all of `foci`.
    pub fn light_weights(foci: &[Self]) -> Vec<f32> {
        let n = foci.first().map_or(0, |focus| focus.weights.len());
        (0..n).map(|l| foci.iter().map(|focus| focus.weights[l]).sum()).collect()
    }

    /// Sizes of a light in all of `foci`, each with its weight.
    pub fn sizes(foci: &[Self], light: usize) -> Vec<(f32, f32)> {
        foci.iter().map(|focus| (focus.lighting.size[light] as f32, focus.weights[light])).collect()
    }
}

/// A basis with its plan, and with what is derived from it for searches.
pub struct WorkingBasis {
    plan: BasisPlan,
    basis: TransportBasis,
    /// The same samples in two replicates, see [`TransportBasis::halves`].
    halves: OnceLock<TransportBasis>,
    /// The two replicates of the picture reduced by [`REDUCTION`].
    reduced: OnceLock<TransportBasis>,
    /// Lightings at which the samples are aimed; `None` while they are spread over all.
    foci: Option<Vec<Focus>>,
    /// Numbers of samples so far, counted with their weights, with the density of each light's size from
    /// which they came.
    sampled: Vec<(f32, Vec<SizeDensity>)>,
    /// Least size of each light within which enough samples fall.
    least_sizes: Vec<f64>,
    /// Seed of the next samples.
    seed: u64,
    /// File in which the basis is stored, and the number of samples in it; `None` if it is not kept.
    stored: Option<(PathBuf, u32)>,
    /// Key of the product that the basis is now: of all samples so far, in their order.
    key: u64,
}

/// Kind of the product that is a basis, with the samples of each replicate that were then still to be added.
const KIND: &str = "basis";
/// Kind of the product that says whether the cache held a basis: 1, or 0.
const CACHED: &str = "cached";

impl BasisPlan {
    /// Plans a basis of a stage within the memory allowed.
    ///
    /// # Errors
    /// When even [`MIN_KNOTS`] need more memory than allowed.
    pub fn new(stage: &Stage, reporter: &impl Reporter) -> Result<Self, RunError> {
        let options = stage.options;
        let ranges = stage.fitted.basis_ranges(stage.constraints, &options.free);
        let knots = if options.cache.is_some() { KEPT_KNOTS } else { KNOTS };
        let mut plan = Self { ranges, knots, batch: BATCH, fixed: stage.fitted.lighting.clone() };
        while plan.splat_memory(stage) > options.memory / BATCH_SHARE && plan.batch > 1 {
            plan.batch /= 2;
        }
        // A basis around the lights found is held beside the first.
        let need = |plan: &Self| {
            let layouts = [plan.layout(stage, None), plan.focused_layout(stage)];
            let tables = layouts.iter().map(|l| l.table_memory(REPLICATES + HALVES)).sum::<u64>();
            tables + plan.splat_memory(stage)
        };
        let wanted = plan.knots;
        while need(&plan) > options.memory && plan.knots > MIN_KNOTS {
            plan.knots = (plan.knots - 4).max(MIN_KNOTS);
        }
        let bytes = need(&plan);
        if bytes > options.memory {
            return Err(RunError::Memory { needed: Bytes(bytes), allowed: Bytes(options.memory) });
        }
        let layout = plan.layout(stage, None);
        let reduced = if plan.knots < wanted { ", fewer to fit the memory allowed" } else { "" };
        reporter.note(&format!(
            "transport basis: {} x {} pixels, {} cells of light and size ({} knots a size{reduced}), {} value \
             nodes, {REPLICATES} replicates, {} with a finer one, should it be needed",
            layout.size.x,
            layout.size.y,
            layout.n_cells(),
            plan.knots,
            layout.nodes.len(),
            Bytes(bytes),
        ));
        Ok(plan)
    }

    /// Upper bound of the memory that contributions of light subpaths take during a batch, bytes.
    fn splat_memory(&self, stage: &Stage) -> u64 {
        let integrator = stage.options.integrator;
        let plan = stage.plan(&self.fixed);
        let pixels = u64::from(stage.options.work_size.element_product());
        let samples = u64::from(self.batch * REPLICATES as u32) * pixels;
        let subpaths = integrator.kind.light_subpaths(samples, plan.counts);
        splat_memory(&self.layout(stage, None), subpaths, integrator.max_depth)
    }

    /// Layout of a basis around the lights of as many looks as may be sought together, all different.
    fn focused_layout(&self, stage: &Stage) -> Layout {
        let n = stage.options.jobs.len().clamp(1, MAX_TOGETHER);
        let at = |i: usize, [lo, hi]: [f32; 2]| f64::from(lo * (hi / lo).powf((i as f32 + 0.5) / n as f32));
        let focus = |i: usize| {
            let size =
                self.ranges.sizes.iter().map(|range| range.map_or(0.0, |range| at(i, range))).collect();
            Focus { lighting: Lighting { size, ..self.fixed.clone() }, weights: Vec::new() }
        };
        self.layout(stage, Some(&(0..n).map(focus).collect::<Vec<_>>()))
    }

    /// Layout of the basis, with knots around the sizes of `foci` if given.
    fn layout(&self, stage: &Stage, foci: Option<&[Focus]>) -> Layout {
        let bins = self.ranges.sizes.iter().enumerate().map(|(l, range)| match (range, foci) {
            (None, _) => SizeBins::Fixed(self.fixed.size[l] as f32),
            (Some([lo, hi]), None) => {
                SizeBins::Free(Knots::geometric(f64::from(*lo), f64::from(*hi), self.knots))
            }
            (Some([lo, hi]), Some(foci)) => SizeBins::Free(Knots::around(
                f64::from(*lo),
                f64::from(*hi),
                &foci.iter().map(|focus| focus.lighting.size[l]).collect::<Vec<_>>(),
                FOCUS,
                self.knots.min(FOCUS_KNOTS),
            )),
        });
        let nodes = match self.ranges.largest_value {
            None => ValueNodes::new(self.fixed.value, 1),
            Some(v) => ValueNodes::new(f64::from(v), stage.options.integrator.max_depth),
        };
        let layout = Layout::new(stage.options.work_size, bins.collect(), nodes);
        let planes = if self.ranges.colors { COLOUR_PLANES } else { stage.options.measure.n_planes() };
        layout.with_planes(planes)
    }

    /// Sampling plan for all sizes and values of the background, with most samples near `foci` if given.
    fn sampling(&self, stage: &Stage, foci: Option<&[Focus]>) -> SamplingPlan {
        let mut plan = stage.plan(&self.fixed);
        if let Some(foci) = foci {
            plan.lights = LightSampler::new(&Focus::light_weights(foci));
        }
        for (l, (q, range)) in plan.sizes.iter_mut().zip(&self.ranges.sizes).enumerate() {
            let Some(range) = *range else { continue };
            *q = match foci {
                None => SizeDensity::any_size(range),
                Some(foci) => {
                    let likely =
                        Focus::sizes(foci, l).into_iter().map(|(s, w)| (s * (1.0 + FOCUS as f32), w));
                    SizeDensity::focused(range, &likely.collect::<Vec<_>>())
                }
            };
        }
        if let Some(v) = self.ranges.largest_value {
            plan.largest_value = v;
        }
        plan
    }

    /// A file name as long as that of any basis of a scene.
    pub fn any_file_name(scene: &Scene) -> String {
        format!("{}-{:016x}.basis", scene.name, 0)
    }

    /// Name of the file that keeps a basis, with a hash of everything on which its tables depend.
    fn file_name(&self, stage: &Stage, layout: &Layout, seed: u64) -> String {
        let (renderer, plan) = (stage.renderer(), self.sampling(stage, None));
        let words = format!(
            "{layout:?} {plan:?} {:?} {:?} {:?} {seed} {REPLICATES} {}",
            stage.camera,
            renderer.integrator,
            renderer.sampler,
            env!("LIGHTOPT_SOURCES")
        );
        let key = hash_words(&[stage.fingerprint, hash_bytes(words.bytes())]);
        format!("{}-{key:016x}.basis", stage.scene.name)
    }
}

impl WorkingBasis {
    /// A basis with its first samples: one that was kept, or a new one that is rendered.
    ///
    /// # Errors
    /// As [`TransportBasis::render`].
    pub fn new(plan: BasisPlan, stage: &Stage, reporter: &impl Reporter) -> Result<Self, RunError> {
        let layout = plan.layout(stage, None);
        let seed = seed_for(stage.options.seed, Purpose::Optimise);
        let cache = stage.options.cache.as_ref();
        let path = cache.map(|directory| directory.join(plan.file_name(stage, &layout, seed)));
        let mut working = Self::with(plan, TransportBasis::new(layout, REPLICATES), None, seed);
        working.key = hash_words(&[working.key, stage.fingerprint]);
        working.stored = path.map(|path| (path, 0));
        if working.take_from_cache(stage, reporter) {
            working.derive();
        } else {
            working.add(stage.options.spp.unwrap_or(FIRST_SAMPLES), stage, reporter)?;
        }
        Ok(working)
    }

    /// Takes the basis from its file in the cache, if there is one that fits, and says whether. What an
    /// earlier attempt at the same run has found there holds, whatever is there now.
    fn take_from_cache(&mut self, stage: &Stage, reporter: &impl Reporter) -> bool {
        let Some((path, samples)) = &mut self.stored else { return false };
        let (products, say) = (stage.products, |text: &str| reporter.note(text));
        let found_then = products.load(self.key, CACHED);
        let from = match found_then.as_deref() {
            None => Some(path.clone()),
            Some([0]) => None,
            Some(_) => products.path(self.key, KIND),
        };
        let loaded = from.filter(|from| from.exists()).and_then(|from| match TransportBasis::load(&from) {
            Ok((basis, _)) => self.basis.is_alike(&basis).then_some(basis),
            // It is written anew.
            Err(e) => {
                say(&format!("{e}; rendering it again"));
                None
            }
        });
        if found_then.is_none() {
            if let Some(basis) = &loaded {
                products.save_file(self.key, KIND, say, |to| basis.save_unsynced(to, &Value::Null));
            }
            products.save(self.key, CACHED, say, |out| out.write_all(&[u8::from(loaded.is_some())]));
        }
        let Some(basis) = loaded else { return false };
        let n = basis.n_samples() * REPLICATES as u32;
        say(&format!("using {}: {n} samples a pixel, nothing to render", path.display()));
        *samples = basis.n_samples();
        self.basis = basis;
        true
    }

    /// A working basis whose next samples come from `seed`, aimed at `foci` if given.
    fn with(plan: BasisPlan, basis: TransportBasis, foci: Option<Vec<Focus>>, seed: u64) -> Self {
        Self {
            key: Products::key(&format!("{:?}", basis.layout()), &[seed]),
            plan,
            basis,
            halves: OnceLock::new(),
            reduced: OnceLock::new(),
            foci,
            sampled: Vec::new(),
            least_sizes: Vec::new(),
            seed,
            stored: None,
        }
    }

    /// What each light brings to the pixels of a mask by its size, with the background at a value.
    pub fn brought(&self, mask: &[bool], value: f64) -> Vec<Brought> {
        self.basis.brought(mask, value)
    }

    /// Writes the basis to the run's own file, if it has one, and to the cache, if it is kept there and has
    /// more samples than the file.
    ///
    /// # Errors
    /// When the cache cannot be written.
    pub fn store(&mut self, setup: Setup, reporter: &impl Reporter) -> Result<(), RunError> {
        self.store_small(setup, reporter);
        let traced = setup.features.is_none().then(|| Features::trace(setup.view()));
        let about = About {
            features: setup.features.or(traced.as_ref()).map(StoredFeatures::new),
            ..About::new(setup.scene, &self.plan.fixed, setup.aovs, setup.variables, setup.options.measure)
                .with_colors(setup.scene, self.basis.layout())
        };
        let about = serde_json::to_value(about).map_err(std::io::Error::from).map_err(RunError::About)?;
        if let Some(path) = &setup.options.basis_file
            && let Err(e) = self.basis.save_unsynced(path, &about)
        {
            reporter.note(&format!("{e}; going on without it"));
        }
        match &mut self.stored {
            Some((path, samples)) if *samples != self.basis.n_samples() => {
                self.basis.save(path, &about)?;
                *samples = self.basis.n_samples();
            }
            _ => {}
        }
        Ok(())
    }

    /// Writes a small copy of the basis, if one is asked for; the run does without where that fails.
    fn store_small(&self, setup: Setup, reporter: &impl Reporter) {
        let Some(path) = &setup.options.live_file else { return };
        let copied = small_copy::of(&self.basis, &self.plan.fixed, setup).map_err(|e| e.to_string());
        let saved = copied.and_then(|live| live.save(path).map_err(|e| e.to_string()));
        if let Err(e) = saved {
            reporter.note(&format!("{e}; going on without a report that can be relit"));
        }
    }

    /// Adds `spp` samples per pixel over all replicates. An interrupt leaves a whole basis of fewer
    /// samples.
    ///
    /// # Errors
    /// When a render fails, or was interrupted before there were any samples.
    pub fn add(&mut self, spp: u32, stage: &Stage, reporter: &impl Reporter) -> Result<(), RunError> {
        let replicates = self.basis.n_replicates() as u32;
        let mut left = spp.div_ceil(replicates).max(1);
        let renders = left.div_ceil(self.plan.batch) * replicates;
        let rows = u64::from(stage.options.work_size.y * renders);
        reporter.stage("rendering the transport basis", Some(rows));
        let plan = self.plan.sampling(stage, self.foci.as_deref());
        let renderer = stage.renderer();
        let samples = hash_words(&[
            samples_key(stage, stage.camera, &plan, self.seed),
            u64::from(self.plan.batch),
            replicates.into(),
        ]);
        let product = hash_words(&[self.key, samples, left.into()]);
        let to_render = self.take_up(product, left, stage);
        self.halves.take();
        self.reduced.take();
        let source = Source {
            view: stage.view(),
            plan: &plan,
            integrator: &renderer.integrator,
            sampler: renderer.sampler,
            seed: self.seed,
        };
        stage.products.begin_growing();
        let mut kept = to_render;
        while left > 0 {
            let count = left.min(self.plan.batch);
            // What an earlier attempt has added is only counted.
            if left <= to_render {
                if stage.search_is_over(reporter) && self.basis.n_samples() > 0 {
                    break;
                }
                if reporter.cancelled() {
                    return Err(RenderError::Cancelled.into());
                }
                self.basis.render(source, count, &Unstoppable(reporter))?;
            } else {
                reporter.advance(u64::from(stage.options.work_size.y * replicates));
            }
            left -= count;
            self.key = hash_words(&[self.key, samples, count.into()]);
            self.sampled.push(((count * replicates) as f32, plan.sizes.clone()));
            if left > 0 && left < kept && stage.products.is_due() {
                self.keep(product, left, stage, reporter);
                kept = left;
            }
        }
        if left < kept {
            self.keep(product, left, stage, reporter);
        }
        self.least_sizes = (0..plan.sizes.len()).map(|l| self.least_size(l)).collect();
        self.derive();
        Ok(())
    }

    /// Takes up the basis to which an earlier attempt has added samples; returns how many of the `left` ones
    /// of each replicate it has left.
    fn take_up(&mut self, product: u64, left: u32, stage: &Stage) -> u32 {
        let path = stage.products.path(product, KIND).filter(|path| path.exists());
        let Some((basis, about)) = path.and_then(|path| TransportBasis::load(&path).ok()) else {
            return left;
        };
        match about.as_u64() {
            Some(then) if then < u64::from(left) && self.basis.is_alike(&basis) => {
                self.basis = basis;
                then as u32
            }
            _ => left,
        }
    }

    /// Keeps the basis, to which `left` samples of each replicate are still to be added.
    fn keep(&self, product: u64, left: u32, stage: &Stage, reporter: &impl Reporter) {
        let write = |path: &Path| self.basis.save_unsynced(path, &Value::from(left));
        stage.products.save_file(product, KIND, |text| reporter.note(text), write);
    }

    /// Least size of a light within which [`MIN_SHARE_WITHIN`] of its samples fall, in its range; 0 for a
    /// size that is not free.
    fn least_size(&self, light: usize) -> f64 {
        let Some([mut below, mut above]) = self.plan.ranges.sizes[light] else { return 0.0 };
        let all: f32 = self.sampled.iter().map(|(samples, _)| samples).sum();
        let within = |size: f32| {
            let of = self.sampled.iter().map(|(samples, of)| samples * of[light].below(size));
            of.sum::<f32>() >= MIN_SHARE_WITHIN * all
        };
        if within(below) {
            return f64::from(below);
        }
        while above > below * 1.001 {
            let middle = (below * above).sqrt();
            if within(middle) { above = middle } else { below = middle }
        }
        f64::from(above)
    }

    /// Derives what evaluations need from the basis, before they run in parallel: all threads would wait
    /// for the first one to do so.
    fn derive(&self) {
        self.reduced.get_or_init(|| self.halves().reduced(REDUCTION));
    }

    /// Samples per pixel of all replicates, in units of the weight of the next sample.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.basis.effective_samples()
    }

    /// Picture with every light at radiance 1 and everything else as it is at the start.
    #[must_use]
    pub fn unit_picture(&self) -> Picture {
        self.basis.picture(&self.plan.fixed.at_unit_radiance())
    }

    /// Focus on a lighting, with weights that sum to `share` and grow as the square root of each light's
    /// share in the picture.
    #[must_use]
    pub fn focus(&self, lighting: Lighting, share: f64) -> Focus {
        let weights: Vec<f64> =
            self.halves().shares(&lighting).iter().map(|s| FAINT_LIGHT + s.sqrt()).collect();
        let scale = share / weights.iter().sum::<f64>();
        Focus { lighting, weights: weights.into_iter().map(|w| (w * scale) as f32).collect() }
    }

    /// A basis without samples whose knots and samples lie around the lights found for some looks.
    #[must_use]
    pub fn around(&self, foci: Vec<Focus>, round: u32, stage: &Stage) -> Self {
        let basis = TransportBasis::new(self.plan.layout(stage, Some(&foci)), REPLICATES);
        let seed = hash_words(&[self.seed, u64::from(round) + 1]);
        Self::with(self.plan.clone(), basis, Some(foci), seed)
    }

    /// Aims the next samples at the lights found for some looks, and lets those so far count half as much.
    /// The knots stay, so that a search may still look everywhere.
    pub fn aim_at(&mut self, foci: Vec<Focus>) {
        self.basis.fade();
        self.sampled.iter_mut().for_each(|(samples, _)| *samples *= 0.5);
        self.seed = hash_words(&[self.seed, 0]);
        self.key = hash_words(&[self.key, 0]);
        self.foci = Some(foci);
    }

    /// Lets the next samples be aimed anew, because other looks are sought.
    pub fn release(&mut self) {
        self.foci = None;
    }

    /// Whether the next samples may be aimed: they have not been yet, and the basis is not kept for other
    /// looks.
    #[must_use]
    pub fn may_aim(&self) -> bool {
        self.foci.is_none() && self.stored.is_none()
    }

    /// The same samples in two replicates.
    fn halves(&self) -> &TransportBasis {
        self.halves.get_or_init(|| self.basis.halves())
    }

    /// Seed of the next samples.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Picture of a lighting, recombined from the basis.
    #[must_use]
    pub fn picture(&self, x: &Lighting) -> Picture {
        self.basis.picture(x)
    }

    /// Picture of a lighting for people to look at, denoised where there are features to do it by.
    #[must_use]
    pub fn shown(&self, x: &Lighting, features: Option<&Features>) -> LinearImage {
        picture::beauty(&self.basis.shown(x, features))
    }

    /// f_q as a function of the variables.
    #[must_use]
    pub fn evaluator<'a>(&'a self, setup: Setup<'a>, objective: &'a Objective) -> Evaluator<'a> {
        Evaluator {
            basis: &self.basis,
            halves: self.halves(),
            objective,
            variables: setup.variables,
            fixed: &self.plan.fixed,
            measure: setup.options.measure,
            least_sizes: &self.least_sizes,
        }
    }

    /// f_q of the picture reduced by [`REDUCTION`], with its `objective`, as a function of the variables.
    #[must_use]
    pub fn reduced<'a>(&'a self, setup: Setup<'a>, objective: &'a Objective) -> Evaluator<'a> {
        let basis = self.reduced.get_or_init(|| self.halves().reduced(REDUCTION));
        Evaluator { basis, halves: basis, ..self.evaluator(setup, objective) }
    }
}
