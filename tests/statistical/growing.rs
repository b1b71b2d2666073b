//! Pictures of several lightings that grow together, against a render of each.

use glam::{UVec2, Vec3};
use lightopt_embree::{
    design::{
        growing::{Between, Grown, Wanted},
        noise::{self, Display},
        render::Renderer,
    },
    film::Picture,
    integrator::{Integrator, IntegratorKind, View, aov::Features},
    lighting::{Lighting, SamplingPlan},
    math::{self, Measure, stats::Moments},
    objective::LuminanceMode,
    sampler::SamplerKind,
    scene::{Scene, material::Model},
};

use crate::support::{
    compare::{Measured, Subject, assert_same},
    scenes,
};

/// A glossy ball in a room with three lamps; the room is the background.
fn scene() -> Scene {
    let (mut s, mut m) = scenes::room();
    m.push(scenes::material("ball", Model::Plastic, [0.6, 0.4, 0.3], 0.3));
    s.sphere(Vec3::new(0.1, 0.5, 0.1), 0.45, 12, true, 3);
    let lights = vec![
        scenes::rectangle("panel", Vec3::new(0.0, 1.9, 0.2), Vec3::NEG_Y, 0.3, 0.3),
        scenes::sphere_light("bulb", Vec3::new(0.6, 1.4, -0.3), 0.12),
        scenes::disk("disk", Vec3::new(-0.8, 1.2, 0.6), Vec3::new(1.0, -0.4, -0.4), 0.2, None),
    ];
    let scene = Scene::new("ball", s.mesh, m, lights, scenes::room_camera((16, 12))).unwrap();
    scene.with_background(vec![0, 1, 2])
}

/// A start with all lights, and a look with two of them, one much smaller, before a darker background.
fn lightings() -> [Lighting; 2] {
    let lighting = |radiance: [f64; 3], size: [f64; 3], value: f64| Lighting {
        radiance: radiance.into(),
        size: size.into(),
        value,
        exposure: 1.0,
        color: Vec::new(),
    };
    [lighting([2.0, 4.0, 2.0], [1.0, 1.0, 1.0], 1.0), lighting([9.0, 0.0, 6.0], [0.3, 1.0, 1.2], 0.6)]
}

fn integrator(kind: IntegratorKind) -> Integrator {
    Integrator { kind, max_depth: 5, ..Integrator::default() }
}

/// Grows the pictures of both lightings.
fn grow(scene: &Scene, kind: IntegratorKind, seed: u64, spp: u32, between: &dyn Between) -> Grown {
    let (measure, sampler) = (Measure::default(), SamplerKind::Sobol);
    let renderer = Renderer { integrator: integrator(kind), sampler, measure };
    let [start, look] = &lightings();
    let plan = SamplingPlan::for_pictures(&[(start, &[0.2, 0.1, 0.2]), (look, &[0.4, 0.2, 0.4])]);
    let view = View { scene, camera: &scene.camera };
    let wanted = Wanted { view, lightings: &[start, look], plan: &plan, seed, spp };
    renderer.grow(&wanted, between, &()).unwrap()
}

/// Statistics of pictures.
fn measured(scene: &Scene, pictures: &[Picture]) -> Measured {
    let size = scene.camera.size();
    let n = size.element_product() as usize;
    let mut out = Measured { size, pixels: vec![[Moments::default(); 3]; n], total: Moments::default() };
    for picture in pictures {
        let mut sum = 0.0;
        for (moments, rgb) in out.pixels.iter_mut().zip(&picture.rgb) {
            for (m, &v) in moments.iter_mut().zip(rgb) {
                m.push(f64::from(v));
                sum += f64::from(v);
            }
        }
        out.total.push(sum / (3 * n) as f64);
    }
    out
}

/// Renders of a lighting alone, with which the pictures of either integrator are compared: bidirectional ones,
/// which have the least noise, with about as many samples as the pictures that are judged.
fn alone(scene: &Scene, lighting: Lighting, seed: u64, spp: u32) -> Measured {
    Subject::lit(scene, lighting).measure(
        &integrator(IntegratorKind::Bdpt),
        SamplerKind::Sobol,
        seed,
        40,
        spp,
    )
}

