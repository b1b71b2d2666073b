//! Renders of the lights found, with samples that chose nothing.

use rayon::prelude::*;

use super::{
    Reporter, RunError, Setting, Unstoppable,
    engine::{Aim, REPLICATES},
    precision::{MAX_SAMPLES, Precision},
};
use crate::{
    film::{LightState, Region, RgbFilm},
    integrator::{Sampling, Values},
    light::SizeDensity,
    math::display::luminance,
    objective::{JackknifeEstimate, LABELLINGS, Objective, Replicates},
    transport::LightingPoint,
};

/// f_q of some lightings, each by its own objective, from one render of their pictures, with
/// hard edges: of `spp` samples per pixel over all replicates, and more until every error is
/// small enough.
///
/// # Errors
/// When a render fails.
///
/// # Panics
/// With more than [`super::MAX_TOGETHER`] lightings.
pub fn check(
    aims: &[Aim],
    objectives: &[&Objective],
    setting: &mut Setting,
    seed: u64,
    spp: u32,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<JackknifeEstimate>, RunError> {
    match aims.len() {
        1 => check_nodes::<1>(aims, objectives, setting, seed, spp, renders, reporter),
        2 => check_nodes::<2>(aims, objectives, setting, seed, spp, renders, reporter),
        _ => check_nodes::<{ super::MAX_TOGETHER }>(aims, objectives, setting, seed, spp, renders, reporter),
    }
}

fn check_nodes<const N: usize>(
    aims: &[Aim],
    objectives: &[&Objective],
    setting: &mut Setting,
    seed: u64,
    mut spp: u32,
    renders: &mut u64,
    reporter: &impl Reporter,
) -> Result<Vec<JackknifeEstimate>, RunError> {
    let Setting { camera, options, .. } = *setting;
    let scene = &mut *setting.scene;
    // The first node of the background's value is the largest.
    let mut order: Vec<usize> = (0..aims.len()).collect();
    let value = |i: usize| aims[i].lighting.value;
    order.sort_by(|&a, &b| value(b).total_cmp(&value(a)));
    let node_of = |aim: usize| order.iter().position(|&i| i == aim).unwrap_or(0);
    let nodes = Values::<N>(std::array::from_fn(|k| order.get(k).map_or(0.0, |&i| value(i) as f32)));
    scene.set_background_value(nodes.0[0], nodes.0[0]);
    let lightings: Vec<Vec<LightState>> = order
        .iter()
        .map(|&i| {
            let LightingPoint { radiance, size, .. } = &aims[i].lighting;
            let state = |(&l, &s): (&f64, &f64)| LightState { radiance: l as f32, size: s as f32 };
            radiance.iter().zip(size).map(state).collect()
        })
        .collect();
    for (l, light) in scene.lights.iter_mut().enumerate() {
        let sizes = Aim::sizes(aims, l);
        let is_same = sizes.iter().all(|s| s.0 == sizes[0].0);
        light.size_density =
            if is_same { SizeDensity::uniform_area(sizes[0].0) } else { SizeDensity::one_of(&sizes) };
    }
    scene.select_lights(&Aim::light_weights(aims));

    let film = || RgbFilm::<N>::of_lightings(Region::full(scene.camera.size()), &lightings, scene.exposure);
    let mut films: Vec<RgbFilm<N>> = (0..REPLICATES).map(|_| film()).collect();
    let rows = u64::from(options.work_size.y) * REPLICATES as u64;
    let observer = Unstoppable(reporter);
    let mut first = 0;
    loop {
        reporter.stage("checking the result with new samples", Some(rows));
        let count = spp.div_ceil(REPLICATES as u32).max(1);
        let sampling = Sampling { sampler: camera.sampler, seed, first, count };
        for (r, film) in films.iter_mut().enumerate() {
            let replicate = sampling.replicate(r as u64);
            camera.integrator.render_values(scene, &nodes, film, &[replicate], &observer)?;
        }
        first += count;
        *renders += 1;
        let estimates: Vec<JackknifeEstimate> = (0..aims.len())
            .into_par_iter()
            .map(|i| {
                let pixel = |film: &RgbFilm<N>, p| {
                    luminance(film.sum(p, node_of(i)).map(|v| (v / f64::from(first)) as f32))
                };
                let n = scene.camera.size().element_product() as usize;
                let linear: Vec<Vec<f64>> =
                    films.iter().map(|film| (0..n).map(|p| pixel(film, p)).collect()).collect();
                let exposure = f64::from(scene.exposure);
                let replicates = Replicates { linear: &linear, luminance: camera.luminance, exposure };
                replicates.measure(objectives[i], LABELLINGS)
            })
            .collect::<Result<_, _>>()?;
        let now = first * REPLICATES as u32;
        let precision = Precision::reported(options.tolerance);
        let wanted = estimates.iter().filter(|e| !precision.is_met(e)).map(|e| precision.more(now, e)).max();
        match wanted {
            Some(wanted) if now < MAX_SAMPLES && !reporter.cancelled() => spp = wanted,
            _ => return Ok(estimates),
        }
    }
}
