//! Lights: sampling against density, closed forms, and the size coordinate.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};
use lightopt_embree::{
    light::{Cone, Edge, Light, LightPoint, LightSampler, Outline, Planar, Point, Shape, SizeDensity},
    math::{
        luminance,
        stats::{Moments, sidak_z},
    },
};

use crate::support::{
    chi2::{Counts, Partition, Rect, sidak_level},
    quadrature::integrate_1d,
    random::Random,
    scenes::{disk, light, rectangle, sphere_light},
};

const N: u32 = 1 << 18;
const EXTENT: f32 = 1.4;
const CONE: Cone = Cone { cos_inner: 0.9, cos_outer: 0.6, edge: Edge::Smooth };

/// Density of the sizes of lights that are sampled up to [`EXTENT`].
fn up_to_extent() -> SizeDensity {
    SizeDensity::uniform_area(EXTENT)
}

/// Lights with a size.
fn lights() -> Vec<Light> {
    let (center, normal) = (Vec3::new(0.3, 2.0, -0.4), Vec3::new(0.3, -1.0, 0.2));
    vec![
        rectangle("rectangle", center, normal, 0.5, 0.2),
        disk("disk", center, normal, 0.4, None),
        disk("spot", center, normal, 0.4, Some(CONE)),
        sphere_light("sphere", center, 0.5),
    ]
}

/// Points that see the lights: in front, aside, close, far and at a grazing angle.
fn references() -> [Vec3; 5] {
    [
        Vec3::new(0.4, 0.0, 0.1),
        Vec3::new(-1.5, 0.5, 0.7),
        Vec3::new(0.5, 1.0, -0.3),
        Vec3::new(9.0, -30.0, 4.0),
        Vec3::new(4.0, 2.9, 0.0),
    ]
}

/// Whether a reference lies within a light's cone, by its centre: none of them lies at its edge.
fn is_lit(light: &Light, reference: Vec3) -> bool {
    let Shape::Planar(Planar { center, frame, cone: Some(cone), .. }) = &light.shape else { return true };
    (reference - *center).normalize().dot(frame.n) > cone.cos_outer
}

/// Rectangles that are mapped onto a light, and back: for planar lights the
/// unit square onto the outline, with equal areas; for a sphere onto the cone
/// of directions, with equal solid angles.
struct Map<'a> {
    light: &'a Light,
    reference: Vec3,
}

const UNIT: Rect = Rect { lo: [0.0; 2], hi: [1.0; 2] };

