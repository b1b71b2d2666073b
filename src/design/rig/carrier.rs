//! Carriers: the lamps among which a rig is chosen, all in one transport basis.
//!
//! Lamps do not block light, so that lamps superpose exactly, also lamps that do not exist yet: *where* a lamp
//! stands is one more thing that a basis keeps apart. A carrier is a set of lamps, each a light of the scene
//! like any other, of which the basis holds the luminance of a coarse picture at unit radiance. Every rig of
//! some of them is then a weighted sum of a few rows of the tables.

use glam::UVec2;
use rayon::prelude::*;

use super::lamp::Lamp;
use crate::{
    camera::Camera,
    design::{
        Reporter, RunError, RunOptions,
        evaluator::Evaluator,
        render::Renderer,
        seeds::{Purpose, seed_for},
    },
    files::number::Bytes,
    film::Picture,
    integrator::{View, aov},
    light::{Light, LightColor},
    lighting::{Lighting, SampleCounts, SamplingPlan},
    math::{Measure, measure::COLOUR_PLANES},
    objective::{Objective, ObjectiveError, Target},
    photo::weights::Weights,
    scene::Scene,
    transport::{Layout, Recombination, SizeBins, Source, Tables, TransportBasis, ValueNodes, splat_memory},
    variables::{Constraints, Fitted, FreeKinds, LightConstraints, ParamVector, Survey, Variable},
};

/// Replicates of a carrier: the least from which noise bias can be corrected.
const REPLICATES: usize = 2;
/// Largest factor by which the pictures are smaller than the working picture in both directions, to fit the memory
/// allowed.
const MOST_REDUCED: u32 = 4;
/// Longer side down to which pictures are reduced for speed alone, pixels: terms of f_q that depend on the
/// resolution, as the gradient's does, then still order rigs as at the working size. On a room with a box, f_q of
/// the rig chosen was .729 in pictures of 8 x 6 pixels where it was 1.23, and .934 in 48 x 36 where it was .954.
const LEAST_SIDE: u32 = 48;
/// Factor by which the pictures of [`Carrier::reduced`] are smaller again.
const REDUCED_AGAIN: u32 = 2;
/// Samples that every lamp has in a pixel of a carrier, all replicates together. Set by reasoning: statistics of
/// whole pictures average over thousands of pixels.
const SAMPLES: u32 = 3;
/// Share of the lamps that a vertex where the camera sees samples, as its inverse, and a later one: many lamps
/// share the cost of a path.
const SAMPLED: [usize; 2] = [4, 16];
/// Camera subpaths for each light subpath: next-event estimation finds nearly everything that large lamps in
/// the open light.
const CAMERA_SUBPATHS: u32 = 8;

/// What a rig is chosen among: each is one light, whose radiance is found.
pub trait Candidate {
    /// Whether such lights are known to be clear of every surface of the scene.
    const IS_CLEAR: bool;
    /// The light, under a name, at radiance 1.
    fn light(&self, name: String) -> Light;
    /// The scene's own light for which it stands, by its index among those that may be moved; `None` for another.
    fn of(&self) -> Option<usize>;
}

impl Candidate for Lamp {
    const IS_CLEAR: bool = true;

    fn light(&self, name: String) -> Light {
        Self::light(self, name)
    }

    fn of(&self) -> Option<usize> {
        self.of
    }
}

/// Lamps, or other lights among which is chosen, with their pictures at unit radiance.
#[derive(Debug)]
pub struct Carrier<L = Lamp> {
    /// Number of the scene's own lights, which come before the lamps in everything that is by light.
    pub n_own: usize,
    /// The lamps.
    pub lamps: Vec<L>,
    /// Tables of the own lights and of the lamps.
    basis: TransportBasis,
    /// The same of pictures reduced by [`REDUCED_AGAIN`].
    reduced: TransportBasis,
    /// Variables of all lights, in their order, then those of the scene.
    variables: Vec<Variable>,
    /// Lighting in which all lamps are off.
    fixed: Lighting,
    measure: Measure,
    /// Mask of the main object in the pictures, and in the reduced ones.
    masks: [(UVec2, Vec<bool>); 2],
    /// Weights in the place of the masks, where there are any.
    weights: Option<Weights>,
}

