//! How many evaluations of the objective a second at the working size 128 × 96?

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lightopt_embree::objective::{Objective, Smoothing, Target};

const WIDTH: usize = 128;
const HEIGHT: usize = 96;

fn bench(c: &mut Criterion) {
    let target = Target::resolve("high-key").expect("built in");
    let mask: Vec<bool> =
        (0..WIDTH * HEIGHT).map(|i| (i % WIDTH).abs_diff(60) < 24 && (i / WIDTH).abs_diff(50) < 32).collect();
    let objective = Objective::new(&target, WIDTH, HEIGHT, &mask).expect("valid mask");
    let l: Vec<f64> = (0..WIDTH * HEIGHT).map(|i| (i as f64 * 0.618_034).fract().powf(1.5)).collect();
    let smoothing = Smoothing::with_delta(Smoothing::DELTA_FIRST);
    let mut adjoint = vec![0.0; l.len()];

    let mut group = c.benchmark_group("objective_128x96");
    group.throughput(Throughput::Elements(1)); // evaluations/s
    group.bench_function("value", |b| b.iter(|| objective.evaluate(black_box(&l)).f_q));
    group.bench_function("smooth_with_adjoint", |b| {
        b.iter(|| objective.evaluate_smooth(black_box(&l), &smoothing, Some(&mut adjoint)).f_q);
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
