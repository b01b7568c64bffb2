//! Diffuse starts in single precision: exact to rounding, or refused.

use nalgebra::{SVector, matrix, vector};
use ohmstrain_ekf::kalman::{Filter, Kalman, KalmanError, Normal, Step, smooth};

use super::dense::{Row, condition};

fn rows() -> Vec<Row<2, 1>> {
    let row = |k: i32| Row {
        transition: matrix![1.0, 0.5; 0.0, 1.0],
        push: vector![0.0, 0.0],
        process_noise: matrix![0.001, 0.002; 0.002, 0.01],
        gradient: matrix![1.0, 0.0],
        reading_noise: matrix![0.25],
        reading: [(k % 5 != 3).then(|| 3.0 + 0.4 * f64::from(k) + 0.5 * f64::from(k * k).sin())],
    };
    (0..40).map(row).collect()
}

/// All in the number type of the filter.
fn filter(start: f32) -> Result<Vec<Step<f32, 2, 1>>, KalmanError> {
    let mut state = Normal::independent(vector![0.0, 0.0], &vector![start, start])?;
    let step = |row: &Row<2, 1>| {
        let (transition, noise) = (row.transition.cast::<f32>(), row.process_noise.cast::<f32>());
        let kalman = Kalman::new(transition, noise, row.gradient.cast(), row.reading_noise.cast());
        let step = kalman.step(&state, &row.reading.map(|y| y.map(|y| y as f32)))?;
        state = step.posterior;
        Ok(step)
    };
    rows().iter().map(step).collect()
}

#[test]
fn a_diffuse_start_costs_no_digits() {
    let start_variance = 1e7_f32;
    let steps = filter(start_variance).unwrap();
    let mut smoothed = vec![steps[0].posterior; steps.len()];
    smooth(&steps, &mut smoothed).unwrap();
    let start = (SVector::zeros(), nalgebra::SMatrix::identity() * f64::from(start_variance));
    let (states, _) = condition(start, &rows());
    // One product or sum is off by ε/2 of a deviation of √1e7; a step has some ten of them; the readings' is 0.5.
    let ten_roundings = 10.0 * f64::from(f32::EPSILON) / 2.0;
    let rounding = ten_roundings * f64::from(start_variance).sqrt() / 0.5;
    for (k, step) in steps.iter().enumerate() {
        let (filtered, _) = condition(start, &rows()[..=k]);
        for (found, (mean, covariance)) in [(&step.posterior, &filtered[k]), (&smoothed[k], &states[k])] {
            for i in 0..2 {
                let sd = covariance[(i, i)].sqrt();
                let off = (f64::from(found.mean[i]) - mean[i]).abs() / sd;
                let sd_off = (f64::from(found.sd()[i]) / sd - 1.0).abs();
                assert!(off < rounding && sd_off < rounding, "{k} {i}: {off} {sd_off}");
            }
        }
    }
}

/// More diffuse: the readings still decide alone. A reading 1e13 times as exact in variance is refused.
#[test]
fn what_would_lose_precision_is_refused() {
    let by_variance = |variance: f32| filter(variance).map(|steps| steps[39].posterior);
    let (moderate, large) = (by_variance(1e7).unwrap(), by_variance(1e10).unwrap());
    assert!((moderate.mean - large.mean).component_div(&large.sd()).amax() < 1e-3, "{moderate:?} {large:?}");
    assert_eq!(by_variance(1e13), Err(KalmanError::LostPrecision));
}