/// Some lights of a carrier with their variables.
#[derive(Debug)]
pub struct Part {
    basis: TransportBasis,
    /// Variables of the lights in their order, then those of the scene.
    pub variables: ParamVector,
    fixed: Lighting,
    measure: Measure,
}

impl Part {
    /// f_q of the lights as a function of their variables.
    #[must_use]
    pub fn evaluator<'a>(&'a self, objective: &'a Objective) -> Evaluator<'a> {
        Evaluator {
            basis: &self.basis,
            halves: &self.basis,
            objective,
            variables: &self.variables,
            fixed: &self.fixed,
            measure: self.measure,
            least_sizes: &[],
        }
    }

    /// Radiance of each light, and the background's value, at the point `u` of the unit cube.
    #[must_use]
    pub fn lighting(&self, u: &[f64]) -> Lighting {
        self.variables.lighting(self.fixed.clone(), &self.variables.decode(u))
    }
}

/// What a carrier is rendered for.
#[derive(Clone, Copy, Debug)]
pub struct Commission<'a> {
    /// The scene's own lighting, which the lamps are added to.
    pub own: &'a Fitted,
    /// Constraints of the scene's author.
    pub constraints: &'a Constraints,
    /// Integrator, sampler and measure of luminance.
    pub renderer: Renderer,
    /// Size of the working pictures, of which those of a carrier are reductions, pixels.
    pub work_size: UVec2,
    /// Kinds of variables that are free.
    pub free: &'a FreeKinds,
    /// Upper bound of the memory, bytes.
    pub memory: u64,
    /// Weights in the place of the mask of the main object, where there are any.
    pub weights: Option<&'a Weights>,
    /// Samples that every lamp has in a pixel, all replicates together.
    pub samples: u32,
    /// Samples of a pixel at least, whatever lamps have.
    pub least_spp: u32,
    /// Seed of the samples.
    pub seed: u64,
}

impl<'a> Commission<'a> {
    /// A carrier for the working pictures of a run.
    #[must_use]
    pub fn of_run(own: &'a Fitted, constraints: &'a Constraints, options: &'a RunOptions) -> Self {
        let RunOptions { integrator, sampler, measure, .. } = *options;
        Self {
            own,
            constraints,
            renderer: Renderer { integrator, sampler, measure },
            work_size: options.work_size,
            free: &options.free,
            memory: options.memory,
            weights: options.weights.as_ref(),
            samples: SAMPLES,
            least_spp: 1,
            seed: seed_for(options.seed, Purpose::Places),
        }
    }

    /// The same with `least_spp` samples of a pixel at least.
    #[must_use]
    pub fn with_spp(self, least_spp: u32) -> Self {
        Self { least_spp, ..self }
    }
}

