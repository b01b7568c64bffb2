//! One prediction and one scalar update, with the state carried from step to step: latency, not throughput.
#![allow(missing_docs, reason = "criterion's macro makes a public function without docs")]

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use ohmstrain_bench_comparison::{every_nonlinear_rival, every_rival};
use ohmstrain_bench_filters::{Filter, STEPS, Visitor, every_filter, linearised};

struct Timed<'a, 'b>(&'a mut BenchmarkGroup<'b, WallTime>);

impl Visitor for Timed<'_, '_> {
    fn visit(&mut self, name: &'static str, readings: &[f64], mut filter: impl Filter) {
        assert_eq!(readings.len(), STEPS);
        self.0.bench_function(name, |bencher| {
            bencher.iter(|| {
                for reading in readings {
                    // Model and state are in memory before and after every step, as they are between readings.
                    black_box(black_box(&mut filter).step(black_box(*reading)));
                }
            });
        });
    }
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    group.throughput(Throughput::Elements(STEPS as u64));
    let mut timed = Timed(&mut group);
    every_rival(&linearised(), &mut timed);
    every_nonlinear_rival(&mut timed);
    every_filter(&mut timed);
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
