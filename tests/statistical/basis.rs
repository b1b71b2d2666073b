//! The transport basis against ordinary renders.

use glam::{UVec2, Vec3};
use lightopt_embree::{
    film::{Contribution, Recorder, RgbFilm},
    integrator::{Context, Heuristic, Integrator, IntegratorKind, Samples, Values, View, bdpt, path},
    light::{LightSampler, SizeDensity},
    lighting::{Lighting, SamplingPlan},
    math::{
        self, luminance,
        stats::{Moments, normal_deviate, sidak_z},
    },
    sampler::{Sampler, SamplerKind},
    scene::{Scene, material::Model},
    transport::{
        Knots, Layout, LightingGradient, Linearised, Recombination, SizeBins, Source, Tables, Tangents,
        TransportBasis, ValueNodes,
    },
};

use crate::support::{compare::Subject, random::Random, scenes};

const PATH: Integrator = Integrator { kind: IntegratorKind::Path, max_depth: 6, heuristic: Heuristic::Power };
const BDPT: Integrator = Integrator { kind: IntegratorKind::Bdpt, ..PATH };
/// Camera subpaths for each light subpath of the bidirectional integrator; a basis is rendered with
/// more than one.
const CAMERA_SUBPATHS: u32 = 4;
const SIZES: [f32; 2] = [0.1, 1.5];
const LARGEST_VALUE: f32 = 1.2;

/// A room with every type of light, whose walls and floor are the background.
fn scene() -> Scene {
    let (mut s, mut m) = scenes::room();
    m.push(scenes::material("floor", Model::Plastic, [0.5, 0.4, 0.3], 0.4));
    m.push(scenes::material("metal", Model::Conductor, [0.7, 0.6, 0.5], 0.5));
    m.push(scenes::material("ball", Model::Diffuse, [0.6, 0.5, 0.7], 0.0));
    s.quad(Vec3::new(-1.0, 0.01, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 3);
    s.quad(Vec3::new(-0.9, 0.1, -0.95), Vec3::X * 0.8, Vec3::Y * 1.2, 4);
    s.sphere(Vec3::new(0.2, 0.4, 0.1), 0.35, 8, true, 5);
    let cone = lightopt_embree::light::Cone {
        cos_inner: 0.9,
        cos_outer: 0.6,
        edge: lightopt_embree::light::Edge::Smooth,
    };
    let lights = vec![
        scenes::rectangle("panel", Vec3::new(0.0, 1.9, 0.0), Vec3::NEG_Y, 0.3, 0.2),
        scenes::disk("spot", Vec3::new(-0.6, 1.6, 0.3), Vec3::new(0.5, -1.0, 0.0), 0.15, Some(cone)),
        scenes::sphere_light("bulb", Vec3::new(0.5, 1.1, -0.3), 0.15),
        scenes::disk("disk", Vec3::new(-0.9, 0.9, 0.6), Vec3::new(1.0, -0.2, -0.5), 0.2, None),
        scenes::light(
            "point",
            lightopt_embree::light::Shape::Point(lightopt_embree::light::Point::isotropic(Vec3::new(
                0.7, 1.5, 0.5,
            ))),
        ),
        scenes::environment("sky", Some(scenes::sky())),
    ];
    let scene = Scene::new("any light", s.mesh, m, lights, scenes::room_camera((16, 12))).unwrap();
    scene.with_background(vec![0, 1, 2, 3, 4])
}

fn layout(scene: &Scene, max_depth: usize) -> Layout {
    layout_of(scene, max_depth, |_| Knots::geometric(f64::from(SIZES[0]), f64::from(SIZES[1]), 12))
}

/// A layout with knots by the index of a light that has a size.
fn layout_of(scene: &Scene, max_depth: usize, knots: impl Fn(usize) -> Knots) -> Layout {
    let bins = scene
        .lights
        .iter()
        .enumerate()
        .map(|(l, light)| if light.has_size() { SizeBins::Free(knots(l)) } else { SizeBins::Fixed(1.0) });
    let nodes = ValueNodes::new(f64::from(LARGEST_VALUE), max_depth);
    Layout::new(scene.camera.size(), bins.collect(), nodes)
}

/// Samples each light that has a size by `density` of its index, the background at `largest_value`.
fn plan_of_sizes(scene: &Scene, largest_value: f32, density: impl Fn(usize) -> SizeDensity) -> SamplingPlan {
    let mut plan = Subject::new(scene).with_camera_subpaths(CAMERA_SUBPATHS).plan;
    for (l, q) in plan.sizes.iter_mut().enumerate().filter(|(l, _)| scene.lights[*l].has_size()) {
        *q = density(l);
    }
    SamplingPlan { largest_value, ..plan }
}

/// Samples all that a basis of free sizes and values may be asked for.
fn open_plan(scene: &Scene) -> SamplingPlan {
    plan_of_sizes(scene, LARGEST_VALUE, |_| SizeDensity::any_size(SIZES))
}

fn source<'a>(scene: &'a Scene, plan: &'a SamplingPlan, integrator: &'a Integrator, seed: u64) -> Source<'a> {
    let view = View { scene, camera: &scene.camera };
    Source { view, plan, integrator, sampler: SamplerKind::Sobol, seed }
}

