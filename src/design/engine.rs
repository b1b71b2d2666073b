//! A transport basis of a scene, planned, rendered and stored for optimisation.

use std::{path::PathBuf, sync::OnceLock};

use super::{
    Camera, MAX_TOGETHER, Purpose, Reporter, RunError, RunOptions, Setting, Unstoppable,
    evaluator::Evaluator, seed_for,
};
use crate::{
    audit::stored::About,
    film::Picture,
    integrator::{RenderError, aov::Aovs},
    light::SizeDensity,
    math::hash::{hash_bytes, hash_words},
    objective::{Objective, Target},
    params::{ParamVector, survey::SizeBounds},
    scene::{Scene, sidecar::FreeKind},
    transport::{Knots, Layout, LightingPoint, SizeBins, Source, TransportBasis, ValueNodes},
};

/// Replicates of a basis and of a check, from which errors are estimated.
pub const REPLICATES: usize = 4;
/// Those of [`TransportBasis::halves`].
const HALVES: usize = 2;
/// Samples of the first basis, which tells where to look, if nobody says how many.
const FIRST_SAMPLES: u32 = 8;
/// Knots of a light's size; of a basis that is kept, of which nobody knows what will be asked; and
/// the fewest that memory may leave.
const KNOTS: usize = 14;
const KEPT_KNOTS: usize = 24;
const MIN_KNOTS: usize = 8;
/// Knots of a basis around what was found: half of them for the whole range, and as many for
/// what lies within this share of a size found.
const FOCUS_KNOTS: usize = 16;
const FOCUS: f64 = 0.35;
/// Weight with which a light that contributes nothing is chosen, beside 1 of all of them.
const FAINT_LIGHT: f64 = 0.05;
/// Share of a light's samples that must lie within a size for which lights are sought.
const WITHIN: f32 = 0.1;
/// Samples of a replicate that are rendered at a time, whatever the user wants meanwhile.
const UNINTERRUPTED: u32 = 8;
/// The picture on which starts are screened is smaller by this factor.
const REDUCTION: u32 = 4;

/// What a basis of a scene leaves open.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Sizes that vary, by light.
    sizes: Vec<SizeBounds>,
    /// The largest value of a background that varies.
    value: Option<f32>,
    knots: usize,
    /// The lighting of what does not vary.
    fixed: LightingPoint,
}

/// A lighting that matters, and how often each light is chosen for it.
#[derive(Clone, Debug)]
pub struct Aim {
    pub lighting: LightingPoint,
    pub weights: Vec<f32>,
}

impl Aim {
    /// How often each light is chosen for all of `aims`.
    pub fn light_weights(aims: &[Self]) -> Vec<f32> {
        let n = aims.first().map_or(0, |aim| aim.weights.len());
        (0..n).map(|l| aims.iter().map(|aim| aim.weights[l]).sum()).collect()
    }

    /// The sizes of a light for all of `aims`, with how much they matter.
    pub fn sizes(aims: &[Self], light: usize) -> Vec<(f32, f32)> {
        aims.iter().map(|aim| (aim.lighting.size[light] as f32, aim.weights[light])).collect()
    }
}

/// A basis and what it is made of.
pub struct Engine {
    plan: Plan,
    basis: TransportBasis,
    /// See [`TransportBasis::halves`].
    halves: OnceLock<TransportBasis>,
    /// The halves of a smaller picture.
    reduced: OnceLock<TransportBasis>,
    /// What its samples are aimed at.
    aims: Option<Vec<Aim>>,
    /// How the sizes of lights were sampled so far, by how many samples.
    sampled: Vec<(f32, Vec<SizeDensity>)>,
    /// The least size of each light of which there are samples enough.
    least_sizes: Vec<f64>,
    seed: u64,
    /// Where it is stored, and how many samples are there.
    stored: Option<(PathBuf, u32)>,
}

