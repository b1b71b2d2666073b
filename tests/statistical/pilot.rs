//! Numbers of samples chosen by a pilot, against the usual ones.

use glam::UVec2;
use lightopt_embree::{
    film::RgbFilm,
    import,
    integrator::{Integrator, IntegratorKind, Pilot, Samples, View},
    lighting::{Lighting, SampleCounts, SamplingPlan},
    math::{display::luminance, stats::Moments},
    sampler::SamplerKind,
    scene::Scene,
};

const SIZE: UVec2 = UVec2::new(32, 24);
const SPP: u32 = 16;
const RENDERS: u64 = 12;

fn scene(name: &str) -> Scene {
    import::load(format!("tests/mitsuba/scenes/{name}.obj").as_ref()).unwrap().scene
}

fn choose(scene: &Scene, integrator: Integrator, spp: u32) -> SampleCounts {
    let lighting = Lighting::authored(scene);
    let camera = scene.camera.resized(UVec2::new(128, 96));
    let view = View { scene, camera: &camera };
    let (lightings, sampler) = (&[&lighting], SamplerKind::Sobol);
    Pilot { integrator, view, lightings, sampler, seed: 0, spp }.choose(&SamplingPlan::for_picture(&lighting))
}

/// Relative variance of a picture with some numbers of samples times its counted work, and the latter, of `n`
/// renders.
fn inefficiency(scene: &Scene, integrator: Integrator, counts: SampleCounts, n: u64) -> [f64; 2] {
    let lighting = Lighting::authored(scene);
    let plan = SamplingPlan { counts, ..SamplingPlan::for_picture(&lighting) };
    let camera = scene.camera.resized(SIZE);
    let view = View { scene, camera: &camera };
    let mut pixels = vec![Moments::default(); SIZE.element_product() as usize];
    let mut cost = 0.0;
    for seed in 100..100 + n {
        let mut film = RgbFilm::by_lighting(SIZE, &[&lighting]);
        let samples = Samples { sampler: SamplerKind::Sobol, seed, first: 0, count: SPP };
        let work = integrator.render(view, &lighting, &plan, &mut film, samples, &()).unwrap();
        assert_eq!(work.samples, u64::from(SIZE.element_product() * SPP));
        cost += work.cost();
        let rgb = |p: usize| film.sum(p, 0).map(|v| (v / f64::from(SPP)) as f32);
        pixels.iter_mut().enumerate().for_each(|(p, pixel)| pixel.push(luminance(rgb(p))));
    }
    let mean = pixels.iter().map(Moments::mean).sum::<f64>() / pixels.len() as f64;
    let relative = |pixel: &Moments| pixel.variance() / (pixel.mean().powi(2) + (0.1 * mean).powi(2));
    [pixels.iter().map(relative).sum::<f64>() * cost, cost]
}

#[test]
fn chosen_numbers_are_more_efficient_where_the_usual_ones_do_not_fit_and_no_worse_elsewhere() {
    // One small panel in a diffuse room needs few light samples, three lights at different distances many.
    for (name, kind, most) in [
        ("cornell", IntegratorKind::Path, 0.85),
        ("cornell", IntegratorKind::Bdpt, 0.95),
        ("lights_in_line", IntegratorKind::Path, 1.1),
        ("lights_in_line", IntegratorKind::Bdpt, 1.1),
    ] {
        let scene = scene(name);
        let integrator = Integrator { kind, ..Integrator::default() };
        let chosen = choose(&scene, integrator, 64);
        let [usual, _] = inefficiency(&scene, integrator, SampleCounts::default(), RENDERS);
        let [pilot, _] = inefficiency(&scene, integrator, chosen, RENDERS);
        println!("{name} {}: {:.2} of the usual, {chosen:?}", kind.name(), pilot / usual);
        assert!(pilot < most * usual, "{name} {}: {pilot} {usual} {chosen:?}", kind.name());
    }
}

#[test]
fn the_choice_does_not_depend_on_threads_and_a_short_render_has_none() {
    let scene = scene("cornell");
    let integrator = Integrator::default();
    let [one, two] = [1, 2].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| choose(&scene, integrator, 64))
    });
    assert_eq!(one, two);
    assert_ne!(one, SampleCounts::default());
    assert_eq!(choose(&scene, integrator, 16), SampleCounts::default());
}

#[test]
fn counted_work_grows_with_the_numbers_of_samples() {
    let scene = scene("cornell");
    let path = Integrator { kind: IntegratorKind::Path, ..Integrator::default() };
    let usual = SampleCounts::default();
    let cost = |integrator, counts| inefficiency(&scene, integrator, counts, 1)[1];
    let more = SampleCounts { first_light_samples: 12, ..usual };
    assert!(cost(path, more) > cost(path, usual));
    assert!(cost(path, SampleCounts { first_roulette: 8, ..usual }) > cost(path, usual));
    let fewer = SampleCounts { camera_subpaths: 16, ..usual };
    assert!(cost(Integrator::default(), fewer) < cost(Integrator::default(), usual));
    assert!(cost(path, usual) < cost(Integrator::default(), fewer));
}
