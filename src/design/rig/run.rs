//! A whole run whose lamps or surroundings the program chooses.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use super::{SkyFile, find, sky};
use crate::{
    audit::{BASIS, LIVE},
    design::{self, Reporter, RunError, RunOptions, RunReport, Subject, deadline::Deadline},
    light::Light,
    lighting::Lighting,
    scene::Scene,
    variables::Constraints,
};

/// Time limit of a look for which no time is left: it gets one pass of everything.
const LEAST_TIME: Duration = Duration::from_millis(1);

/// What rigs are sought for.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// Lamps at most, besides the scene's own lights.
    pub most: usize,
    /// Whether the scene's own flat lights may be moved.
    pub moves: bool,
    /// Lights that were staged for a scene that has none: a rig like those that are sought, and used where none of
    /// these is better.
    pub staged: &'a [Light],
    /// Pictures of surroundings, one of which takes the place of the scene's own; none to place lamps.
    pub skies: &'a [SkyFile],
    /// Whether the lights of the scene's files were left out.
    pub without_lights: bool,
    /// Path of the scene file, for the record.
    pub path: &'a Path,
    /// Lighting of the scene's own lights.
    pub authored: &'a Lighting,
    /// Names of the scene's own lights.
    pub own_names: &'a [String],
    /// Constraints of the scene's author.
    pub constraints: &'a Constraints,
    /// Options of the run.
    pub options: &'a RunOptions,
}

/// Finds a rig for every look, then its lights as an ordinary run does, and records both; returns a report for
/// each job. Looks share the pictures of the places of lamps; the rest is done for one after the other, since
/// each has lamps of its own.
///
/// # Errors
/// As the search for places and [`design::run`].
pub fn run(scene: Scene, order: &Order, reporter: &impl Reporter) -> Result<Vec<RunReport>, RunError> {
    let start = Instant::now();
    let deadline = Deadline::new(start, order.options.time_limit);
    let lit = scene.lights.iter().zip(&order.authored.radiance);
    let lights = lit.map(|(light, &radiance)| Light { radiance: radiance as f32, ..light.clone() }).collect();
    let scene = scene.with_lights(lights);
    let found = if order.skies.is_empty() {
        find(scene, order, deadline, reporter)
    } else {
        sky::find(scene, order, deadline, reporter)
    };
    let (rigs, mut scene) = found?;
    let own = scene.lights.clone();
    let mut reports = Vec::new();
    let n = rigs.len();
    for (k, (job, rig)) in order.options.jobs.iter().zip(&rigs).enumerate() {
        scene = scene.with_lights(own.iter().cloned().chain(rig.lights()).collect());
        let authored = Lighting { exposure: order.authored.exposure, ..Lighting::authored(&scene) };
        let constraints = rig.constrained(&own, order);
        let left = deadline.left_until(1.0);
        let options = RunOptions {
            jobs: vec![job.clone()],
            basis_file: order.options.basis_file.as_ref().map(|_| job.out.join(BASIS)),
            live_file: order.options.live_file.as_ref().map(|_| job.out.join(LIVE)),
            ..order.options.clone()
        };
        let subject = Subject {
            scene: &scene,
            path: order.path,
            authored: &authored,
            constraints: &constraints,
            rig: Some(rig),
            // In equal parts.
            time_left: left.map(|left| (left / (n - k) as u32).max(LEAST_TIME)),
        };
        reports.extend(design::run(subject, &options, reporter)?);
        if reporter.cancelled() {
            break;
        }
    }
    Ok(reports)
}
