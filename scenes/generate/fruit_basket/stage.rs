//! Table and backdrop: the background of the picture.

use std::f64::consts::PI;

use glam::DVec3;

use super::mesh::Mesh;
use super::random::noise;

/// Half-extents of the table's top in x and z, metres.
const HALF: [f64; 2] = [0.78, 0.50];
/// Position of the table's centre in z, metres: the table reaches farther before the basket than behind.
const CENTRE_Z: f64 = 0.10;
/// Thickness of the table's top, metres.
const THICKNESS: f64 = 0.036;
/// Radius of the table's rounded edge, metres.
const EDGE: f64 = 0.009;

/// Height of the table at (x, z): long swells and a fine ripple, as of hand-planed, varnished wood.
pub fn table_height(x: f64, z: f64) -> f64 {
    let swell = 0.0014 * noise(DVec3::new(x / 0.21, 0.5, z / 0.15), 11);
    let ripple = 0.00034 * noise(DVec3::new(x / 0.062, 0.5, z / 0.034), 12);
    swell + ripple
}

/// Coordinate in [-1, 1] with cells three times as fine in the middle as at the ends.
fn spread(i: usize, n: usize) -> f64 {
    let u = 2.0 * i as f64 / n as f64 - 1.0;
    u * (0.6 + 0.4 * u * u)
}

/// The table's top, rounded edge, sides and bottom.
pub fn table() -> Mesh {
    const N: [usize; 2] = [72, 52];
    let inner = [HALF[0] - EDGE, HALF[1] - EDGE];
    let top = |i: usize, j: usize| {
        let (x, z) = (inner[0] * spread(i, N[0]), CENTRE_Z + inner[1] * spread(j, N[1]));
        DVec3::new(x, table_height(x, z), z)
    };
    let mut mesh = Mesh::patch(N[1], N[0], |j, i| top(i, j), "table");
    // Four sides, each from the top's border around the edge to the bottom's border.
    let strip = |from: &dyn Fn(usize) -> DVec3, out: DVec3, n: usize| {
        Mesh::patch(
            n,
            5,
            |i, k| {
                let p = from(i);
                let (bottom, angle) = (k > 2, PI / 4.0 * (if k > 2 { k - 1 } else { k }) as f64);
                let (sin, cos) = angle.sin_cos();
                // Mitre the corners: stretch the ends of the strip outward along it.
                let along = DVec3::Y.cross(out);
                let end = match i {
                    0 => 1.0,
                    _ if i == n => -1.0,
                    _ => 0.0,
                };
                let centre = if bottom { -THICKNESS + EDGE } else { p.y - EDGE };
                p.with_y(centre + EDGE * cos) + (out + along * end) * (EDGE * sin)
            },
            "table",
        )
    };
    let (nx, nz) = (N[0], N[1]);
    mesh.append(strip(&|i| top(nx - i, nz), DVec3::Z, nx));
    mesh.append(strip(&|i| top(i, 0), -DVec3::Z, nx));
    mesh.append(strip(&|j| top(nx, j), DVec3::X, nz));
    mesh.append(strip(&|j| top(0, nz - j), -DVec3::X, nz));
    let border = (0..nx).map(|i| (i, 0)).chain((0..nz).map(|j| (nx, j)));
    let border = border.chain((1..=nx).rev().map(|i| (i, nz))).chain((1..=nz).rev().map(|j| (0, j)));
    let border: Vec<DVec3> = border.map(|(i, j)| top(i, j).with_y(-THICKNESS)).collect();
    mesh.append(Mesh::fan(&border, "table"));
    mesh
}

/// A paper sweep behind the table: wall, curve and floor, with a back side.
pub fn backdrop() -> Mesh {
    const STEPS: usize = 16;
    const WIDTH: f64 = 5.2;
    let (wall, floor, radius) = (-2.60, -0.80, 0.55);
    let mut profile = vec![(1.6, floor, 0.0), (0.4, floor, 0.0)];
    profile.extend((0..=STEPS).map(|i| {
        let a = 0.5 * PI * i as f64 / STEPS as f64;
        (wall + radius * (1.0 - a.sin()), floor + radius * (1.0 - a.cos()), a)
    }));
    profile.extend([(wall, 0.5, 0.5 * PI), (wall, 1.3, 0.5 * PI), (wall, 2.3, 0.5 * PI)]);
    let at = |i: usize, x: f64, back: f64| {
        let (z, y, a) = profile[i];
        DVec3::new(x, y - back * a.cos(), z - back * a.sin())
    };
    let last = profile.len() - 1;
    let across = |j: usize| WIDTH * (j as f64 / 12.0 - 0.5);
    let mut mesh = Mesh::patch(12, last, |j, i| at(i, across(j), 0.0), "backdrop");
    mesh.append(Mesh::patch(12, last, |j, i| at(i, -across(j), 0.02), "backdrop"));
    for side in [-0.5 * WIDTH, 0.5 * WIDTH] {
        let depth = |k: usize| 0.02 * if side < 0.0 { k as f64 } else { 1.0 - k as f64 };
        mesh.append(Mesh::patch(last, 1, |i, k| at(i, side, depth(k)), "backdrop"));
    }
    for end in [0, last] {
        let depth = |k: usize| 0.02 * if end == last { k as f64 } else { 1.0 - k as f64 };
        mesh.append(Mesh::patch(12, 1, |j, k| at(end, across(j), depth(k)), "backdrop"));
    }
    mesh
}
