//! The two integrators against each other and against closed forms.

use glam::UVec2;
use lightopt_embree::{
    film::Region,
    integrator::{Heuristic, Integrator, IntegratorKind, Sampling},
    math::stats::sidak_z,
    sampler::SamplerKind,
    scene::Scene,
};

use crate::support::{
    compare::{assert_same, measure, render, render_region},
    scenes,
};

const PATH: Integrator = Integrator { kind: IntegratorKind::Path, max_depth: 8, heuristic: Heuristic::Power };
const BDPT: Integrator = Integrator { kind: IntegratorKind::Bdpt, ..PATH };

#[test]
fn a_closed_furnace_gives_the_geometric_series() {
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        for (albedo, max_depth) in [(0.5, 8), (0.9, 24), (1.0, 5)] {
            let scene = scenes::furnace(albedo);
            let integrator = Integrator { kind, max_depth, ..PATH };
            let m = measure(&scene, &integrator, SamplerKind::Sobol, 1, 64, 64);
            let expected: f64 = (0..max_depth).map(|k| f64::from(albedo).powi(k as i32)).sum();
            let z = (m.total.mean() - expected) / m.total.variance_of_mean().sqrt().max(1e-9);
            println!("{kind:?} albedo {albedo}: {} expected {expected}, z {z:.2}", m.total.mean());
            assert!(z.abs() < sidak_z(0.01, 6), "{kind:?} {albedo}");
        }
    }
}

fn path_equals_bdpt(scene: &Scene, n: u32, spp: u32) {
    let path = measure(scene, &PATH, SamplerKind::Sobol, 1, n, 4 * spp);
    let bdpt = measure(scene, &BDPT, SamplerKind::Sobol, 2, n, spp);
    assert_same(&scene.name, &path, &bdpt);
}

const SIZE: (u32, u32) = (32, 32);

#[test]
fn path_equals_bdpt_in_a_cornell_box() {
    path_equals_bdpt(&scenes::cornell(SIZE), 24, 32);
}

#[test]
fn path_equals_bdpt_on_a_sphere_with_smooth_normals() {
    path_equals_bdpt(&scenes::smooth_sphere(SIZE), 24, 32);
}

#[test]
fn path_equals_bdpt_through_rough_glass() {
    path_equals_bdpt(&scenes::rough_glass(SIZE), 24, 32);
}

#[test]
fn path_equals_bdpt_on_a_glossy_floor() {
    path_equals_bdpt(&scenes::glossy_floor(SIZE), 24, 32);
}

#[test]
fn path_equals_bdpt_on_tilted_normals_and_textured_mixtures() {
    path_equals_bdpt(&scenes::normal_mapped(SIZE), 24, 32);
}

#[test]
fn no_light_leaks_through_tilted_normals() {
    let scene = scenes::dark_box(SIZE);
    for integrator in [PATH, BDPT] {
        let picture = render(&scene, &integrator, Sampling { count: 64, ..ONCE });
        assert!(picture.rgb.iter().all(|p| *p == [0.0; 3]), "{:?}", integrator.kind);
    }
}

#[test]
fn path_equals_bdpt_with_two_lights_in_line() {
    path_equals_bdpt(&scenes::lights_in_line(SIZE), 24, 32);
}

#[test]
fn balance_and_power_heuristics_agree_and_so_do_the_samplers() {
    let scene = scenes::glossy_floor((16, 16));
    let power = measure(&scene, &BDPT, SamplerKind::Sobol, 3, 24, 32);
    let balance = Integrator { heuristic: Heuristic::Balance, ..BDPT };
    assert_same("balance", &measure(&scene, &balance, SamplerKind::Sobol, 4, 24, 32), &power);
    assert_same("halton", &measure(&scene, &BDPT, SamplerKind::Halton, 5, 24, 32), &power);
}

#[test]
fn the_mean_does_not_depend_on_the_sample_count() {
    let scene = scenes::glossy_floor((16, 16));
    for integrator in [PATH, BDPT] {
        let few = measure(&scene, &integrator, SamplerKind::Sobol, 6, 256, 2);
        let many = measure(&scene, &integrator, SamplerKind::Sobol, 7, 24, 64);
        assert_same("spp", &few, &many);
    }
}

const ONCE: Sampling = Sampling { sampler: SamplerKind::Sobol, seed: 5, first: 0, count: 4 };

#[test]
fn a_crop_equals_the_crop_of_the_whole() {
    let scene = scenes::glossy_floor((24, 20));
    let region = Region { min: UVec2::new(5, 3), max: UVec2::new(17, 14) };
    for integrator in [PATH, BDPT] {
        let full = render(&scene, &integrator, ONCE);
        let crop = render_region(&scene, &integrator, ONCE, region);
        for y in 0..crop.height {
            for x in 0..crop.width {
                assert_eq!(crop.rgb[y * crop.width + x], full.rgb[(y + 3) * full.width + x + 5]);
            }
        }
    }
}

#[test]
fn one_and_many_threads_give_the_same_bits() {
    let scene = scenes::glossy_floor((24, 20));
    for integrator in [PATH, BDPT] {
        let with = |n| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
            pool.install(|| render(&scene, &integrator, ONCE)).rgb
        };
        let one = with(1);
        assert_eq!(one, with(2));
        assert_eq!(one, with(5));
    }
}
