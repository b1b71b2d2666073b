//! No light passes an opaque surface, neither by rounding nor through its shading.

use glam::{Quat, UVec2, Vec3};
use lightopt_embree::{
    camera::Camera,
    film::Contribution,
    integrator::{Context, Integrator, IntegratorKind, Values, bdpt, path},
    light::{Light, Shape},
    math::stats::Moments,
    sampler::{Sampler, SamplerKind},
    scene::{Mesh, Scene, material::Model, mesh::smooth_normals},
};

use crate::support::{
    compare::Subject,
    random::Random,
    scenes::{Shapes, camera, material, rectangle, sphere_light},
};

/// Width and height of the pictures, pixels.
const SIZE: u32 = 24;

/// A surface: its name, and what adds it to the shapes of a scene.
type Surface = (&'static str, fn(&mut Shapes));

/// Closed opaque surfaces around a lamp, all seen from outside with a floor and a wall that would show
/// what comes out: name, surface, and whether it is moved somewhere where no coordinate is exact.
const CLOSED: [Surface; 6] = [
    ("flat box", |s| {
        s.cuboid(Vec3::splat(-0.35), Vec3::splat(0.35), false, 0);
    }),
    ("smooth box", |s| {
        s.cuboid(Vec3::splat(-0.35), Vec3::splat(0.35), false, 0);
        smooth(&mut s.mesh);
    }),
    ("smooth ball", |s| {
        s.sphere(Vec3::ZERO, 0.35, 6, true, 0);
    }),
    ("inward flat ball", |s| {
        s.sphere(Vec3::ZERO, 0.35, 8, false, 0);
        s.mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
    }),
    // Four wedges of some 20 degrees, smooth across their edges.
    ("smooth spike", |s| {
        pyramid(s, 0.12, 0.9);
        smooth(&mut s.mesh);
    }),
    ("flat spike", |s| pyramid(s, 0.12, 0.9)),
];

/// A closed pyramid with its tip up, around the origin.
fn pyramid(s: &mut Shapes, half: f32, height: f32) {
    let base = Vec3::new(-half, -0.2, -half);
    s.quad(base, Vec3::X * (2.0 * half), Vec3::Z * (2.0 * half), 0);
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    let at = |k: usize| Vec3::new(corners[k % 4].0 * half, -0.2, corners[k % 4].1 * half);
    let tip = Vec3::Y * (height - 0.2);
    for k in 0..4 {
        let first = s.mesh.positions.len() as u32;
        let face = [at(k), at(k + 1), tip];
        let n = (face[1] - face[0]).cross(face[2] - face[0]).normalize();
        for p in face {
            s.mesh.positions.push(p);
            s.mesh.normals.push(n);
            s.mesh.uvs.push(glam::Vec2::ZERO);
        }
        s.mesh.indices.push([first, first + 1, first + 2]);
        s.mesh.materials.push(0);
        s.mesh.objects.push(0);
    }
}

/// Gives a mesh normals that are smooth across all edges.
fn smooth(mesh: &mut Mesh) {
    let normals = smooth_normals(&mesh.positions, &mesh.indices, 3.2);
    for (t, n) in mesh.indices.clone().iter().zip(normals) {
        for (i, n) in t.iter().zip(n) {
            mesh.normals[*i as usize] = n;
        }
    }
}

/// One of the closed surfaces around a lamp, turned and moved if `is_moved`, between a floor and a wall.
fn closed(shape: fn(&mut Shapes), lamp: Light, is_moved: bool, scale: f32) -> Scene {
    let mut s = Shapes::default();
    shape(&mut s);
    let turn = if is_moved { Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, -0.4) } else { Quat::IDENTITY };
    let shift = if is_moved { Vec3::new(0.31, 0.57, -0.23) } else { Vec3::Y * 0.35 };
    for p in &mut s.mesh.positions {
        *p = (turn * *p + shift) * scale;
    }
    for n in &mut s.mesh.normals {
        *n = turn * *n;
    }
    let mut lamp = lamp;
    lamp.radiance = 1e6;
    match &mut lamp.shape {
        Shape::Sphere(l) => {
            l.center = (turn * l.center + shift) * scale;
            l.radius *= scale;
        }
        Shape::Point(l) => l.position = (turn * l.position + shift) * scale,
        other => panic!("no test with {other:?}"),
    }
    s.quad(Vec3::new(-2.0, -0.3, -2.0) * scale, Vec3::Z * (4.0 * scale), Vec3::X * (4.0 * scale), 1);
    s.quad(Vec3::new(-2.0, -0.3, -1.5) * scale, Vec3::X * (4.0 * scale), Vec3::Y * (3.0 * scale), 1);
    let materials = vec![
        material("shell", Model::Plastic, [0.8; 3], 0.6),
        material("floor", Model::Diffuse, [0.8; 3], 0.0),
    ];
    let camera =
        camera(Vec3::new(0.6, 0.9, 3.2) * scale, Vec3::new(0.0, 0.35, 0.0) * scale, 30.0, (SIZE, SIZE));
    Scene::new("closed", s.mesh, materials, vec![lamp], camera).unwrap()
}

