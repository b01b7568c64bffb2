//! Refused input, by name.

use nalgebra::{Vector1, matrix, vector};
use ohmstrain_ekf::kalman::{Filter, Kalman, KalmanError, NoMaximum, Normal, Ukf, maximise, smooth, smooth_first};

#[test]
fn bad_input_is_refused_by_name() {
    let kalman = Kalman::new(matrix![1.0, 0.1; 0.0, 1.0], matrix![0.0, 0.0; 0.0, 0.1], matrix![1.0, 0.0], matrix![0.1]);
    let state = Normal::independent(vector![0.0, 0.0], &vector![1.0, 1.0]).unwrap();
    let refused = |kalman: Kalman<f64, 2, 1>, y: f64| kalman.step(&state, &[Some(y)]).unwrap_err();
    assert_eq!(refused(kalman, f64::NAN), KalmanError::NonFiniteReading);
    assert_eq!(refused(kalman, f64::INFINITY), KalmanError::NonFiniteReading);
    assert_eq!(refused(kalman, 1e300), KalmanError::NonFiniteState);
    for process_noise in [
        matrix![-1.0, 0.0; 0.0, 1.0],
        matrix![1.0, 2.0; 2.0, 1.0],
        matrix![1.0, 0.5; 0.0, 1.0],
        matrix![f64::NAN, 0.0; 0.0, 1.0],
    ] {
        assert_eq!(refused(Kalman { process_noise, ..kalman }, 0.0), KalmanError::ProcessNoise);
        assert_eq!(Normal::new(vector![0.0, 0.0], &process_noise), Err(KalmanError::InitialCovariance));
    }
    assert_eq!(refused(Kalman { reading_noise: matrix![-1.0], ..kalman }, 0.0), KalmanError::ReadingNoise);
    assert_eq!(
        refused(Kalman { transition: matrix![f64::NAN, 0.0; 0.0, 1.0], ..kalman }, 0.0),
        KalmanError::ProcessNoise
    );
    assert_eq!(Normal::independent(vector![f64::NAN], &vector![1.0]), Err(KalmanError::NonFiniteState));
    let nan = Ukf::new((|x: &Vector1<f64>| x.map(f64::sqrt), |x: &Vector1<f64>| *x), matrix![0.1], matrix![0.1]);
    let near_zero = Normal::independent(vector![0.1], &vector![1.0]).unwrap();
    assert_eq!(nan.step(&near_zero, &[Some(0.0)]).unwrap_err(), KalmanError::ProcessNoise);
    let known = Normal::independent(vector![0.0, 0.0], &vector![0.0, 0.0]).unwrap();
    let exact = Kalman { reading_noise: matrix![0.0], ..kalman };
    assert_eq!(exact.update(&known, &[Some(0.0)]).unwrap_err(), KalmanError::SingularInnovation);
    let step = kalman.step(&state, &[None]).unwrap();
    assert_eq!((step.posterior, step.log_likelihood, step.readings), (step.prior, 0.0, 0));
    assert_eq!(smooth(&[step], &mut []), Err(KalmanError::Length));
    assert_eq!(smooth_first::<f64, 2, 1>(&[]), Err(KalmanError::Length));
}

/// Exact readings, exactly known states and noise of a lower rank are ordinary input.
#[test]
fn an_exact_reading_leaves_no_variance() {
    let exact = Kalman::new(matrix![1.0, 1.0; 0.0, 1.0], matrix![0.0, 0.0; 0.0, 0.0], matrix![1.0, 0.0], matrix![0.0]);
    let state = Normal::independent(vector![0.0, 0.0], &vector![1.0, 2.0]).unwrap();
    let first = exact.step(&state, &[Some(3.0)]).unwrap();
    let second = exact.step(&first.posterior, &[Some(5.0)]).unwrap();
    // Position 3 and 5 a step apart: speed 2, from rounding to rounding.
    assert!((second.posterior.mean - vector![5.0, 2.0]).amax() < 1e-14);
    assert!(second.posterior.covariance().amax() < 1e-15);
    let mut smoothed = [state; 2];
    smooth(&[first, second], &mut smoothed).unwrap();
    assert!((smoothed[0].mean - vector![3.0, 2.0]).amax() < 1e-14 && smoothed[0].covariance().amax() < 1e-15);
}

#[test]
fn a_missing_maximum_is_reported() {
    let start = maximise([0.0], |_| Err::<f64, _>(KalmanError::NonFiniteState));
    assert_eq!(start, Err(NoMaximum::Start));
    let rising = maximise([0.0], |theta| Ok::<_, KalmanError>(theta[0]));
    assert!(matches!(rising, Err(NoMaximum::StillRising { .. } | NoMaximum::Flat { .. })), "{rising:?}");
    let ridge = maximise([0.3, 0.2], |[a, b]| Ok::<_, KalmanError>(-(a + b - 1.0).powi(2)));
    assert!(matches!(ridge, Err(NoMaximum::Flat { .. } | NoMaximum::StillRising { .. })), "{ridge:?}");
}

/// The variance of n independent readings: θ = ln σ² is largest at their mean square, with a standard error of √(2/n).
#[test]
fn standard_errors_are_those_of_a_variance() {
    let readings: Vec<f64> = (0..500).map(|k| 3.0 * f64::from(k * k).sin()).collect();
    let found = maximise([0.0], |[ln_variance]| {
        let kalman = Kalman::new(matrix![1.0], matrix![0.0], matrix![1.0], matrix![ln_variance.exp()]);
        let known = Normal::independent(vector![0.0], &vector![0.0])?;
        readings
            .iter()
            .try_fold(0.0, |sum, y| Ok::<_, KalmanError>(sum + kalman.step(&known, &[Some(*y)])?.log_likelihood))
    });
    let found = found.unwrap();
    let variance = readings.iter().map(|y| y * y).sum::<f64>() / 500.0;
    let error = (2.0_f64 / 500.0).sqrt();
    // Where the search ends a step is below 1.5e-5 standard errors; ∜ε squared is the curvature's.
    assert!((found.parameters[0] - variance.ln()).abs() < 1.5e-5 * error, "{found:?}");
    assert!((found.standard_errors[0] / error - 1.0).abs() < 1e-6, "{found:?}");
}