impl Plan {
    /// Plans a basis of the scene, whose sizes have been fitted, within the memory
    /// allowed.
    ///
    /// # Errors
    /// When even the fewest knots need more memory than allowed.
    pub fn new(
        scene: &Scene,
        sizes: &[SizeBounds],
        largest_value: Option<f32>,
        options: &RunOptions,
        reporter: &impl Reporter,
    ) -> Result<Self, RunError> {
        let free = |kind| options.free.contains(kind);
        let open = |l: usize| free(FreeKind::Size) && scene.light_bounds[l].size_free;
        let mut plan = Self {
            sizes: sizes.iter().enumerate().map(|(l, s)| s.filter(|_| open(l))).collect(),
            value: largest_value.filter(|_| free(FreeKind::Background)),
            knots: if options.cache.is_some() { KEPT_KNOTS } else { KNOTS },
            fixed: LightingPoint {
                radiance: scene.lights.iter().map(|l| f64::from(l.radiance)).collect(),
                size: scene.lights.iter().map(|l| f64::from(l.size)).collect(),
                value: f64::from(scene.background_value()),
            },
        };
        // A basis around what is found lies beside the first.
        let need = |plan: &Self| {
            let layouts = [plan.layout(scene, options, None), plan.focused_layout(scene, options)];
            layouts.iter().map(|l| l.table_memory(REPLICATES + HALVES)).sum::<u64>()
        };
        let wanted = plan.knots;
        while need(&plan) > options.memory && plan.knots > MIN_KNOTS {
            plan.knots = (plan.knots - 4).max(MIN_KNOTS);
        }
        let bytes = need(&plan);
        if bytes > options.memory {
            return Err(RunError::Memory { needed: bytes >> 20, allowed: options.memory >> 20 });
        }
        let layout = plan.layout(scene, options, None);
        let reduced = if plan.knots < wanted { ", fewer to fit the memory allowed" } else { "" };
        reporter.note(&format!(
            "transport basis: {} x {} pixels, {} cells of light and size ({} knots a size{reduced}), {} value \
             nodes, {REPLICATES} replicates, {} MiB with a finer one, should it be needed",
            layout.size.x,
            layout.size.y,
            layout.n_cells(),
            plan.knots,
            layout.nodes.len(),
            bytes >> 20,
        ));
        Ok(plan)
    }

    /// The layout of a basis around different lights for as many looks as there may be at once.
    fn focused_layout(&self, scene: &Scene, options: &RunOptions) -> Layout {
        let n = options.jobs.len().clamp(1, MAX_TOGETHER);
        let at = |i: usize, [lo, hi]: [f32; 2]| f64::from(lo * (hi / lo).powf((i as f32 + 0.5) / n as f32));
        let aim = |i: usize| {
            let size = self.sizes.iter().map(|range| range.map_or(0.0, |range| at(i, range))).collect();
            Aim { lighting: LightingPoint { size, ..self.fixed.clone() }, weights: Vec::new() }
        };
        self.layout(scene, options, Some(&(0..n).map(aim).collect::<Vec<_>>()))
    }

    /// The layout, with knots around the sizes in `focus` if given.
    fn layout(&self, scene: &Scene, options: &RunOptions, focus: Option<&[Aim]>) -> Layout {
        let bins = self.sizes.iter().enumerate().map(|(l, range)| match (range, focus) {
            (None, _) => SizeBins::Fixed(scene.lights[l].size),
            (Some([lo, hi]), None) => {
                SizeBins::Free(Knots::geometric(f64::from(*lo), f64::from(*hi), self.knots))
            }
            (Some([lo, hi]), Some(aims)) => SizeBins::Free(Knots::around(
                f64::from(*lo),
                f64::from(*hi),
                &aims.iter().map(|aim| aim.lighting.size[l]).collect::<Vec<_>>(),
                FOCUS,
                self.knots.min(FOCUS_KNOTS),
            )),
        });
        let nodes = match self.value {
            None => ValueNodes::new(f64::from(scene.background_value()), 1),
            Some(v) => ValueNodes::new(f64::from(v), options.integrator.max_depth),
        };
        Layout::new(options.work_size, bins.collect(), nodes)
    }

    /// Makes the scene sample every size and the largest value, most of all what is
    /// in focus.
    fn open(&self, scene: &mut Scene, focus: Option<&[Aim]>) {
        scene.select_all_lights();
        if let Some(aims) = focus {
            scene.select_lights(&Aim::light_weights(aims));
        }
        for (l, (light, range)) in scene.lights.iter_mut().zip(&self.sizes).enumerate() {
            let Some(range) = *range else { continue };
            light.size_density = match focus {
                None => SizeDensity::any_size(range),
                Some(aims) => {
                    let likely = Aim::sizes(aims, l).into_iter().map(|(s, w)| (s * (1.0 + FOCUS as f32), w));
                    SizeDensity::focused(range, &likely.collect::<Vec<_>>())
                }
            };
        }
        if let Some(v) = self.value {
            scene.set_background_value(v, v);
        }
    }
}

