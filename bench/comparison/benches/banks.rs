//! Many sensors of one kind: time per sensor and tick. Here it is throughput that counts: the sensors do not wait for each
//! other.
#![allow(missing_docs, reason = "criterion's macro makes a public function without docs")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ohmstrain_bench_filters::{DT_S, STEPS, readings, sensor};
use ohmstrain_ekf::{Bank, Belief, Compact, Reading, SparseEkf};

const SENSORS: usize = 64;

/// What every sensor reads at a tick: each is at another place of its period.
fn tick(recording: &[f64], k: usize) -> [f64; SENSORS] {
    std::array::from_fn(|sensor| recording[(k + 7 * sensor) % STEPS])
}

fn banks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bank");
    group.throughput(Throughput::Elements((SENSORS * STEPS) as u64));
    let (recording, model) = (readings::<1>(STEPS), sensor::<1, 3>());
    let ticks: Vec<[f64; SENSORS]> = (0..STEPS).map(|k| tick(&recording, k)).collect();

    let ekf = SparseEkf::<f64, Compact, 1, 3>::new(model, DT_S).expect("the step's length is positive");
    let mut beliefs = [Belief::<f64, 3, 6>::initial(&model); SENSORS];
    group.bench_function("one_at_a_time_3", |bencher| {
        bencher.iter(|| {
            for readings in &ticks {
                for (belief, reading) in black_box(&mut beliefs).iter_mut().zip(black_box(readings)) {
                    let _ = black_box(ekf.step(belief, Some(Reading::from(*reading))));
                }
            }
        });
    });
    for (name, bits) in [("bank_3_256_bits", 256), ("bank_3", 512)] {
        let bank = Bank::<f64, 1, 3, 6>::new(model, DT_S, SENSORS).expect("the step's length is positive");
        let mut bank = bank.with_vectors_up_to(bits);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for readings in &ticks {
                    assert_eq!(black_box(&mut bank).step(black_box(readings)), Ok(0));
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, banks);
criterion_main!(benches);
