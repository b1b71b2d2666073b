//! Full-size pictures of a run, and the attributes of its EXR files.

use std::{path::Path, sync::Mutex, time::Instant};

use serde_json::{Value, json};

use super::{
    FinalPicture, Reporter, RunError, allotment,
    growing::{Grown, Wanted},
    noise::{self, Display, Noise, SquaredErrors},
    products::{GrowingPictures, growing_key},
    setup::{Setup, Task},
};
use crate::{
    audit::{ENVIRONMENTS, lights::LightsFile, pick_stem, picture, write_whole},
    denoise::Layer,
    film::{
        exr::{write_exr, write_exr_plain},
        image_file::{LinearImage, write_view_png},
    },
    integrator::{
        RenderError, View,
        aov::{self, Aovs, Features},
    },
    lighting::{Lighting, SamplingPlan},
    objective::{Evaluation, LABELLINGS, Objective, Replicates, Target},
    photo::weights::Weights,
};

/// Weight of the picture of the start, where one of lights found has 1: it is only looked at, and may have
/// twice the noise.
const START_WEIGHT: f32 = 0.5;

/// Writes the lights that were found, and the small picture of them that showed how good they are, where
/// there is one.
pub(super) fn write_found(
    task: &Task,
    u: &[f64],
    shown: Option<&LinearImage>,
    setup: Setup,
) -> Result<(), RunError> {
    let lighting = setup.lighting(u);
    let mut file = LightsFile::new(setup.scene, &lighting).seen_through(setup.options.measure.view);
    if let Some(rig) = setup.rig {
        rig.describe(&mut file, setup.scene, &lighting);
        match &rig.sky {
            None => rig.write_plan(setup.scene, &lighting, &task.job.out)?,
            Some(sky) => write_whole(&task.job.out.join(ENVIRONMENTS), sky.table()?)?,
        }
    }
    write_whole(&task.job.out.join("lights.toml"), toml::to_string(&file)?)?;
    if let Some(shown) = shown {
        let view = setup.options.measure.view;
        write_view_png(&task.job.out.join("found.png"), shown, lighting.exposure, view)?;
    }
    Ok(())
}

/// Writes the n-th lighting that may be chosen, from 2, with its small picture.
pub(super) fn write_pick(
    task: &Task,
    n: usize,
    u: &[f64],
    shown: &LinearImage,
    setup: Setup,
) -> Result<(), RunError> {
    let (lighting, view) = (setup.lighting(u), setup.options.measure.view);
    let mut file = LightsFile::new(setup.scene, &lighting).seen_through(view);
    if let Some(rig) = setup.rig {
        rig.describe(&mut file, setup.scene, &lighting);
    }
    let stem = task.job.out.join(pick_stem(n));
    write_whole(&stem.with_extension("toml"), toml::to_string(&file)?)?;
    write_view_png(&stem.with_extension("png"), shown, lighting.exposure, view)?;
    Ok(())
}

/// A picture to be taken.
struct Shot<'t, 'a> {
    /// Name of its files.
    name: &'static str,
    /// Indices and tasks of the looks that it belongs to.
    tasks: Vec<(usize, &'t Task<'a>)>,
    /// Point of the unit cube.
    u: Vec<f64>,
    lighting: Lighting,
    /// Share of the samples, and inverse of the noise allowed, both in those of a picture of lights found.
    weight: f32,
    /// Share of all samples that each light is to be chosen for, for this picture.
    lights: Vec<f32>,
}

impl Shot<'_, '_> {
    /// The part of a picture's error that counts when it is compared with what is allowed.
    fn counted(&self, noise: &Noise) -> f64 {
        f64::from(self.weight) * noise.error()
    }