impl Engine {
    /// Renders the first samples of a basis.
    ///
    /// # Errors
    /// As [`TransportBasis::render`].
    pub fn new(
        plan: Plan,
        scene: &mut Scene,
        camera: &Camera,
        options: &RunOptions,
        reporter: &impl Reporter,
    ) -> Result<Self, RunError> {
        let layout = plan.layout(scene, options, None);
        let seed = seed_for(options.seed, Purpose::Optimise);
        let stored = options.cache.as_ref().map(|directory| {
            plan.open(scene, None);
            let sampling = format!("{:?} {:?} {seed}", camera.integrator, camera.sampler);
            let words = format!("{layout:?} {sampling} {REPLICATES} {}", env!("LIGHTOPT_COMMIT"));
            let key = hash_words(&[scene.fingerprint(), hash_bytes(words.bytes())]);
            (directory.join(format!("{}-{key:016x}.basis", scene.name)), 0)
        });
        let mut engine = Self {
            plan,
            basis: TransportBasis::new(layout.clone(), REPLICATES),
            halves: OnceLock::new(),
            reduced: OnceLock::new(),
            aims: None,
            sampled: Vec::new(),
            least_sizes: Vec::new(),
            seed,
            stored,
        };
        if let Some((path, samples)) = &mut engine.stored
            && path.exists()
        {
            match TransportBasis::load(path) {
                Ok((basis, _)) if *basis.layout() == layout && basis.n_replicates() == REPLICATES => {
                    *samples = basis.n_samples();
                    engine.basis = basis;
                    reporter.note(&format!(
                        "using {}: {} samples a pixel, nothing to render",
                        path.display(),
                        *samples * REPLICATES as u32
                    ));
                    engine.derive();
                    return Ok(engine);
                }
                Ok(_) => {}
                // It is written anew.
                Err(e) => reporter.note(&format!("{e}; rendering it again")),
            }
        }
        engine.add(options.spp.unwrap_or(FIRST_SAMPLES), scene, camera, options, reporter)?;
        Ok(engine)
    }

