//! The fruit, each about its own centre with its stem toward +y.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

use super::mesh::{Ends, Material, Mesh};
use super::random::{Rng, noise, smoothstep};
use super::settle::Shape;

/// A fruit: what is seen, and what it collides with.
pub struct Fruit {
    /// The surface.
    pub mesh: Mesh,
    /// The collision shape.
    pub shape: Shape,
}

/// Skin that changes its colour gradually: the materials of the ramp's steps.
pub type Ramp = [Material; 6];

/// Green-yellow to red.
pub const RED: Ramp = ["red_1", "red_2", "red_3", "red_4", "red_5", "red_6"];
/// Green to dark crimson.
pub const CRIMSON: Ramp = ["crimson_1", "crimson_2", "crimson_3", "crimson_4", "crimson_5", "crimson_6"];
/// Yellow to orange-red.
pub const GALA: Ramp = ["gala_1", "gala_2", "gala_3", "gala_4", "gala_5", "gala_6"];
/// Yellow-green to apple green.
pub const GREEN: Ramp = ["green_1", "green_2", "green_3", "green_4", "green_5", "green_6"];
/// Pear green to yellow-green.
pub const PEAR: Ramp = ["pear_1", "pear_2", "pear_3", "pear_4", "pear_5", "pear_6"];
/// Ripe yellow to a red cheek.
pub const RIPE: Ramp = ["ripe_1", "ripe_2", "ripe_3", "ripe_4", "ripe_5", "ripe_6"];

/// Green to banana yellow.
pub const BANANA: Ramp = ["banana_1", "banana_2", "banana_3", "banana_4", "banana_5", "banana_6"];

/// Step of the ramp at `t` ∈ [0, 1]; `dither` ∈ [-1, 1] blurs the borders between steps.
fn step(ramp: &Ramp, t: f64, dither: f64) -> Material {
    ramp[((t * 6.0 + 0.7 * dither).max(0.0) as usize).min(5)]
}

fn rings(rows: usize, columns: usize, f: impl Fn(f64, f64) -> DVec3) -> Vec<Vec<DVec3>> {
    (1..rows)
        .map(|i| PI * i as f64 / rows as f64)
        .map(|t| (0..columns).map(|j| f(t, TAU * j as f64 / columns as f64)).collect())
        .collect()
}

/// A slightly bent, thickened-at-the-end stalk from `foot` along +y.
fn stalk(foot: DVec3, length: f64, radius: f64, rng: &mut Rng) -> Mesh {
    let lean = rng.direction() * DVec3::new(0.35, 0.0, 0.35);
    let path: Vec<DVec3> =
        (0..=8).map(|i| f64::from(i) / 8.0).map(|t| foot + (DVec3::Y * t + lean * t * t) * length).collect();
    let swell = |i: usize| {
        radius * (1.0 - 0.25 * (PI * i as f64 / 8.0).sin() + 0.35 * smoothstep(6.0, 8.0, i as f64))
    };
    Mesh::tube(&path, 8, swell, "stem")
}