impl Map<'_> {
    /// Point of the unit square of a direction that meets the light's plane or cone.
    fn locate(&self, wi: Vec3) -> [f64; 2] {
        let w = wi.as_dvec3();
        let extent = f64::from(EXTENT);
        match &self.light.shape {
            Shape::Planar(s) => {
                let (n, d) = (s.frame.n.as_dvec3(), (s.center - self.reference).as_dvec3());
                let x = w * (d.dot(n) / w.dot(n)) - d;
                let x = [x.dot(s.frame.s.as_dvec3()), x.dot(s.frame.t.as_dvec3())].map(|v| v / extent);
                match s.outline {
                    Outline::Rectangle { a, b } => {
                        [0.5 + 0.5 * x[0] / f64::from(a), 0.5 + 0.5 * x[1] / f64::from(b)]
                    }
                    Outline::Disk { r } => {
                        let r2 = (x[0] * x[0] + x[1] * x[1]) / f64::from(r * r);
                        [r2, 0.5 + x[1].atan2(x[0]) / (2.0 * PI)]
                    }
                }
            }
            Shape::Sphere(_) => {
                let (axis, s, t, versine) = self.cone();
                // 1 − cos from the sine, which has the digits.
                let (x, y) = (w.dot(s), w.dot(t));
                let v = (x * x + y * y) / (1.0 + w.dot(axis));
                [v / versine, 0.5 + y.atan2(x) / (2.0 * PI)]
            }
            _ => unreachable!(),
        }
    }

    /// Axis, tangents and 1 − cos of the cone of a sphere.
    fn cone(&self) -> (glam::DVec3, glam::DVec3, glam::DVec3, f64) {
        let Shape::Sphere(sphere) = &self.light.shape else { unreachable!() };
        let d = (sphere.center - self.reference).as_dvec3();
        let axis = d.normalize();
        let (s, t) = axis.any_orthonormal_pair();
        let sin2 = f64::from(sphere.radius * EXTENT).powi(2) / d.length_squared();
        (axis, s, t, sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    /// Direction of a point of the unit square, and dω over its area.
    fn direction(&self, [u, v]: [f64; 2]) -> (Vec3, f64) {
        let extent = f64::from(EXTENT);
        match &self.light.shape {
            Shape::Planar(shape) => {
                let (x, y, area) = match shape.outline {
                    Outline::Rectangle { a, b } => {
                        let (a, b) = (f64::from(a) * extent, f64::from(b) * extent);
                        (a * (2.0 * u - 1.0), b * (2.0 * v - 1.0), 4.0 * a * b)
                    }
                    Outline::Disk { r } => {
                        let r = f64::from(r) * extent;
                        let phi = 2.0 * PI * (v - 0.5);
                        (r * u.sqrt() * phi.cos(), r * u.sqrt() * phi.sin(), PI * r * r)
                    }
                };
                let d = (shape.center - self.reference).as_dvec3()
                    + shape.frame.s.as_dvec3() * x
                    + shape.frame.t.as_dvec3() * y;
                let cos = -d.normalize().dot(shape.frame.n.as_dvec3());
                (d.normalize().as_vec3(), area * cos / d.length_squared())
            }
            Shape::Sphere(_) => {
                let (axis, s, t, versine) = self.cone();
                let h = u * versine;
                let sin = (h * (2.0 - h)).sqrt();
                let phi = 2.0 * PI * (v - 0.5);
                let w = axis * (1.0 - h) + s * (sin * phi.cos()) + t * (sin * phi.sin());
                (w.as_vec3(), 2.0 * PI * versine)
            }
            _ => unreachable!(),
        }
    }
}

/// p value of `sample_li` against the density of the point that the ray
/// crosses, times `mutation` of its size coordinate and direction.
fn p_value(light: &Light, reference: Vec3, seed: u64, mutation: impl Fn(f32, Vec3) -> f32) -> f64 {
    let (map, q) = (Map { light, reference }, up_to_extent());
    let mut random = Random::new(&[11, seed]);
    let sample = |r: &mut Random| light.sample_li(&q, reference, r.next_2d()).map(|s| map.locate(s.wi));
    let pilot: Vec<_> = (0..1 << 13).filter_map(|_| sample(&mut random)).collect();
    let partition = Partition::new(UNIT, &pilot, 8, &[]);
    let probabilities: Vec<f64> = partition
        .integrals(&|x| {
            let (wi, measure) = map.direction(x);
            [light.crossing(reference, wi, f32::INFINITY, EXTENT).map_or(0.0, |c| {
                f64::from(light.pdf_li(&q, reference, &c.at).0 * mutation(c.at.rho, wi)) * measure
            })]
        })
        .iter()
        .map(|c| c[0])
        .collect();
    let mut counts = Counts::new(&partition);
    for _ in 0..N {
        match sample(&mut random) {
            // Rounding may put a sample of the rim just outside.
            Some(x) if x.iter().all(|x| (-1e-3..1.001).contains(x)) => {
                counts.cells[partition.find(x)] += 1;
            }
            _ => counts.absorbed += 1,
        }
    }
    counts.p_value(&probabilities)
}

#[test]
fn light_points_follow_their_density() {
    let (lights, references) = (lights(), references());
    let level = sidak_level(0.01, lights.len() * references.len());
    for light in &lights {
        for (i, &reference) in references.iter().enumerate().filter(|(_, r)| is_lit(light, **r)) {
            let p = p_value(light, reference, i as u64, |_, _| 1.0);
            println!("{} from {reference}: p {p:.4}", light.name);
            assert!(p > level, "{} from {reference}: p {p:.1e}", light.name);
        }
    }
}

#[test]
fn wrong_light_densities_are_rejected() {
    let (lights, references) = (lights(), references());
    let level = sidak_level(0.01, lights.len() * references.len());
    for light in &lights {
        // A size coordinate that is uniform itself, not its area.
        let p = p_value(light, references[2], 1, |rho, _| 0.5 * EXTENT / rho);
        assert!(p < level, "{}", light.name);
        let Shape::Planar(planar) = &light.shape else { continue };
        // Area taken for solid angle, but for a constant.
        let p = p_value(light, references[2], 1, |_, wi| -wi.dot(planar.frame.n));
        assert!(p < level, "{}", light.name);
    }
}

#[test]
fn a_sampled_light_point_is_the_one_that_its_ray_meets() {
    for light in lights() {
        for reference in references() {
            let q = up_to_extent();
            let mut random = Random::new(&[12]);
            let mut n = 0;
            for _ in 0..20_000 {
                let Some(s) = light.sample_li(&q, reference, random.next_2d()) else { continue };
                n += 1;
                let what = format!("{} from {reference}: {s:?}", light.name);
                let Some(c) = light.crossing(reference, s.wi, f32::INFINITY, EXTENT) else {
                    // Only the rim can be lost to rounding.
                    assert!(s.at.rho > EXTENT * (1.0 - 1e-5) || s.radiance.x < 1e-4, "{what}");
                    continue;
                };
                // Rounding of a ray's far end, by the light's cosine there; a tangent of
                // the sphere has the root of it.
                let distance = s.at.p.distance(reference);
                let cos = -s.wi.dot(s.at.n);
                let error = 1e-6 * (distance + 1.0) / cos;
                assert!((c.at.p - s.at.p).length() < error, "{what} {c:?}");
                assert!((c.t - distance).abs() < error, "{what} {c:?}");
                assert!((c.at.rho - s.at.rho).abs() < 10.0 * error, "{what} {c:?}");
                assert!((c.at.n - s.at.n).length() < 10.0 * error, "{what} {c:?}");
                assert!((c.radiance - s.radiance).abs().max_element() < 1e-5, "{what} {c:?}");
                let pdf = light.pdf_li(&q, reference, &c.at).0;
                assert!((pdf / s.pdf.0 - 1.0).abs() < 10.0 * error / cos, "{what} {c:?} {pdf}");
                // Beyond or behind the light there is nothing to meet.
                assert!(light.crossing(reference, s.wi, 0.99 * distance, EXTENT).is_none());
                assert!(light.crossing(reference, -s.wi, f32::INFINITY, EXTENT).is_none());
                assert!(
                    light
                        .crossing(s.at.p + s.wi * (0.01 + 2.0 * EXTENT), s.wi, f32::INFINITY, EXTENT)
                        .is_none()
                );
            }
            assert_eq!(n > 5_000, is_lit(&light, reference), "{} from {reference}: {n}", light.name);
            assert_eq!(n > 0, is_lit(&light, reference), "{} from {reference}: {n}", light.name);
        }
    }
}

#[test]
fn back_sides_emit_nothing() {
    for light in lights() {
        let q = up_to_extent();
        let mut random = Random::new(&[13]);
        for _ in 0..20_000 {
            let e = light.sample_le(&q, random.next_2d(), random.next_2d());
            assert!(e.is_none_or(|e| e.dir.dot(e.at.n) > 0.0 && e.radiance.x > 0.0));
            let behind = match &light.shape {
                Shape::Planar(s) => {
                    let d = random.direction();
                    s.center + d * -d.dot(s.frame.n).signum() * random.range(0.01, 3.0)
                }
                Shape::Sphere(s) => {
                    s.center + random.direction() * random.range(0.0, EXTENT * s.radius * 0.999)
                }
                _ => unreachable!(),
            };
            assert!(light.sample_li(&q, behind, random.next_2d()).is_none(), "{} {behind}", light.name);
            assert!(light.crossing(behind, random.direction(), f32::INFINITY, EXTENT).is_none());
        }
    }
}

/// What a test expects of a light against the mean of samples of it.
struct Expectation {
    what: String,
    expected: f64,
    measured: Moments,
}

/// Z-tests of all, at level 0.01 with Šidák correction.
fn judge(all: &[Expectation]) {
    let threshold = sidak_z(0.01, all.len());
    let mut failures = Vec::new();
    for Expectation { what, expected, measured } in all {
        // Samples without variance differ by f32 rounding alone.
        let sd = measured.variance_of_mean().sqrt() + 1e-6 * expected;
        let z = (measured.mean() - expected) / sd;
        println!("{what}: {:.6} ± {sd:.6}, expected {expected:.6}, z {z:.2}", measured.mean());
        if z.abs() > threshold {
            failures.push(format!("{what}: {} ± {sd}, expected {expected}, z {z:.2}", measured.mean()));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Sizes at which lights that are sampled up to [`EXTENT`] are looked at.
const SIZES: [f32; 4] = [0.2, 0.7, 1.0, EXTENT];

#[test]
fn emitted_samples_carry_the_power_of_every_size() {
    let mut all = Vec::new();
    let mut lights = lights();
    lights.push(light("point", Shape::Point(Point::isotropic(Vec3::ONE))));
    let hard = Cone { cos_inner: 0.8, cos_outer: 0.8, edge: Edge::Smooth };
    lights.push(disk("hard spot", Vec3::ZERO, Vec3::Z, 0.3, Some(hard)));
    for light in &mut lights {
        light.color = Vec3::new(1.2, 0.9, 1.0);
        let q = up_to_extent();
        let mut random = Random::new(&[14]);
        let mut by_size = SIZES.map(|_| Moments::default());
        for _ in 0..N {
            let e = light.sample_le(&q, random.next_2d(), random.next_2d());
            if let Some(e) = &e {
                let (pos, dir) = light.pdf_le(&q, &e.at, e.dir);
                assert!((pos.0 / e.pdf_pos.0 - 1.0).abs() < 1e-5, "{}: {e:?}", light.name);
                // At the horizon the cosine, a square root, has the root of its rounding.
                let error = (dir.0 - e.pdf_dir.0).abs() / e.pdf_dir.0;
                let cos = if light.is_delta() { 1.0 } else { e.dir.dot(e.at.n) };
                assert!(error < 1e-6 / (cos * cos), "{}: {e:?} {dir:?}", light.name);
                assert!((e.dir.length() - 1.0).abs() < 1e-5);
                assert!(e.at.rho <= EXTENT);
            }
            for (m, s) in by_size.iter_mut().zip(SIZES) {
                m.push(e.as_ref().filter(|e| e.at.rho <= s).map_or(0.0, |e| {
                    let cos = if light.is_delta() { 1.0 } else { e.at.n.dot(e.dir) };
                    f64::from(luminance(e.radiance) * cos / (e.pdf_pos.0 * e.pdf_dir.0))
                }));
            }
        }
        for (measured, s) in by_size.into_iter().zip(SIZES) {
            let what = format!("power of {} at {s}", light.name);
            all.push(Expectation { what, expected: f64::from(light.unit_power(s)), measured });
        }
    }
    judge(&all);
    // The closed forms themselves.
    let power = |name: &str| {
        f64::from(lights.iter().find(|l| l.name == name).unwrap().unit_power(0.5))
            / f64::from(luminance(lights[0].color))
    };
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
    close(power("rectangle"), PI * 0.5 * 0.2);
    close(power("disk"), PI * PI * 0.2 * 0.2);
    close(power("sphere"), 4.0 * PI * PI * 0.25 * 0.25);
    close(power("point"), 4.0 * PI);
    close(power("hard spot"), PI * (1.0 - 0.64) * PI * 0.15 * 0.15);
    let cone = integrate_1d(0.6, 1.0, 400, |c| 2.0 * PI * profile(c) * c);
    close(power("spot"), cone * PI * 0.2 * 0.2);
}

#[test]
fn a_cone_that_falls_off_squared_has_the_power_of_its_profile() {
    let cone = Cone { edge: Edge::Squared, ..CONE };
    let squared = |c: f64| {
        let x = (c - f64::from(cone.cos_outer)) / f64::from(cone.cos_inner - cone.cos_outer);
        x.clamp(0.0, 1.0).powi(2)
    };
    let point = Shape::Point(Point { position: Vec3::ONE, cone: Some((Vec3::Z, cone)) });
    for (light, weight) in [
        (light("point", point), (|_| 1.0) as fn(f64) -> f64),
        (disk("disk", Vec3::ZERO, Vec3::Z, 0.3, Some(cone)), |c| c * PI * 0.3 * 0.3),
    ] {
        let exact = integrate_1d(0.6, 1.0, 400, |c| 2.0 * PI * squared(c) * weight(c));
        let power = f64::from(light.unit_power(1.0)) / f64::from(luminance(light.color));
        assert!((power / exact - 1.0).abs() < 1e-5, "{} {power} {exact}", light.name);
        // What samples of its emission carry is that power too.
        let q = SizeDensity::uniform_area(1.0);
        let mut random = Random::new(&[15]);
        let mut carried = Moments::default();
        for _ in 0..N {
            let e = light.sample_le(&q, random.next_2d(), random.next_2d());
            carried.push(e.map_or(0.0, |e| {
                let cos = if e.at.n == Vec3::ZERO { 1.0 } else { e.dir.dot(e.at.n) };
                f64::from(luminance(e.radiance) * cos / (e.pdf_pos.0 * e.pdf_dir.0))
            }));
        }
        let sd = carried.variance_of_mean().sqrt();
        let z = (carried.mean() - exact) / sd;
        assert!(z.abs() < sidak_z(0.01, 2), "{}: {} ± {sd}, {exact}", light.name, carried.mean());
    }
}

/// The cone's smooth step.
fn profile(cos: f64) -> f64 {
    let x = ((cos - f64::from(CONE.cos_outer)) / f64::from(CONE.cos_inner - CONE.cos_outer)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Irradiance at a point with a normal from the part ρ ≤ s of a light that is sampled up to `extent`.
fn irradiance(light: &Light, extent: f32, p: Vec3, n: Vec3, s: f32, random: &mut Random) -> Moments {
    let q = SizeDensity::uniform_area(extent);
    let mut m = Moments::default();
    for _ in 0..N / 4 {
        let sample = light.sample_li(&q, p, random.next_2d()).filter(|l| l.at.rho <= s);
        m.push(sample.map_or(0.0, |l| f64::from(luminance(l.radiance) * l.wi.dot(n).max(0.0) / l.pdf.0)));
    }
    m
}

/// Form factor of a rectangle of half-extents `a`, `b`, from a parallel facing
/// element at distance `d` below its centre: four times that of a corner
/// (C-11 of Howell's catalogue of configuration factors, renamed).
fn rectangle_form_factor(a: f64, b: f64, d: f64) -> f64 {
    let (x, y) = (a / d, b / d);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    2.0 / PI * (x / p * (y / p).atan() + y / q * (x / q).atan())
}

#[test]
fn parts_of_a_large_light_are_the_small_light() {
    let mut all = Vec::new();
    let mut random = Random::new(&[15]);
    for s in SIZES {
        let size = f64::from(s);
        for d in [0.3_f32, 1.0, 20.0] {
            let h = f64::from(d);
            let center = Vec3::Y * d;
            let r2 = (0.4 * size).powi(2);
            // A point below the centre sees the rim at this cosine.
            let cos = h / (h * h + r2).sqrt();
            let cases = [
                (
                    rectangle("rectangle", center, Vec3::NEG_Y, 0.5, 0.2),
                    rectangle_form_factor(0.5 * size, 0.2 * size, h),
                ),
                (disk("disk", center, Vec3::NEG_Y, 0.4, None), r2 / (r2 + h * h)),
                (
                    disk("spot", center, Vec3::NEG_Y, 0.4, Some(CONE)),
                    integrate_1d(cos, 1.0, 400, |c| 2.0 * profile(c) * c),
                ),
                (sphere_light("sphere", center, 0.15), (0.15 * size / h).powi(2)),
            ];
            for (light, form_factor) in cases {
                // From the large light, and from one that is sampled at this size.
                for extent in [EXTENT, s] {
                    let measured = irradiance(&light, extent, Vec3::ZERO, Vec3::Y, s, &mut random);
                    let what = format!("irradiance of {} {s} of {extent} at {d}", light.name);
                    all.push(Expectation { what, expected: PI * form_factor, measured });
                }
            }
        }
    }
    judge(&all);
}

/// A receiver that sees the light aslant, where there is no closed form.
#[test]
fn parts_of_a_large_light_are_the_small_light_from_aside() {
    let mut all = Vec::new();
    let mut random = Random::new(&[16]);
    for light in lights() {
        for reference in &references()[..3] {
            let n = Vec3::new(-0.2, 1.0, 0.1).normalize();
            for s in SIZES {
                let part = irradiance(&light, EXTENT, *reference, n, s, &mut random);
                let small = irradiance(&light, s, *reference, n, s, &mut random);
                let sd = (part.variance_of_mean() + small.variance_of_mean()).sqrt();
                all.push((format!("{} {s} from {reference}", light.name), part.mean(), small.mean(), sd));
            }
        }
    }
    let threshold = sidak_z(0.01, all.len());
    for (what, part, small, sd) in all {
        println!("{what}: {part:.6} {small:.6} ± {sd:.6}");
        assert!((part - small).abs() <= threshold * sd + 1e-6 * part, "{what}: {part} {small} ± {sd}");
    }
}

#[test]
fn far_away_only_the_power_counts() {
    // A sphere and a point are alike from all around; a disk has four times the mean
    // intensity along its axis, 4 cos θ in all, and a rectangle the same.
    let mut all = Vec::new();
    let q = SizeDensity::uniform_area(1.0);
    let mut random = Random::new(&[17]);
    let distance = 400.0;
    let expected = 1.0 / (4.0 * PI * f64::from(distance).powi(2)) * 1e6;
    for light in [
        light("point", Shape::Point(Point::isotropic(Vec3::ZERO))),
        sphere_light("sphere", Vec3::ZERO, 0.3),
        disk("disk", Vec3::ZERO, Vec3::Z, 0.3, None),
        rectangle("rectangle", Vec3::ZERO, Vec3::Z, 0.3, 0.1),
    ] {
        let scale = 1e6 / f64::from(light.unit_power(1.0));
        let gain = |w: Vec3| match light.shape {
            Shape::Planar(_) => 4.0 * f64::from(w.z.max(0.0)),
            _ => 1.0,
        };
        let irradiance_at = |p: Vec3, random: &mut Random| {
            light
                .sample_li(&q, p, random.next_2d())
                .map_or(0.0, |l| scale * f64::from(l.radiance.x * l.wi.dot(-p.normalize()) / l.pdf.0))
        };
        for w in [Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, -0.99, 0.1).normalize()] {
            let mut measured = Moments::default();
            for _ in 0..1 << 14 {
                measured.push(irradiance_at(w * distance, &mut random));
            }
            let what = format!("{} far along {w}", light.name);
            // Terms of second order in size over distance, here 10⁻⁶, remain.
            all.push(Expectation { what, expected: gain(w) * expected, measured });
        }
        let mut measured = Moments::default();
        for _ in 0..1 << 16 {
            measured.push(irradiance_at(random.direction() * distance, &mut random));
        }
        all.push(Expectation { what: format!("{} far all around", light.name), expected, measured });
    }
    judge(&all);
}

#[test]
fn lights_are_chosen_as_often_as_they_say() {
    let weights = [0.5, 3.0, 1e-3, 1.5, 2.0];
    let sampler = LightSampler::new(&weights);
    let total: f32 = weights.iter().sum();
    let probabilities: Vec<f64> = (0..weights.len()).map(|i| f64::from(sampler.pmf(i as u32).0)).collect();
    for (p, w) in probabilities.iter().zip(weights) {
        assert!((p - f64::from(w / total)).abs() < 1e-7);
    }
    assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-6);
    let mut random = Random::new(&[18]);
    let mut counts = Counts { cells: vec![0; weights.len()], absorbed: 0 };
    // What is left of the variate is uniform: for the lights chosen often enough, in tenths.
    let mut rests = vec![Counts { cells: vec![0; 10], absorbed: 0 }; weights.len()];
    for _ in 0..N {
        let (i, pmf, rest) = sampler.sample(random.next()).unwrap();
        assert_eq!(pmf, sampler.pmf(i));
        counts.cells[i as usize] += 1;
        rests[i as usize].cells[(rest * 10.0) as usize] += 1;
    }
    assert!(counts.p_value(&probabilities) > 0.01);
    for i in [0, 1, 3, 4] {
        assert!(rests[i].p_value(&[0.1; 10]) > sidak_level(0.01, 4));
    }
    assert_eq!(sampler.sample(0.0).unwrap().0, 0);
    assert_eq!(sampler.sample(lightopt_embree::math::ONE_MINUS_EPSILON).unwrap().0, 4);
    assert!(LightSampler::new(&[]).sample(0.5).is_none());
}

/// Directions of emission follow their density: a χ² over the light's own
/// hemisphere, for a point over the sphere.
#[test]
fn emitted_directions_follow_their_density() {
    let mut lights = lights();
    lights.push(light("point", Shape::Point(Point::isotropic(Vec3::ONE))));
    let level = sidak_level(0.01, lights.len());
    for light in &lights {
        let q = up_to_extent();
        let mut random = Random::new(&[19]);
        // Fixed place of emission: only the direction varies.
        let u = Vec2::new(0.3, 0.6);
        let e = light.sample_le(&q, u, Vec2::new(0.5, 0.5)).unwrap();
        let n = match &light.shape {
            Shape::Point(_) => glam::DVec3::Z,
            _ => e.at.n.as_dvec3(),
        };
        let (s, t) = n.any_orthonormal_pair();
        let locate = |w: Vec3| {
            let w = w.as_dvec3();
            [w.dot(n), w.dot(t).atan2(w.dot(s))]
        };
        let domain = Rect { lo: [-1.0, -PI], hi: [1.0, PI] };
        let sample = |r: &mut Random| light.sample_le(&q, u, r.next_2d()).map(|e| locate(e.dir));
        let pilot: Vec<_> = (0..1 << 13).filter_map(|_| sample(&mut random)).collect();
        let partition = Partition::new(domain, &pilot, 8, &[(0, 0.0)]);
        let probabilities: Vec<f64> = partition
            .integrals(&|[z, phi]| {
                let sin = (1.0 - z * z).max(0.0).sqrt();
                let dir = (n * z + s * (sin * phi.cos()) + t * (sin * phi.sin())).as_vec3();
                let rho = match &light.shape {
                    Shape::Sphere(_) => EXTENT * sin as f32,
                    _ => e.at.rho,
                };
                [f64::from(light.pdf_le(&q, &LightPoint { rho, ..e.at }, dir).1.0)]
            })
            .iter()
            .map(|c| c[0])
            .collect();
        let mut counts = Counts::new(&partition);
        for _ in 0..N {
            match sample(&mut random) {
                Some(x) => counts.cells[partition.find(x)] += 1,
                None => counts.absorbed += 1,
            }
        }
        let p = counts.p_value(&probabilities);
        println!("emission of {}: p {p:.4}, ∫pdf {:.6}", light.name, probabilities.iter().sum::<f64>());
        assert!(p > level, "{}: p {p:.1e}", light.name);
    }
}

/// ρ follows its density, whatever is in focus: a χ² over bins that end where the
/// mixture's parts do.
#[test]
fn sizes_follow_their_density() {
    let range = [0.1, 2.0];
    let densities = [
        SizeDensity::any_size(range),
        SizeDensity::focused(range, &[(0.7, 1.0)]),
        SizeDensity::focused(range, &[(1.4, 1.0), (0.2, 3.0)]),
        SizeDensity::one_of(&[(2.0, 1.0), (0.55, 0.2), (0.7, 2.0)]),
    ];
    for density in densities {
        let edges = [0.0, 0.05, 0.1, 0.2, 0.4, 0.55, 0.7, 1.0, 1.4, 1.7, 2.0_f32];
        let probabilities: Vec<f64> = edges
            .windows(2)
            .map(|e| {
                let n = 4000;
                let step = (e[1] - e[0]) / n as f32;
                let rho = |i: i32| e[0] + (i as f32 + 0.5) * step;
                (0..n).map(|i| f64::from(density.pdf_over_rho(rho(i)) * rho(i) * step)).sum()
            })
            .collect();
        assert!((probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-4, "{probabilities:?}");
        let mut below = 0.0;
        for (edge, p) in edges[1..].iter().zip(&probabilities) {
            below += p;
            assert!((f64::from(density.below(*edge)) - below).abs() < 1e-4, "{density:?} {edge}");
        }
        let mut random = Random::new(&[20]);
        let mut counts = Counts { cells: vec![0; probabilities.len()], absorbed: 0 };
        for _ in 0..N {
            let rho = density.sample(random.next());
            counts.cells[edges[1..].partition_point(|&e| e < rho)] += 1;
        }
        assert!(counts.p_value(&probabilities) > sidak_level(0.01, densities.len()), "{density:?}");
    }
}
