//! The fruit basket.

use std::path::Path;

use glam::UVec2;
use lightopt_embree::{
    import::{self, Loaded},
    integrator::{Integrator, IntegratorKind, Samples, View, aov},
    lighting::{Lighting, SamplingPlan},
    math::display::LuminanceMode,
    sampler::SamplerKind,
    variables::Fitted,
};

use crate::support::compare::{Subject, assert_same, measure};

fn basket(size: (u32, u32)) -> Loaded {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fruit_basket.obj");
    let mut loaded = import::load(&path).unwrap();
    loaded.scene.camera = loaded.scene.camera.resized(UVec2::new(size.0, size.1));
    loaded
}

/// Asserts that both integrators show the same, by 24 renders of `spp` samples a pixel with bdpt and three times
/// as many with path tracing.
fn assert_path_is_bdpt(spp: u32) {
    let scene = basket((32, 24)).scene;
    let path = Integrator { kind: IntegratorKind::Path, ..Integrator::default() };
    let a = measure(&scene, &path, SamplerKind::Sobol, 21, 24, 3 * spp);
    let b = measure(&scene, &Integrator::default(), SamplerKind::Sobol, 22, 24, spp);
    assert_same("fruit_basket", &a, &b);
}

#[test]
fn path_equals_bdpt_on_the_fruit_basket() {
    assert_path_is_bdpt(12);
}

#[test]
#[ignore = "long: the same with more samples"]
fn path_equals_bdpt_on_the_fruit_basket_with_many_samples() {
    assert_path_is_bdpt(48);
}

/// Without this, low-key would end in a black picture.
#[test]
fn light_separates_the_fruit_from_its_background() {
    let Loaded { scene, constraints, .. } = basket((96, 72));
    assert!(scene.mesh.indices.len() >= 60_000);
    assert_eq!(scene.light_names(), ["key", "backdrop", "rim"]);
    let view = View { scene: &scene, camera: &scene.camera };
    let fitted = Fitted::new(view, &Lighting::authored(&scene), &constraints).unwrap();
    let [v_min, v_max] = fitted.value_range.unwrap();
    let lighting = Lighting {
        radiance: vec![72.0, 0.0, 0.0],
        size: vec![1.0; 3],
        value: f64::from(v_min),
        ..Lighting::authored(&scene)
    };
    let plan = SamplingPlan { largest_value: v_max, ..SamplingPlan::uniform(&lighting) };
    let samples = Samples { sampler: SamplerKind::Sobol, seed: 3, first: 0, count: 64 };
    let picture = Subject { view, lighting, plan }.render(&Integrator::default(), samples);
    let l = LuminanceMode::Srgb.encode_image(&picture.rgb, 1.0);
    let mask = aov::trace(view, v_min).mask;
    let mean = |main: bool| {
        let of: Vec<f64> = l.iter().zip(&mask).filter(|(_, m)| **m == main).map(|(l, _)| *l).collect();
        of.iter().sum::<f64>() / of.len() as f64
    };
    println!("object {:.3}, background {:.3}", mean(true), mean(false));
    assert!(mean(true) > 0.3, "object {}", mean(true));
    assert!(mean(false) < 0.1, "background {}", mean(false));
}
