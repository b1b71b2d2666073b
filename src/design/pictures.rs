//! Full-size pictures of a run, and the attributes of its EXR files.

use std::time::Instant;

use serde_json::{Value, json};

use super::{
    Reporter, RunError,
    products::{GrowingPicture, picture_key},
    render::{Budget, PassedPicture},
    setup::{Setup, Task},
};
use crate::{
    audit::{lights::LightsFile, picture, write_whole},
    film::{
        exr::{write_exr, write_exr_plain},
        image_file::write_png,
    },
    integrator::{RenderError, View, aov},
    lighting::SamplingPlan,
    objective::{Evaluation, Objective, Target},
};

/// Samples of the final picture over those of the initial one: that is only looked at, and a quarter of
/// the samples has twice the noise at a quarter of the time.
const INITIAL_SHARE: u32 = 4;

/// Writes the lights that were found.
pub(super) fn write_lights(task: &Task, found: &[f64], setup: Setup) -> Result<(), RunError> {
    let file = LightsFile::new(setup.scene, &setup.lighting(found));
    Ok(write_whole(&task.job.out.join("lights.toml"), toml::to_string(&file)?)?)
}

/// The final picture of a look.
pub(super) struct Last {
    /// f_q and terms of the picture as it was written.
    pub evaluation: Evaluation,
    /// Samples per pixel that it has.
    pub spp: u32,
}

/// Renders the full-size pictures of the start and of what was found; `part` is the share of the time
/// left that both may take.
pub(super) fn take(
    task: &Task,
    found: &[f64],
    setup: Setup,
    part: f64,
    reporter: &impl Reporter,
) -> Result<Option<Last>, RunError> {
    let final_spp = setup.options.final_spp;
    let first = (final_spp / INITIAL_SHARE).max(1);
    let end = setup.deadline.of_part(part / f64::from(1 + INITIAL_SHARE));
    take_one(task, "initial", &setup.variables.start(), first, end, setup, reporter)?;
    let rest = part * f64::from(INITIAL_SHARE) / (f64::from(1 + INITIAL_SHARE) - part);
    let end = setup.deadline.of_part(rest.min(1.0));
    take_one(task, "final", found, final_spp, end, setup, reporter)
}

/// Renders and writes the picture of a point of the unit cube: of `spp` samples per pixel or, when the
/// time is over or somebody interrupts, of those so far; `None` where there are none.
fn take_one(
    task: &Task,
    name: &str,
    u: &[f64],
    spp: u32,
    end: Option<Instant>,
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Option<Last>, RunError> {
    if reporter.cancelled() {
        return Ok(None);
    }
    let (options, scene) = (setup.options, setup.scene);
    let lighting = setup.lighting(u);
    let camera = scene.camera.resized(options.size);
    let view = View { scene, camera: &camera };
    // Before the samples: whoever interrupts those waits no longer than he must.
    let aovs = aov::trace(view, lighting.value as f32);
    let objective = Objective::new(&task.job.target, aovs.width, aovs.height, &aovs.mask)?;
    let rows = u64::from(options.size.y) * u64::from(spp);
    reporter.stage(&format!("{name} picture"), Some(rows));
    let budget = Budget { seed: options.seed, spp, n_replicates: 1 };
    let plan = SamplingPlan::for_picture(&lighting);
    let is_over = || reporter.cancelled() || end.is_some_and(|end| Instant::now() >= end);
    let key = picture_key(&setup, &lighting, &plan, &camera, budget);
    let growing = GrowingPicture { products: setup.products, key, is_over: &is_over, reporter };
    let rendered = setup.renderer().render_in_passes(view, &lighting, &plan, budget, &growing, reporter);
    let PassedPicture { picture: rendered, spp: taken } = match rendered {
        Err(RenderError::Cancelled) => return Ok(None),
        other => other?,
    };
    if taken < spp {
        reporter.note(&format!("{name} picture: {taken} of {spp} samples a pixel"));
    }
    let display = options.luminance.encode_image(&rendered.rgb, lighting.exposure);
    let evaluation = objective.evaluate(&display);
    let mut attribute = attribute(setup, &task.job.target, u, &evaluation, taken);
    if taken < spp {
        attribute["incomplete"] = true.into();
    }
    let names = scene.light_names();
    let exr = picture::exr(&rendered, &aovs, &names, lighting.exposure, options.luminance, attribute);
    let out = &task.job.out;
    let write = if taken < spp { write_exr_plain } else { write_exr };
    write(&out.join(format!("{name}.exr")), &exr)?;
    write_png(&out.join(format!("{name}.png")), &picture::beauty(&rendered), lighting.exposure)?;
    Ok(Some(Last { evaluation, spp: taken }))
}

/// The `lightopt` attribute of the picture of the point `u` of the unit cube: enough to evaluate the
/// picture again.
pub(super) fn attribute(
    setup: Setup,
    target: &Target,
    u: &[f64],
    evaluation: &Evaluation,
    spp: u32,
) -> Value {
    let options = setup.options;
    json!({
        "scene": setup.scene.name,
        "x": setup.variables.named(&setup.variables.decode(u)),
        "f_q": evaluation.f_q,
        "terms": evaluation.terms_json(),
        "exposure": setup.fitted.lighting.exposure,
        "luminance": options.luminance,
        "target": target,
        "integrator": options.integrator.kind,
        "spp": spp,
        "seed": options.seed,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": env!("LIGHTOPT_COMMIT"),
    })
}