/// Numbers of contributions that carry light, and of samples, in `spp` samples a pixel by both integrators.
fn leaks(scene: &Scene, spp: u32) -> [u64; 2] {
    let subject = Subject::new(scene).with_camera_subpaths(1);
    let kinds = [IntegratorKind::Path, IntegratorKind::Bdpt];
    std::thread::scope(|threads| {
        kinds
            .map(|kind| {
                let subject = &subject;
                threads.spawn(move || {
                    let integrator = Integrator { kind, ..Integrator::default() };
                    let context = Context::new(integrator, subject.view, Values([1.0]), &subject.plan);
                    let mut n_lit = 0;
                    let mut recorder = |_: Option<glam::Vec2>, c: &Contribution| {
                        n_lit += u64::from(!c.value.is_zero());
                    };
                    let mut workspace = bdpt::Workspace::default();
                    let mut sampler = Sampler::new(SamplerKind::Sobol, 1);
                    for pixel in (0..SIZE * SIZE).map(|i| UVec2::new(i % SIZE, i / SIZE)) {
                        for index in 0..spp {
                            sampler.start(pixel, index);
                            match kind {
                                IntegratorKind::Path => {
                                    path::sample(&context, &mut sampler, pixel, &mut recorder);
                                }
                                IntegratorKind::Bdpt => {
                                    bdpt::sample(
                                        &context,
                                        &mut sampler,
                                        pixel,
                                        &mut workspace,
                                        &mut recorder,
                                    );
                                }
                            }
                        }
                    }
                    n_lit
                })
            })
            .map(|thread| thread.join().unwrap())
    })
}

