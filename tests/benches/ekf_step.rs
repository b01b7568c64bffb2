//! One EKF step of the sensor's model beside adskalman's step on the same linearised model, same data, state carried
//! from step to step. The ratio of the two is the figure; nanoseconds belong to the machine.
#![allow(missing_docs, reason = "criterion's macro makes a public function without docs")]

use std::hint::black_box;

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::SVector;
use ohmstrain_ekf::{Belief, Channel, Compact, Dynamics, Ekf, LinearStep, Reading, SparseEkf};
use ohmstrain_model::{Phase, SwitchedModel};
use ohmstrain_tests::sensor;

const DT_S: f64 = 0.01;
const READINGS: usize = 512;

/// Readings of a slow sine; what they are does not matter, that they move the state does.
fn readings() -> Vec<f64> {
    (0..READINGS).map(|k| 0.1 + 0.08 * (k as f64 * 0.02).sin()).collect()
}

fn ekf(criterion: &mut Criterion, model: &SwitchedModel<f64, 2, 1, 3>) {
    let ekf = Ekf::new(*model);
    let start = Belief::<f64, 3, 6>::initial(model);
    let prepared = Dynamics::<f64, 3, 6>::prepare(model, DT_S);
    let readings = readings();
    criterion.bench_function("ohmstrain EKF, n = 3, 512 steps", |bencher| {
        bencher.iter_batched(
            || start,
            |mut belief| {
                for &reading in &readings {
                    if let Ok(step) = ekf.step_prepared(&belief, &prepared, Some(Reading::from(black_box(reading)))) {
                        belief = step.posterior;
                    }
                }
                belief
            },
            BatchSize::SmallInput,
        );
    });
}

/// The same filter without a multiplication by zero, and without an exponential.
fn sparse(criterion: &mut Criterion, model: &SwitchedModel<f64, 2, 1, 3>) {
    let Ok(ekf) = SparseEkf::<f64, Compact, 1, 3>::new(*model, DT_S) else { return };
    let start = Belief::<f64, 3, 6>::initial(model);
    let readings = readings();
    criterion.bench_function("ohmstrain sparse EKF, n = 3, 512 steps", |bencher| {
        bencher.iter_batched(
            || start,
            |mut belief| {
                for &reading in &readings {
                    // An error would leave the belief as it was.
                    let _ = ekf.step(&mut belief, Some(Reading::from(black_box(reading))));
                }
                belief
            },
            BatchSize::SmallInput,
        );
    });
}

/// The same law frozen at one linearisation, which is what adskalman can be given.
fn adskalman(criterion: &mut Criterion, model: &SwitchedModel<f64, 2, 1, 3>) {
    let start = Belief::<f64, 3, 6>::initial(model);
    let prepared = Dynamics::<f64, 3, 6>::prepare(model, DT_S);
    let transition = Dynamics::<f64, 3, 6>::transition(model, &prepared, &start, Some(Phase::Extend));
    let observation = Channel::<f64, 3, 6>::observe(model, &start, Some(Phase::Extend));
    let step = LinearStep::new(start.mean, &transition, transition.mean, &[observation]);
    let readings: Vec<SVector<f64, 1>> = readings().into_iter().map(|y| SVector::from([y])).collect();
    criterion.bench_function("adskalman, n = 3, 512 steps", |bencher| {
        bencher.iter_batched(
            || StateAndCovariance::new(start.mean, start.covariance.to_matrix()),
            |mut state| {
                let filter = KalmanFilterNoControl::new(&step, &step);
                for reading in &readings {
                    if let Ok(next) = filter.step(&state, black_box(reading)) {
                        state = next;
                    }
                }
                state
            },
            BatchSize::SmallInput,
        );
    });
}

fn benchmarks(criterion: &mut Criterion) {
    let model = sensor::<f64, 1, 3>();
    ekf(criterion, &model);
    sparse(criterion, &model);
    adskalman(criterion, &model);
}

criterion_group!(benches, benchmarks);
criterion_main!(benches);
