//! What does an evaluation on the transport basis cost, and how does it grow with the lights?

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{UVec2, Vec3};
use lightopt_embree::{
    camera::Camera,
    design::evaluator::{Evaluator, Scratch},
    integrator::{Integrator, View, aov},
    light::{Light, LightColor, Shape, SizeDensity, Sphere},
    lighting::{Lighting, SamplingPlan},
    math::{Measure, Rgb},
    objective::{Objective, Smoothing, Target},
    sampler::SamplerKind,
    scene::{
        Material, Mesh, Scene,
        material::{Coats, MaterialParams},
    },
    transport::{Knots, Layout, SizeBins, Source, TransportBasis, ValueNodes},
    variables::{ParamVector, Scale, Variable, VariableKind},
};

const SIZES: [f32; 2] = [0.05, 1.0];

/// A card before a wall, and `n` lamps.
fn scene(n: usize) -> Scene {
    let mut mesh = Mesh::default();
    for (z, half, material) in [(-1.0, 3.0, 0), (0.0, 0.5, 1)] {
        let first = mesh.positions.len() as u32;
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            mesh.positions.push(Vec3::new(x * half, y * half, z));
            mesh.normals.push(Vec3::Z);
            mesh.uvs.push(glam::Vec2::ZERO);
        }
        for t in [[0, 1, 2], [0, 2, 3]] {
            mesh.indices.push(t.map(|i| first + i));
            mesh.materials.push(material);
            mesh.objects.push(material);
        }
    }
    let mut coats = Coats::default();
    let mut material = |name: &str| Material::new(name.into(), MaterialParams::default(), &mut coats);
    let materials = vec![material("wall"), material("card")];
    let lights = (0..n)
        .map(|i| {
            let angle = i as f32 / n as f32 * std::f32::consts::TAU;
            let center = Vec3::new(1.5 * angle.cos(), 1.5 * angle.sin(), 0.8);
            Light {
                name: format!("lamp {i}"),
                shape: Shape::Sphere(Sphere { center, radius: 0.1 }),
                color: Rgb::ONE,
                picture_color: LightColor::Recorded,
                temperature: None,
                radiance: 1.0,
                size: 1.0,
                camera_visible: true,
                occludes: false,
            }
        })
        .collect();
    let size = UVec2::new(128, 96);
    let camera = Camera::new(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, Vec3::Y, 40.0, size).expect("looks ahead");
    let mut scene = Scene::new("card", mesh, materials, lights, camera).expect("is sound");
    scene.is_main = vec![false, false, true, true];
    scene.with_background(vec![0])
}

fn variables(n: usize) -> ParamVector {
    let variable = |keyword: &str, light: usize, [lower, upper]: [f64; 2], scale: Scale| Variable {
        name: format!("{light}.{keyword}"),
        unit: "",
        lower,
        upper,
        initial: 0.5 * upper,
        scale,
        kind: VariableKind::named(keyword).expect("is a kind"),
        light,
    };
    let mut variables: Vec<Variable> = (0..n)
        .flat_map(|l| {
            [
                variable("radiance", l, [0.0, 50.0], Scale::Perceptual),
                variable("size", l, SIZES.map(f64::from), Scale::Logarithmic),
            ]
        })
        .collect();
    variables.push(variable("background", 0, [0.05, 1.0], Scale::Perceptual));
    ParamVector { variables, ..ParamVector::default() }
}

fn layout(n: usize) -> Layout {
    let knots = || Knots::geometric(f64::from(SIZES[0]), f64::from(SIZES[1]), 24);
    Layout::new(
        UVec2::new(128, 96),
        (0..n).map(|_| SizeBins::Free(knots())).collect(),
        ValueNodes::new(1.0, 8),
    )
}

fn benchmark(c: &mut Criterion) {
    let integrator = Integrator::default();
    let mut group = c.benchmark_group("basis");
    group.sample_size(10);
    for n in [3, 12, 48] {
        let scene = scene(n);
        let view = View { scene: &scene, camera: &scene.camera };
        let fixed = Lighting::authored(&scene);
        let plan =
            SamplingPlan { sizes: vec![SizeDensity::any_size(SIZES); n], ..SamplingPlan::uniform(&fixed) };
        let sampler = SamplerKind::Sobol;
        let source = Source { view, plan: &plan, integrator: &integrator, sampler, seed: 0 };
        let mut basis = TransportBasis::new(layout(n), 4);
        let memory = basis.layout().table_memory(4);
        println!("{n} lights: {} MiB", memory >> 20);
        group.bench_function(format!("render, 4 replicates of 4 samples, {n} lights"), |b| {
            b.iter(|| basis.render(source, 4, &()).expect("is sound"));
        });
        let halves = basis.halves();
        let aovs = aov::trace(view, 1.0);
        let target = Target::resolve("high-key").expect("is built in");
        let objective = Objective::new(&target, aovs.width, aovs.height, &aovs.mask).expect("has both");
        let variables = variables(n);
        let evaluator = Evaluator {
            basis: &basis,
            halves: &halves,
            objective: &objective,
            variables: &variables,
            fixed: &fixed,
            measure: Measure::default(),
            least_sizes: &[],
        };
        let u = vec![0.4; variables.len()];
        let (mut gradient, mut scratch) = (vec![0.0; variables.len()], Scratch::default());
        let smoothing = Smoothing::with_delta(Smoothing::DELTA_LAST);
        group.bench_function(format!("f_q with gradient, {n} lights, 128x96"), |b| {
            b.iter(|| evaluator.evaluate(black_box(&u), &smoothing, Some(&mut gradient), &mut scratch));
        });
        // As in a descent that has found the background's value.
        let mut scratch = Scratch::of_descent();
        group.bench_function(format!("the same at the same background, {n} lights"), |b| {
            b.iter(|| evaluator.evaluate(black_box(&u), &smoothing, Some(&mut gradient), &mut scratch));
        });
    }
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