#[test]
fn pictures_that_grow_together_are_those_of_renders_of_their_own() {
    let scene = scene();
    let references = lightings().map(|x| {
        let mut of_light = x.clone();
        of_light.radiance[..2].fill(0.0);
        [alone(&scene, x, 7, 24), alone(&scene, of_light, 8, 24)]
    });
    for kind in IntegratorKind::ALL {
        let grown: Vec<Grown> = (0..40).map(|seed| grow(&scene, kind, seed, 32, &|| false)).collect();
        for (k, [all_lights, of_light]) in references.iter().enumerate() {
            let pictures: Vec<Picture> = grown.iter().map(|grown| grown.picture(k)).collect();
            let name = |of: &str| format!("grown-{}-{k}-{of}", kind.name());
            assert_same(&name("all"), &measured(&scene, &pictures), all_lights);
            let halves: Vec<Picture> = grown.iter().flat_map(|grown| grown.halves(k)).collect();
            assert_same(&name("halves"), &measured(&scene, &halves), all_lights);
            let layers: Vec<Picture> = pictures
                .into_iter()
                .map(|mut picture| {
                    picture.rgb = picture.lights.swap_remove(2);
                    picture
                })
                .collect();
            assert_same(&name("light"), &measured(&scene, &layers), of_light);
        }
    }
}

/// Gives the right one of two tiles five times as many samples as the left one.
struct Uneven;

impl Between for Uneven {
    fn is_over(&self) -> bool {
        false
    }
    fn next_round(&self, grown: &Grown) -> Option<Vec<u32>> {
        (grown.counts() == [4, 4]).then(|| vec![4, 20])
    }
}

#[test]
fn tiles_with_many_and_with_few_samples_have_the_same_light() {
    let mut scene = scene();
    scene.camera = scene.camera.resized(UVec2::new(32, 16));
    let references = lightings().map(|x| alone(&scene, x, 9, 12));
    for kind in IntegratorKind::ALL {
        let grown: Vec<Grown> = (0..40).map(|seed| grow(&scene, kind, seed, 1000, &Uneven)).collect();
        assert!(grown.iter().all(|grown| grown.counts() == [4, 20] && grown.spp() == 48));
        for (k, reference) in references.iter().enumerate() {
            let pictures: Vec<Picture> = grown.iter().map(|grown| grown.picture(k)).collect();
            assert_same(&format!("uneven-{}-{k}", kind.name()), &measured(&scene, &pictures), reference);
        }
    }
}

/// Mean over the pixels of the squared errors of a picture, free of the noise of the truth: of its two
/// independent halves each takes one factor of the square.
fn squared_error(picture: &[f64], truth: &[Vec<f64>; 2]) -> f64 {
    let squares = picture.iter().zip(&truth[0]).zip(&truth[1]).map(|((p, a), b)| (p - a) * (p - b));
    squares.sum::<f64>() / picture.len() as f64
}

/// Display luminance of radiance.
fn show(rgb: &[f32; 3]) -> f64 {
    LuminanceMode::Srgb.encode(math::display::luminance(*rgb), 1.0)
}

/// What both lightings show, in two independent halves of `spp` samples a pixel together.
fn truths(scene: &Scene, kind: IntegratorKind, spp: u32) -> [[Vec<f64>; 2]; 2] {
    let grown = grow(scene, kind, 1_000_000, spp, &|| false);
    [0, 1].map(|k| grown.halves(k).map(|half| half.rgb.iter().map(show).collect()))
}

