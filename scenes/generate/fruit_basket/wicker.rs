//! The basket: strands woven over and under stakes, twisted rim and foot, two ears.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::mesh::{Material, Mesh};
use super::random::{Rng, noise};

/// Height of the rim's centre line above the table, metres.
pub const RIM_HEIGHT: f64 = 0.104;
/// Radius of the rim's centre line, metres.
pub const RIM_RADIUS: f64 = 0.163;
/// Half thickness of the woven wall, metres.
pub const WALL: f64 = 0.0048;
/// Radius of the twisted rim, metres.
pub const RIM_THICKNESS: f64 = 0.0085;
/// Height of the upper side of the base, on which the fruit stand, metres.
pub const FLOOR: f64 = 0.052;

/// Number of upright stakes; even, so that weavers pass them outside and inside in turn.
const STAKES: usize = 32;
/// Number of weavers one above the other: 6.2 mm apart, a little less than the 6.6 mm of one.
const ROWS: usize = 15;
/// Half thickness of a weaver across the wall and along it, metres.
const STRAND: (f64, f64) = (0.0015, 0.0033);
/// Half thickness of a stake across the wall and along it, metres.
const STAKE: (f64, f64) = (0.0015, 0.0026);

/// Radius of the wall at height `s` ∈ [0, 1] between foot and rim.
fn wall_radius(s: f64) -> f64 {
    0.112 + (RIM_RADIUS - 0.112) * s + 0.010 * (PI * s).sin()
}

fn wall_height(s: f64) -> f64 {
    0.009 + (RIM_HEIGHT - 0.009) * s
}

/// Centre line of the wall in (radius, height), from foot to rim.
pub fn wall_profile() -> Vec<(f64, f64)> {
    (0..=12).map(|i| f64::from(i) / 12.0).map(|s| (wall_radius(s), wall_height(s))).collect()
}

fn polar(radius: f64, angle: f64, y: f64) -> DVec3 {
    DVec3::new(radius * angle.cos(), y, radius * angle.sin())
}

/// Outward normal of the wall at height `s`, in the half plane of `angle`.
fn wall_normal(s: f64, angle: f64) -> DVec3 {
    let d = 1e-3;
    let slope = (wall_radius(s + d) - wall_radius(s - d)) / (wall_height(s + d) - wall_height(s - d));
    polar(1.0, angle, -slope).normalize()
}

/// Weaver colours: honey with two darker bands.
fn row_material(row: usize) -> Material {
    match row {
        4 | 5 | 10 | 11 => "wicker_dark",
        _ if row % 3 == 1 => "wicker_light",
        _ => "wicker",
    }
}

/// One weaver: a closed strand that passes the stakes outside and inside in turn.
fn weaver(row: usize) -> Mesh {
    const STEPS: usize = STAKES * 4;
    let s = (row as f64 + 0.6) / (ROWS as f64 + 0.3);
    let angle = |i: usize| TAU * i as f64 / STEPS as f64;
    let wobble = |i: usize, seed| noise(polar(3.0, angle(i), 0.0), seed + row as u64);
    let path: Vec<DVec3> = (0..STEPS)
        .map(|i| {
            let over = (STAKES as f64 / 2.0 * angle(i) + PI * row as f64).cos();
            let base = polar(wall_radius(s), angle(i), wall_height(s) + 0.0004 * wobble(i, 100));
            base + wall_normal(s, angle(i)) * (STRAND.0 + STAKE.0) * over
        })
        .collect();
    let section = |i: usize, a: f64| {
        let full = 1.0 + 0.07 * wobble(i, 200);
        (STRAND.0 * full * a.cos(), STRAND.1 * full * a.sin())
    };
    Mesh::sweep(&path, |i| wall_normal(s, angle(i)), 6, true, section, row_material(row))
}

fn stake(index: usize) -> Mesh {
    let angle = TAU * index as f64 / STAKES as f64;
    let path: Vec<DVec3> =
        (0..=7).map(|i| f64::from(i) / 7.0).map(|s| polar(wall_radius(s), angle, wall_height(s))).collect();
    let section = |_, a: f64| (STAKE.0 * a.cos(), STAKE.1 * a.sin());
    Mesh::sweep(&path, |_| polar(1.0, angle, 0.0), 6, false, section, "wicker_light")
}

/// Rope of `plies` strands twisted `turns` times about a closed or open curve.
struct Rope<'a> {
    plies: usize,
    turns: f64,
    strand: f64,
    helix: f64,
    steps: usize,
    materials: &'a [Material],
}

