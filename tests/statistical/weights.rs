//! Multiple importance sampling weights of the bidirectional path tracer.

use std::collections::BTreeMap;

use glam::UVec2;
use lightopt_embree::{
    film::Contribution,
    integrator::{Context, Heuristic, Integrator, IntegratorKind, Strategy, Values, bdpt},
    math::{
        luminance,
        stats::{Moments, sidak_z},
    },
    sampler::{Sampler, SamplerKind},
    scene::Scene,
};

use crate::support::{compare::Subject, scenes, verify};

#[test]
fn fast_weights_equal_the_reference_on_random_paths() {
    for scene in scenes::ALL.map(|make| make((24, 24))) {
        for (heuristic, camera_subpaths) in
            [(Heuristic::Balance, 1), (Heuristic::Power, 1), (Heuristic::Power, 4)]
        {
            let integrator = Integrator { heuristic, ..Integrator::default() };
            let subject = Subject::new(&scene).with_camera_subpaths(camera_subpaths);
            let context = Context::new(integrator, subject.view, Values([1.0]), &subject.plan);
            let mut sampler = Sampler::new(SamplerKind::Sobol, 11);
            let (n, mut worst) = (std::cell::Cell::new(0), 0.0_f64);
            let mut strategies = BTreeMap::new();
            let (mut n_short, mut n_inexact) = (0, 0);
            // In some scenes most light subpaths miss everything.
            for i in (0..8 * 24 * 24).take_while(|i| *i < 24 * 24 || n.get() < 3_000) {
                let pixel = UVec2::new(i % 24, i / 24 % 24);
                sampler.start(pixel, 3 + i / (24 * 24));
                for compared in verify::compare_weights(&context, &mut sampler, pixel) {
                    if compared.shortest_edge < 0.02 {
                        n_short += 1;
                        continue;
                    }
                    let (c, reference) = (compared.contribution, compared.reference);
                    n.set(n.get() + 1);
                    *strategies.entry(c.strategy).or_insert(0) += 1;
                    let error = (f64::from(c.mis_weight) - reference).abs();
                    worst = worst.max(error);
                    // f32 densities in another order: grazing cosines and sharp lobes amplify
                    // rounding, but rarely.
                    n_inexact += u32::from(error > 1e-3);
                    assert!(
                        error < 1e-2,
                        "{}: {:?}: weight {} reference {reference}",
                        scene.name,
                        c.strategy,
                        c.mis_weight
                    );
                }
            }
            println!(
                "{}: {} weights of {} strategies, worst error {worst:.1e}, {n_short} left out",
                scene.name,
                n.get(),
                strategies.len()
            );
            assert!(n_inexact <= n.get() / 500, "{n_inexact} of {} beyond 1e-3", n.get());
            assert!(n.get() >= 3_000 && n_short < n.get() / 5, "{n_short} short");
        }
    }
}

/// Unweighted contributions by strategy: value without its weight.
fn unweighted(c: &Contribution, scene: &Scene) -> f64 {
    let l = &scene.lights[c.light as usize];
    if c.mis_weight > 0.0 { f64::from(luminance(c.value.largest()) * l.radiance / c.mis_weight) } else { 0.0 }
}

/// Every strategy alone, unweighted, estimates the same mean for each path
/// length that all of them can sample.
#[test]
fn every_strategy_has_the_same_mean_per_path_length() {
    // A closed diffuse room around a lamp that every strategy can find, seen whole.
    let scene = strategy_scene();
    let integrator = Integrator { kind: IntegratorKind::Bdpt, max_depth: 4, heuristic: Heuristic::Power };
    let subject = Subject::new(&scene).with_camera_subpaths(3);
    let context = Context::new(integrator, subject.view, Values([1.0]), &subject.plan);
    let size = scene.camera.size();
    let n_renders = 48;
    let mut means: BTreeMap<Strategy, Moments> = BTreeMap::new();
    let mut workspace = bdpt::Workspace::default();
    for seed in 0..n_renders {
        let mut sampler = Sampler::new(SamplerKind::Sobol, 100 + seed);
        let mut sums: BTreeMap<Strategy, f64> = BTreeMap::new();
        for y in 0..size.y {
            for x in 0..size.x {
                for index in 0..64 {
                    let pixel = UVec2::new(x, y);
                    sampler.start(pixel, index);
                    let mut recorder = |_: Option<glam::Vec2>, c: &Contribution| {
                        *sums.entry(c.strategy).or_default() += unweighted(c, &scene);
                    };
                    bdpt::sample(&context, &mut sampler, pixel, &mut workspace, &mut recorder);
                }
            }
        }
        for n_edges in 1..=integrator.max_depth {
            for s in 0..=n_edges {
                let strategy = Strategy::new(s, n_edges + 1 - s);
                let sum = sums.get(&strategy).copied().unwrap_or(0.0);
                means.entry(strategy).or_default().push(sum / f64::from(64 * size.element_product()));
            }
        }
    }
    let threshold = sidak_z(0.01, means.len());
    for n_edges in 1..=integrator.max_depth {
        let of_length: Vec<_> = means.iter().filter(|(s, _)| s.n_edges() == n_edges).collect();
        // Inverse-variance mean over the strategies of this length.
        let precision = |m: &Moments| 1.0 / m.variance_of_mean().max(1e-30);
        let total: f64 = of_length.iter().map(|(_, m)| precision(m)).sum();
        let mean = of_length.iter().map(|(_, m)| m.mean() * precision(m)).sum::<f64>() / total;
        for (s, m) in of_length {
            // The strategy is part of the mean: their covariance is 1/total.
            let z = (m.mean() - mean) / (m.variance_of_mean() - 1.0 / total).max(1e-30).sqrt();
            println!(
                "length {n_edges} {s:?}: {:.6} ± {:.6}, z {z:.2}",
                m.mean(),
                m.variance_of_mean().sqrt()
            );
            assert!(m.mean() > 0.0, "{s:?} found nothing");
            assert!(z.abs() < threshold, "{s:?}: {} against {mean}", m.mean());
        }
    }
}

fn strategy_scene() -> Scene {
    use glam::{Vec3, Vec3Swizzles};
    use lightopt_embree::scene::material::Model;
    let mut s = scenes::Shapes::default();
    // Walls that do not touch: where surfaces meet, an unweighted connection has
    // no finite variance.
    for n in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z] {
        let (a, b) = (n.yzx() * 0.8, n.cross(n.yzx()) * 0.8);
        s.quad(-n - a - b, a * 2.0, b * 2.0, 0);
    }
    s.sphere(Vec3::new(0.2, -0.3, -0.3), 0.3, 8, true, 1);
    let materials = vec![
        scenes::material("wall", Model::Diffuse, [0.6; 3], 0.0),
        scenes::material("ball", Model::Plastic, [0.5, 0.4, 0.3], 0.6),
    ];
    let lights = vec![
        scenes::rectangle("panel", Vec3::new(0.0, 0.6, -0.6), Vec3::new(0.0, -1.0, 1.0), 0.4, 0.3),
        scenes::sphere_light("bulb", Vec3::new(-0.5, 0.3, -0.4), 0.25),
    ];
    let camera = scenes::camera(Vec3::new(0.0, 0.0, 0.9), Vec3::new(0.0, 0.0, -1.0), 80.0, (12, 12));
    Scene::new("strategies", s.mesh, materials, lights, camera).unwrap()
}