    /// Stores the basis, if there is a cache and more in it than there was.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn store(
        &self,
        scene: &Scene,
        aovs: &Aovs,
        variables: &ParamVector,
        options: &RunOptions,
    ) -> Result<(), RunError> {
        let Some((path, samples)) = &self.stored else { return Ok(()) };
        if *samples == self.basis.n_samples() {
            return Ok(());
        }
        let about = About::new(scene, &self.plan.fixed, aovs, variables, options.luminance);
        let about = serde_json::to_value(about).map_err(std::io::Error::from).map_err(RunError::About)?;
        self.basis.save(path, &about)?;
        Ok(())
    }

    /// Adds samples: `spp` per pixel over all replicates. An interrupt leaves a whole
    /// basis of fewer samples.
    ///
    /// # Errors
    /// When a render fails, or was interrupted before there were any samples.
    pub fn add(
        &mut self,
        spp: u32,
        scene: &mut Scene,
        camera: &Camera,
        options: &RunOptions,
        reporter: &impl Reporter,
    ) -> Result<(), RunError> {
        let replicates = self.basis.n_replicates() as u32;
        let mut left = spp.div_ceil(replicates).max(1);
        let renders = left.div_ceil(UNINTERRUPTED) * replicates;
        reporter.stage("rendering the transport basis", Some(u64::from(options.work_size.y * renders)));
        self.plan.open(scene, self.aims.as_deref());
        self.halves.take();
        self.reduced.take();
        let source =
            Source { scene, integrator: &camera.integrator, sampler: camera.sampler, seed: self.seed };
        while left > 0 {
            if reporter.cancelled() {
                if self.basis.n_samples() == 0 {
                    return Err(RenderError::Cancelled.into());
                }
                break;
            }
            let count = left.min(UNINTERRUPTED);
            self.basis.render(source, count, &Unstoppable(reporter))?;
            left -= count;
            let densities = scene.lights.iter().map(|l| l.size_density).collect();
            self.sampled.push(((count * replicates) as f32, densities));
        }
        self.least_sizes = (0..scene.lights.len()).map(|l| self.least_size(l)).collect();
        self.derive();
        Ok(())
    }

    /// The size within which [`WITHIN`] of the samples of a light lie, at least the least there is.
    fn least_size(&self, light: usize) -> f64 {
        let Some([mut below, mut above]) = self.plan.sizes[light] else { return 0.0 };
        let all: f32 = self.sampled.iter().map(|(samples, _)| samples).sum();
        let within = |size: f32| {
            let of = self.sampled.iter().map(|(samples, of)| samples * of[light].below(size));
            of.sum::<f32>() >= WITHIN * all
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

    /// Makes what evaluations need of the basis: before any of them, since all threads would
    /// wait for the one that came first.
    fn derive(&self) {
        self.reduced.get_or_init(|| self.halves().reduced(REDUCTION));
    }

    /// Samples per pixel of all replicates.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.basis.effective_samples()
    }

    /// The picture with every light at radiance 1, its present size, and the
    /// background as it is.
    #[must_use]
    pub fn unit_picture(&self) -> Picture {
        let x = &self.plan.fixed;
        self.basis.picture(&LightingPoint { radiance: vec![1.0; x.radiance.len()], ..x.clone() })
    }

    /// A lighting at which samples are aimed, in proportion to `share`.
    #[must_use]
    pub fn aim(&self, lighting: LightingPoint, share: f64) -> Aim {
        let weights: Vec<f64> =
            self.halves().shares(&lighting).iter().map(|s| FAINT_LIGHT + s.sqrt()).collect();
        let scale = share / weights.iter().sum::<f64>();
        Aim { lighting, weights: weights.into_iter().map(|w| (w * scale) as f32).collect() }
    }

    /// An empty basis around what was found for some looks.
    #[must_use]
    pub fn around(&self, aims: Vec<Aim>, round: u32, scene: &Scene, options: &RunOptions) -> Self {
        Self {
            plan: self.plan.clone(),
            basis: TransportBasis::new(self.plan.layout(scene, options, Some(&aims)), REPLICATES),
            halves: OnceLock::new(),
            reduced: OnceLock::new(),
            aims: Some(aims),
            sampled: Vec::new(),
            least_sizes: Vec::new(),
            seed: hash_words(&[self.seed, u64::from(round) + 1]),
            stored: None,
        }
    }

    /// Aims the samples that follow at what was found for some looks, and lets those so far count
    /// less. The knots stay, so that a search may still look everywhere.
    pub fn aim_at(&mut self, aims: Vec<Aim>) {
        self.basis.fade();
        self.sampled.iter_mut().for_each(|(samples, _)| *samples *= 0.5);
        self.seed = hash_words(&[self.seed, 0]);
        self.aims = Some(aims);
    }

    /// Lets samples be aimed anew: other looks are sought.
    pub fn release(&mut self) {
        self.aims = None;
    }

    /// Whether samples are to be aimed yet. A basis to be kept serves other looks too.
    #[must_use]
    pub fn may_aim(&self) -> bool {
        self.aims.is_none() && self.stored.is_none()
    }

    fn halves(&self) -> &TransportBasis {
        self.halves.get_or_init(|| self.basis.halves())
    }

    /// The seed of its samples.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The lighting at a point of the unit cube.
    #[must_use]
    pub fn lighting(&self, variables: &ParamVector, u: &[f64]) -> LightingPoint {
        variables.lighting(self.plan.fixed.clone(), &variables.decode(u))
    }

    /// The picture of a lighting.
    #[must_use]
    pub fn picture(&self, x: &LightingPoint) -> Picture {
        self.basis.picture(x)
    }

    /// f_q as a function of the variables.
    #[must_use]
    pub fn evaluator<'a>(&'a self, setting: &'a Setting, objective: &'a Objective) -> Evaluator<'a> {
        Evaluator {
            basis: &self.basis,
            halves: self.halves(),
            objective,
            variables: setting.variables,
            fixed: &self.plan.fixed,
            luminance: setting.options.luminance,
            exposure: f64::from(setting.scene.exposure),
            least_sizes: &self.least_sizes,
        }
    }

    /// As [`Self::evaluator`], of the smaller picture.
    #[must_use]
    pub fn reduced<'a>(&'a self, setting: &'a Setting, objective: &'a Objective) -> Evaluator<'a> {
        let basis = self.reduced.get_or_init(|| self.halves().reduced(REDUCTION));
        Evaluator { basis, halves: basis, ..self.evaluator(setting, objective) }
    }
}

/// What is asked of a smaller picture; `None` where object or background are too small for
/// it.
pub fn reduced_objective(setting: &Setting, target: &Target) -> Option<Objective> {
    let size = setting.options.work_size / REDUCTION;
    let wide = setting.aovs.width;
    let (side, n) = (REDUCTION as usize, (REDUCTION * REDUCTION) as usize);
    // A small pixel is the object's when most of its pixels are.
    let mask: Vec<bool> = (0..size.element_product() as usize)
        .map(|i| {
            let (x, y) = (i % size.x as usize * side, i / size.x as usize * side);
            let covered = (0..n).filter(|k| setting.aovs.mask[(y + k / side) * wide + x + k % side]).count();
            2 * covered >= n
        })
        .collect();
    Objective::new(target, size.x as usize, size.y as usize, &mask).ok()
}