    /// Errors of the k-th picture as it is shown, and the picture: where features are given, the mean of two
    /// that are denoised apart.
    fn look(
        &self,
        k: usize,
        grown: &Grown,
        features: Option<&Features>,
        setup: Setup,
    ) -> (SquaredErrors, Layer) {
        let width = setup.options.size.x as usize;
        // A display shows it so, whatever f_q measures.
        let measure = setup.options.measure.as_shown();
        let display = Display { width, measure, exposure: self.lighting.exposure };
        let [a, b, c, d] = grown.planes(k, measure).map(widened);
        let Some(features) = features else {
            return (noise::estimate(&[a, b, c, d], display), grown.beauty(k));
        };
        let halves = grown.denoised_halves(k, features);
        let [x, y] = halves.each_ref().map(|half| measure.planes(half));
        let errors = noise::of_denoised([&x, &y], [[&a, &b], [&c, &d]], display);
        let mean = |(x, y): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| 0.5 * (x[c] + y[c]));
        (errors, halves[0].iter().zip(&halves[1]).map(mean).collect())
    }

    fn write_png(&self, rgb: &[[f32; 3]], setup: Setup) -> Result<(), RunError> {
        let [width, height] = setup.options.size.to_array().map(|n| n as usize);
        let image = LinearImage { width, height, rgb: rgb.to_vec() };
        let path = |out: &Path| out.join(self.name).with_extension("png");
        let mut each = self.tasks.iter();
        let (exposure, view) = (self.lighting.exposure, setup.options.measure.view);
        each.try_for_each(|(_, task)| write_view_png(&path(&task.job.out), &image, exposure, view))?;
        Ok(())
    }
}

/// The final pictures of all looks.
pub(super) struct Pictures {
    /// Final picture of each look; `None` where an interrupt left no time for one.
    pub taken: Vec<Option<FinalPicture>>,
    /// Number of renders that it took.
    pub renders: u64,
}

/// A look with the lights that were found for it.
pub(super) struct FoundLook<'t, 'a> {
    pub task: &'t Task<'a>,
    /// Point of the unit cube.
    pub u: &'t [f64],
    /// Share of the samples that each light is to be chosen for.
    pub lights: &'t [f32],
}

