//! What all looks of a run have in common, and what each has of its own.

use super::{Job, Reporter, RunOptions, attainable::Reach, deadline::Deadline, render::Renderer};
use crate::{
    audit::RunDir,
    camera::Camera,
    integrator::{View, aov::Aovs},
    lighting::{Lighting, SampleCounts, SamplingPlan},
    objective::{JackknifeEstimate, Objective, Target},
    optim::StopReason,
    scene::Scene,
    variables::{Fitted, ParamVector, Wishes},
};

/// Camera subpaths for each light subpath of a working picture: where those find much light that
/// next-event estimation does not, more samples will make up for it.
const CAMERA_SUBPATHS: u32 = 4;

/// A scene and how it is rendered while lights are sought.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Camera of the working pictures.
    pub camera: &'a Camera,
    /// The author's lighting within the bounds that the geometry sets.
    pub fitted: &'a Fitted,
    /// What the scene's author wishes of the variables.
    pub wishes: &'a Wishes,
    /// What the working pictures show beside light.
    pub aovs: &'a Aovs,
    /// What the run is asked to do.
    pub options: &'a RunOptions,
    /// How long it may take.
    pub deadline: Deadline,
}

impl<'a> Stage<'a> {
    /// Whether the search for lights must end: by an interrupt, or because the time for it is over.
    pub fn search_is_over(&self, reporter: &impl Reporter) -> bool {
        reporter.cancelled() || self.deadline.has_passed(Deadline::SEARCH)
    }

    /// The scene at the working size.
    pub fn view(&self) -> View<'a> {
        View { scene: self.scene, camera: self.camera }
    }

    /// How pictures are rendered.
    pub fn renderer(&self) -> Renderer {
        let RunOptions { integrator, sampler, luminance, .. } = *self.options;
        Renderer { integrator, sampler, luminance }
    }

    /// The plan of a working picture: all lights alike, for all values that the background may take.
    pub fn plan(&self, lighting: &Lighting) -> SamplingPlan {
        SamplingPlan {
            largest_value: self.fitted.largest_value(),
            counts: SampleCounts { camera_subpaths: CAMERA_SUBPATHS, ..SampleCounts::default() },
            ..SamplingPlan::uniform(lighting)
        }
    }

    /// The picture's objective reduced by `factor` in both directions; `None` where the object or
    /// the background are too small for it.
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
        Objective::new(target, size.x as usize, size.y as usize, &mask).ok()
    }
}

/// A stage with the variables that its survey found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setup<'a> {
    /// The scene and how it is rendered.
    pub stage: Stage<'a>,
    /// What varies.
    pub variables: &'a ParamVector,
}

impl<'a> std::ops::Deref for Setup<'a> {
    type Target = Stage<'a>;
    fn deref(&self) -> &Stage<'a> {
        &self.stage
    }
}

impl Setup<'_> {
    /// The lighting at a point of the unit cube.
    pub fn lighting(&self, u: &[f64]) -> Lighting {
        self.variables.lighting(self.fitted.lighting.clone(), &self.variables.decode(u))
    }
}

/// A job being done.
pub(super) struct Task<'a> {
    /// The look wanted, and where it is recorded.
    pub job: &'a Job,
    /// What is asked of a working picture.
    pub objective: Objective,
    /// What is asked of the smaller picture on which starts are screened.
    pub reduced: Option<Objective>,
    /// Named points at which a search may begin, in the optimiser's units.
    pub starts: Vec<(String, Vec<f64>)>,
    /// The record.
    pub dir: RunDir,
}

/// What was found for one target.
pub(super) struct Found {
    /// The point, in the unit cube.
    pub u: Vec<f64>,
    /// f_q there, from samples that chose nothing.
    pub check: JackknifeEstimate,
    /// Evaluations with gradient.
    pub evaluations: u32,
    /// Why the last search ended.
    pub stop: StopReason,
    /// What of each term the lights can reach.
    pub reach: Vec<Reach>,
}
