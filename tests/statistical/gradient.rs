//! The gradient of f_q by the variables, through basis, display, jackknife and terms at once.

use glam::Vec3;
use lightopt_embree::{
    design::{
        evaluator::{Evaluator, Scratch},
        pareto::{self, Aim},
    },
    integrator::{Integrator, IntegratorKind, View, aov},
    light::SizeDensity,
    lighting::{Lighting, SamplingPlan},
    math::{Measure, Rgb, ViewTransform, measure::plane_of},
    objective::{LuminanceMode, Objective, Smoothing, Target, Term},
    sampler::SamplerKind,
    scene::{Scene, material::Model},
    transport::{Knots, Layout, Recombination, SizeBins, Source, Tables, TransportBasis, ValueNodes},
    variables::{ParamVector, Scale, Tie, Variable, VariableKind},
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

/// A basis of four replicates in which both sizes and the background's value are open, with pictures of so
/// many planes.
fn basis(scene: &Scene, planes: usize) -> TransportBasis {
    let integrator = Integrator { kind: IntegratorKind::Bdpt, max_depth: 5, ..Integrator::default() };
    let knots = || Knots::geometric(f64::from(SIZES[0]), f64::from(SIZES[1]), 12);
    let bins = (0..2).map(|_| SizeBins::Free(knots())).collect();
    let layout = Layout::new(scene.camera.size(), bins, ValueNodes::new(f64::from(LARGEST_VALUE), 5));
    let layout = layout.with_planes(planes);
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
        ties: vec![],
        variables: vec![
            variable("radiance", 0, [0.0, 30.0], Scale::Perceptual),
            variable("size", 0, sizes, Scale::Logarithmic),
            variable("radiance", 1, [0.0, 60.0], Scale::Perceptual),
            variable("size", 1, sizes, Scale::Logarithmic),
            variable("background", 0, [0.05, f64::from(LARGEST_VALUE)], Scale::Perceptual),
            variable("exposure", 0, [0.25, 4.0], Scale::Logarithmic),
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
    let of_white = basis(&scene, 3);
    // What one white light shows in a grey room is grey but for rounding. There the least channel, from which PBR
    // Neutral takes its offset, changes from one to another, and f_q has a slope on either side (see the test of that
    // edge in `math::view`). Under lights of two colours there is no such edge on the bounds either.
    let of_colored = {
        let mut lights = scene.lights.clone();
        for (light, color) in lights.iter_mut().zip([[1.0, 0.8, 0.55], [0.6, 0.85, 1.0]]) {
            light.color = Rgb::from_array(color);
        }
        let mut colored = Scene::new(
            "coloured",
            scene.mesh.clone(),
            scene.materials.clone(),
            lights,
            scenes::room_camera((24, 18)),
        )
        .unwrap();
        colored.is_main.clone_from(&scene.is_main);
        basis(&colored.with_background(vec![0, 1, 2]), 3)
    };
    let halves = [of_white.halves(), of_colored.halves()];
    let fixed = Lighting::authored(&scene);
    let variables = variables();
    let aovs = aov::trace(View { scene: &scene, camera: &scene.camera }, 1.0);
    let mut random = Random::new(&[61]);
    let mut points: Vec<Vec<f64>> =
        (0..6).map(|_| (0..6).map(|_| f64::from(random.range(0.1, 0.9))).collect()).collect();
    // Each variable on a bound of its own, and all at once.
    for (i, bound) in [(0, 0.0), (1, 1.0), (2, 0.0), (3, 0.0), (4, 0.0), (4, 1.0)] {
        let mut u = points[i].clone();
        u[i] = bound;
        points.push(u);
    }
    points.push(vec![0.0, 1.0, 0.5, 0.0, 1.0, 0.4]);
    let through = |view| Measure { view, luminance: LuminanceMode::Srgb, color: false };
    let measures = [
        ("high-key", Measure::default()),
        ("low-key", LuminanceMode::Linear.into()),
        ("high-key", through(ViewTransform::Agx)),
        ("low-key", through(ViewTransform::Filmic)),
        ("high-key", through(ViewTransform::PbrNeutral)),
        ("low-key", through(ViewTransform::Linear)),
    ];
    for (look, measure) in measures {
        let target = Target::resolve(look).unwrap();
        let objective = Objective::new(&target, aovs.width, aovs.height, &aovs.mask).unwrap();
        let is_colored = measure.view == ViewTransform::PbrNeutral;
        let evaluator = Evaluator {
            basis: if is_colored { &of_colored } else { &of_white },
            halves: &halves[usize::from(is_colored)],
            objective: &objective,
            variables: &variables,
            fixed: &fixed,
            measure,
            least_sizes: &[],
        };
        for delta in [Smoothing::DELTA_FIRST, 5e-3] {
            let smoothing = Smoothing::with_delta(delta);
            let f = |u: &[f64]| evaluator.evaluate(u, &smoothing, None, &mut Scratch::default()).unwrap();
            let gradient_at = |u: &[f64]| {
                let mut gradient = vec![0.0; u.len()];
                let mut scratch = Scratch::default();
                let value = evaluator.evaluate(u, &smoothing, Some(&mut gradient), &mut scratch).unwrap();
                assert!((value - f(u)).abs() < 1e-12);
                gradient
            };
            for u in &points {
                let gradient = gradient_at(u);
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

/// The gradient of f_q with terms of colour, by the colours of lights too.
#[test]
fn the_gradient_by_colours_agrees_with_differences() {
    let scene = scene();
    let basis = basis(&scene, 3);
    let halves = basis.halves();
    let fixed = Lighting::authored(&scene);
    let variable = |kind: VariableKind, light: usize, [lower, upper]: [f64; 2], scale| {
        let name = kind.variable_name(&light.to_string());
        Variable { name, unit: "", lower, upper, initial: upper, scale, kind, light }
    };
    let named = |word: &str| VariableKind::named(word).unwrap();
    let mut all = vec![
        variable(named("radiance"), 0, [0.0, 30.0], Scale::Perceptual),
        variable(named("color"), 0, [2700.0, 7500.0], Scale::Reciprocal),
        variable(named("radiance"), 1, [0.0, 60.0], Scale::Perceptual),
        variable(named("exposure"), 0, [0.25, 4.0], Scale::Logarithmic),
    ];
    let channels = VariableKind::all().filter(|kind| kind.keyword() == "color_rgb");
    all.extend(channels.map(|kind| variable(kind, 1, [0.01, 1.0], Scale::Perceptual)));
    let variables = ParamVector { ties: vec![], variables: all };
    let aovs = aov::trace(View { scene: &scene, camera: &scene.camera }, 1.0);
    let shares =
        (0..256).map(|i| if (100..140).contains(&i) { 1.0 / 40.0 } else { 0.0 }).collect::<Vec<f64>>();
    let goals = "t_aObj = 0.03\nt_bObj = 0.05\nt_aBack = -0.02\nt_bBack = 0.02\nt_spreadObj = 0.05\n\
                 t_spreadBack = 0.03\n[palette]\nshares = ";
    let text = include_str!("../../scenes/targets/low-key.toml");
    let weights =
        "[weights]\naObj = 1\nbObj = 1\naBack = 1\nbBack = 1\nspreadObj = 1\nspreadBack = 1\nchroma = 1\n";
    let (head, rest) = text.split_once("[weights]").unwrap();
    let (scalars, palette) = goals.split_once("[palette]").unwrap();
    let text = format!("{head}{scalars}{weights}{rest}\n[palette]{palette}{shares:?}\n");
    let target = Target::from_toml(&text, "colours.toml".as_ref()).unwrap();
    let objective = Objective::new(&target, aovs.width, aovs.height, &aovs.mask).unwrap();
    let mut random = Random::new(&[62]);
    for view in [ViewTransform::Srgb, ViewTransform::Agx] {
        let evaluator = Evaluator {
            basis: &basis,
            halves: &halves,
            objective: &objective,
            variables: &variables,
            fixed: &fixed,
            measure: Measure { view, luminance: LuminanceMode::Srgb, color: true },
            least_sizes: &[],
        };
        let smoothing = Smoothing::with_delta(5e-3);
        let f = |u: &[f64]| evaluator.evaluate(u, &smoothing, None, &mut Scratch::default()).unwrap();
        for _ in 0..4 {
            let u: Vec<f64> = (0..variables.len()).map(|_| f64::from(random.range(0.1, 0.9))).collect();
            let mut gradient = vec![0.0; u.len()];
            let value =
                evaluator.evaluate(&u, &smoothing, Some(&mut gradient), &mut Scratch::default()).unwrap();
            assert!((value - f(&u)).abs() < 1e-12);
            let longest = gradient.iter().fold(1e-3_f64, |m, g| m.max(g.abs()));
            for (i, g) in gradient.iter().enumerate() {
                let expected = difference(&f, &u, i);
                let name = &variables.variables[i].name;
                assert!((g - expected).abs() < 1e-6 * longest, "{view} {u:?} {name}: {g} {expected}");
            }
        }
    }
}

/// A ratio of what two lights bring to the object is kept at any size, and the gradient goes through it.
#[test]
fn a_ratio_is_kept_while_sizes_vary() {
    let scene = scene();
    let basis = basis(&scene, 1);
    let halves = basis.halves();
    let fixed = Lighting::authored(&scene);
    let aovs = aov::trace(View { scene: &scene, camera: &scene.camera }, 1.0);
    let brought = basis.brought(&aovs.mask, fixed.value);
    let tie = Tie {
        light: 1,
        leader: 0,
        factor: 0.25,
        brought: Some(Box::new([brought[0].clone(), brought[1].clone()])),
    };
    let keep =
        |v: &Variable| [(0, "radiance"), (0, "size"), (1, "size")].contains(&(v.light, v.kind.keyword()));
    let variables = ParamVector {
        variables: variables().variables.into_iter().filter(|v| keep(v) && v.unit.is_empty()).collect(),
        ties: vec![tie],
    };
    assert_eq!(variables.len(), 3);
    let target = Target::resolve("high-key").unwrap();
    let objective = Objective::new(&target, aovs.width, aovs.height, &aovs.mask).unwrap();
    let evaluator = Evaluator {
        basis: &basis,
        halves: &halves,
        objective: &objective,
        variables: &variables,
        fixed: &fixed,
        measure: Measure::default(),
        least_sizes: &[],
    };
    let smoothing = Smoothing::with_delta(5e-3);
    let f = |u: &[f64]| evaluator.evaluate(u, &smoothing, None, &mut Scratch::default()).unwrap();
    let mut random = Random::new(&[63]);
    for _ in 0..6 {
        let u: Vec<f64> = (0..3).map(|_| f64::from(random.range(0.1, 0.9))).collect();
        let x = evaluator.lighting(&variables.decode(&u));
        let mean = |light: usize| {
            let mut alone = x.clone();
            alone.radiance[1 - light] = 0.0;
            let mut sum = 0.0;
            for replicate in 0..basis.n_replicates() {
                let mut y = vec![0.0; basis.layout().n_pixels()];
                basis.luminance(replicate, &Recombination::new(basis.layout(), &alone), &mut y);
                sum += y.iter().zip(&aovs.mask).filter(|(_, on)| **on).map(|(y, _)| y).sum::<f64>();
            }
            sum
        };
        assert!((mean(1) / mean(0) / 0.25 - 1.0).abs() < 1e-6, "{u:?}: {} {}", mean(1), mean(0));
        let mut gradient = vec![0.0; 3];
        evaluator.evaluate(&u, &smoothing, Some(&mut gradient), &mut Scratch::default()).unwrap();
        let longest = gradient.iter().fold(1e-3_f64, |m, g| m.max(g.abs()));
        for (i, g) in gradient.iter().enumerate() {
            let expected = difference(&f, &u, i);
            assert!((g - expected).abs() < 1e-6 * longest, "{u:?} {i}: {g} {expected}");
        }
    }
}

/// Of ten thousand random lightings none is better in both aims than one of the front, by more than .003.
#[test]
fn no_random_lighting_dominates_the_front() {
    random_lightings_do_not_dominate(10_000);
}

#[test]
#[ignore = "a minute"]
fn none_of_a_hundred_thousand_random_lightings_dominates_the_front() {
    random_lightings_do_not_dominate(100_000);
}

fn random_lightings_do_not_dominate(n: usize) {
    let scene = scene();
    let basis = basis(&scene, 1);
    let halves = basis.halves();
    let fixed = Lighting::authored(&scene);
    let aovs = aov::trace(View { scene: &scene, camera: &scene.camera }, 1.0);
    let of = |look: &str| {
        let target = Target::resolve(look).unwrap();
        Objective::new(&target, aovs.width, aovs.height, &aovs.mask).unwrap()
    };
    let (high, low) = (of("high-key"), of("low-key"));
    let all = variables();
    let kept = all.variables.into_iter().filter(|v| v.kind.keyword() != "exposure").collect();
    let variables = ParamVector { variables: kept, ties: vec![] };
    let evaluator = Evaluator {
        basis: &basis,
        halves: &halves,
        objective: &high,
        variables: &variables,
        fixed: &fixed,
        measure: Measure::default(),
        least_sizes: &[],
    };
    let watts: Vec<(f64, bool)> = scene.lights.iter().map(|l| (f64::from(l.unit_power(1.0)), true)).collect();
    let look = |objective: Objective| Aim::Look(Box::new(objective));
    let mut random = Random::new(&[71]);
    let points: Vec<Vec<f64>> =
        (0..n).map(|_| (0..variables.len()).map(|_| f64::from(random.range(0.0, 1.0))).collect()).collect();
    for aims in [
        [look(high.only(Term::MeanObj)), look(high.only(Term::VarBack))],
        [look(high.clone()), look(low)],
        [look(high.clone()), Aim::Power { lights: watts, unit: 10.0 }],
    ] {
        let front = pareto::front(&evaluator, &aims, 12, 1).unwrap();
        assert!(front.windows(2).all(|w| w[0].values[0] < w[1].values[0] && w[0].values[1] > w[1].values[1]));
        for values in pareto::measure(&evaluator, &aims, &points).unwrap() {
            let dominates = |p: &&pareto::FrontPoint| (0..2).all(|k| values[k] < p.values[k] - 0.003);
            assert_eq!(front.iter().find(dominates), None, "{values:?}");
        }
    }
}

/// Its luminance is that of a basis without, bit for bit, and so are its pictures but for rounding; the planes
/// of its replicates have the mean that its pictures show, also after it was written to a file and read.
#[test]
fn a_basis_with_the_colour_of_each_replicate_shows_the_same() {
    let scene = scene();
    let [plain, coloured] = [1, 3].map(|planes| basis(&scene, planes));
    let x = Lighting { size: vec![0.7, 0.3], value: 0.8, ..Lighting::authored(&scene) };
    let n = plain.layout().n_pixels();
    let planes = |basis: &TransportBasis, replicate: usize, planes: usize| {
        let mut out = vec![0.0; planes * n];
        basis.luminance(replicate, &Recombination::new(basis.layout(), &x), &mut out);
        out
    };
    let shown = coloured.picture(&x);
    for (a, b) in plain.picture(&x).rgb.iter().flatten().zip(shown.rgb.iter().flatten()) {
        assert!((a - b).abs() <= 1e-5 * (1e-2 + a.abs()), "{a} {b}");
    }
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.basis");
    coloured.save(&path, &serde_json::Value::Null).unwrap();
    let (read, _) = TransportBasis::load(&path).unwrap();
    for basis in [&coloured, &read] {
        let of: Vec<Vec<f64>> = (0..4).map(|r| planes(basis, r, 3)).collect();
        for (r, of) in of.iter().enumerate() {
            assert_eq!(planes(&plain, r, 1), of[..n]);
            assert_eq!(planes(basis, r, 1), of[..n]);
        }
        for (i, value) in (0..3 * n).map(|i| (i, of.iter().map(|of| of[i] / 4.0).sum::<f64>())) {
            let wanted = plane_of(i / n, shown.rgb[i % n]);
            assert!((value - wanted).abs() <= 1e-5 * (1e-2 + wanted.abs()), "{i}: {value} {wanted}");
        }
        // Both halves have the same mean.
        let halves = basis.halves();
        let mean = |i: usize| (0..2).map(|r| planes(&halves, r, 3)[i] / 2.0).sum::<f64>();
        for i in [0, n / 2, n + 7, 2 * n + n / 3] {
            let all = of.iter().map(|of| of[i] / 4.0).sum::<f64>();
            assert!((mean(i) - all).abs() <= 1e-5 * (1e-2 + all.abs()));
        }
    }
}
