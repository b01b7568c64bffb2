//! The sensor's filters are instances: its transition and reading through `kalman::Ekf` give their numbers.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::kalman::{self, Filter, Normal};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, Logistic, Reading, SparseEkf};
use ohmstrain_model::{Observation, SwitchedModel, Symmetric, Transition};

use crate::step::sensor;

const DT_S: f64 = 0.05;

/// One step of the sensor's model, linearised as its filters linearise it: the direction of motion is uncertain by what
/// the belief says, which is why Q and R change from step to step.
fn step(model: &SwitchedModel<f64, 2, 5>, state: &Normal<f64, 5>, reading: Option<f64>) -> kalman::Step<f64, 5, 1> {
    let belief = |state: &Normal<f64, 5>| Belief::<f64, 5, 15> {
        mean: state.mean,
        covariance: Symmetric::from_lower(&state.covariance()),
    };
    let moved: Transition<f64, 5, 15> = Dynamics::transition(model, &model.prepare(DT_S), &belief(state), None);
    let nothing = |_: &SVector<f64, 5>| SVector::<f64, 1>::zeros();
    let no_slope = |_: &SVector<f64, 5>| SMatrix::<f64, 1, 5>::zeros();
    let functions = (|_: &SVector<f64, 5>| moved.mean, |_: &SVector<f64, 5>| moved.jacobian, nothing, no_slope);
    let ahead = kalman::Ekf::new(functions, moved.noise.to_matrix(), SMatrix::identity());
    let prediction = ahead.predict(state).unwrap();

    let seen: Observation<f64, 5> = Channel::observe(model, &belief(&prediction.prior), None);
    let value = |_: &SVector<f64, 5>| SVector::from([seen.value]);
    let slope = |_: &SVector<f64, 5>| seen.gradient.transpose();
    let stay = |x: &SVector<f64, 5>| *x;
    let still = |_: &SVector<f64, 5>| SMatrix::identity();
    let here = kalman::Ekf::new((stay, still, value, slope), SMatrix::zeros(), SMatrix::from([[seen.variance]]));
    let update = here.update(&prediction.prior, &[reading]).unwrap();
    kalman::Step { transition: prediction.transition, ..update }
}

/// A step is some 50 operations deep, on quantities up to S/R ≈ 100 times larger than what is left: 5000 ε, in standard
/// deviations of the prior.
#[test]
fn the_sensors_filters_are_instances() {
    let model = sensor::<f64>();
    let (ekf, sparse) = (Ekf::new(model), SparseEkf::<f64, Logistic, 2, 5>::new(model, DT_S).unwrap());
    let start = Belief::<f64, 5, 15>::initial(&model);
    let mut state = Normal::new(start.mean, &start.covariance.to_matrix()).unwrap();
    for k in 0..400_i32 {
        let reading = (k % 7 != 3).then(|| 0.2 - 0.15 * (0.05 * f64::from(k)).cos());
        let belief = Belief::<f64, 5, 15> { mean: state.mean, covariance: Symmetric::from_lower(&state.covariance()) };
        let own = ekf.step(&belief, DT_S, reading.map(Reading::from)).unwrap();
        let mut fast = belief;
        sparse.step(&mut fast, reading.map(Reading::from)).unwrap();
        let found = step(&model, &state, reading);
        for expected in [&own.posterior, &fast] {
            for i in 0..5 {
                let sd = |i: usize| own.prior.covariance[(i, i)].sqrt();
                let off = (found.posterior.mean[i] - expected.mean[i]).abs() / sd(i);
                assert!(off < 5000.0 * f64::EPSILON, "{k} {i}: {off:e}");
                for j in 0..=i {
                    let off = (found.posterior.covariance()[(i, j)] - expected.covariance[(i, j)]).abs();
                    assert!(off < 5000.0 * f64::EPSILON * sd(i) * sd(j), "{k} {i} {j}: {off:e}");
                }
            }
        }
        let log_likelihood = own.update.map_or(0.0, |update| update.log_likelihood);
        assert!((found.log_likelihood - log_likelihood).abs() < 5000.0 * f64::EPSILON * (1.0 + found.nis), "{k}");
        state = found.posterior;
    }
}
