//! A thermometer read every second and a better one read every ten seconds, with correlated errors. Prints the temperature.

use nalgebra::{matrix, vector};
use ohmstrain_ekf::kalman::{Filter, Kalman, KalmanError, Normal};

/// Readings of both at second k, °C; the temperature starts at 20 °C and rises by 0.02 °C per second.
pub fn reading(k: i32) -> [Option<f64>; 2] {
    let temperature = 20.0 + 0.02 * f64::from(k);
    let (coarse, fine) = (f64::from(k * k).sin(), f64::from(7 * k).cos());
    [Some(temperature + 0.5 * coarse), (k % 10 == 0).then_some(temperature + 0.05 * fine)]
}

/// Returns the printed numbers.
pub fn run() -> Result<[f64; 2], KalmanError> {
    let filter = Kalman::new(
        matrix![1.0, 1.0; 0.0, 1.0],
        matrix![1e-4, 0.0; 0.0, 1e-6],
        matrix![1.0, 0.0; 1.0, 0.0],
        matrix![0.25, 0.01; 0.01, 0.0025],
    );
    let mut state = Normal::independent(vector![0.0, 0.0], &vector![1e7, 1.0])?;
    for k in 0..60 {
        state = filter.step(&state, &reading(k))?.posterior;
    }
    Ok([state.mean[0], state.sd()[0]])
}

fn main() -> Result<(), KalmanError> {
    let [temperature, sd] = run()?;
    println!("{temperature:.3} ± {sd:.3} °C");
    Ok(())
}
