//! Our pictures of the scenes in tests/mitsuba against Mitsuba's, which are committed.

use std::path::{Path, PathBuf};

use glam::UVec2;
use lightopt_embree::{
    film::exr::read_exr,
    integrator::{Integrator, IntegratorKind},
    math::stats::Moments,
    sampler::SamplerKind,
    scene::{self, Scene},
};

use crate::support::compare::{Comparison, Measured, compare, measure, write_failure};

/// Independent renders of each picture.
const N_RENDERS: u32 = 12;
/// Means may differ by this besides noise: what is not exact in the export
/// (see the table there) is well below it.
const MAX_MEAN_DIFFERENCE: f64 = 0.003;

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mitsuba")
}

/// Moments of `n` numbers that have this mean and this variance of it.
fn moments(mean: f32, variance_of_mean: f32, n: u64) -> Moments {
    let half = n.div_ceil(2) as f64;
    let deviation = (f64::from(variance_of_mean) * n as f64 * (n - 1) as f64 / (2.0 * half)).sqrt();
    let mut m = Moments::default();
    for i in 0..n {
        m.push(f64::from(mean) + if i % 2 == 0 { deviation } else { -deviation });
    }
    m
}

/// Mitsuba's picture and its noise.
fn reference(name: &str) -> Measured {
    let path = directory().join(format!("references/{name}.exr"));
    let exr = read_exr(&path).unwrap();
    let note = exr.lightopt.as_ref().expect("says how it was made");
    let n = note["renders"].as_u64().unwrap();
    let [mean, variance] = ["", "variance."]
        .map(|prefix| ["R", "G", "B"].map(|c| exr.parts[0].channel(&format!("{prefix}{c}")).unwrap()));
    let pixels: Vec<[Moments; 3]> = (0..exr.width * exr.height)
        .map(|i| std::array::from_fn(|c| moments(mean[c][i], variance[c][i], n)))
        .collect();
    let total =
        mean.iter().flat_map(|m| m.iter()).map(|&v| f64::from(v)).sum::<f64>() / (3 * pixels.len()) as f64;
    let variance_of_total = note["variance_of_mean"].as_f64().unwrap();
    Measured {
        size: UVec2::new(exr.width as u32, exr.height as u32),
        pixels,
        total: moments(total as f32, variance_of_total as f32, n),
    }
}

fn load(name: &str, size: UVec2) -> Scene {
    let mut scene = scene::load(&directory().join(format!("scenes/{name}.obj"))).unwrap();
    scene.camera.resize(size);
    scene
}

fn agree(c: &Comparison) -> bool {
    let [difference, error] = c.relative;
    c.worst <= c.threshold && difference.abs() <= MAX_MEAN_DIFFERENCE + 3.0 * error
}

fn rendered(scene: &Scene, kind: IntegratorKind, spp: u32) -> Measured {
    let integrator = Integrator { kind, ..Integrator::default() };
    measure(scene, &integrator, SamplerKind::Sobol, 41, N_RENDERS, spp)
}

fn check(name: &str, kind: IntegratorKind, spp: u32) {
    let reference = reference(name);
    let ours = rendered(&load(name, reference.size), kind, spp);
    let c = compare(&ours, &reference);
    let label = format!("mitsuba-{name}-{kind:?}").to_lowercase();
    println!(
        "{label}: worst z {:.2} of {:.2}, means {:+.3} % ± {:.3} %",
        c.worst,
        c.threshold,
        100.0 * c.relative[0],
        100.0 * c.relative[1]
    );
    if !agree(&c) {
        let directory = write_failure(&label, &ours, &reference, &c);
        panic!("{label}: pictures differ; see {}", directory.display());
    }
}

/// A test a scene: samples per pixel and render of each integrator, as many as
/// make the mean's error about 0.3 %. Path tracing that needs more is left out.
macro_rules! scenes {
    ($($name:ident: $($kind:ident $spp:literal)+;)+) => {
        const SCENES: &[&str] = &[$(stringify!($name)),+];
        $(#[test]
        fn $name() {
            $(check(stringify!($name), IntegratorKind::$kind, $spp);)+
        })+
    };
}

scenes! {
    cornell: Bdpt 8 Path 16;
    glossy_floor: Bdpt 8 Path 16;
    smooth_plastic: Bdpt 8 Path 16;
    rough_conductor: Bdpt 8 Path 16;
    caustic: Bdpt 16;
    smooth_glass: Bdpt 16;
    rough_glass: Bdpt 16;
    smooth_normals: Bdpt 8 Path 16;
    lights_in_line: Bdpt 8 Path 16;
    textured: Bdpt 8 Path 16;
    point_light: Bdpt 8 Path 16;
    environment: Bdpt 8 Path 16;
    overcast: Bdpt 8 Path 16;
    spot: Bdpt 8 Path 16;
    sun: Bdpt 8 Path 16;
    shining_mesh: Bdpt 8 Path 16;
    thin_lens: Bdpt 8 Path 16;
}

#[test]
fn every_reference_is_compared() {
    let mut names: Vec<String> = std::fs::read_dir(directory().join("references"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "exr"))
        .map(|p| p.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    let mut tested = SCENES.to_vec();
    tested.sort_unstable();
    assert_eq!(names, tested);
}

#[test]
fn a_scene_that_is_not_quite_the_same_is_rejected() {
    let reference = reference("cornell");
    let judged = |scene: &Scene| {
        let c = compare(&rendered(scene, IntegratorKind::Bdpt, 8), &reference);
        println!(
            "worst z {:.2}, means {:+.3} % ± {:.3} %",
            c.worst,
            100.0 * c.relative[0],
            100.0 * c.relative[1]
        );
        agree(&c)
    };
    let mut scene = load("cornell", reference.size);
    scene.lights[0].radiance *= 1.02;
    assert!(!judged(&scene), "a light 2 % too bright passes");

    // The red wall darker by a tenth, and the light brighter to make up for it on the whole.
    let mut scene = load("cornell", reference.size);
    let red = scene.materials.iter().position(|m| m.name == "red").unwrap();
    scene.materials[red].set_value(0.9, 1.0);
    let mean = |scene: &Scene| rendered(scene, IntegratorKind::Bdpt, 8).total.mean();
    scene.lights[0].radiance *= (reference.total.mean() / mean(&scene)) as f32;
    assert!(!judged(&scene), "a wall that is too dark passes");
}
