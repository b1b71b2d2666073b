//! Setup that all looks of a run share, the task of each look, and its result.

use super::{
    Job, Reporter, RunOptions, alternatives::Alternative, attainable::Reach, deadline::Deadline,
    render::Renderer, rig::Rig,
};
use crate::{
    audit::{RunDir, products::Products},
    camera::Camera,
    integrator::{
        View,
        aov::{Aovs, Features},
    },
    lighting::{Lighting, SampleCounts, SamplingPlan},
    objective::{JackknifeEstimate, Objective, Target},
    optim::StopReason,
    photo::weights::Weights,
    scene::Scene,
    variables::{Constraints, Fitted, ParamVector},
};

/// Camera subpaths for each light subpath of a working picture. On the fruit basket, where next-event
/// estimation finds nearly everything, a sample takes 15 to 30 % less time than with one; 3, 6 and 8
/// were no better. Where light subpaths carry a look, more samples make up for it: a glass vase took
/// 112 samples in the place of 72, in the same time.
const CAMERA_SUBPATHS: u32 = 4;

/// A scene with everything that working pictures of it have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Camera of the working pictures.
    pub camera: &'a Camera,
    /// The author's lighting within the bounds that geometry and materials set.
    pub fitted: &'a Fitted,
    /// Constraints that the scene's author sets on the variables.
    pub constraints: &'a Constraints,
    /// Lamps that the program placed; `None` where all lights are the scene's own.
    pub rig: Option<&'a Rig>,
    /// Auxiliary pictures of the working size.
    pub aovs: &'a Aovs,
    /// What the camera of the working pictures sees, by which those that are shown are denoised; `None` where
    /// they are shown as they are.
    pub features: Option<&'a Features>,
    /// Options of the run.
    pub options: &'a RunOptions,
    /// Time that the run may take.
    pub deadline: Deadline,
    /// Hash of what decides how light is transported in the scene: [`Scene::fingerprint`], which takes time.
    pub fingerprint: u64,
    /// What an earlier attempt at the same run has made, and this one keeps.
    pub products: &'a Products,
}

impl<'a> Stage<'a> {
    /// Whether the search for lights must end, by an interrupt or because its part of the time is over.
    pub fn search_is_over(&self, reporter: &impl Reporter) -> bool {
        reporter.cancelled() || self.deadline.has_passed(Deadline::SEARCH)
    }

    /// The scene with the camera of the working pictures.
    pub fn view(&self) -> View<'a> {
        View { scene: self.scene, camera: self.camera }
    }

    /// Renderer with the run's integrator, sampler and measure of luminance.
    pub fn renderer(&self) -> Renderer {
        let RunOptions { integrator, sampler, measure, .. } = *self.options;
        Renderer { integrator, sampler, measure }
    }

    /// Sampling plan of a working picture of `lighting`: all lights with the same probability, and all
    /// values that the background may take.
    pub fn plan(&self, lighting: &Lighting) -> SamplingPlan {
        SamplingPlan {
            largest_value: self.fitted.largest_value(),
            counts: SampleCounts { camera_subpaths: CAMERA_SUBPATHS, ..SampleCounts::default() },
            ..SamplingPlan::uniform(lighting)
        }
    }

    /// Objective of a target for the working picture reduced by `factor` in both directions; `None` where
    /// object or background are too small for it.
    pub fn reduced_objective(&self, target: &Target, factor: u32) -> Option<Objective> {
        let size = self.options.work_size / factor;
        let wide = self.aovs.width;
        let (side, n) = (factor as usize, (factor * factor) as usize);
        // A small pixel is the object's when most of its pixels are.
        let mask: Vec<bool> = (0..size.element_product() as usize)
            .map(|i| {
                let (x, y) = (i % size.x as usize * side, i / size.x as usize * side);
                let covered = (0..n).filter(|k| self.aovs.mask[(y + k / side) * wide + x + k % side]).count();
                2 * covered >= n
            })
            .collect();
        Weights::objective(self.options.weights.as_ref(), target, size.to_array().map(|n| n as usize), &mask)
            .ok()
    }
}

/// A stage with its free variables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setup<'a> {
    /// The scene with everything that working pictures have in common.
    pub stage: Stage<'a>,
    /// Free variables.
    pub variables: &'a ParamVector,
}

impl<'a> std::ops::Deref for Setup<'a> {
    type Target = Stage<'a>;
    fn deref(&self) -> &Stage<'a> {
        &self.stage
    }
}

impl Setup<'_> {
    /// Lighting at the point `u` of the unit cube.
    pub fn lighting(&self, u: &[f64]) -> Lighting {
        self.variables.lighting(self.fitted.lighting.clone(), &self.variables.decode(u))
    }
}

/// The task of finding one look.
pub(super) struct Task<'a> {
    /// Look to be found, and the directory that records it.
    pub job: &'a Job,
    /// Objective of the working pictures.
    pub objective: Objective,
    /// Objective of the reduced picture on which starts are screened; `None` where object or background
    /// are too small for it.
    pub reduced: Option<Objective>,
    /// Starts of the search with their names, as points of the unit cube.
    pub starts: Vec<(String, Vec<f64>)>,
    /// Open run directory.
    pub dir: RunDir,
}

/// Result of the search for one look.
pub(super) struct Found {
    /// Point found, in the unit cube.
    pub u: Vec<f64>,
    /// f_q at that point, measured with samples that chose nothing.
    pub check: JackknifeEstimate,
    /// Number of evaluations of f_q with its gradient.
    pub evaluations: u32,
    /// Reason why the last descent ended.
    pub stop: StopReason,
    /// Range of each term within reach of the lights; empty in paper mode.
    pub reach: Vec<Reach>,
    /// Other lightings to choose from; empty where none were sought.
    pub alternatives: Vec<Alternative>,
}
