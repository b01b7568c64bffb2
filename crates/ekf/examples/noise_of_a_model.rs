//! A tank with pump, hole and level gauge. Prints the noise of model and gauge, m, and their relative standard errors.

use nalgebra::{Vector1, matrix, vector};
use ohmstrain_ekf::kalman::{Filter, KalmanError, Normal, Ukf, maximise};

/// Inflow at step k, m.
pub fn pumped(k: i32) -> f64 {
    if k % 50 < 25 { 0.02 } else { 0.08 }
}

/// 400 readings of the level, m, with a noise of 0.02 m; the noise of the model is 0.005 m.
pub fn readings() -> Vec<f64> {
    let (mut level, noise) = (1.0_f64, |k: i32, sd: f64| sd * std::f64::consts::SQRT_2 * f64::from(k).sin());
    let step = |k: i32| {
        level += pumped(k) - 0.05 * level.sqrt() + noise(k * k, 0.005);
        level + noise(k * k * 3 + 1, 0.02)
    };
    (0..400).map(step).collect()
}

/// ℓ(ln sd of the model, ln sd of the gauge).
pub fn log_likelihood(readings: &[f64], [model, gauge]: &[f64; 2]) -> Result<f64, KalmanError> {
    let (mut state, mut sum) = (Normal::independent(vector![1.0], &vector![0.01])?, 0.0);
    for (k, level) in (0..).zip(readings) {
        let tank = |x: &Vector1<f64>| vector![x[0] + pumped(k) - 0.05 * x[0].sqrt()];
        let functions = (tank, |x: &Vector1<f64>| *x);
        let ukf = Ukf::new(functions, matrix![(2.0 * model).exp()], matrix![(2.0 * gauge).exp()]);
        let step = ukf.step(&state, &[Some(*level)])?;
        (state, sum) = (step.posterior, sum + step.log_likelihood);
    }
    Ok(sum)
}

fn main() {
    let readings = readings();
    let found = maximise([-4.0, -4.0], |theta| log_likelihood(&readings, theta));
    println!("{:.5?}", found.map(|found| (found.parameters.map(f64::exp), found.standard_errors)));
}
