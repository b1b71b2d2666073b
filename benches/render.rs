//! Samples per second of both integrators on the fruit basket.
#![allow(missing_docs, clippy::unwrap_used)]

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::UVec2;
use lightopt_embree::{
    film::RgbFilm,
    import,
    integrator::{Integrator, IntegratorKind, Samples, View},
    lighting::{Lighting, SamplingPlan},
    sampler::SamplerKind,
};

const SPP: u32 = 4;

fn benchmark(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fruit_basket.obj");
    let scene = import::load(&path).unwrap().scene;
    let camera = scene.camera.resized(UVec2::new(128, 96));
    let view = View { scene: &scene, camera: &camera };
    let lighting = Lighting::authored(&scene);
    let plan = SamplingPlan::uniform(&lighting);
    let samples = Samples { sampler: SamplerKind::Sobol, seed: 0, first: 0, count: SPP };
    let mut group = c.benchmark_group("samples");
    group.sample_size(10);
    group.throughput(Throughput::Elements(u64::from(128 * 96 * SPP)));
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        let integrator = Integrator { kind, ..Integrator::default() };
        group.bench_function(BenchmarkId::new("fruit_basket", format!("{kind:?}")), |b| {
            b.iter(|| {
                let mut film = RgbFilm::by_light(camera.size(), &lighting);
                integrator.render(view, &lighting, &plan, &mut film, samples, &()).unwrap();
                film
            });
        });
    }
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