fn random_lighting(scene: &Scene, random: &mut Random, value: f64) -> Lighting {
    Lighting {
        radiance: scene.lights.iter().map(|_| f64::from(random.range(0.0, 4.0))).collect(),
        size: scene.lights.iter().map(|_| f64::from(random.range(SIZES[0], SIZES[1]))).collect(),
        value,
        exposure: 1.0,
        color: Vec::new(),
    }
}

/// Sums contributions with the feathered profile of each light and its radiance:
/// what the basis stands for, without it.
struct Feathered<'a> {
    x: &'a Lighting,
    layout: &'a Layout,
    pixel: usize,
    luminance: Vec<f64>,
}

impl Feathered<'_> {
    fn add_to(&mut self, pixel: usize, c: &Contribution) {
        let light = c.light as usize;
        let share = match &self.layout.lights[light].knots {
            Some(knots) => knots.feather(self.x.size[light], c.at.rho),
            None => 1.0,
        };
        self.luminance[pixel] += self.x.radiance[light] * share * f64::from(luminance(c.value.largest()));
    }
}

impl Recorder for &mut Feathered<'_> {
    fn add(&mut self, c: &Contribution) {
        self.add_to(self.pixel, c);
    }
    fn splat(&mut self, raster: glam::Vec2, c: &Contribution) {
        let p = raster.as_uvec2();
        self.add_to((p.y * self.layout.size.x + p.x) as usize, c);
    }
}

/// One render, its contributions weighted directly; sampled at the largest value.
fn feathered(source: Source, layout: &Layout, x: &Lighting, spp: u32) -> Vec<f64> {
    let Source { view, plan, integrator, sampler, seed } = source;
    let context = Context::new(*integrator, view, Values([x.value as f32]), plan);
    let size = layout.size;
    let mut film = Feathered { x, layout, pixel: 0, luminance: vec![0.0; layout.n_pixels()] };
    let mut sampler = Sampler::new(sampler, seed);
    let mut workspace = bdpt::Workspace::default();
    for p in 0..layout.n_pixels() as u32 {
        let pixel = UVec2::new(p % size.x, p / size.x);
        film.pixel = p as usize;
        for i in 0..spp {
            sampler.start(pixel, i);
            let mut recorder = &mut film;
            _ = match integrator.kind {
                IntegratorKind::Path => path::sample(&context, &mut sampler, pixel, &mut recorder),
                IntegratorKind::Bdpt => {
                    bdpt::sample(&context, &mut sampler, pixel, &mut workspace, &mut recorder)
                }
            };
        }
    }
    film.luminance.iter().map(|v| v / f64::from(spp)).collect()
}

pub fn recombined(basis: &TransportBasis, x: &Lighting) -> Vec<Vec<f64>> {
    let r = Recombination::new(basis.layout(), x);
    (0..basis.n_replicates())
        .map(|i| {
            let mut out = vec![0.0; basis.layout().n_pixels()];
            basis.luminance(i, &r, &mut out);
            out
        })
        .collect()
}

