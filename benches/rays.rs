//! How many rays a second: closest hits and occlusion, incoherent, on one thread.
//!
//! The scene is a closed room around a bumpy ball of 130,000 triangles. Rays join random points of
//! the room, open-ended for closest hits and up to the second point for occlusion.

use std::f32::consts::{PI, TAU};
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use lightopt_embree::embree::{Accel, Ray, TriangleMesh, isa, version};

const N_RAYS: u32 = 1 << 14;
const N_THETA: u32 = 256;
const N_PHI: u32 = 256;

fn ball() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let point = |i: u32, j: u32| {
        let (theta, phi) = (PI * i as f32 / N_THETA as f32, TAU * j as f32 / N_PHI as f32);
        let r = 0.5 + 0.03 * (20.0 * theta).sin() * (20.0 * phi).cos();
        r * Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let id = |i, j| i * (N_PHI + 1) + j;
    let positions = (0..=N_THETA).flat_map(|i| (0..=N_PHI).map(move |j| point(i, j)));
    let cells = (0..N_THETA).flat_map(|i| (0..N_PHI).map(move |j| (i, j)));
    let indices = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [id(i, j), id(i, j + 1), id(i + 1, j), id(i + 1, j + 1)];
        [[a, b, c], [b, d, c]]
    });
    (positions.collect(), indices.collect())
}

fn room() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
    let walls = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 3, 5, 7]];
    let indices = walls.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [b, d, c]]);
    ((0..8).map(corner).collect(), indices.collect())
}

/// Points of the room outside the ball, by SplitMix64.
fn points() -> impl Iterator<Item = Vec3> {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    };
    std::iter::repeat_with(move || Vec3::new(uniform(), uniform(), uniform())).filter(|p| p.length() > 0.6)
}

fn rays(c: &mut Criterion) {
    let meshes = [ball(), room()];
    let meshes = meshes.each_ref().map(|(positions, indices)| TriangleMesh { positions, indices });
    let accel = Accel::build(&meshes).expect("the scene is valid");

    let (mut from, mut to) = (points(), points().skip(7));
    let mut segment = |t_max| {
        let (org, end) = (from.next().unwrap_or_default(), to.next().unwrap_or_default());
        Ray { org, dir: end - org, t_min: 1e-4, t_max }
    };
    let closest: Vec<Ray> = (0..N_RAYS).map(|_| segment(f32::INFINITY)).collect();
    let shadow: Vec<Ray> = (0..N_RAYS).map(|_| segment(1.0 - 1e-4)).collect();

    let mut group = c.benchmark_group(format!("rays, Embree {}, {}", version(), isa()));
    group.throughput(Throughput::Elements(u64::from(N_RAYS)));
    group.bench_function("closest hit", |b| {
        b.iter(|| closest.iter().filter_map(|ray| accel.intersect(black_box(ray))).map(|h| h.t).sum::<f32>())
    });
    group.bench_function("occlusion", |b| {
        b.iter(|| shadow.iter().filter(|ray| accel.occluded(black_box(ray))).count())
    });
    group.finish();
}

criterion_group!(benches, rays);
criterion_main!(benches);