impl<L: Candidate> Carrier<L> {
    /// Renders the tables of some lamps. Returns them with the scene, which has the lamps as its last lights.
    ///
    /// # Errors
    /// When the tables need more memory than is allowed, or the render fails.
    pub fn render(
        scene: Scene,
        lamps: Vec<L>,
        commission: Commission,
        reporter: &impl Reporter,
    ) -> Result<(Self, Scene), RunError> {
        let Commission { own, renderer, samples, seed, .. } = commission;
        let n_own = scene.lights.len();
        let named = |(i, lamp): (usize, &L)| lamp.light(format!("place {}", i + 1));
        let lights: Vec<Light> = lamps.iter().enumerate().map(named).collect();
        let scene = if L::IS_CLEAR {
            scene.with_clear_lights(lights)
        } else {
            let all = scene.lights.iter().cloned().chain(lights).collect();
            scene.with_lights(all)
        };
        let fitted = with_lamps(own, lamps.len());
        let counts = SampleCounts {
            first_light_samples: (scene.lights.len() / SAMPLED[0]).clamp(6, 96) as u32,
            light_samples: (scene.lights.len() / SAMPLED[1]).clamp(3, 24) as u32,
            camera_subpaths: CAMERA_SUBPATHS,
            ..SampleCounts::default()
        };
        let of_lamps = samples as usize * scene.lights.len();
        let spp = (of_lamps.div_ceil(counts.first_light_samples as usize) as u32).max(commission.least_spp);
        let (layout, nodes) = plan(&scene, &fitted, &commission, counts, spp, reporter)?;
        let camera = scene.camera.resized(layout.size);
        let view = View { scene: &scene, camera: &camera };
        let sampling =
            SamplingPlan { largest_value: nodes as f32, counts, ..SamplingPlan::uniform(&fitted.lighting) };
        reporter.stage("rendering the places of lamps", Some(u64::from(layout.size.y) * REPLICATES as u64));
        let mut basis = TransportBasis::for_search(layout, REPLICATES);
        let source = Source {
            view,
            plan: &sampling,
            integrator: &renderer.integrator,
            sampler: renderer.sampler,
            seed,
        };
        basis.render(source, spp.div_ceil(REPLICATES as u32), reporter)?;
        let mut reduced = basis.reduced(REDUCED_AGAIN);
        let mut masks = [&basis, &reduced].map(|b| mask(&scene, &camera, b.layout().size));
        let has_both = |mask: &[bool]| mask.contains(&true) && mask.contains(&false);
        if 2 * reduced.layout().size.max_element() < LEAST_SIDE || !has_both(&masks[1].1) {
            (reduced, masks[1]) = (basis.clone(), masks[0].clone());
        }
        let variables = variables(&scene, &fitted, &commission, (&reduced, &masks[1].1));
        let fixed = dark(&fitted.lighting, n_own);
        let measure = renderer.measure;
        let weights = commission.weights.cloned();
        let carrier = Self { n_own, lamps, basis, reduced, variables, fixed, measure, masks, weights };
        Ok((carrier, scene))
    }

    /// The carrier with some lamps of another one, by their indices among all its lights, after its own; `None` where
    /// their pictures have not the same size.
    #[must_use]
    pub fn joined(&self, other: &Self, lights: &[usize]) -> Option<Self>
    where
        L: Clone,
    {
        let basis = self.basis.joined(&other.basis.of_lights(lights))?;
        let reduced = self.reduced.joined(&other.reduced.of_lights(lights))?;
        let n = self.n_own + self.lamps.len();
        let (of_lights, of_scene): (Vec<_>, Vec<_>) =
            self.variables.iter().cloned().partition(|v| v.kind.is_of_light());
        let added = lights.iter().enumerate().flat_map(|(k, &light)| {
            other.of_light(light).map(move |v| Variable { light: n + k, ..v.clone() })
        });
        // Every lamp is dark there and of size 1, as the first is.
        let all: Vec<usize> = (0..n).chain(std::iter::repeat_n(self.n_own, lights.len())).collect();
        Some(Self {
            n_own: self.n_own,
            lamps: self.lamps.iter().chain(lights.iter().map(|&light| other.lamp(light))).cloned().collect(),
            basis,
            reduced,
            variables: of_lights.into_iter().chain(added).chain(of_scene).collect(),
            fixed: self.fixed.of_lights(&all),
            measure: self.measure,
            masks: self.masks.clone(),
            weights: self.weights.clone(),
        })
    }

    /// Objectives of a target for the pictures, and for the reduced ones.
    ///
    /// # Errors
    /// When object or background are too small.
    pub fn objectives(&self, target: &Target) -> Result<[Objective; 2], ObjectiveError> {
        let [whole, reduced] = &self.masks;
        let of = |(size, mask): &(UVec2, Vec<bool>)| {
            Weights::objective(self.weights.as_ref(), target, size.to_array().map(|n| n as usize), mask)
        };
        Ok([of(whole)?, of(reduced)?])
    }