/// Values of the background at which recombination is tried: the ends too.
fn values() -> [f64; 10] {
    std::array::from_fn(|i| f64::from(LARGEST_VALUE) * i as f64 / 9.0)
}

#[test]
fn recombination_is_the_same_samples_weighted_by_the_feather() {
    // Without roulette, whose survival differs with the value, the samples are the same.
    for base in [PATH, BDPT] {
        let integrator = Integrator { max_depth: 3, ..base };
        let scene = scene();
        let plan = open_plan(&scene);
        let layout = layout(&scene, 3);
        let mut basis = TransportBasis::new(layout.clone(), 1);
        let source = source(&scene, &plan, &integrator, 5);
        basis.render(source, 4, &()).unwrap();
        let seed = lightopt_embree::math::hash::hash_words(&[5, 0]);
        let mut random = Random::new(&[41]);
        for value in values() {
            let x = random_lighting(&scene, &mut random, value);
            let found = &recombined(&basis, &x)[0];
            let expected = feathered(Source { seed, ..source }, &layout, &x, 4);
            let scale = expected.iter().fold(0.0_f64, |m, v| m.max(*v));
            let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{:?} v {value:.2}: worst {:.1e} of {scale:.2}", integrator.kind, worst / scale);
            assert!(worst < 2e-5 * scale, "{:?} {value}", integrator.kind);
        }
    }
}

#[test]
fn recombination_equals_feathered_renders_at_random_lightings() {
    for integrator in [PATH, BDPT] {
        let scene = scene();
        let plan = open_plan(&scene);
        let layout = layout(&scene, integrator.max_depth);
        let (n, spp) = (16, 16);
        let mut basis = TransportBasis::new(layout.clone(), n);
        let source = source(&scene, &plan, &integrator, 6);
        basis.render(source, spp, &()).unwrap();
        let mut random = Random::new(&[42]);
        let lightings: Vec<Lighting> =
            values().iter().flat_map(|&v| [v; 2]).map(|v| random_lighting(&scene, &mut random, v)).collect();
        let threshold = sidak_z(0.01, lightings.len() * (layout.n_pixels() + 1));
        for (k, x) in lightings.iter().enumerate() {
            let direct: Vec<Vec<f64>> = (0..n)
                .map(|i| Source { seed: (1000 * k + i) as u64, ..source })
                .map(|source| feathered(source, &layout, x, spp / 2))
                .collect();
            let (worst, total) = compare(&recombined(&basis, x), &direct);
            println!("{:?} v {:.2}: worst z {worst:.2}, picture z {total:.2}", integrator.kind, x.value);
            assert!(worst < threshold && total.abs() < threshold, "{:?} {x:?}", integrator.kind);
        }
    }
}

/// Samples of two densities: those of the first count half, those that follow are aimed at some
/// sizes of some lights.
#[test]
fn aimed_samples_after_others_equal_feathered_renders_too() {
    let scene = scene();
    let plan = open_plan(&scene);
    let layout = layout(&scene, BDPT.max_depth);
    let (n, spp) = (16, 16);
    let mut basis = TransportBasis::new(layout.clone(), n);
    basis.render(source(&scene, &plan, &BDPT, 10), 4, &()).unwrap();
    basis.fade();
    assert_eq!(basis.effective_samples(), 2 * n as u32);
    let weights: Vec<f32> = (0..scene.lights.len()).map(|l| 0.2 + l as f32).collect();
    let focused =
        plan_of_sizes(&scene, LARGEST_VALUE, |_| SizeDensity::focused(SIZES, &[(0.3, 1.0), (0.9, 2.0)]));
    let aimed = SamplingPlan { lights: LightSampler::new(&weights), ..focused };
    basis.render(source(&scene, &aimed, &BDPT, 11), spp, &()).unwrap();
    assert_eq!(basis.effective_samples(), (2 + spp) * n as u32);
    let mut random = Random::new(&[45]);
    let lightings: Vec<Lighting> =
        values().iter().map(|&v| random_lighting(&scene, &mut random, v)).collect();
    let threshold = sidak_z(0.01, lightings.len() * (layout.n_pixels() + 1));
    for (k, x) in lightings.iter().enumerate() {
        let direct: Vec<Vec<f64>> = (0..n)
            .map(|i| source(&scene, &plan, &BDPT, (2000 * (k + 1) + i) as u64))
            .map(|source| feathered(source, &layout, x, spp / 2))
            .collect();
        let (worst, total) = compare(&recombined(&basis, x), &direct);
        println!("v {:.2}: worst z {worst:.2}, picture z {total:.2}", x.value);
        assert!(worst < threshold && total.abs() < threshold, "{x:?}");
    }
}