/// A lamp in every closed surface, at the origin and moved: asserts that nothing of `n_paths` paths in all
/// comes out, camera and light subpaths counted.
fn assert_dark(n_paths: u64) {
    let lamps = [
        sphere_light("bulb", Vec3::new(0.0, 0.02, 0.0), 0.05),
        // As near to a face as it gets.
        sphere_light("grain", Vec3::new(0.0, -0.19, 0.0), 0.001),
    ];
    let n_scenes = CLOSED.len() * 2 * lamps.len();
    // A sample has a camera subpath, with bdpt a light subpath too.
    let spp = (n_paths / (3 * n_scenes as u64 * u64::from(SIZE * SIZE))).max(1) as u32;
    let mut failures = Vec::new();
    for (name, shape) in CLOSED {
        for lamp in &lamps {
            for is_moved in [false, true] {
                let scene = closed(shape, lamp.clone(), is_moved, 1.0);
                let [path, bdpt] = leaks(&scene, spp);
                if path + bdpt > 0 {
                    failures
                        .push(format!("{name}, {}, moved {is_moved}: {path} path, {bdpt} bdpt", lamp.name));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{spp} samples a pixel: {failures:#?}");
}

#[test]
fn no_light_leaves_a_closed_surface() {
    assert_dark(10_000_000);
}

#[test]
#[ignore = "takes minutes"]
fn no_light_leaves_a_closed_surface_in_many_more_paths() {
    assert_dark(100_000_000);
}

/// Mean over a film of what the author's lighting gives, by either integrator, and its standard error.
fn mean(scene: &Scene, kind: IntegratorKind) -> [f64; 2] {
    let subject = Subject::new(scene);
    let integrator = Integrator { kind, ..Integrator::default() };
    let measured = subject.measure(&integrator, SamplerKind::Sobol, 5, 16, 4);
    let total: &Moments = &measured.total;
    [total.mean(), total.variance_of_mean().sqrt()]
}

/// A floor under a panel of light that faces down from `light`, with an opaque plate at the height `plate`
/// of all sizes in metres.
fn plated(plate: Option<f32>, light: f32, scale: f32) -> Scene {
    let mut s = Shapes::default();
    s.quad(Vec3::new(-2.0, 0.0, -2.0) * scale, Vec3::Z * (4.0 * scale), Vec3::X * (4.0 * scale), 0);
    if let Some(y) = plate {
        let corner = Vec3::new(-2.0, 0.0, -2.0) * scale + Vec3::Y * y;
        s.quad(corner, Vec3::X * (4.0 * scale), Vec3::Z * (4.0 * scale), 0);
    }
    let mut panel = rectangle("panel", Vec3::Y * light, -Vec3::Y, 0.3 * scale, 0.3 * scale);
    panel.radiance = 1000.0;
    let camera =
        camera(Vec3::new(0.6, 0.9, 3.2) * scale, Vec3::new(0.0, 0.35, 0.0) * scale, 30.0, (SIZE, SIZE));
    Scene::new("plated", s.mesh, vec![material("gray", Model::Diffuse, [0.5; 3], 0.0)], vec![panel], camera)
        .unwrap()
}

#[test]
fn a_plate_just_before_a_light_shades_it_at_every_scale() {
    for scale in [1e-6_f32, 1e-3, 1.0, 1e3, 1e9] {
        let height = 10.0 * scale;
        for gap in [5e-4, 5e-5, 5e-6] {
            let light = height + gap * scale;
            for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
                assert_eq!(mean(&plated(Some(height), light, scale), kind)[0], 0.0, "{scale} {gap} {kind:?}");
            }
        }
    }
}

#[test]
fn a_light_on_a_surface_is_not_shaded_by_it() {
    for scale in [1e-6_f32, 1e-3, 1.0, 1e3, 1e9] {
        let height = 10.0 * scale;
        for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
            let [free, free_error] = mean(&plated(None, height, scale), kind);
            let [mounted, error] = mean(&plated(Some(height), height, scale), kind);
            // The plate sends some light back: no more than the albedo of both allows.
            let z = (mounted - free) / error.hypot(free_error);
            assert!(
                free > 0.0 && z > -4.0 && mounted < 1.1 * free,
                "{scale} {kind:?}: {mounted} against {free}"
            );
        }
    }
}

/// Just below a panel the floor sees nothing else: it shines with albedo times the panel's radiance.
#[test]
fn a_light_just_above_a_floor_lights_it_as_its_flux_says() {
    for (scale, gap) in [(1e-6_f32, 1e-5_f32), (1.0, 1e-3), (1.0, 1e-5), (1.0, 3e-6), (1e9, 1e-5)] {
        let mut s = Shapes::default();
        s.quad(Vec3::new(-2.0, 0.0, -2.0) * scale, Vec3::Z * (4.0 * scale), Vec3::X * (4.0 * scale), 0);
        let half = 0.2 * scale;
        let center = Vec3::new(1.0, gap, 0.5) * scale;
        let panel = rectangle("panel", center, -Vec3::Y, half, half);
        // Straight down on the floor within the panel's outline, through the panel, which emits downward.
        let vfov = 2.0 * (0.19_f32 / 3.0).atan().to_degrees();
        let [eye, target] = [3.0, 0.0].map(|y| Vec3::new(1.0, y, 0.5) * scale);
        let camera = Camera::new(eye, target, Vec3::Z, vfov, UVec2::splat(SIZE)).unwrap();
        let materials = vec![material("gray", Model::Diffuse, [0.5; 3], 0.0)];
        let scene = Scene::new("lying", s.mesh, materials, vec![panel], camera).unwrap();
        for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
            let [mean, error] = mean(&scene, kind);
            assert!((mean - 0.5).abs() < 4.0 * error + 0.01, "{scale} {gap} {kind:?}: {mean} ± {error}");
        }
    }
}

/// Rays that start anywhere on a triangle, needles among them, are clear of it; the margin is tested by
/// what Embree makes of a quarter of it.
#[test]
fn rays_leave_needles_and_far_triangles_clear_of_them() {
    let mut random = Random::new(&[31]);
    for _ in 0..2_000 {
        let width = 10_f32.powf(-4.0 * random.next());
        let center = random.direction() * random.range(0.0, 30.0);
        let (along, across) = (random.direction(), random.direction() * width);
        let mut mesh = Mesh::default();
        let corners = [center, center + along, center + along * random.next() + across];
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        for p in corners {
            mesh.positions.push(p);
            mesh.normals.push(n);
            mesh.uvs.push(glam::Vec2::ZERO);
        }
        mesh.indices.push([0, 1, 2]);
        mesh.materials.push(0);
        mesh.objects.push(0);
        let materials = vec![material("gray", Model::Diffuse, [0.5; 3], 0.0)];
        let scene =
            Scene::new("needle", mesh, materials, vec![], camera(Vec3::Z, Vec3::ZERO, 40.0, (4, 4))).unwrap();
        for _ in 0..20 {
            let (u, v) = (random.next(), random.next());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let target = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
            let org = target + (n + random.direction() * 0.5) * random.range(0.1, 3.0);
            let Some(hit) = scene.intersect(org, (target - org).normalize()) else { continue };
            let w = random.direction();
            let again = scene.intersect(hit.si.spawn_origin(w), w);
            assert!(again.is_none(), "width {width} at {center}");
        }
    }
}