/// Apple of radius `r`: round shoulders, a deep stem cavity, five bumps below; `rows` of
/// vertices from pole to pole.
pub fn apple(r: f64, rows: usize, skin: &Ramp, rng: &mut Rng) -> Fruit {
    let seed = rng.range(0.0, 1e6) as u64;
    let point = |t: f64, a: f64| {
        let (sin, cos) = t.sin_cos();
        let ribs = 1.0 + 0.030 * (5.0 * a).cos() * smoothstep(0.1, -1.0, cos) + 0.012 * (5.0 * a + 0.6).cos();
        let unit = DVec3::new(sin * a.cos(), cos, sin * a.sin());
        let uneven = 1.0 + 0.030 * noise(unit * 1.3, seed) + 0.012 * noise(unit * 3.1, seed + 1);
        let radius = sin * (1.0 + 0.07 * cos) * ribs * uneven;
        let cavity = |depth: f64, width: f64| depth * (-(radius / width).powi(2)).exp();
        let height = 0.90 * cos * uneven - if cos > 0.0 { cavity(0.36, 0.30) } else { -cavity(0.20, 0.24) };
        DVec3::new(radius * a.cos(), height, radius * a.sin()) * r
    };
    let pole = |t: f64| DVec3::Y * point(t, 0.0).y;
    let mut mesh = Mesh::skin(&rings(rows, rows * 3 / 2, point), Ends::Points(pole(0.0), pole(PI)), skin[3]);
    mesh.paint(|p| {
        let a = p.z.atan2(p.x);
        let streak = noise(DVec3::new(7.0 * a.cos(), p.y / r * 0.6, 7.0 * a.sin()), seed + 2);
        let patch = noise(p / r * 1.2, seed + 3);
        // Pale in the cavity, full colour from the shoulder on.
        let along = if p.y > 0.0 { p.x.hypot(p.z) / r } else { 1.0 };
        let t = smoothstep(0.10, 0.95, along + 0.20 * streak + 0.30 * patch);
        step(skin, t, noise(p / 0.003, seed + 4))
    });
    let shape = Shape::star(&mesh);
    mesh.append(stalk(pole(0.0) - DVec3::Y * 0.001, r * 0.62, 0.0015, rng));
    let calyx = |t: f64, a: f64| {
        let (sin, cos) = t.sin_cos();
        DVec3::new(sin * a.cos() * 0.004, cos * 0.002, sin * a.sin() * 0.004)
            * (1.0 + 0.3 * (5.0 * a).cos() * sin)
            + pole(PI)
    };
    mesh.append(Mesh::skin(&rings(5, 15, calyx), Ends::Points(calyx(0.0, 0.0), calyx(PI, 0.0)), "stem"));
    Fruit { mesh, shape }
}

/// Pear, `size` tall without its stem.
pub fn pear(size: f64, skin: &Ramp, rng: &mut Rng) -> Fruit {
    let seed = rng.range(0.0, 1e6) as u64;
    let bend = rng.direction() * DVec3::new(1.0, 0.0, 1.0) * 0.10 * size;
    let point = |t: f64, a: f64| {
        let (sin, cos) = t.sin_cos();
        // A sphere whose upper half is drawn out and narrowed to a neck.
        let neck = smoothstep(-0.15, 0.95, cos);
        let unit = DVec3::new(sin * a.cos(), cos, sin * a.sin());
        let uneven = 1.0 + 0.030 * noise(unit * 1.6, seed) + 0.012 * noise(unit * 4.0, seed + 1);
        let radius = 0.375 * sin * (1.0 - 0.50 * neck) * uneven * (1.0 + 0.012 * (5.0 * a).cos());
        let dimple = |depth: f64, width: f64| depth * (-(radius / width).powi(2)).exp();
        let height = if cos > 0.0 {
            0.62 * cos.powf(0.90) - dimple(0.03, 0.05)
        } else {
            0.36 * cos + dimple(0.05, 0.10)
        };
        DVec3::new(radius * a.cos(), height, radius * a.sin()) * size + bend * (height.max(0.0)).powi(2)
    };
    let mean = |t: f64| 0.5 * (point(t, 0.0) + point(t, PI));
    let mut mesh = Mesh::skin(&rings(30, 33, point), Ends::Points(mean(0.0), mean(PI)), skin[0]);
    mesh.paint(|p| {
        let cheek = p.x / size * 1.3 + 0.45 * noise(p / size * 2.4, seed + 2);
        step(skin, smoothstep(-0.25, 0.75, cheek), noise(p / 0.0025, seed + 3))
    });
    let shape = Shape::star(&mesh);
    mesh.append(stalk(mean(0.0) - DVec3::Y * 0.002, size * 0.26, 0.0017, rng));
    Fruit { mesh, shape }
}