/// A basis whose knots and samples lie around the lights found, as a run makes it to refine its search: there
/// it shows what a render of those lights shows, whose edges are not feathered, and with less error than the
/// basis of all lights from as many samples.
#[test]
fn a_refocused_basis_shows_its_lights_with_less_error_than_one_of_all_lights() {
    /// Reach of dense knots and samples about a size, and knots of a size, as in a run.
    const REACH: f64 = 0.35;
    const KNOTS: usize = 16;
    let scene = scene();
    let (n, spp, n_direct) = (16, 16, 16);
    let everywhere = layout(&scene, BDPT.max_depth);
    let open = open_plan(&scene);
    let mut unfocused = TransportBasis::new(everywhere.clone(), n);
    unfocused.render(source(&scene, &open, &BDPT, 12), spp, &()).unwrap();
    let mut random = Random::new(&[46]);
    // Small lamps, as looks ask for, of which one is off; and any.
    let mut small = random_lighting(&scene, &mut random, 0.6);
    small.size.iter_mut().for_each(|s| *s = 0.15 + 0.25 * *s);
    small.radiance[3] = 0.0;
    let lightings = [small, random_lighting(&scene, &mut random, 1.0)];
    let threshold = sidak_z(0.01, lightings.len() * (everywhere.n_pixels() + 1));
    for (k, x) in lightings.iter().enumerate() {
        let mut plan = plan_of_sizes(&scene, LARGEST_VALUE, |l| {
            SizeDensity::focused(SIZES, &[((x.size[l] * (1.0 + REACH)) as f32, 1.0)])
        });
        let [least, largest] = SIZES.map(f64::from);
        let around = |l: usize| Knots::around(least, largest, &[x.size[l]], REACH, KNOTS);
        let shares = unfocused.shares(x);
        plan.lights = LightSampler::new(&shares.iter().map(|s| 0.05 + s.sqrt() as f32).collect::<Vec<_>>());
        let mut focused = TransportBasis::new(layout_of(&scene, BDPT.max_depth, around), n);
        focused.render(source(&scene, &plan, &BDPT, 13 + k as u64), spp, &()).unwrap();

        let subject = Subject::lit(&scene, x.clone()).with_camera_subpaths(CAMERA_SUBPATHS);
        let direct: Vec<Vec<f64>> = (0..n_direct)
            .map(|i| {
                let seed = 3000 * (k as u64 + 1) + i;
                let samples = Samples { sampler: SamplerKind::Sobol, seed, first: 0, count: 64 };
                let rgb = subject.render(&BDPT, samples).rgb;
                rgb.into_iter().map(math::display::luminance).collect()
            })
            .collect();
        let images = recombined(&focused, x);
        let (worst, total) = compare(&images, &direct);
        println!("lighting {k}: worst z {worst:.2}, picture z {total:.2} of {threshold:.2}");
        assert!(worst < threshold && total.abs() < threshold, "{x:?}");

        // Of two independent truths each takes one factor of a squared error: their noise has no part in it.
        let truths: [Vec<f64>; 2] = std::array::from_fn(|h| {
            let half = direct.iter().skip(h).step_by(2);
            half.fold(vec![0.0; direct[0].len()], |mut sum, image| {
                sum.iter_mut().zip(image).for_each(|(s, v)| *s += 2.0 * v / n_direct as f64);
                sum
            })
        });
        let errors = |images: &[Vec<f64>]| {
            let mut moments = Moments::default();
            for image in images {
                let squares =
                    image.iter().zip(&truths[0]).zip(&truths[1]).map(|((v, a), b)| (v - a) * (v - b));
                moments.push(squares.sum::<f64>() / image.len() as f64);
            }
            moments
        };
        let (near, far) = (errors(&images), errors(&recombined(&unfocused, x)));
        let z = (far.mean() - near.mean()) / (far.variance_of_mean() + near.variance_of_mean()).sqrt();
        println!(
            "lighting {k}: error {:.5} after, {:.5} before, z {z:.1}",
            near.mean().sqrt(),
            far.mean().sqrt()
        );
        assert!(z > 4.0, "lighting {k}: {z}");
    }
}

