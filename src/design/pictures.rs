//! Pictures of a run at full size, and what its EXR files say of themselves.

use serde_json::{Value, json};

use super::{
    Reporter, RunError,
    observer::Unstoppable,
    render::Budget,
    setup::{Setup, Task},
};
use crate::{
    audit::{lights::LightsFile, picture, write_whole},
    film::{exr::write_exr, image_file::write_png},
    integrator::{View, aov},
    lighting::SamplingPlan,
    objective::{Evaluation, Objective, Target},
};

/// The initial picture is rendered with this share of the final samples: it is only looked at.
const INITIAL_SHARE: u32 = 4;

/// Renders the full-size pictures of the start and of what was found, writes the lights, and
/// returns the f_q of the last picture as it was written.
pub(super) fn take(
    task: &Task,
    found: &[f64],
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Evaluation, RunError> {
    let final_spp = setup.options.final_spp;
    let first = (final_spp / INITIAL_SHARE).max(1);
    take_one(task, "initial", &setup.variables.start(), first, setup, reporter)?;
    let evaluation = take_one(task, "final", found, final_spp, setup, reporter)?;
    let file = LightsFile::new(setup.scene, &setup.lighting(found));
    write_whole(&task.job.out.join("lights.toml"), toml::to_string(&file)?)?;
    Ok(evaluation)
}

/// Renders and writes the picture of a point of the unit cube.
fn take_one(
    task: &Task,
    name: &str,
    u: &[f64],
    spp: u32,
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Evaluation, RunError> {
    let (options, scene) = (setup.options, setup.scene);
    let lighting = setup.lighting(u);
    let camera = scene.camera.resized(options.size);
    let view = View { scene, camera: &camera };
    reporter.stage(&format!("{name} picture"), Some(u64::from(options.size.y)));
    let budget = Budget { seed: options.seed, spp, n_replicates: 1 };
    let plan = SamplingPlan::for_picture(&lighting);
    let rendered = setup.renderer().render(view, &lighting, &plan, budget, &Unstoppable(reporter))?;
    let aovs = aov::trace(view, lighting.value as f32);
    let objective = Objective::new(&task.job.target, aovs.width, aovs.height, &aovs.mask)?;
    let evaluation = objective.evaluate(&rendered.display());
    let attribute = attribute(setup, &task.job.target, u, &evaluation, spp);
    let names = scene.light_names();
    let exr = picture::exr(&rendered.picture, &aovs, &names, lighting.exposure, options.luminance, attribute);
    let out = &task.job.out;
    write_exr(&out.join(format!("{name}.exr")), &exr)?;
    write_png(&out.join(format!("{name}.png")), &picture::beauty(&rendered.picture), lighting.exposure)?;
    Ok(evaluation)
}

/// The `lightopt` attribute of the picture of a point of the unit cube: enough to evaluate it again.
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
