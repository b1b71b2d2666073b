//! `result.json`: what a run has come to, and the lights with which it did. Its keys are listed in
//! `docs/formats.md`.

use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::{
    Job, RunReport, alternatives,
    attainable::{self, Reach},
    setup::Setup,
};
use crate::{
    audit::{RESULT, write_whole},
    light::{Light, Outline, Shape},
};

/// Version of the format.
const SCHEMA: u32 = 1;

impl RunReport {
    /// Range of each term within reach of the lights, including the lights found.
    #[must_use]
    pub fn reach_with_found(&self) -> Vec<Reach> {
        let with_found = |reach: &Reach| {
            let found = self.check.evaluation[reach.term];
            Reach {
                floor: reach.floor.min(found.f),
                least: reach.least.min(found.value),
                largest: reach.largest.max(found.value),
                ..*reach
            }
        };
        self.reach.iter().map(with_found).collect()
    }

    /// The report as a JSON object, without the time that the run took.
    #[must_use]
    pub fn to_json(&self, job: &Job) -> Value {
        let last = self.last.as_ref();
        let mut report = json!({
            "target": job.target.name(),
            "f_q_initial": self.initial.evaluation.f_q,
            "f_q": self.check.evaluation.f_q,
            "f_q_error": self.check.error_bar(),
            "f_q_final": last.map(|last| last.estimate.evaluation.f_q),
            "f_q_final_error": last.map(|last| last.estimate.error_bar()),
            "f_q_picture": last.map(|last| last.f_q_picture),
            "final_noise": last.map(|last| last.noise.error()),
            "final_spp": last.map(|last| last.spp),
            "terms": self.check.evaluation.terms_json(),
            "x": self.variables.named(&self.x),
            "renders": self.renders,
            "evaluations": self.evaluations,
            "attainable": attainable::to_json(&self.reach_with_found()),
            "caution": self.caution,
            "stop_reason": self.stop.to_string(),
        });
        if let Some(surroundings) = &self.surroundings {
            report["surroundings"] = json!(surroundings);
        }
        if !self.lamps.is_empty() {
            report["lamps"] =
                self.lamps.iter().map(|(name, lamp)| json!({"name": name, "setup": lamp})).collect();
        }
        report
    }
}

/// Writes what a look has come to beside its other files.
pub(super) fn write(report: &RunReport, job: &Job, setup: Setup) -> Result<(), super::RunError> {
    let mut value = report.to_json(job);
    let (scene, variables) = (setup.scene, setup.variables);
    let fitted = &setup.fitted.lighting;
    let initial: Vec<f64> = variables.variables.iter().map(|v| v.initial).collect();
    let reach = report.reach_with_found();
    let counting: Vec<Reach> = reach.into_iter().filter(|r| job.target.weight(r.term) > 0.0).collect();
    value["schema"] = SCHEMA.into();
    value["f_q_initial_error"] = report.initial.error_bar().into();
    value["terms_initial"] = report.initial.evaluation.terms_json();
    value["terms_final"] = report.last.as_ref().map(|last| last.estimate.evaluation.terms_json()).into();
    value["in_words"] = attainable::in_words(&counting).into();
    value["authored"] = json!(fitted);
    value["start"] = json!(variables.lighting(fitted.clone(), &initial));
    value["found"] = json!(variables.lighting(fitted.clone(), &report.x));
    let moved = |light: &Light| setup.rig?.lamps.iter().find(|lamp| lamp.name == light.name)?.moved_from;
    value["lights"] = scene.lights.iter().map(|light| facts(light, moved(light), scene.origin)).collect();
    value["has_background"] = (!scene.background().is_empty()).into();
    if !report.alternatives.is_empty() {
        value["picks"] = alternatives::to_json(report, setup);
    }
    // Numbers without an end in decimals are written so that they come back.
    write_whole(&job.out.join(RESULT), format!("{value:#}\n"))?;
    Ok(())
}

/// What is to be known of a light: what it is, where it stands in the scene's file, whose origin is at `origin`
/// there, and where it stood if it was moved, and its power, W, for unit radiance at size 1.
fn facts(light: &Light, moved_from: Option<Vec3>, origin: DVec3) -> Value {
    let place = |p: Vec3| (p.as_dvec3() + origin).to_array();
    let beam = |cos: f32| 2.0 * f64::from(cos).acos().to_degrees();
    let (kind, position, extent, beam) = match &light.shape {
        Shape::Planar(p) => {
            let (kind, extent) = match (p.outline, p.cone) {
                (Outline::Rectangle { a, b }, _) => ("rectangle", [a, b]),
                (Outline::Disk { r }, None) => ("disk", [r, r]),
                (Outline::Disk { r }, Some(_)) => ("spot", [r, r]),
            };
            (kind, Some(place(p.center)), Some(extent), p.cone.map(|cone| beam(cone.cos_outer)))
        }
        Shape::Sphere(s) => ("sphere", Some(place(s.center)), Some([s.radius; 2]), None),
        Shape::Point(p) => ("point", Some(place(p.position)), None, p.cone.map(|(_, c)| beam(c.cos_outer))),
        Shape::Distant(_) => ("distant", None, None, None),
        Shape::Environment(_) => ("environment", None, None, None),
        Shape::Mesh(_) => ("mesh", None, None, None),
    };
    let mut facts = json!({
        "name": light.name,
        "type": kind,
        "unit": light.unit(),
        "color": light.color.to_array(),
        "position": position,
        // Width and height at size 1, metres.
        "extent": extent.map(|half| half.map(|half| 2.0 * half)),
        "beam": beam,
        "has_size": light.has_size(),
        // The power of a surface grows as the square of its size, that of other lights has none.
        "power": light.unit_power(1.0),
    });
    if let Some(place_before) = moved_from {
        facts["moved_from"] = json!(place(place_before));
    }
    facts
}
