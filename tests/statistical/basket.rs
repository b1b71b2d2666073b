//! The fruit basket.

use std::path::Path;

use glam::UVec2;
use lightopt_embree::{
    integrator::{Integrator, IntegratorKind, Sampling, aov},
    math::display::LuminanceMode,
    params::survey,
    sampler::SamplerKind,
    scene::{self, Scene},
};

use crate::support::compare::{assert_same, measure, render};

fn basket(size: (u32, u32)) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fruit_basket.obj");
    let mut scene = scene::load(&path).unwrap();
    scene.camera.resize(UVec2::new(size.0, size.1));
    scene
}

#[test]
fn path_equals_bdpt_on_the_fruit_basket() {
    let scene = basket((32, 24));
    let path = Integrator { kind: IntegratorKind::Path, ..Integrator::default() };
    let a = measure(&scene, &path, SamplerKind::Sobol, 21, 24, 96);
    let b = measure(&scene, &Integrator::default(), SamplerKind::Sobol, 22, 24, 32);
    assert_same("fruit_basket", &a, &b);
}

/// Without this, low-key would end in a black picture.
#[test]
fn light_separates_the_fruit_from_its_background() {
    let mut scene = basket((96, 72));
    assert!(scene.mesh.indices.len() >= 60_000);
    let [v_min, v_max] = survey::value_range(&scene).unwrap();
    scene.set_background_value(v_min, v_max);
    for (i, name) in ["key", "backdrop", "rim"].into_iter().enumerate() {
        assert_eq!(scene.lights[i].name, name);
        scene.set_light(i, if name == "key" { 72.0 } else { 0.0 }, 1.0);
    }
    let sampling = Sampling { sampler: SamplerKind::Sobol, seed: 3, first: 0, count: 64 };
    let picture = render(&scene, &Integrator::default(), sampling);
    let l = LuminanceMode::Srgb.encode_image(&picture.rgb, 1.0);
    let mask = aov::trace(&scene).mask;
    let mean = |main: bool| {
        let of: Vec<f64> = l.iter().zip(&mask).filter(|(_, m)| **m == main).map(|(l, _)| *l).collect();
        of.iter().sum::<f64>() / of.len() as f64
    };
    println!("object {:.3}, background {:.3}", mean(true), mean(false));
    assert!(mean(true) > 0.3, "object {}", mean(true));
    assert!(mean(false) < 0.1, "background {}", mean(false));
}
