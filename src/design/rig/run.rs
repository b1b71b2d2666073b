//! A whole run whose lamps the program places.

use std::path::Path;

use super::find;
use crate::{
    design::{self, Reporter, RunError, RunOptions, RunReport, Subject},
    lighting::Lighting,
    scene::Scene,
    variables::Constraints,
};

/// What rigs are sought for.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// Lamps at most, besides the scene's own lights.
    pub most: usize,
    /// Whether the lights of the scene's files were left out.
    pub without_lights: bool,
    /// Path of the scene file, for the record.
    pub path: &'a Path,
    /// Lighting of the scene's own lights.
    pub authored: &'a Lighting,
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
/// As [`find`] and [`design::run`].
pub fn run(scene: Scene, order: &Order, reporter: &impl Reporter) -> Result<Vec<RunReport>, RunError> {
    let (rigs, mut scene) = find(scene, order, reporter)?;
    let own = scene.lights.clone();
    let mut reports = Vec::new();
    for (job, rig) in order.options.jobs.iter().zip(&rigs) {
        scene = scene.with_lights(own.iter().cloned().chain(rig.lights()).collect());
        let authored = Lighting { exposure: order.authored.exposure, ..Lighting::authored(&scene) };
        let constraints = rig.constrained(order.constraints);
        let options = RunOptions { jobs: vec![job.clone()], ..order.options.clone() };
        let subject = Subject {
            scene: &scene,
            path: order.path,
            authored: &authored,
            constraints: &constraints,
            rig: Some(rig),
        };
        reports.extend(design::run(subject, &options, reporter)?);
        if reporter.cancelled() {
            break;
        }
    }
    Ok(reports)
}