/// Orange of radius `r` with a pitted skin; `n` cells a cube edge (see [`Mesh::star`]).
pub fn orange(r: f64, n: i32, skin: Material, rng: &mut Rng) -> Fruit {
    let seed = rng.range(0.0, 1e6) as u64;
    let radius = |d: DVec3| {
        let polar = d.y.clamp(-1.0, 1.0).acos();
        let uneven = 0.020 * noise(d * 1.4, seed) + 0.010 * noise(d * 3.0, seed + 1);
        let stem = -0.055 * (-(polar / 0.16).powi(2)).exp() - 0.025 * (-((PI - polar) / 0.14).powi(2)).exp();
        let pits = noise(d * (r / 0.0072), seed + 2).max(-0.2) + 0.4 * noise(d * (r / 0.0046), seed + 3);
        r * (1.0 - 0.035 * d.y * d.y + uneven + stem) - 0.00060 * pits
    };
    let mut mesh = Mesh::star(n, radius, skin);
    let shape = Shape::star(&mesh);
    let top = DVec3::Y * (radius(DVec3::Y) - 0.0002);
    let button = |t: f64, a: f64| {
        let (sin, cos) = t.sin_cos();
        let star = 0.0042 * (1.0 + 0.22 * (5.0 * a).cos());
        top + DVec3::new(star * sin * a.cos(), 0.0017 * cos, star * sin * a.sin())
    };
    mesh.append(Mesh::skin(&rings(6, 20, button), Ends::Points(button(0.0, 0.0), button(PI, 0.0)), "calyx"));
    Fruit { mesh, shape }
}

/// A hand of `count` bananas, its arch upward: crown at −x, tips at +x, side by side in z.
pub fn bananas(count: usize, rng: &mut Rng) -> Fruit {
    const STEPS: usize = 32;
    let mut mesh = Mesh::default();
    let mut balls = Vec::new();
    let mut necks = Vec::new();
    for index in 0..count {
        let place = index as f64 - 0.5 * (count as f64 - 1.0);
        let (bend, half) = (rng.range(0.100, 0.112), rng.range(0.80, 0.90));
        let yaw = DQuat::from_rotation_y(-place * rng.range(0.15, 0.18));
        let lift = rng.range(-0.003, 0.003) - 0.004 * place * place;
        let path: Vec<DVec3> = (0..=STEPS)
            .map(|i| i as f64 / STEPS as f64)
            .map(|t| {
                // Straighter toward the crown than toward the tip.
                let a = half * (2.0 * t - 1.0) + 0.18 * (1.0 - t).powi(3);
                let arc = DVec3::new(
                    bend * (a.sin() + 0.78),
                    bend * (a.cos() - 0.7) + lift * smoothstep(0.0, 0.3, t),
                    0.0,
                );
                let aside = place * (0.0068 + 0.0170 * smoothstep(0.02, 0.26, t));
                yaw * arc + DVec3::new(-0.78 * bend, 0.0, aside)
            })
            .collect();
        let girth = move |i: usize| {
            let t = i as f64 / STEPS as f64;
            let body = smoothstep(0.05, 0.30, t) * (1.0 - smoothstep(0.74, 0.965, t));
            0.0046 + 0.0128 * body.powf(0.8) - 0.0012 * smoothstep(0.97, 1.0, t)
        };
        let turn = rng.range(0.0, TAU);
        let section = move |i: usize, a: f64| {
            // A pentagon with soft edges; no facets where neck and tip are round.
            let facets = 0.072 * smoothstep(0.006, 0.014, girth(i));
            let a5 = (5.0 * (a + 0.1 * turn)).cos();
            let r = girth(i) * (1.0 + facets * (a5 + 0.25 * a5 * a5));
            (r * a.cos(), r * a.sin())
        };
        let mut banana = Mesh::sweep(&path, |_| yaw * DVec3::Z, 20, false, section, BANANA[5]);
        let (neck, tip) = (path[0], path[STEPS]);
        necks.push(neck);
        let seed = rng.range(0.0, 1e6) as u64;
        let ripe = if index % 2 == 0 { 1.0 } else { 0.86 };
        banana.paint(|p| {
            let (from_neck, from_tip) = (p.distance(neck), p.distance(tip));
            let uneven = noise(p / 0.012, seed);
            if from_tip < 0.0095 + 0.001 * uneven {
                return "banana_tip";
            }
            let stem = smoothstep(0.012, 0.050, from_neck + 0.006 * uneven);
            let end = smoothstep(0.006, 0.034, from_tip + 0.004 * uneven);
            step(&BANANA, ripe * stem * (0.35 + 0.65 * end), noise(p / 0.003, seed + 1))
        });
        mesh.append(banana);
        balls.extend((1..STEPS).step_by(2).map(|i| (path[i], girth(i))));
    }
    // The crown holds the necks together and ends in a dark cut.
    let centre = necks.iter().sum::<DVec3>() / count as f64 - DVec3::X * 0.003;
    let half_width = 0.0034 * (count as f64 - 1.0) + 0.0065;
    let crown = |t: f64, a: f64| {
        let (sin, cos) = t.sin_cos();
        let across = sin.sqrt();
        centre + DVec3::new(0.012 * across * a.cos(), 0.0078 * across * a.sin(), half_width * cos)
    };
    let poles = Ends::Points(crown(0.0, 0.0), crown(PI, 0.0));
    let mut stub = Mesh::skin(&rings(12, 16, crown), poles, BANANA[0]);
    stub.paint(|p| if p.x < centre.x - 0.007 { "banana_tip" } else { BANANA[0] });
    mesh.append(stub);
    Fruit { mesh, shape: Shape::Balls(balls) }
}

