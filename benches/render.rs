//! Samples per second of both integrators on the fruit basket.
#![allow(missing_docs, clippy::unwrap_used)]

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::UVec2;
use lightopt_embree::{
    film::{LightState, Region, RgbFilm},
    integrator::{Integrator, IntegratorKind, Sampling},
    sampler::SamplerKind,
    scene,
};

const SPP: u32 = 4;

fn samples(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fruit_basket.obj");
    let mut scene = scene::load(&path).unwrap();
    scene.camera.resize(UVec2::new(128, 96));
    let states: Vec<LightState> =
        scene.lights.iter().map(|l| LightState { radiance: l.radiance, size: l.size }).collect();
    let mut group = c.benchmark_group("samples");
    group.sample_size(10);
    group.throughput(Throughput::Elements(u64::from(128 * 96 * SPP)));
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        let integrator = Integrator { kind, ..Integrator::default() };
        group.bench_function(BenchmarkId::new("fruit_basket", format!("{kind:?}")), |b| {
            b.iter(|| {
                let mut film = RgbFilm::new(Region::full(scene.camera.size()), &states, 1.0);
                let sampling = Sampling { sampler: SamplerKind::Sobol, seed: 0, first: 0, count: SPP };
                integrator.render(&scene, &mut film, sampling, &()).unwrap();
                film
            });
        });
    }
    group.finish();
}

criterion_group!(benches, samples);
criterion_main!(benches);