impl Rope<'_> {
    /// `curve(t)` gives the point and one normal of the curve at t ∈ [0, 1].
    fn build(&self, joined: bool, curve: impl Fn(f64) -> (DVec3, DVec3)) -> Mesh {
        let mut mesh = Mesh::default();
        for ply in 0..self.plies {
            let last = if joined { self.steps - 1 } else { self.steps };
            let path: Vec<DVec3> = (0..=last)
                .map(|i| {
                    let t = i as f64 / self.steps as f64;
                    let (centre, normal) = curve(t);
                    let tangent = (curve(t + 1e-4).0 - curve(t - 1e-4).0).normalize();
                    let other = tangent.cross(normal);
                    let (sin, cos) = (TAU * (self.turns * t + ply as f64 / self.plies as f64)).sin_cos();
                    centre + (normal * cos + other * sin) * self.helix
                })
                .collect();
            let section = |_, a: f64| (self.strand * a.cos(), self.strand * a.sin());
            let side = |i: usize| curve(i as f64 / self.steps as f64).1 + DVec3::splat(1e-6);
            let material = self.materials[ply % self.materials.len()];
            mesh.append(Mesh::sweep(&path, side, 7, joined, section, material));
        }
        mesh
    }
}

/// An ear on the rim, at `angle`: a small rope arch leaning outward.
fn ear(angle: f64) -> Mesh {
    let outward = polar(1.0, angle, 0.0);
    let along = polar(1.0, angle + TAU / 4.0, 0.0);
    let arch = move |t: f64| {
        let (sin, cos) = (PI * t).sin_cos();
        let rise = sin.max(0.0).powf(0.75);
        let foot = polar(RIM_RADIUS, angle, RIM_HEIGHT - 0.012);
        let curve_in = outward * (-0.0125 * cos * cos);
        (foot + along * (0.062 * cos) + curve_in + (DVec3::Y * 0.070 + outward * 0.020) * rise, outward)
    };
    let rope = Rope {
        plies: 3,
        turns: 7.0,
        strand: 0.0037,
        helix: 0.0038,
        steps: 50,
        materials: &["wicker", "wicker_light"],
    };
    let mut mesh = rope.build(false, arch);
    // Bindings where the ear meets the rim.
    for side in [-1.0, 1.0] {
        let at = angle + side * 0.385;
        let binding = Rope {
            plies: 1,
            turns: 4.0,
            strand: 0.0016,
            helix: 0.0122,
            steps: 64,
            materials: &["wicker_dark"],
        };
        mesh.append(binding.build(false, |t| {
            let a = at + (t - 0.5) * 0.10;
            (polar(RIM_RADIUS, a, RIM_HEIGHT - 0.001), polar(1.0, a, 0.0))
        }));
    }
    mesh
}

/// The whole basket, standing on y = 0 about the y axis.
pub fn basket(rng: &mut Rng) -> Mesh {
    let mut mesh = Mesh::default();
    (0..ROWS).for_each(|row| mesh.append(weaver(row)));
    (0..STAKES).for_each(|index| mesh.append(stake(index)));

    let phase = rng.range(0.0, TAU);
    let ring = |radius: f64, y: f64| {
        move |t: f64| {
            let a = TAU * t + phase;
            (polar(radius, a, y), polar(1.0, a, 0.0))
        }
    };
    let rim = Rope {
        plies: 3,
        turns: 30.0,
        strand: 0.0044,
        helix: 0.0044,
        steps: 210,
        materials: &["wicker", "wicker_light", "wicker"],
    };
    mesh.append(rim.build(true, ring(RIM_RADIUS, RIM_HEIGHT)));
    let foot = Rope {
        plies: 2,
        turns: 30.0,
        strand: 0.0038,
        helix: 0.0032,
        steps: 150,
        materials: &["wicker", "wicker_dark"],
    };
    mesh.append(foot.build(true, ring(0.113, 0.007)));

    let base: Vec<Vec<DVec3>> = (1..8)
        .map(|i| {
            let (sin, cos) = (PI * f64::from(i) / 8.0).sin_cos();
            (0..40)
                .map(|j| polar(0.112 * sin.sqrt(), TAU * f64::from(j) / 40.0, FLOOR - 0.006 + 0.006 * cos))
                .collect()
        })
        .collect();
    let ends = super::mesh::Ends::Points(DVec3::Y * FLOOR, DVec3::Y * (FLOOR - 0.012));
    mesh.append(Mesh::skin(&base, ends, "wicker_dark"));
    mesh.append(ear(0.10));
    mesh.append(ear(PI + 0.10));
    mesh
}