    /// Indices of the lamps that light some of the picture, among all lights.
    #[must_use]
    pub fn candidates(&self) -> Vec<usize> {
        let has_variable = |l: &usize| self.of_light(*l).next().is_some();
        (self.n_own..self.n_own + self.lamps.len()).filter(has_variable).collect()
    }

    /// The lamp of an index among all lights.
    #[must_use]
    pub fn lamp(&self, light: usize) -> &L {
        &self.lamps[light - self.n_own]
    }

    fn of_light(&self, light: usize) -> impl Iterator<Item = &Variable> {
        self.variables.iter().filter(move |v| v.kind.is_of_light() && v.light == light)
    }

    /// Some of the lights, by their indices.
    #[must_use]
    pub fn part(&self, lights: &[usize]) -> Part {
        self.part_of(&self.basis, lights)
    }

    /// Some of the lights in reduced pictures.
    #[must_use]
    pub fn reduced_part(&self, lights: &[usize]) -> Part {
        self.part_of(&self.reduced, lights)
    }

    fn part_of(&self, basis: &TransportBasis, lights: &[usize]) -> Part {
        let of_lights = lights
            .iter()
            .enumerate()
            .flat_map(|(k, &light)| self.of_light(light).map(move |v| Variable { light: k, ..v.clone() }));
        let of_scene = self.variables.iter().filter(|v| !v.kind.is_of_light()).cloned();
        let fixed = self.fixed.of_lights(lights);
        Part {
            basis: basis.of_lights(lights),
            // Lights that follow others are free here; the search that follows ties them.
            variables: ParamVector { variables: of_lights.chain(of_scene).collect(), ties: Vec::new() },
            fixed,
            measure: self.measure,
        }
    }

    /// Mean luminance that each of some lights brings to the object and to the background of the picture.
    #[must_use]
    pub fn means(&self, lights: &[usize], radiance: &[f64]) -> Vec<[f64; 2]> {
        let (_, mask) = &self.masks[0];
        let on = mask.iter().filter(|m| **m).count().max(1) as f64;
        let off = (mask.len() as f64 - on).max(1.0);
        let of = |(&light, &radiance): (&usize, &f64)| {
            let image = unit_image(&self.basis, &self.fixed, light);
            let sum = |main: bool| -> f64 {
                image.iter().zip(mask).filter(|(_, m)| **m == main).map(|(y, _)| y * radiance).sum()
            };
            [sum(true) / on, sum(false) / off]
        };
        lights.iter().zip(radiance).map(of).collect()
    }
}

/// The lighting and sizes of the own lights with those of `n` lamps added, at size and radiance 1.
fn with_lamps(own: &Fitted, n: usize) -> Fitted {
    let mut fitted = own.clone();
    fitted.lighting.radiance.extend(vec![1.0; n]);
    fitted.lighting.size.extend(vec![1.0; n]);
    if !fitted.lighting.color.is_empty() {
        fitted.lighting.color.extend(vec![LightColor::Recorded; n]);
    }
    // Nothing of a carrier has a free size.
    fitted.sizes = vec![None; fitted.lighting.n_lights()];
    fitted
}

/// The lighting with all lamps off.
fn dark(lighting: &Lighting, n_own: usize) -> Lighting {
    let mut lighting = lighting.clone();
    lighting.radiance[n_own..].fill(0.0);
    lighting
}

