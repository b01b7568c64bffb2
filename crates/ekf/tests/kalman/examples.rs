//! The numbers that the examples print.

use nalgebra::{SMatrix, matrix, vector};
use ohmstrain_ekf::kalman::maximise;

use super::dense::{Row, condition};

macro_rules! example {
    ($name:ident, $path:literal) => {
        #[path = $path]
        #[allow(dead_code, reason = "its main")]
        mod $name;
    };
}

example!(constant_velocity, "../../examples/constant_velocity.rs");
example!(late_reading, "../../examples/late_reading.rs");
example!(nile, "../../examples/nile.rs");
example!(noise_of_a_model, "../../examples/noise_of_a_model.rs");
example!(pendulum, "../../examples/pendulum.rs");
example!(two_rates, "../../examples/two_rates.rs");

/// See `the_pendulum_is_filterpys`.
const PENDULUM: [f64; 3] = [0.04527865816087423, 0.04384552600263735, 0.014149599205381884];
/// Some hundred sums and products of numbers of order one, S with a condition of 1e3.
const ROUNDING: f64 = 1e-10;

fn check<const M: usize>(found: [f64; 2], which: usize, start: [f64; 2], rows: &[Row<2, M>]) {
    let (states, _) = condition((vector![0.0, 0.0], SMatrix::from_diagonal(&start.into())), rows);
    let (mean, covariance) = states.last().unwrap();
    assert!((found[0] - mean[which]).abs() < ROUNDING, "{found:?} {mean}");
    assert!((found[1] - covariance[(which, which)].sqrt()).abs() < ROUNDING, "{found:?} {covariance}");
}

#[test]
fn constant_velocity_is_least_squares() {
    let dt = 0.1_f64;
    let row = |y: f64| Row {
        transition: matrix![1.0, dt; 0.0, 1.0],
        push: vector![0.0, 0.0],
        process_noise: matrix![dt.powi(3) / 3.0, dt.powi(2) / 2.0; dt.powi(2) / 2.0, dt] * 1e-3,
        gradient: matrix![1.0, 0.0],
        reading_noise: matrix![0.0025],
        reading: [(!y.is_nan()).then_some(y)],
    };
    check(constant_velocity::run().unwrap(), 1, [1.0, 1.0], &constant_velocity::POSITIONS.map(row));
}

/// The root mean square errors of filterpy 2.0.0 (ExtendedKalmanFilter; UnscentedKalmanFilter with
/// MerweScaledSigmaPoints(2, alpha=1, beta=2, kappa=0)), and of Rauch, Tung and Striebel's formulas in NumPy on the
/// former's numbers.
#[test]
fn the_pendulum_is_filterpys() {
    for (found, expected) in pendulum::run().unwrap().iter().zip(PENDULUM) {
        assert!((found - expected).abs() < ROUNDING, "{found} {expected}");
    }
}

/// Durbin & Koopman (2012), §2.10: σ²_ε = 15099 and σ²_η = 1469.1; −641.5856 is the log-likelihood there with P = 1e7.
#[test]
fn the_nile_is_durbin_and_koopmans() {
    let published = [15099.0_f64.ln(), 1469.1_f64.ln()];
    // Half of the last digit that is printed.
    assert!((nile::log_likelihood(&published).unwrap() + 641.5856).abs() < 5e-5);
    let found = maximise([9.0, 7.0], nile::log_likelihood).unwrap();
    assert!((found.log_likelihood + 641.5856).abs() < 5e-5, "{found:?}");
    // They stopped where a step gained some 1e-6, two thousandths of a standard error; ours is 21 and 87 percent.
    for i in 0..2 {
        assert!((found.parameters[i] - published[i]).abs() < 2e-3 * found.standard_errors[i], "{found:?}");
    }
    // The readings' joint density, written out.
    let row = |y: f64| Row {
        transition: matrix![1.0],
        push: vector![0.0],
        process_noise: matrix![1469.1],
        gradient: matrix![1.0],
        reading_noise: matrix![15099.0],
        reading: [Some(y)],
    };
    let (_, log_density) = condition((vector![0.0], matrix![1e7 - 1469.1]), &nile::FLOW.map(row));
    assert!((nile::log_likelihood(&published).unwrap() - log_density).abs() < 1e-8);
}

