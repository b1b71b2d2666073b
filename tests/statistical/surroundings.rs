//! Lights at infinity, emissive meshes and point lights with a cone.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use lightopt_embree::{
    light::{Cone, Distant, Edge, Environment, Light, LightPoint, Point, Shape, SizeDensity, Surroundings},
    math::{
        luminance,
        stats::{Moments, sidak_z},
    },
};

use crate::support::{
    chi2::{Counts, sidak_level},
    random::Random,
    scenes::{Shapes, light, mesh_light, rectangle, sky},
};

const N: u32 = 1 << 18;
/// Cells of the picture of the surroundings, and a finer grid.
const COLUMNS: usize = 32;
const ROWS: usize = 16;

/// Density of the sizes of lights that are sampled at their unit size.
fn unit_size() -> SizeDensity {
    SizeDensity::uniform_area(1.0)
}

fn surroundings() -> Environment {
    let scene = Surroundings { center: Vec3::new(0.3, 1.0, 0.0), radius: 2.0, far: 9.0 };
    Environment { map: Some(sky()), rotation: 0.0, scene }
}

/// The direction at (u, v) of the picture.
fn direction(u: f64, v: f64) -> Vec3 {
    let (sin, cos) = (PI * v).sin_cos();
    let phi = 2.0 * PI * u;
    glam::DVec3::new(sin * phi.sin(), cos, -sin * phi.cos()).as_vec3()
}

/// p value of the directions sampled toward the surroundings against their
/// density times `mutation` of its height.
fn p_value(light: &Light, mutation: impl Fn(f32) -> f64) -> f64 {
    let q = unit_size();
    let mut random = Random::new(&[31]);
    let mut counts = Counts { cells: vec![0; COLUMNS * ROWS], absorbed: 0 };
    let cell = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
    for _ in 0..N {
        // None at the very pole, where rounding leaves no sine.
        let Some(s) = light.sample_li(&q, Vec3::ZERO, random.next_2d()) else {
            counts.absorbed += 1;
            continue;
        };
        let wi = s.wi;
        let u = (f64::from(wi.x).atan2(f64::from(-wi.z)) / (2.0 * PI)).rem_euclid(1.0);
        let v = f64::from(wi.y).clamp(-1.0, 1.0).acos() / PI;
        counts.cells[cell(v, ROWS) * COLUMNS + cell(u, COLUMNS)] += 1;
    }
    let n_fine = 16;
    let probabilities: Vec<f64> = (0..COLUMNS * ROWS)
        .map(|i| {
            let (x, y) = (i % COLUMNS, i / COLUMNS);
            let strip = |k: usize| {
                let v = (y as f64 + (k as f64 + 0.5) / n_fine as f64) / ROWS as f64;
                let wi = direction((x as f64 + 0.5) / COLUMNS as f64, v);
                let at = LightPoint { p: wi, n: -wi, rho: 0.0, element: 0 };
                f64::from(light.pdf_li(&q, Vec3::ZERO, &at).0) * mutation(wi.y) * (PI * v).sin()
            };
            (0..n_fine).map(strip).sum::<f64>() * 2.0 * PI * PI / (COLUMNS * ROWS * n_fine) as f64
        })
        .collect();
    counts.p_value(&probabilities)
}

#[test]
fn directions_toward_the_surroundings_follow_their_density() {
    let constant = Environment { map: None, ..surroundings() };
    let lights = [surroundings(), constant].map(|e| light("sky", Shape::Environment(e)));
    let level = sidak_level(0.01, lights.len());
    for light in &lights {
        let p = p_value(light, |_| 1.0);
        println!("p {p:.4}");
        assert!(p > level, "p {p:.1e}");
        // As if all rows of the picture covered the same solid angle.
        let wrong = p_value(light, |y| f64::from(1.0 - y * y).sqrt() * 4.0 / PI);
        assert!(wrong < level, "p {wrong:.1e}");
    }
}

#[test]
fn surroundings_are_seen_where_they_are_sampled_whatever_their_turn() {
    let q = unit_size();
    let mut random = Random::new(&[32]);
    for rotation in [0.0, 1.0, -2.5] {
        let l = light("sky", Shape::Environment(Environment { rotation, ..surroundings() }));
        for _ in 0..2000 {
            let Some(s) = l.sample_li(&q, Vec3::ONE, random.next_2d()) else { continue };
            let c = l.crossing(Vec3::ONE, s.wi, f32::INFINITY, 1.0).unwrap();
            assert!((c.radiance - s.radiance).length() < 1e-4 * s.radiance.length());
            let pdf = l.pdf_li(&q, Vec3::ONE, &c.at).0;
            assert!((pdf / s.pdf.0 - 1.0).abs() < 1e-4);
            assert!(l.crossing(Vec3::ONE, s.wi, 1e9, 1.0).is_none(), "a surface hides the sky");
        }
    }
    // A turn of +90° about +y carries what was seen toward +x to −z.
    let at = |rotation: f32, dir: Vec3| Environment { rotation, ..surroundings() }.radiance(dir);
    let turned = at(std::f32::consts::FRAC_PI_2, Vec3::NEG_Z);
    assert!((turned - at(0.0, Vec3::X)).length() < 1e-5);
}