/// One render of several lightings, at sizes and background values of their own, against a
/// render of each.
#[test]
fn lightings_rendered_together_equal_renders_of_each() {
    const N: usize = 3;
    for integrator in [PATH, BDPT] {
        let scene = scene();
        let (n, spp) = (24, 32);
        let mut random = Random::new(&[7]);
        // The first value is the largest.
        let lightings = [1.1, 0.6, 0.0].map(|v| random_lighting(&scene, &mut random, v));
        let size = scene.camera.size();
        let n_pixels = size.element_product() as usize;
        let samples = |seed: u64| Samples { sampler: SamplerKind::Sobol, seed, first: 0, count: spp };
        let image = |sum: &dyn Fn(usize) -> [f64; 3]| -> Vec<f64> {
            let pixel = |p| math::display::luminance(sum(p).map(|v| (v / f64::from(spp)) as f32));
            (0..n_pixels).map(pixel).collect()
        };

        let one_of = |l: usize| {
            let sizes = lightings.each_ref().map(|x| (x.size[l] as f32, 1.0 + x.radiance[l] as f32));
            SizeDensity::one_of(&sizes)
        };
        let shared = plan_of_sizes(&scene, 1.1, one_of);
        let view = View { scene: &scene, camera: &scene.camera };
        let nodes = Values::<N>(std::array::from_fn(|k| lightings[k].value as f32));
        let mut together = vec![Vec::new(); N];
        for seed in 0..n {
            let mut film = RgbFilm::by_lighting(size, &lightings.each_ref());
            integrator.render_values(view, &nodes, &shared, &mut film, &[samples(seed)], &()).unwrap();
            for (k, images) in together.iter_mut().enumerate() {
                images.push(image(&|p| film.sum(p, k)));
            }
        }
        let threshold = sidak_z(0.01, N * (n_pixels + 1));
        for (k, x) in lightings.iter().enumerate() {
            let subject = Subject::lit(&scene, x.clone()).with_camera_subpaths(CAMERA_SUBPATHS);
            let each: Vec<Vec<f64>> = (0..n)
                .map(|seed| {
                    let picture = subject.render(&integrator, samples(1000 + seed));
                    picture.rgb.iter().map(|&rgb| math::display::luminance(rgb)).collect()
                })
                .collect();
            let (worst, total) = compare(&together[k], &each);
            println!("{:?} lighting {k}: worst z {worst:.2}, picture z {total:.2}", integrator.kind);
            assert!(worst < threshold && total.abs() < threshold, "{:?} {x:?}", integrator.kind);
        }
    }
}

/// Worst deviate of a pixel and that of the picture, Student-corrected.
pub fn compare(a: &[Vec<f64>], b: &[Vec<f64>]) -> (f64, f64) {
    let moments = |images: &[Vec<f64>], f: &dyn Fn(&Vec<f64>) -> f64| {
        let mut m = Moments::default();
        images.iter().for_each(|i| m.push(f(i)));
        m
    };
    let variance =
        |p: usize| moments(a, &|i| i[p]).variance_of_mean() + moments(b, &|i| i[p]).variance_of_mean();
    let mut all: Vec<f64> = (0..a[0].len()).map(variance).collect();
    all.sort_by(f64::total_cmp);
    let floor = all[all.len() / 2];
    let deviate = |f: &dyn Fn(&Vec<f64>) -> f64, floor: f64| {
        let (ma, mb) = (moments(a, f), moments(b, f));
        let v = (ma.variance_of_mean() + mb.variance_of_mean()).max(floor);
        normal_deviate((ma.mean() - mb.mean()) / v.sqrt(), (a.len() + b.len() - 2) as f64)
    };
    let worst = (0..a[0].len()).map(|p| deviate(&|i| i[p], floor).abs()).fold(0.0, f64::max);
    (worst, deviate(&|i| i.iter().sum(), 0.0))
}

