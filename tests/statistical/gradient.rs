//! The gradient of f_q by the variables, through basis, display, jackknife and terms at once.

use glam::Vec3;
use lightopt_embree::{
    design::evaluator::{Evaluator, Scratch},
    integrator::{Integrator, IntegratorKind, View, aov},
    light::SizeDensity,
    lighting::{Lighting, SamplingPlan},
    objective::{LuminanceMode, Objective, Smoothing, Target},
    sampler::SamplerKind,
    scene::{Scene, material::Model},
    transport::{Knots, Layout, SizeBins, Source, TransportBasis, ValueNodes},
    variables::{ParamVector, Scale, Variable, VariableKind},
};

use crate::support::{random::Random, scenes};

const SIZES: [f32; 2] = [0.1, 1.6];
const LARGEST_VALUE: f32 = 1.2;

/// A ball in a room with two lamps; the room is the background.
fn scene() -> Scene {
    let (mut s, mut m) = scenes::room();
    m.push(scenes::material("ball", Model::Plastic, [0.6, 0.4, 0.3], 0.3));
    let room = s.mesh.indices.len();
    s.sphere(Vec3::new(0.1, 0.5, 0.1), 0.45, 12, true, 3);
    let lights = vec![
        scenes::rectangle("panel", Vec3::new(0.0, 1.9, 0.2), Vec3::NEG_Y, 0.3, 0.3),
        scenes::sphere_light("bulb", Vec3::new(0.6, 1.4, -0.3), 0.12),
    ];
    let mut scene = Scene::new("ball", s.mesh, m, lights, scenes::room_camera((24, 18))).unwrap();
    scene.is_main = (0..scene.is_main.len()).map(|i| i >= room).collect();
    scene.with_background(vec![0, 1, 2])
}

/// A basis of four replicates in which both sizes and the background's value are open.
fn basis(scene: &Scene) -> TransportBasis {
    let integrator = Integrator { kind: IntegratorKind::Bdpt, max_depth: 5, ..Integrator::default() };
    let knots = || Knots::geometric(f64::from(SIZES[0]), f64::from(SIZES[1]), 12);
    let bins = (0..2).map(|_| SizeBins::Free(knots())).collect();
    let layout = Layout::new(scene.camera.size(), bins, ValueNodes::new(f64::from(LARGEST_VALUE), 5));
    let mut plan = SamplingPlan::uniform(&Lighting::authored(scene));
    plan.sizes = vec![SizeDensity::any_size(SIZES); 2];
    plan.largest_value = LARGEST_VALUE;
    let mut basis = TransportBasis::new(layout, 4);
    let view = View { scene, camera: &scene.camera };
    let source = Source { view, plan: &plan, integrator: &integrator, sampler: SamplerKind::Sobol, seed: 3 };
    basis.render(source, 16, &()).unwrap();
    basis
}

fn variables() -> ParamVector {
    let variable = |kind: &str, light: usize, [lower, upper]: [f64; 2], scale| {
        let kind = VariableKind::named(kind).unwrap();
        let name = kind.variable_name(&light.to_string());
        Variable { name, unit: "", lower, upper, initial: upper, scale, kind, light }
    };
    let sizes = SIZES.map(f64::from);
    ParamVector {
        variables: vec![
            variable("radiance", 0, [0.0, 30.0], Scale::Perceptual),
            variable("size", 0, sizes, Scale::Logarithmic),
            variable("radiance", 1, [0.0, 60.0], Scale::Perceptual),
            variable("size", 1, sizes, Scale::Logarithmic),
            variable("background", 0, [0.05, f64::from(LARGEST_VALUE)], Scale::Perceptual),
        ],
    }
}

/// Derivative of `f` along coordinate `i` at `u` by differences of second order: central, or to the
/// inside where `u` lies on a bound. The step is so short that hardly a pixel meets white or the edge
/// of a bin on the way, where f is differentiable once only.
fn difference(f: &dyn Fn(&[f64]) -> f64, u: &[f64], i: usize) -> f64 {
    const H: f64 = 1e-7;
    let at = |steps: f64| {
        let mut u = u.to_vec();
        u[i] += steps * H;
        f(&u)
    };
    if u[i] > 0.0 && u[i] < 1.0 {
        (at(1.0) - at(-1.0)) / (2.0 * H)
    } else {
        let inward = if u[i] <= 0.0 { 1.0 } else { -1.0 };
        inward * (-3.0 * at(0.0) + 4.0 * at(inward) - at(2.0 * inward)) / (2.0 * H)
    }
}

#[test]
fn the_gradient_of_f_q_agrees_with_differences_inside_and_on_bounds() {
    let scene = scene();
    let basis = basis(&scene);
    let halves = basis.halves();
    let fixed = Lighting::authored(&scene);
    let variables = variables();
    let aovs = aov::trace(View { scene: &scene, camera: &scene.camera }, 1.0);
    let mut random = Random::new(&[61]);
    let mut points: Vec<Vec<f64>> =
        (0..6).map(|_| (0..5).map(|_| f64::from(random.range(0.1, 0.9))).collect()).collect();
    // Each variable on a bound of its own, and all at once.
    for (i, bound) in [(0, 0.0), (1, 1.0), (2, 0.0), (3, 0.0), (4, 0.0), (4, 1.0)] {
        let mut u = points[i].clone();
        u[i] = bound;
        points.push(u);
    }
    points.push(vec![0.0, 1.0, 0.5, 0.0, 1.0]);
    for (look, luminance) in [("high-key", LuminanceMode::Srgb), ("low-key", LuminanceMode::Linear)] {
        let target = Target::resolve(look).unwrap();
        let objective = Objective::new(&target, aovs.width, aovs.height, &aovs.mask).unwrap();
        let evaluator = Evaluator {
            basis: &basis,
            halves: &halves,
            objective: &objective,
            variables: &variables,
            fixed: &fixed,
            luminance,
            least_sizes: &[],
        };
        for delta in [Smoothing::DELTA_FIRST, 5e-3] {
            let smoothing = Smoothing::with_delta(delta);
            let f = |u: &[f64]| evaluator.evaluate(u, &smoothing, None, &mut Scratch::default()).unwrap();
            for u in &points {
                let mut gradient = vec![0.0; u.len()];
                let mut scratch = Scratch::default();
                let value = evaluator.evaluate(u, &smoothing, Some(&mut gradient), &mut scratch).unwrap();
                assert!((value - f(u)).abs() < 1e-12);
                let longest = gradient.iter().fold(1e-3_f64, |m, g| m.max(g.abs()));
                for (i, g) in gradient.iter().enumerate() {
                    let expected = difference(&f, u, i);
                    println!("{look} delta {delta} {}: {g:.6e} {expected:.6e}", variables.variables[i].name);
                    assert!(
                        (g - expected).abs() < 1e-6 * longest,
                        "{look} {delta} {u:?} {i}: {g} {expected}"
                    );
                }
            }
        }
    }
}
