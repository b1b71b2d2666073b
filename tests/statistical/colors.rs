//! Colours of lights as factors on the channels of a basis.

use glam::Vec3;
use lightopt_embree::{
    integrator::{Integrator, IntegratorKind, View},
    light::LightColor,
    lighting::{Lighting, SamplingPlan},
    math::Rgb,
    sampler::SamplerKind,
    scene::{Scene, material::Model},
    transport::{
        Knots, Layout, LightingGradient, Linearised, Recombination, SizeBins, Source, Tables, Tangents,
        TransportBasis, ValueNodes,
    },
};

use crate::support::{random::Random, scenes};

const INTEGRATOR: Integrator = Integrator {
    kind: IntegratorKind::Bdpt,
    max_depth: 4,
    heuristic: lightopt_embree::integrator::Heuristic::Power,
};

/// A room with coloured surfaces, a panel of a free size and a bulb.
fn scene(colors: [Rgb; 2]) -> Scene {
    let (mut s, mut m) = scenes::room();
    m.push(scenes::material("ball", Model::Diffuse, [0.6, 0.3, 0.7], 0.0));
    s.sphere(Vec3::new(0.2, 0.4, 0.1), 0.35, 8, true, 3);
    let mut lights = vec![
        scenes::rectangle("panel", Vec3::new(0.0, 1.9, 0.0), Vec3::NEG_Y, 0.3, 0.2),
        scenes::sphere_light("bulb", Vec3::new(0.5, 1.1, -0.3), 0.15),
    ];
    lights.iter_mut().zip(colors).for_each(|(light, color)| light.color = color);
    let scene = Scene::new("coloured", s.mesh, m, lights, scenes::room_camera((12, 9))).unwrap();
    scene.with_background(vec![0, 1, 2])
}

fn basis(scene: &Scene) -> TransportBasis {
    let sizes = vec![SizeBins::Free(Knots::geometric(0.2, 1.5, 8)), SizeBins::Fixed(1.0)];
    let layout =
        Layout::new(scene.camera.size(), sizes, ValueNodes::new(1.0, INTEGRATOR.max_depth)).with_planes(3);
    let lighting = Lighting::authored(scene);
    let plan = SamplingPlan {
        sizes: vec![
            lightopt_embree::light::SizeDensity::any_size([0.2, 1.5]),
            SamplingPlan::uniform(&lighting).sizes[1],
        ],
        ..SamplingPlan::uniform(&lighting)
    };
    let mut basis = TransportBasis::new(layout, 2);
    let view = View { scene, camera: &scene.camera };
    let source = Source { view, plan: &plan, integrator: &INTEGRATOR, sampler: SamplerKind::Sobol, seed: 3 };
    basis.render(source, 4, &()).unwrap();
    basis
}

/// A lighting of both lights in these colours.
fn lighting(color: Vec<LightColor>) -> Lighting {
    Lighting { radiance: vec![2.0, 3.0], size: vec![0.7, 1.0], value: 0.8, exposure: 1.0, color }
}

fn planes(tables: &impl Tables, x: &Lighting, planes: usize) -> Vec<Vec<f64>> {
    let r = Recombination::new(tables.layout(), x);
    let of = |replicate| {
        let mut out = vec![0.0; planes * tables.layout().n_pixels()];
        tables.luminance(replicate, &r, &mut out);
        out
    };
    (0..tables.n_replicates()).map(of).collect()
}

/// Lights that are rendered in a colour, and lights that are rendered white and seen in that colour.
#[test]
fn a_colour_is_a_factor_of_what_is_recorded_white() {
    let warm = LightColor::Temperature { kelvin: 2900.0, tint: 0.01 };
    let violet = LightColor::Rgb([0.5, 0.02, 1.0]);
    let colors = [warm, violet].map(|c| Rgb::from_array(c.factor().map(|v| v as f32)));
    let (colored, white) = (basis(&scene(colors)), basis(&scene([Rgb::ONE; 2])));
    let (plain, seen) = (lighting(Vec::new()), lighting(vec![warm, violet]));
    let mut near = Linearised::new(&white, seen.value);
    near.prepare(&seen);
    for n in [1, 3] {
        let wanted = planes(&colored, &plain, n);
        for found in [planes(&white, &seen, n), planes(&near, &seen, n)] {
            for (a, b) in wanted.iter().flatten().zip(found.iter().flatten()) {
                assert!((a - b).abs() < 2e-5 * a.abs().max(1e-2), "{n} planes: {a} {b}");
            }
        }
    }
    for (a, b) in colored.picture(&plain).rgb.iter().zip(&white.picture(&seen).rgb) {
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-4 * a[c].max(1e-2)), "{a:?} {b:?}");
    }
    for (a, b) in colored.shares(&plain).iter().zip(white.shares(&seen)) {
        assert!((a - b).abs() < 1e-4, "{a} {b}");
    }
}

/// The gradient of Σ adjoint · image, of luminance alone and of all planes.
#[test]
fn derivatives_by_colours_agree_with_central_differences() {
    let white = basis(&scene([Rgb::ONE; 2]));
    let x = lighting(vec![
        LightColor::Rgb([0.9, 0.3, 0.5]),
        LightColor::Temperature { kelvin: 3400.0, tint: 0.0 },
    ]);
    for n in [1, 3] {
        let mut random = Random::new(&[5]);
        let length = n * white.layout().n_pixels();
        let adjoint: Vec<f64> = (0..length).map(|_| f64::from(random.range(-1.0, 1.0))).collect();
        let value =
            |x: &Lighting| -> f64 { planes(&white, x, n)[0].iter().zip(&adjoint).map(|(y, a)| y * a).sum() };
        let mut tangents = Tangents::default();
        let mut g = [LightingGradient::zero(2)];
        let mut image = vec![0.0; length];
        white.differentiate(0, &Recombination::new(white.layout(), &x), &mut image, &mut tangents);
        tangents.pull_back(&[&adjoint], &mut g);
        for (a, b) in image.iter().zip(&planes(&white, &x, n)[0]) {
            assert!((a - b).abs() < 1e-12 * b.abs().max(1.0));
        }
        let [g] = g;
        let check = |what: &str, found: f64, h: f64, change: &dyn Fn(&mut Lighting, f64)| {
            let at = |h: f64| {
                let mut x = x.clone();
                change(&mut x, h);
                value(&x)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (found - difference).abs() < 1e-6 * found.abs().max(1e-2),
                "{n} {what}: {found} {difference}"
            );
        };
        for l in 0..2 {
            check("radiance", g.radiance[l], 1e-4, &|x, h| x.radiance[l] += h);
        }
        check("size", g.size[0], 1e-5, &|x, h| x.size[0] += h);
        check("value", g.value, 1e-5, &|x, h| x.value += h);
        for c in 0..3 {
            check("channel", x.color[0].by_channel(c, g.color[0]), 1e-5, &|x, h| {
                let LightColor::Rgb(rgb) = &mut x.color[0] else { panic!("given so") };
                rgb[c] += h;
            });
        }
        let by_mired = 1e6 / (3400.0 * 3400.0);
        check("temperature", x.color[1].by_kelvin(g.color[1]) / by_mired, 1e-2, &|x, h| {
            x.color[1] = LightColor::Temperature { kelvin: 3400.0 + h / by_mired, tint: 0.0 };
        });
    }
}