/// The images of a lighting, and the derivatives of the sum of their products with `adjoints`.
fn differentiated(
    tables: &impl Tables,
    x: &Lighting,
    adjoints: &[Vec<f64>],
) -> (Vec<Vec<f64>>, LightingGradient) {
    let r = Recombination::new(tables.layout(), x);
    let mut g = [LightingGradient::zero(x.radiance.len())];
    let mut tangents = Tangents::default();
    let of_replicate = |(i, adjoint): (usize, &Vec<f64>)| {
        let mut image = vec![0.0; tables.layout().n_pixels()];
        tables.differentiate(i, &r, &mut image, &mut tangents);
        tangents.pull_back(&[adjoint], &mut g);
        image
    };
    let images = adjoints.iter().enumerate().map(of_replicate).collect();
    let [g] = g;
    (images, g)
}

#[test]
fn around_a_value_the_linearised_basis_is_the_basis() {
    let scene = scene();
    let plan = open_plan(&scene);
    let layout = layout(&scene, BDPT.max_depth);
    let mut basis = TransportBasis::new(layout, 2);
    let source = source(&scene, &plan, &BDPT, 8);
    basis.render(source, 2, &()).unwrap();
    let mut random = Random::new(&[44]);
    let n = basis.layout().n_pixels();
    let adjoints: Vec<Vec<f64>> =
        (0..2).map(|_| (0..n).map(|_| f64::from(random.range(-1.0, 1.0))).collect()).collect();
    for value_at in [0.0, 0.4, f64::from(LARGEST_VALUE)] {
        let mut linearised = Linearised::new(&basis, value_at);
        // One after the other: cells are added to those that are there.
        for _ in 0..3 {
            let x = random_lighting(&scene, &mut random, value_at);
            let (images, g) = differentiated(&basis, &x, &adjoints);
            linearised.prepare(&x);
            let (near_images, near_g) = differentiated(&linearised, &x, &adjoints);
            let brightest = images.iter().flatten().fold(0.0_f64, |m, v| m.max(*v));
            for (a, b) in images.iter().flatten().zip(near_images.iter().flatten()) {
                assert!((a - b).abs() < 1e-6 * brightest, "{value_at}: {a} {b}");
            }
            let all = |g: &LightingGradient| [&g.radiance[..], &g.size[..], &[g.value]].concat();
            let (g, near_g) = (all(&g), all(&near_g));
            let scale = g.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            for (a, b) in g.iter().zip(&near_g) {
                assert!((a - b).abs() < 1e-5 * scale, "{value_at}: {g:?} {near_g:?}");
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_the_recombination() {
    let scene = scene();
    let plan = open_plan(&scene);
    let layout = layout(&scene, BDPT.max_depth);
    let mut basis = TransportBasis::new(layout, 2);
    let source = source(&scene, &plan, &BDPT, 7);
    basis.render(source, 2, &()).unwrap();
    let mut random = Random::new(&[43]);
    let n = basis.layout().n_pixels();
    let adjoints: Vec<Vec<f64>> =
        (0..2).map(|_| (0..n).map(|_| f64::from(random.range(-1.0, 1.0))).collect()).collect();
    let value = |x: &Lighting| -> f64 {
        let images = recombined(&basis, x);
        images.iter().zip(&adjoints).flat_map(|(y, a)| y.iter().zip(a)).map(|(y, a)| y * a).sum()
    };
    for value_at in [0.0, 0.4, f64::from(LARGEST_VALUE)] {
        let x = random_lighting(&scene, &mut random, value_at);
        let (_, g) = differentiated(&basis, &x, &adjoints);
        let scale = g.radiance.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let check = |what: &str, found: f64, at: &dyn Fn(f64) -> Lighting| {
            let h = 1e-5;
            let difference = (value(&at(h)) - value(&at(-h))) / (2.0 * h);
            assert!(
                (found - difference).abs() < 1e-6 * scale.max(found.abs()),
                "{what}: {found} {difference}"
            );
        };
        for l in 0..scene.lights.len() {
            check("radiance", g.radiance[l], &|h| {
                let mut x = x.clone();
                x.radiance[l] += h;
                x
            });
            check("size", g.size[l], &|h| {
                let mut x = x.clone();
                x.size[l] += h;
                x
            });
        }
        check("value", g.value, &|h| Lighting { value: x.value + h, ..x.clone() });
    }
}

#[test]
fn halves_are_the_means_of_every_other_replicate() {
    let scene = scene();
    let plan = open_plan(&scene);
    let layout = layout(&scene, PATH.max_depth);
    let mut random = Random::new(&[11]);
    let x = random_lighting(&scene, &mut random, 0.5);
    for n in [3, 4] {
        let mut basis = TransportBasis::new(layout.clone(), n);
        let source = source(&scene, &plan, &PATH, 5);
        basis.render(source, 1, &()).unwrap();
        let (all, halves) = (recombined(&basis, &x), recombined(&basis.halves(), &x));
        if n == 3 {
            assert_eq!(all, halves);
            continue;
        }
        for (i, half) in halves.iter().enumerate() {
            let largest = half.iter().copied().fold(0.0, f64::max);
            assert!(largest > 0.0);
            for (p, y) in half.iter().enumerate() {
                let mean = 0.5 * (all[i][p] + all[i + 2][p]);
                assert!((y - mean).abs() < 1e-6 * largest, "{y} {mean}");
            }
        }
    }
}

#[test]
fn a_furnace_has_the_powers_of_its_albedo_as_coefficients() {
    let (albedo, max_depth) = (0.7, 6);
    let scene = scenes::furnace(albedo).with_background(vec![0]);
    let plan = Subject::new(&scene).with_camera_subpaths(CAMERA_SUBPATHS).plan;
    for base in [PATH, BDPT] {
        let integrator = Integrator { max_depth, ..base };
        let sizes = scene.lights.iter().map(|_| SizeBins::Fixed(1.0)).collect();
        let layout = Layout::new(scene.camera.size(), sizes, ValueNodes::new(1.0, max_depth));
        let mut basis = TransportBasis::new(layout, 24);
        let source = source(&scene, &plan, &integrator, 8);
        basis.render(source, 64, &()).unwrap();
        let nodes = ValueNodes::new(1.0, max_depth);
        let mut moments = vec![Moments::default(); max_depth];
        for r in 0..24 {
            let at_nodes: Vec<f64> = nodes
                .values()
                .iter()
                .map(|&value| {
                    let x = Lighting { value, ..Lighting::authored(&scene) };
                    let image = &recombined(&basis, &x)[r];
                    image.iter().sum::<f64>() / image.len() as f64
                })
                .collect();
            for (m, c) in moments.iter_mut().zip(nodes.coefficients(&at_nodes)) {
                m.push(c);
            }
        }
        for (k, m) in moments.iter().enumerate() {
            let expected = f64::from(albedo).powi(k as i32);
            let z = (m.mean() - expected) / m.variance_of_mean().sqrt().max(1e-6);
            println!("{:?} C_{k} = {:.5} expected {expected:.5} z {z:.2}", integrator.kind, m.mean());
            assert!(z.abs() < sidak_z(0.01, 2 * max_depth));
        }
    }
}

#[test]
fn no_radiance_is_exactly_black_and_the_threads_do_not_matter() {
    let scene = scene();
    let plan = open_plan(&scene);
    let layout = layout(&scene, BDPT.max_depth);
    let source = source(&scene, &plan, &BDPT, 9);
    let render = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut basis = TransportBasis::new(layout.clone(), 2);
        pool.install(|| basis.render(source, 2, &()).unwrap());
        basis
    };
    let (one, three) = (render(1), render(3));
    let mut x = random_lighting(&scene, &mut Random::new(&[44]), 0.7);
    assert_eq!(recombined(&one, &x), recombined(&three, &x));
    assert_eq!(one.picture(&x).rgb, three.picture(&x).rgb);
    x.radiance.fill(0.0);
    assert!(recombined(&one, &x).iter().flatten().all(|&v| v == 0.0));
}
