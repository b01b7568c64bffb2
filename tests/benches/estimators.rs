//! Steps of every estimator on the sensor's model, beside adskalman's on the same model linearised, same data, state carried
//! from step to step. Ratios are the figures; nanoseconds belong to the machine. `bench/` compares more, and more carefully.
#![allow(missing_docs, reason = "criterion's macro makes a public function without docs")]

use std::hint::black_box;

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::SVector;
use ohmstrain_ekf::{
    Belief, Channel, Compact, Dwell, Dynamics, Ekf, Estimator, Evidence, Imm, LinearStep, Mixture, PhaseMixture,
    Reading, SignSplit, SparseEkf, State, Step,
};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};
use ohmstrain_tests::{rts_smooth, sensor};

const DT_S: f64 = 0.01;
const READINGS: usize = 512;

/// Readings of a slow sine; what they are does not matter, that they move the state does.
fn readings() -> Vec<f64> {
    (0..READINGS).map(|k| 0.1 + 0.08 * (k as f64 * 0.02).sin()).collect()
}

/// Times 512 steps; `None` is an error, which leaves the state.
fn time<S: Clone>(criterion: &mut Criterion, name: &str, start: &S, step: impl Fn(&S, f64) -> Option<S>) {
    let readings = readings();
    let run = |start: S| readings.iter().fold(start, |state, y| step(&state, black_box(*y)).unwrap_or(state));
    criterion.bench_function(&format!("{name}, 512 steps"), |bencher| {
        bencher.iter_batched(|| start.clone(), run, BatchSize::SmallInput);
    });
}

fn estimator<E, const N: usize, const L: usize>(criterion: &mut Criterion, name: &str, start: &E::State, estimator: E)
where
    E: Estimator<f64, N, L>,
    E::State: State<f64, N, L>,
{
    let prepared = estimator.prepare(DT_S);
    let step = |state: &E::State, y| estimator.advance(state, &prepared, Some(Reading::from(y))).ok();
    time(criterion, name, start, |state, y| step(state, y).map(|advanced| advanced.state));
}

/// The EKF without a multiplication by zero, and without an exponential.
fn sparse<const B: usize, const N: usize, const L: usize>(criterion: &mut Criterion, name: &str) {
    let model = sensor::<f64, B, N>();
    let Ok(ekf) = SparseEkf::<f64, Compact, B, N>::new(model, DT_S) else { return };
    time(criterion, name, &Belief::<f64, N, L>::initial(&model), |belief, y| {
        let mut belief = *belief;
        ekf.step(&mut belief, Some(Reading::from(y))).ok().map(|_| belief)
    });
}

/// Filter and smoother.
fn smoother(criterion: &mut Criterion, model: &SwitchedModel<f64, 1, 3>) {
    let (ekf, readings) = (Ekf::new(*model), readings());
    let prepared = model.prepare(DT_S);
    criterion.bench_function("smoother, n = 3, 512 steps", |bencher| {
        bencher.iter(|| {
            let mut belief = Belief::<f64, 3, 6>::initial(model);
            let taken = |y: &f64| {
                let step = ekf.step_prepared(&belief, &prepared, Some(Reading::from(black_box(*y)))).ok()?;
                belief = step.posterior;
                Some(step)
            };
            let steps: Vec<Step<f64, 3, 6>> = readings.iter().map_while(taken).collect();
            rts_smooth(&steps)
        });
    });
}

/// The law frozen at one linearisation, which is what adskalman can be given.
fn adskalman(criterion: &mut Criterion, model: &SwitchedModel<f64, 1, 3>) {
    let start = Belief::<f64, 3, 6>::initial(model);
    let prepared = Dynamics::<f64, 3, 6>::prepare(model, DT_S);
    let transition = Dynamics::<f64, 3, 6>::transition(model, &prepared, &start, Some(Phase::Extend));
    let observation = Channel::<f64, 3, 6>::observe(model, &start, Some(Phase::Extend));
    let step = LinearStep::new(start.mean, &transition, transition.mean, &[observation]);
    let start = StateAndCovariance::from(start);
    time(criterion, "adskalman, n = 3", &start, |state, y| {
        KalmanFilterNoControl::new(&step, &step).step(state, &SVector::from([y])).ok()
    });
}

fn benchmarks(criterion: &mut Criterion) {
    let (three, six) = (sensor::<f64, 1, 3>(), sensor::<f64, 3, 6>());
    adskalman(criterion, &three);
    sparse::<1, 3, 6>(criterion, "sparse EKF, n = 3");
    sparse::<3, 6, 21>(criterion, "sparse EKF, n = 6");
    estimator::<_, 3, 6>(criterion, "EKF, n = 3", &Belief::initial(&three), Ekf::new(three));
    estimator::<_, 6, 21>(criterion, "EKF, n = 6", &Belief::initial(&six), Ekf::new(six));
    let Ok(dwell) = Dwell::new(5.0, 1.0, 0.3) else { return };
    let evidence = Evidence { limits: StrainRange { lower: -0.02, upper: 0.35 }, tempering: 1.0 };
    let belief = Belief::initial(&six);
    let start = PhaseMixture::single(belief, Phase::Hold);
    let imm = Imm::<f64, 3, 6>::new(six, DT_S, dwell, evidence).expect("the step's length is positive");
    estimator::<_, 6, 21>(criterion, "IMM, n = 6", &start, imm);
    let start = Mixture::single(belief, Phase::Hold);
    let split = SignSplit::<f64, 3, 6, 8>::new(six, DT_S, Some(dwell), evidence);
    let split = split.expect("the step's length is positive");
    estimator::<_, 6, 21>(criterion, "sign-split of 8, n = 6", &start, split);
    smoother(criterion, &three);
}

criterion_group!(benches, benchmarks);
criterion_main!(benches);