/// A panel as two triangles of the scene and as a light of its own.
fn panel(two_sided: bool) -> (Light, Light) {
    let mut s = Shapes::default();
    s.quad(Vec3::new(-0.5, 1.0, -0.2), Vec3::X, Vec3::Z * 0.4, 0);
    let mesh = mesh_light("mesh", &s.mesh, 0..2, two_sided);
    (mesh, rectangle("rectangle", Vec3::new(0.0, 1.0, 0.0), Vec3::NEG_Y, 0.5, 0.2))
}

#[test]
fn emitted_samples_carry_the_power() {
    let cone = Cone { cos_inner: 0.9, cos_outer: 0.6, edge: Edge::Smooth };
    let scene = surroundings().scene;
    let lights = [
        light("sky", Shape::Environment(surroundings())),
        light("constant", Shape::Environment(Environment { map: None, ..surroundings() })),
        light("sun", Shape::Distant(Distant { direction: Vec3::new(0.6, -0.8, 0.0), scene })),
        light("cone", Shape::Point(Point { position: Vec3::ONE, cone: Some((Vec3::Y, cone)) })),
        panel(false).0,
        panel(true).0,
    ];
    // π R² times the integral of the radiance over all directions; the quad's π A.
    let sky: f64 = (0..512 * 256)
        .map(|i| {
            let (u, v) = ((f64::from(i % 512) + 0.5) / 512.0, (f64::from(i / 512) + 0.5) / 256.0);
            f64::from(luminance(surroundings().radiance(direction(u, v)))) * (PI * v).sin()
        })
        .sum::<f64>()
        * 2.0
        * PI
        * PI
        / (512.0 * 256.0);
    let disk = PI * 4.0;
    let expected = [sky * disk, 4.0 * PI * disk, disk, 2.0 * PI * (1.0 - 0.75), PI * 0.4, 2.0 * PI * 0.4];
    let threshold = sidak_z(0.01, lights.len());
    let q = unit_size();
    for (light, expected) in lights.iter().zip(expected) {
        let mut random = Random::new(&[33]);
        let mut m = Moments::default();
        for _ in 0..N {
            let e = light.sample_le(&q, random.next_2d(), random.next_2d());
            m.push(e.map_or(0.0, |e| {
                let (pos, dir) = light.pdf_le(&q, &e.at, e.dir);
                assert!((pos.0 / e.pdf_pos.0 - 1.0).abs() < 1e-4, "{}: {e:?} {pos:?}", light.name);
                assert!((dir.0 / e.pdf_dir.0 - 1.0).abs() < 1e-4, "{}: {e:?} {dir:?}", light.name);
                let cos = if light.is_delta() { 1.0 } else { e.at.n.dot(e.dir) };
                f64::from(luminance(e.radiance) * cos / (e.pdf_pos.0 * e.pdf_dir.0))
            }));
        }
        let z = (m.mean() - expected) / (m.variance_of_mean().sqrt() + 1e-5 * expected);
        println!("{}: {} expected {expected} z {z:.2}", light.name, m.mean());
        assert!(z.abs() < threshold, "{}", light.name);
        // The stated power rests on the means of the picture's cells: the poles are coarse.
        assert!((f64::from(light.unit_power(1.0)) / expected - 1.0).abs() < 0.02, "{}", light.name);
    }
}

#[test]
fn a_shining_quad_lights_a_point_as_a_rectangle_does() {
    let q = unit_size();
    let mut random = Random::new(&[34]);
    let references = [Vec3::new(0.2, 0.0, 0.1), Vec3::new(1.5, 0.4, -0.7), Vec3::new(0.1, 0.9, 0.0)];
    let threshold = sidak_z(0.01, references.len());
    for p in references {
        let irradiance = |light: &Light, random: &mut Random| {
            let mut m = Moments::default();
            for _ in 0..N {
                let l = light.sample_li(&q, p, random.next_2d());
                m.push(l.map_or(0.0, |l| f64::from(l.radiance.x * l.wi.y.max(0.0) / l.pdf.0)));
            }
            m
        };
        let (mesh, plain) = panel(false);
        let (a, b) = (irradiance(&mesh, &mut random), irradiance(&plain, &mut random));
        let z = (a.mean() - b.mean()) / (a.variance_of_mean() + b.variance_of_mean()).sqrt();
        println!("{p}: {} {} z {z:.2}", a.mean(), b.mean());
        assert!(z.abs() < threshold);
        // From behind: only the light of two sides is seen.
        let behind = Vec3::new(p.x, 2.0 - p.y, p.z);
        assert!(mesh.sample_li(&q, behind, Vec2::new(0.3, 0.4)).is_none());
        assert!(panel(true).0.sample_li(&q, behind, Vec2::new(0.3, 0.4)).is_some());
    }
}

#[test]
fn a_body_that_stops_rays_does_so_from_every_side() {
    let mut l = rectangle("panel", Vec3::Y, Vec3::NEG_Y, 0.5, 0.2);
    assert!(l.stop(Vec3::ZERO, Vec3::Y, 9.0).is_none(), "lights do not block unless they say so");
    l.occludes = true;
    assert_eq!(l.stop(Vec3::ZERO, Vec3::Y, 9.0), Some(1.0));
    assert_eq!(l.stop(Vec3::Y * 3.0, Vec3::NEG_Y, 9.0), Some(2.0));
    assert!(l.stop(Vec3::ZERO, Vec3::Y, 0.9).is_none());
    assert!(l.stop(Vec3::new(0.6, 0.0, 0.0), Vec3::Y, 9.0).is_none());
    assert!(!l.has_size(), "its shadow does not grow");
}