/// One grape of radius `r`, a little longer than wide.
pub fn grape(r: f64, skin: Material) -> Mesh {
    let point =
        |t: f64, a: f64| DVec3::new(t.sin() * a.cos(), 1.10 * t.cos(), t.sin() * a.sin()) * (r * 0.985);
    Mesh::skin(&rings(10, 13, point), Ends::Points(point(0.0, 0.0), point(PI, 0.0)), skin)
}

/// A leaf of `length` from the origin along +x, its face up, drooping at the tip.
pub fn leaf(length: f64, droop: f64, skin: Material) -> Mesh {
    const STEPS: usize = 18;
    let width = |t: f64| 0.23 * length * (PI * t.powf(0.82)).sin().max(0.0).powf(0.75) + 0.0014;
    // `lift` parts the two sides; they meet in a crease along the outline.
    let point = |i: usize, k: i32, lift: f64| {
        let (t, u) = (i as f64 / STEPS as f64, f64::from(k) / 6.0);
        // Waves, vein and thickness shrink with the leaf.
        let size = (width(t) / 0.012).min(1.0);
        let wave = 0.0016 * size * (9.0 * PI * t + u.abs()).sin() * u * u;
        let vein = -0.0009 * size * (-(u / 0.12).powi(2)).exp();
        let ends = if i == 0 || i == STEPS { 0.0 } else { size };
        let thick = lift * ends * (1.0 - u * u);
        DVec3::new(
            t * length - 0.2 * width(t) * u * u * t,
            0.22 * u.abs() * width(t) + wave + vein + thick - droop * t * t * length,
            u * width(t),
        )
    };
    let mut mesh = Mesh::patch(12, STEPS, |k, i| point(i, k as i32 - 6, 0.00035), skin);
    mesh.append(Mesh::patch(STEPS, 12, |i, k| point(i, k as i32 - 6, -0.00035), skin));
    let petiole =
        [DVec3::new(-0.014, -0.004, 0.0), DVec3::new(-0.007, -0.001, 0.0), DVec3::new(0.004, 0.0, 0.0)];
    mesh.append(Mesh::tube(&petiole, 6, |_| 0.0009, "stem"));
    mesh
}