/// Renders the full-size pictures of the start and of the lights found for every look, as many together as
/// the memory allows, and writes them. `start_lights` is the share of the samples at the start that each light
/// is to be chosen for.
pub(super) fn take(
    looks: &[FoundLook],
    start_lights: &[f32],
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Pictures, RunError> {
    let mut pictures = Pictures { taken: looks.iter().map(|_| None).collect(), renders: 0 };
    if reporter.cancelled() {
        return Ok(pictures);
    }
    let shot = |name, tasks, u: &[f64], lights: &[f32], weight| {
        let (u, lighting) = (u.to_vec(), setup.lighting(u));
        Shot { name, tasks, u, lighting, weight, lights: lights.iter().map(|share| weight * share).collect() }
    };
    let all = looks.iter().enumerate().map(|(i, look)| (i, look.task)).collect();
    let start = shot("initial", all, &setup.variables.start(), start_lights, START_WEIGHT);
    let found = looks
        .iter()
        .enumerate()
        .map(|(i, look)| shot("final", vec![(i, look.task)], look.u, look.lights, 1.0));
    let shots: Vec<Shot> = std::iter::once(start).chain(found).collect();

    let camera = setup.scene.camera.resized(setup.options.size);
    let view = View { scene: setup.scene, camera: &camera };
    let n_groups = shots.len().div_ceil(most_together(setup));
    let mut groups_left = n_groups as u32;
    for group in shots.chunks(shots.len().div_ceil(n_groups)) {
        let end = setup.deadline.of_part(1.0 / f64::from(groups_left));
        groups_left -= 1;
        pictures.renders += 1;
        for (look, last) in take_group(group, view, end, setup, reporter)? {
            pictures.taken[look] = Some(last);
        }
    }
    Ok(pictures)
}

/// Number of pictures that may be rendered together.
fn most_together(setup: Setup) -> usize {
    let bytes = Grown::bytes(setup.options.size, setup.scene.lights.len());
    usize::try_from(setup.options.memory / bytes.max(1))
        .unwrap_or(usize::MAX)
        .clamp(1, SamplingPlan::MAX_TOGETHER)
}

/// Renders some pictures together and writes them; returns the measures of those of lights found, by look.
fn take_group(
    shots: &[Shot],
    view: View,
    end: Option<Instant>,
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<Vec<(usize, FinalPicture)>, RunError> {
    let options = setup.options;
    // Before the samples: whoever interrupts those waits no longer than he must.
    let aovs = trace(shots, view);
    let features = options.denoise.then(|| Features::trace(view));
    let features = features.as_ref();
    let objective = |task: &Task, aovs: &Aovs| {
        let size = [aovs.width, aovs.height];
        Weights::objective(setup.options.weights.as_ref(), &task.job.target, size, &aovs.mask)
    };
    let objectives: Vec<Vec<Objective>> = shots
        .iter()
        .map(|shot| shot.tasks.iter().map(|(_, task)| objective(task, &aovs[0].1)).collect())
        .collect::<Result<_, _>>()?;

    let lightings: Vec<&Lighting> = shots.iter().map(|shot| &shot.lighting).collect();
    let weighted: Vec<(&Lighting, &[f32])> =
        shots.iter().map(|shot| (&shot.lighting, shot.lights.as_slice())).collect();
    let plan = SamplingPlan::for_pictures(&weighted);
    let plan = setup.renderer().suited(plan, view, &lightings, options.seed, options.final_spp);
    let wanted =
        Wanted { view, lightings: &lightings, plan: &plan, seed: options.seed, spp: options.final_spp };
    reporter.stage("pictures", Some(u64::from(options.size.y) * u64::from(options.final_spp)));
    let (failure, last_look) = (Mutex::new(None), Mutex::new((0, Vec::new())));
    let next_round = |grown: &Grown| {
        let (noise, errors) = match look_at(shots, grown, features, setup, reporter) {
            Ok(seen) => seen,
            Err(e) => {
                failure.lock().map(|mut failure| *failure = Some(e)).ok();
                return None;
            }
        };
        let is_enough = largest_counted(shots, &noise) < options.final_noise;
        last_look.lock().map(|mut last| *last = (grown.n_samples(), noise)).ok()?;
        (!is_enough).then(|| allot(shots, grown, &errors, options.final_noise))
    };
    let is_over = || reporter.cancelled() || end.is_some_and(|end| Instant::now() >= end);
    let growing = GrowingPictures {
        products: setup.products,
        key: growing_key(&setup, &wanted),
        is_over: &is_over,
        next_round: &next_round,
        reporter,
    };
    let grown = match setup.renderer().grow(&wanted, &growing, reporter) {
        Err(RenderError::Cancelled) => return Ok(Vec::new()),
        other => other?,
    };
    if let Some(e) = failure.into_inner().unwrap_or_default() {
        return Err(e);
    }
    let (n_samples, noise) = last_look.into_inner().unwrap_or_default();
    let noise = match n_samples == grown.n_samples() {
        true => noise,
        false => look_at(shots, &grown, features, setup, reporter)?.0,
    };
    if !grown.is_complete() {
        reporter.note(&format!("pictures: {} of {} samples a pixel", grown.spp(), options.final_spp));
    }
    let written: Vec<_> = shots
        .iter()
        .zip(&objectives)
        .zip(noise)
        .enumerate()
        .map(|(k, ((shot, objectives), noise))| {
            let (_, aovs) =
                aovs.iter().find(|(value, _)| *value == shot.lighting.value as f32).unwrap_or(&aovs[0]);
            write(shot, (k, &grown, noise), (aovs, features), objectives, setup)
        })
        .collect::<Result<_, RunError>>()?;
    let each = shots.iter().zip(written).filter(|(shot, _)| shot.name == "final");
    let mut lasts: Vec<(usize, FinalPicture)> = Vec::new();
    for (shot, measured) in each {
        lasts.extend(shot.tasks.iter().map(|(look, _)| *look).zip(measured));
    }
    let error = lasts.iter().map(|(_, last)| last.noise.error()).fold(0.0, f64::max);
    if grown.is_complete() && error >= options.final_noise && options.final_noise > 0.0 {
        reporter.note(&format!(
            "pictures: noise {error:.4} is left after {} samples a pixel, as many as are allowed; {} was asked for",
            grown.spp(),
            options.final_noise
        ));
    }
    Ok(lasts)
}

/// Auxiliary pictures for every value of the background among some pictures.
fn trace(shots: &[Shot], view: View) -> Vec<(f32, Aovs)> {
    let mut values: Vec<f32> = shots.iter().map(|shot| shot.lighting.value as f32).collect();
    values.sort_by(f32::total_cmp);
    values.dedup();
    values.into_iter().map(|value| (value, aov::trace(view, value))).collect()
}

/// Largest of the errors of pictures that are compared with what is allowed.
fn largest_counted(shots: &[Shot], noise: &[Noise]) -> f64 {
    shots.iter().zip(noise).map(|(shot, noise)| shot.counted(noise)).fold(0.0, f64::max)
}

/// Samples of every tile in the next round, for an error of the pictures that is less than what is asked for.
fn allot(shots: &[Shot], grown: &Grown, errors: &[SquaredErrors], asked: f64) -> Vec<u32> {
    let tiling = grown.tiling();
    // Zero asks for as many samples as are allowed, everywhere.
    let of_picture = |(shot, errors): (&Shot, &SquaredErrors)| {
        let scale = (f64::from(shot.weight) / asked.max(1e-9)).powi(2);
        errors.of_tiles(&tiling).into_iter().map(|square| scale * square).collect()
    };
    let squares: Vec<Vec<f64>> = shots.iter().zip(errors).map(of_picture).collect();
    allotment::allot(&tiling, &squares, &grown.counts(), grown.most())
}

/// Refreshes the pictures on disk after a round, and measures and tells how noisy they are.
fn look_at(
    shots: &[Shot],
    grown: &Grown,
    features: Option<&Features>,
    setup: Setup,
    reporter: &impl Reporter,
) -> Result<(Vec<Noise>, Vec<SquaredErrors>), RunError> {
    let look = |(k, shot): (usize, &Shot)| {
        let (errors, shown) = shot.look(k, grown, features, setup);
        shot.write_png(&shown, setup)?;
        Ok(errors)
    };
    // One after the other, since each fills all threads and takes memory.
    let errors = shots.iter().enumerate().map(look).collect::<Result<Vec<SquaredErrors>, RunError>>()?;
    let noise: Vec<Noise> = errors.iter().map(SquaredErrors::noise).collect();
    let error = largest_counted(shots, &noise);
    let asked = setup.options.final_noise;
    let wanted = if asked > 0.0 { format!(", wanted {asked}") } else { String::new() };
    let spp = grown.spp();
    reporter.progress(&format!("pictures: {spp} samples a pixel, noise {error:.4}{wanted}"));
    Ok((noise, errors))
}

/// The same numbers with more digits.
pub(super) fn widened(values: Vec<f32>) -> Vec<f64> {
    values.into_iter().map(f64::from).collect()
}

/// Writes the k-th picture for every look that it belongs to, and measures it for each.
fn write(
    shot: &Shot,
    (k, grown, noise): (usize, &Grown, Noise),
    (aovs, features): (&Aovs, Option<&Features>),
    objectives: &[Objective],
    setup: Setup,
) -> Result<Vec<FinalPicture>, RunError> {
    let (options, exposure) = (setup.options, shot.lighting.exposure);
    let rendered = grown.picture(k);
    let display = options.measure.encode_image(&rendered.rgb, exposure);
    // As the EXR has them.
    let planes = grown.planes(k, options.measure);
    let linear = planes.clone().map(widened);
    let denoised = features.map(|features| grown.denoised(k, features));
    let replicates = Replicates { linear: &linear, measure: options.measure, exposure };
    shot.write_png(&denoised.as_ref().unwrap_or(&rendered).rgb, setup)?;
    let (names, is_incomplete) = (setup.scene.light_names(), !grown.is_complete());
    let each = shot.tasks.iter().zip(objectives).map(|((_, task), objective)| {
        let estimate = replicates.measure(objective, LABELLINGS)?;
        let f_q_picture = objective.evaluate(&display).f_q;
        let mut attribute = attribute(setup, &task.job.target, &shot.u, &estimate.evaluation, grown.spp());
        attribute["f_q_error"] = estimate.error_bar().into();
        attribute["f_q_picture"] = f_q_picture.into();
        attribute["noise"] = noise.error().into();
        attribute["sampling"] = json!(grown.sampling());
        if is_incomplete {
            attribute["incomplete"] = true.into();
        }
        let mut exr = picture::exr(&rendered, aovs, &names, exposure, options.measure, attribute);
        exr.parts.push(picture::replicates(planes.clone(), options.measure));
        exr.parts.extend(denoised.iter().flat_map(|denoised| picture::denoised(denoised, &names)));
        let write = if is_incomplete { write_exr_plain } else { write_exr };
        write(&task.job.out.join(shot.name).with_extension("exr"), &exr)?;
        Ok(FinalPicture { estimate, f_q_picture, noise, spp: grown.spp(), is_incomplete })
    });
    each.collect()
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
        "exposure": setup.lighting(u).exposure,
        "luminance": options.measure.luminance,
        "view": options.measure.view,
        "target": target,
        "integrator": options.integrator.kind,
        "spp": spp,
        "seed": options.seed,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": env!("LIGHTOPT_COMMIT"),
    })
}