/// With as many samples as here the display's curve is straight over the noise; with few the jackknife's
/// variance of a curved function is too large rather than too small (\[Efron82\] theorem 4.1).
#[test]
fn the_noise_that_is_told_is_that_of_the_pictures() {
    let scene = scene();
    let kind = IntegratorKind::Bdpt;
    let width = scene.camera.size().x as usize;
    let truth = truths(&scene, kind, 1 << 11);
    let [mut told, mut known] = [[Moments::default(); 2]; 2];
    for seed in 0..40 {
        let grown = grow(&scene, kind, seed, 96, &|| false);
        for k in 0..2 {
            let linear: Vec<Vec<f64>> = grown
                .planes(k, Measure::default())
                .iter()
                .map(|y| y.iter().map(|&y| f64::from(y)).collect())
                .collect();
            let display = Display { width, measure: Measure::default(), exposure: 1.0 };
            told[k].push(noise::estimate(&linear, display).noise().whole.powi(2));
            let shown: Vec<f64> = grown.beauty(k).iter().map(show).collect();
            known[k].push(squared_error(&shown, &truth[k]));
        }
    }
    for (k, (told, known)) in told.iter().zip(&known).enumerate() {
        let spread = (told.variance_of_mean() + known.variance_of_mean()).sqrt();
        let z = (told.mean() - known.mean()) / spread;
        println!("lighting {k}: told {:.5}, known {:.5}, z {z:.2}", told.mean().sqrt(), known.mean().sqrt());
        assert!(spread < 0.1 * known.mean(), "{spread}");
        assert!(z.abs() < 2.8, "{z}");
    }
}

/// What is told is of the mean of two pictures that are denoised apart, and as much or a little more than the
/// error of the picture that is denoised with all samples.
#[test]
fn the_noise_that_is_told_of_denoised_pictures_has_their_bias() {
    let mut scene = scene();
    scene.camera = scene.camera.resized(UVec2::new(48, 36));
    let kind = IntegratorKind::Bdpt;
    let display = Display { width: 48, measure: Measure::default(), exposure: 1.0 };
    let y = |rgb: &[f32; 3]| math::display::luminance(*rgb);
    let show = |y: f64| LuminanceMode::Srgb.encode(y, 1.0);
    let features = Features::trace(View { scene: &scene, camera: &scene.camera });
    let truth = truths(&scene, kind, 1 << 9);
    let grown: Vec<Grown> = (0..24).map(|seed| grow(&scene, kind, seed, 16, &|| false)).collect();
    for (k, truth) in truth.iter().enumerate() {
        let error = |picture: &[f64]| {
            let shown: Vec<f64> = picture.iter().map(|&y| show(y)).collect();
            squared_error(&shown, truth)
        };
        let [mut told, mut known, mut whole, mut noisy, mut spread_alone] = [Moments::default(); 5];
        for grown in &grown {
            let [a, b, c, d] = grown
                .planes(k, Measure::default())
                .map(|y| y.into_iter().map(f64::from).collect::<Vec<f64>>());
            let [first, second] =
                grown.denoised_halves(k, &features).map(|half| half.iter().map(y).collect());
            let [first, second]: [Vec<f64>; 2] = [first, second];
            let mean: Vec<f64> = first.iter().zip(&second).map(|(a, b)| 0.5 * (a + b)).collect();
            let noise = noise::of_denoised([&first, &second], [[&a, &b], [&c, &d]], display).noise();
            told.push(noise.whole.powi(2));
            known.push(error(&mean));
            let differences = first.iter().zip(&second).map(|(a, b)| (show(*a) - show(*b)).powi(2));
            spread_alone.push(0.25 * differences.sum::<f64>() / mean.len() as f64);
            whole.push(error(&grown.denoised(k, &features).rgb.iter().map(y).collect::<Vec<f64>>()));
            noisy.push(error(&grown.beauty(k).iter().map(y).collect::<Vec<f64>>()));
        }
        let [told_rms, known_rms, whole_rms, noisy_rms] =
            [told, known, whole, noisy].map(|moments| moments.mean().sqrt());
        println!(
            "{k}: told {told_rms:.5}, known {known_rms:.5}, of all {whole_rms:.5}, noisy {noisy_rms:.5}"
        );
        // The slope of the display's curve stands for the curve, which is less steep toward what is brighter:
        // in dark places the error of what is too dark is told too large.
        let spread = (told.variance_of_mean() + known.variance_of_mean()).sqrt();
        assert!(told.mean() > known.mean() - 3.0 * spread && told_rms < 1.25 * known_rms, "lighting {k}");
        assert!(spread_alone.mean() < 0.8 * known.mean(), "lighting {k}: there is a bias to be told");
        assert!(whole_rms < 1.02 * known_rms && whole_rms < noisy_rms, "lighting {k}");
    }
}
