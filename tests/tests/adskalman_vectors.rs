//! Several readings at once in adskalman, compared with one after the other in our filter, and with the textbook's
//! vector update for correlated noise.

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use nalgebra::{Const, SMatrix, SVector, matrix, vector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, LinearStep, Reading, StepError};
use ohmstrain_model::{Observation, Phase, SwitchedModel, Transition};
use ohmstrain_tests::sensor;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

type Sensor = SwitchedModel<f64, 2, 5>;

/// The sensor with a linear reading instead of its own.
#[derive(Clone, Copy)]
struct Other {
    sensor: Sensor,
    gradient: SVector<f64, 5>,
    variance: f64,
}

impl Channel<f64, 5, 15> for Other {
    fn observe(&self, at: &Belief<f64, 5, 15>, _: Option<Phase>) -> Observation<f64, 5> {
        Observation { value: self.gradient.dot(&at.mean), gradient: self.gradient, variance: self.variance }
    }
}

impl Dynamics<f64, 5, 15> for Other {
    type Prepared = <Sensor as Dynamics<f64, 5, 15>>::Prepared;

    fn prepare(&self, dt_s: f64) -> Self::Prepared {
        self.sensor.prepare(dt_s)
    }

    fn transition(&self, by: &Self::Prepared, at: &Belief<f64, 5, 15>, phase: Option<Phase>) -> Transition<f64, 5, 15> {
        Dynamics::transition(&self.sensor, by, at, phase)
    }
}

/// Coarse strain, and a tachometer.
fn others(sensor: Sensor) -> [Other; 2] {
    [
        Other { sensor, gradient: vector![1.0, 0.0, 0.0, 0.0, 0.0], variance: 4e-4 },
        Other { sensor, gradient: vector![0.0, 1.0, 0.0, 0.0, 0.0], variance: 1e-3 },
    ]
}

/// Resistance comes first, nonlinear and linearised at the prior in both; the others are linear, so their linearisation
/// point does not matter. Each component is sometimes missing, and sometimes all are.
#[test]
fn three_readings_at_once_are_three_readings_in_turn() {
    let sensor = sensor::<f64, 2, 5>();
    let others = others(sensor);
    let prepared = sensor.prepare(0.05);
    let mut rng = ChaCha12Rng::seed_from_u64(8);
    let mut belief: Belief<f64, 5, 15> = Belief::initial(&sensor);
    let mut theirs: StateAndCovariance<f64, Const<5>> = belief.into();
    for k in 0..500 {
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let strain = 0.15 - 0.1 * (0.02 * f64::from(k)).cos();
        let values = [
            1.6 * strain - 1.2 * strain * strain + 2e-3 * noise(),
            strain + 0.02 * noise(),
            0.04 * (0.02 * f64::from(k)).sin() + 0.03 * noise(),
        ];
        let readings = [0, 1, 2].map(|i| {
            let reading = Reading { value: values[i], extra_variance: if k % 2 == 0 { 1e-5 } else { 0.0 } };
            (k % [7, 3, 5][i] != 1).then_some(reading)
        });
        let step =
            LinearStep::linearise(&sensor, [&sensor, &others[0], &others[1]], &prepared, &(&theirs).into(), None);
        let (step, vector) = step.take(&readings).unwrap();
        theirs = KalmanFilterNoControl::new(&step, &step).step(&theirs, &vector).unwrap();

        belief = Ekf::new(sensor).step_prepared(&belief, &prepared, readings[0]).unwrap().posterior;
        for (other, reading) in others.iter().zip(&readings[1..]) {
            belief = Ekf::new(*other).step(&belief, 0.0, *reading).unwrap().posterior;
        }
        // Per step one rounding times the condition number of S, 1e2; the filter forgets within about a hundred steps.
        let tolerance = 1e2 * 1e2 * f64::EPSILON;
        for i in 0..5 {
            assert!((belief.mean[i] - theirs.state()[i]).abs() < tolerance, "mean[{i}] at {k}");
            for j in 0..5 {
                let size = (belief.covariance[(i, i)] * belief.covariance[(j, j)]).sqrt();
                let apart = (belief.covariance[(i, j)] - theirs.covariance()[(i, j)]).abs();
                assert!(apart < tolerance * size, "P[{i}][{j}] at {k}: {apart} of {size}");
            }
        }
    }
}

/// Two readings with a common noise: K = P Hᵀ (H P Hᵀ + R)⁻¹, written out. If one is missing, its noise has no effect.
#[test]
fn correlated_noise_is_the_vector_update() {
    let sensor = sensor::<f64, 2, 5>();
    let others = others(sensor);
    let prepared = sensor.prepare(0.05);
    let start: Belief<f64, 5, 15> = Belief::initial(&sensor);
    let noise = matrix![2e-4, 1.5e-4; 1.5e-4, 3e-4];
    let linear = LinearStep::linearise(&sensor, [&others[0], &others[1]], &prepared, &start, Some(Phase::Extend));
    let linear = linear.with_noise(noise);
    let by = Dynamics::<f64, 5, 15>::transition(&sensor, &prepared, &start, Some(Phase::Extend));
    let prior = by.jacobian * start.covariance.to_matrix() * by.jacobian.transpose() + by.noise.to_matrix();
    let run = |readings: [Option<Reading<f64>>; 2]| {
        let (step, values) = linear.take(&readings).unwrap();
        KalmanFilterNoControl::new(&step, &step).step(&start.into(), &values).unwrap()
    };

    let y = vector![0.2, 0.05];
    let h = SMatrix::<f64, 2, 5>::from_rows(&others.map(|other| other.gradient.transpose()));
    let gain = prior * h.transpose() * (h * prior * h.transpose() + noise).try_inverse().unwrap();
    let both = run([Some(y[0].into()), Some(y[1].into())]);
    // Numbers below one, products of five terms, and the inverse of a matrix with condition number 10.
    assert!((both.state() - (by.mean + gain * (y - h * by.mean))).amax() < 1e-14);
    assert!((both.covariance() - (prior - gain * h * prior)).amax() < 1e-15);

    let h = others[1].gradient;
    let gain = prior * h / (h.dot(&(prior * h)) + noise[(1, 1)]);
    let one = run([None, Some(y[1].into())]);
    assert!((one.state() - (by.mean + gain * (y[1] - h.dot(&by.mean)))).amax() < 1e-14);
    assert!((one.covariance() - (prior - gain * h.transpose() * prior)).amax() < 1e-15);

    let none = run([None, None]);
    assert!((none.state() - by.mean).amax() < 1e-15 && (none.covariance() - prior).amax() < 1e-16);
    assert_eq!(linear.take(&[None, Some(f64::NAN.into())]).unwrap_err(), StepError::NonFiniteReading);
}
