//! Our pictures of the scenes in tests/mitsuba against Mitsuba's, which are committed.

use std::path::{Path, PathBuf};

use glam::UVec2;
use lightopt_embree::{
    film::exr::read_exr,
    import,
    integrator::{Integrator, IntegratorKind},
    math::stats::{Moments, sidak_z},
    sampler::SamplerKind,
    scene::Scene,
};

use crate::support::compare::{Comparison, Measured, Subject, compare, write_failure};

/// Independent renders of each picture.
const N_RENDERS: u32 = 12;
/// Means may differ by this besides noise: what is not exact in the export
/// (see the table there) is well below it.
const MAX_MEAN_DIFFERENCE: f64 = 0.003;

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mitsuba")
}

/// Moments of `n` numbers that have this mean and this variance of it.
fn moments(mean: f64, variance_of_mean: f64, n: u64) -> Moments {
    assert_eq!(n % 2, 0);
    let deviation = (variance_of_mean * (n - 1) as f64).sqrt();
    let mut m = Moments::default();
    for i in 0..n {
        m.push(mean + if i % 2 == 0 { deviation } else { -deviation });
    }
    m
}

/// Mitsuba's picture and its noise, and how many samples a pixel had in all.
fn reference(name: &str) -> (Measured, u64) {
    let path = directory().join(format!("references/{name}.exr"));
    let exr = read_exr(&path).unwrap();
    let note = exr.lightopt.as_ref().expect("says how it was made");
    let n = note["renders"].as_u64().unwrap();
    let [mean, variance] = ["", "variance."]
        .map(|prefix| ["R", "G", "B"].map(|c| exr.parts[0].channel(&format!("{prefix}{c}")).unwrap()));
    let pixels: Vec<[Moments; 3]> = (0..exr.width * exr.height)
        .map(|i| std::array::from_fn(|c| moments(f64::from(mean[c][i]), f64::from(variance[c][i]), n)))
        .collect();
    let values = mean.iter().flat_map(|m| m.iter()).map(|&v| f64::from(v));
    let total = values.sum::<f64>() / (3 * pixels.len()) as f64;
    let total = moments(total, note["variance_of_mean"].as_f64().unwrap(), n);
    let size = UVec2::new(exr.width as u32, exr.height as u32);
    (Measured { size, pixels, total }, n * note["spp"].as_u64().unwrap())
}

/// The scene at the size of the references.
fn load(name: &str) -> Scene {
    let mut scene = import::load(&directory().join(format!("scenes/{name}.obj"))).unwrap().scene;
    scene.camera = scene.camera.resized(UVec2::new(32, 24));
    scene
}

fn agree(c: &Comparison) -> bool {
    let [difference, error] = c.relative;
    c.worst <= c.threshold && difference.abs() <= MAX_MEAN_DIFFERENCE + 3.0 * error
}

fn rendered(subject: &Subject, kind: IntegratorKind, spp: u32) -> Measured {
    let integrator = Integrator { kind, ..Integrator::default() };
    subject.measure(&integrator, SamplerKind::Sobol, 41, N_RENDERS, spp)
}

/// Our picture against the reference.
///
/// A pixel in which all our samples missed what is rarely seen has hardly any
/// variance: each has at least what the reference's samples have if they are as few.
fn judge(name: &str, ours: &mut Measured, spp: u32) -> (Comparison, Measured) {
    let (reference, n_samples) = reference(name);
    let fewer = n_samples as f64 / f64::from(N_RENDERS * spp);
    for (m, r) in ours.pixels.iter_mut().flatten().zip(reference.pixels.iter().flatten()) {
        let variance = m.variance_of_mean().max(r.variance_of_mean() * fewer);
        *m = moments(m.mean(), variance, m.n());
    }
    let mut c = compare(ours, &reference);
    // All pictures together fail by chance at level 0.01: two integrators a scene, a pixel each and the mean.
    c.threshold = sidak_z(0.01, 2 * SCENES.len() * (ours.pixels.len() + 1));
    (c, reference)
}

fn check(name: &str, kind: IntegratorKind, spp: u32) {
    let mut ours = rendered(&Subject::new(&load(name)), kind, spp);
    let (c, reference) = judge(name, &mut ours, spp);
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

/// A test a scene: samples per pixel and render of each integrator, as many as show what
/// `a_scene_that_is_not_quite_the_same_is_rejected` does; the long test of all takes four times as many, which
/// makes the mean's error about 0.3 %. Path tracing that needs more is left out.
macro_rules! scenes {
    ($($name:ident: $($kind:ident $spp:literal)+;)+) => {
        const SCENES: &[&str] = &[$(stringify!($name)),+];
        $(#[test]
        fn $name() {
            $(check(stringify!($name), IntegratorKind::$kind, $spp);)+
        })+

        #[test]
        #[ignore = "long: every scene with more samples"]
        fn all_scenes_with_many_samples() {
            $($(check(stringify!($name), IntegratorKind::$kind, 4 * $spp);)+)+
        }
    };
}

scenes! {
    cornell: Bdpt 16 Path 24;
    glossy_floor: Bdpt 16 Path 24;
    smooth_plastic: Bdpt 16 Path 24;
    rough_conductor: Bdpt 16 Path 24;
    caustic: Bdpt 16;
    smooth_glass: Bdpt 16;
    rough_glass: Bdpt 16;
    smooth_normals: Bdpt 16 Path 24;
    lights_in_line: Bdpt 16 Path 24;
    textured: Bdpt 16 Path 24;
    point_light: Bdpt 16 Path 24;
    environment: Bdpt 16 Path 24;
    overcast: Bdpt 16 Path 24;
    spot: Bdpt 16 Path 24;
    sun: Bdpt 16 Path 24;
    shining_mesh: Bdpt 16 Path 24;
    thin_lens: Bdpt 16 Path 24;
    normal_mapped: Bdpt 16 Path 24;
    cutout: Bdpt 16 Path 24;
    metallic_blend: Bdpt 16 Path 24;
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
    const SPP: u32 = 16;
    let judged = |subject: &Subject| {
        let mut ours = rendered(subject, IntegratorKind::Bdpt, SPP);
        let (c, reference) = judge("cornell", &mut ours, SPP);
        println!(
            "worst z {:.2}, means {:+.3} % ± {:.3} %",
            c.worst,
            100.0 * c.relative[0],
            100.0 * c.relative[1]
        );
        (agree(&c), ours.total.mean() / reference.total.mean())
    };
    let scene = load("cornell");
    let mut subject = Subject::new(&scene);
    subject.lighting.radiance[0] *= 1.02;
    assert!(!judged(&subject).0, "a light 2 % too bright passes");

    // The red wall darker by a fifth, and the light brighter to make up for it on the whole.
    let red = scene.materials.iter().position(|m| m.name == "red").unwrap();
    let scene = scene.with_background(vec![red]);
    let mut subject = Subject::new(&scene);
    subject.lighting.value = 0.8;
    let brightness = judged(&subject).1;
    subject.lighting.radiance[0] /= brightness;
    assert!(!judged(&subject).0, "a wall that is too dark passes");
}
