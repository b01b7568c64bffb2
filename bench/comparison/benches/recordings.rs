//! Whole recordings: smoothing, and one pass of a calibration.
#![allow(missing_docs, reason = "criterion's macro makes a public function without docs")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::SVector;
use ohmstrain_bench_comparison::{RecordingPass, adskalman_smoother, simulated_recording, typed_kalman_smoother};
use ohmstrain_bench_filters::{linearised, readings, sensor, smoother};

const ROWS: usize = 10_000;

fn recordings(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("recording");
    group.throughput(Throughput::Elements(ROWS as u64));
    let rows = readings::<1>(ROWS);
    let vectors: Vec<SVector<f64, 1>> = rows.iter().map(|y| SVector::from([*y])).collect();
    let theirs = adskalman_smoother(&linearised());
    group.bench_function("adskalman_smoother_3", |bencher| bencher.iter(|| theirs(black_box(&vectors))));
    let theirs = typed_kalman_smoother(&linearised());
    group.bench_function("typed_kalman_smoother_3", |bencher| bencher.iter(|| theirs(black_box(&rows))));
    let ours = smoother(sensor::<1, 3>());
    group.bench_function("smoother_3", |bencher| bencher.iter(|| ours.in_place(black_box(&rows))));
    group.finish();
}

fn passes(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pass");
    let (recording, pass) = (simulated_recording(), RecordingPass::new());
    group.throughput(Throughput::Elements(1));
    group.bench_function("generic_5", |bencher| bencher.iter(|| pass.generic(black_box(&recording))));
    group.bench_function("sparse_5", |bencher| bencher.iter(|| pass.sparse(black_box(&recording))));
    group.finish();
}

criterion_group!(benches, recordings, passes);
criterion_main!(benches);
