//! Many sensors of one kind: time per sensor and tick. Here it is throughput that counts: the sensors do not wait for each
//! other.
#![allow(missing_docs, reason = "criterion's macro makes a public function without docs")]

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use ohmstrain_bench_filters::{DT_S, STEPS, readings, sensor_of};
use ohmstrain_ekf::{Bank, Belief, Compact, Lane, Reading, SparseEkf};

const SENSORS: usize = 64;

/// What every sensor reads at a tick: each is at another place of its period.
fn tick<T: Lane>(recording: &[f64], k: usize) -> [T; SENSORS] {
    std::array::from_fn(|sensor| T::of(recording[(k + 7 * sensor) % STEPS]))
}

fn one_kind<T: Lane>(group: &mut BenchmarkGroup<'_, WallTime>, one_at_a_time: &str, banks: &[(&str, usize)]) {
    let (recording, model) = (readings::<1>(STEPS), sensor_of::<T, 1, 3>());
    let ticks: Vec<[T; SENSORS]> = (0..STEPS).map(|k| tick(&recording, k)).collect();
    let ekf = SparseEkf::<T, Compact, 1, 3>::new(model, T::of(DT_S)).expect("the step's length is positive");
    let mut beliefs = [Belief::<T, 3, 6>::initial(&model); SENSORS];
    group.bench_function(one_at_a_time, |bencher| {
        bencher.iter(|| {
            for readings in &ticks {
                for (belief, reading) in black_box(&mut beliefs).iter_mut().zip(black_box(readings)) {
                    let _ = black_box(ekf.step(belief, Some(Reading::from(*reading))));
                }
            }
        });
    });
    for (name, bits) in banks {
        let bank = Bank::<T, 1, 3, 6>::new(model, T::of(DT_S), SENSORS).expect("the step's length is positive");
        let mut bank = bank.with_vectors_up_to(*bits);
        group.bench_function(*name, |bencher| {
            bencher.iter(|| {
                for readings in &ticks {
                    assert_eq!(black_box(&mut bank).step(black_box(readings)), Ok(0));
                }
            });
        });
    }
}

fn banks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bank");
    group.throughput(Throughput::Elements((SENSORS * STEPS) as u64));
    one_kind::<f64>(&mut group, "one_at_a_time_3", &[("bank_3_256_bits", 256), ("bank_3", 512)]);
    one_kind::<f32>(&mut group, "one_at_a_time_3_f32", &[("bank_3_f32_256_bits", 256)]);
    group.finish();
}

criterion_group!(benches, banks);
criterion_main!(benches);