#[test]
fn two_rates_are_least_squares() {
    let row = |k: i32| Row {
        transition: matrix![1.0, 1.0; 0.0, 1.0],
        push: vector![0.0, 0.0],
        process_noise: matrix![1e-4, 0.0; 0.0, 1e-6],
        gradient: matrix![1.0, 0.0; 1.0, 0.0],
        reading_noise: matrix![0.25, 0.01; 0.01, 0.0025],
        reading: two_rates::reading(k),
    };
    let found = two_rates::run().unwrap();
    let start = (vector![0.0, 0.0], matrix![1e7, 0.0; 0.0, 1.0]);
    let (states, _) = condition(start, &(0..60).map(row).collect::<Vec<_>>());
    // The dense sums have a condition of 1e7/0.0025.
    let (mean, covariance) = states[59];
    assert!(
        (found[0] - mean[0]).abs() < 1e-6 && (found[1] - covariance[(0, 0)].sqrt()).abs() < 1e-6,
        "{found:?} {mean}"
    );
}

#[test]
fn a_late_reading_is_least_squares_in_the_order_of_time() {
    let mut arrivals = late_reading::ARRIVALS;
    arrivals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut before_s = 0.0;
    let row = |(time_s, y): (f64, f64)| {
        let dt: f64 = time_s - before_s;
        before_s = time_s;
        Row {
            transition: matrix![1.0, dt; 0.0, 1.0],
            push: vector![0.0, 0.0],
            process_noise: matrix![dt.powi(3) / 3.0, dt.powi(2) / 2.0; dt.powi(2) / 2.0, dt] * 0.1,
            gradient: matrix![1.0, 0.0],
            reading_noise: matrix![if time_s == 0.55 { 1e-4 } else { 2.5e-3 }],
            reading: [Some(y)],
        }
    };
    check(late_reading::run().unwrap(), 0, [1.0, 10.0], &arrivals.map(row));
}

/// The textbook's unscented filter of one state, points at x ± √P and the centre with weight 2 in the variance.
fn tank(readings: &[f64], [model, reading]: [f64; 2]) -> f64 {
    let (mut x, mut p, mut sum) = (1.0_f64, 0.01_f64, 0.0);
    for (k, y) in (0..).zip(readings) {
        let next = |x: f64| x + noise_of_a_model::pumped(k) - 0.05 * x.sqrt();
        let (above, below, centre) = (next(x + p.sqrt()), next(x - p.sqrt()), next(x));
        x = (above + below) / 2.0;
        p = ((above - x).powi(2) + (below - x).powi(2)) / 2.0 + 2.0 * (centre - x).powi(2) + (2.0 * model).exp();
        let s = p + (2.0 * reading).exp();
        let innovation = y - x;
        sum -= 0.5 * (innovation * innovation / s + (std::f64::consts::TAU * s).ln());
        x += p / s * innovation;
        p -= p * p / s;
    }
    sum
}

#[test]
fn noise_of_a_model_is_where_a_textbook_filters_likelihood_is_largest() {
    let readings = noise_of_a_model::readings();
    let found = maximise([-4.0, -4.0], |theta| noise_of_a_model::log_likelihood(&readings, theta)).unwrap();
    let (at, errors): ([f64; 2], _) = (found.parameters.into(), found.standard_errors);
    let largest = tank(&readings, at);
    assert!((noise_of_a_model::log_likelihood(&readings, &at).unwrap() - largest).abs() < 1e-8);
    // A hundredth of a standard error away the likelihood falls by 1/2 · 1e-4 and more; by the slope that is left at 1e-4
    // standard errors from the maximum it could rise by 1e-6.
    for (i, side) in [(0, -0.01), (0, 0.01), (1, -0.01), (1, 0.01)] {
        let mut moved = at;
        moved[i] += side * errors[i];
        assert!(tank(&readings, moved) < largest - 0.4e-4, "{i} {side}");
    }
    // The level was simulated with these.
    for (i, sd) in [0.005_f64, 0.02].into_iter().enumerate() {
        assert!((at[i] - sd.ln()).abs() < 2.0 * errors[i], "{found:?}");
    }
}