/// Layout of the tables within the memory allowed, with the largest value of the background.
fn plan(
    scene: &Scene,
    fitted: &Fitted,
    commission: &Commission,
    counts: SampleCounts,
    spp: u32,
    reporter: &impl Reporter,
) -> Result<(Layout, f64), RunError> {
    let Commission { renderer: Renderer { integrator, measure, .. }, work_size, free, memory, .. } =
        *commission;
    let nodes = match (free.contains("background"), fitted.value_range) {
        (true, Some(_)) => ValueNodes::new(f64::from(fitted.largest_value()), integrator.max_depth),
        _ => ValueNodes::new(fitted.lighting.value, 1),
    };
    let planes = if fitted.lighting.color.is_empty() { measure.n_planes() } else { COLOUR_PLANES };
    let largest = nodes.values()[0];
    let mut needed = 0;
    let least = if work_size.max_element() >= 2 * LEAST_SIDE { 2 } else { 1 };
    for factor in least..=MOST_REDUCED {
        let size = (work_size / factor).max(UVec2::ONE);
        let bins = fitted.lighting.size.iter().map(|&s| SizeBins::Fixed(s as f32)).collect();
        let layout = Layout::new(size, bins, nodes.clone()).with_planes(planes);
        let subpaths = integrator.kind.light_subpaths(u64::from(size.element_product() * spp), counts);
        let splats = splat_memory(&layout, subpaths, integrator.max_depth);
        // Tables, and those of a quarter of the pixels.
        needed = layout.search_memory(REPLICATES) * 5 / 4 + splats;
        if needed <= memory {
            reporter.note(&format!(
                "places of lamps: {} in {} x {} pixels, {} value nodes, {REPLICATES} replicates, {spp} samples a pixel, {}",
                scene.lights.len(),
                size.x,
                size.y,
                layout.nodes.len(),
                Bytes(needed)
            ));
            return Ok((layout, largest));
        }
    }
    Err(RunError::Memory { needed: Bytes(needed), allowed: Bytes(memory) })
}

/// Mask of the main object in pictures of a size.
fn mask(scene: &Scene, camera: &Camera, size: UVec2) -> (UVec2, Vec<bool>) {
    let camera = camera.resized(size);
    (size, aov::trace(View { scene, camera: &camera }, 1.0).mask)
}

/// Mean over the replicates of the picture of a light alone, at unit radiance.
fn unit_image(basis: &TransportBasis, fixed: &Lighting, light: usize) -> Vec<f64> {
    let one = basis.of_lights(&[light]);
    let x = Lighting { radiance: vec![1.0], ..fixed.of_lights(&[light]) };
    let r = Recombination::new(one.layout(), &x);
    let mut sum = vec![0.0; one.layout().n_pixels()];
    let mut image = sum.clone();
    for replicate in 0..one.n_replicates() {
        one.luminance(replicate, &r, &mut image);
        sum.iter_mut().zip(&image).for_each(|(s, v)| *s += v / one.n_replicates() as f64);
    }
    sum
}

/// Variables of all lights and of the scene, but for sizes. Lamps that light nothing have none.
fn variables(
    scene: &Scene,
    fitted: &Fitted,
    commission: &Commission,
    (basis, mask): (&TransportBasis, &[bool]),
) -> Vec<Variable> {
    let n = fitted.lighting.n_lights();
    let size = basis.layout().size.to_array().map(|n| n as usize);
    let grey = |l: usize| -> Vec<[f32; 3]> {
        unit_image(basis, &fitted.lighting, l).into_iter().map(|y| [y as f32; 3]).collect()
    };
    let unit = Picture::of_lights(size, (0..n).into_par_iter().map(grey).collect());
    let mut constraints =
        Constraints { bonds: Vec::new(), groups: Vec::new(), ..commission.constraints.clone() };
    let lamp = LightConstraints { is_from_file: true, ..LightConstraints::default() };
    constraints.lights.resize(n, lamp);
    constraints.lights.iter_mut().for_each(|light| light.is_from_file = true);
    let free = FreeKinds(commission.free.0.iter().copied().filter(|kind| kind.keyword() != "size").collect());
    let measure = commission.renderer.measure;
    let survey = Survey::new(scene, fitted, &constraints, &free, measure, (&unit, mask));
    survey.variables().map(|vector| vector.variables).unwrap_or_default()
}
