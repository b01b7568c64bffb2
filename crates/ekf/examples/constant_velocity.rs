//! A body of constant velocity whose position is read every 0.1 s, with gaps. Prints its speed and the standard
//! deviation.

use nalgebra::{matrix, vector};
use ohmstrain_ekf::kalman::{Filter, Kalman, KalmanError, Normal};

/// Positions, m, with a noise of 0.05 m; NaN where a reading is missing.
pub const POSITIONS: [f64; 12] =
    [0.02, 0.05, f64::NAN, 0.13, 0.11, 0.16, f64::NAN, f64::NAN, f64::NAN, 0.29, 0.26, 0.36];

/// Returns the printed numbers.
pub fn run() -> Result<[f64; 2], KalmanError> {
    let (dt, q) = (0.1_f64, 1e-3);
    let filter = Kalman::new(
        matrix![1.0, dt; 0.0, 1.0],
        matrix![dt.powi(3) / 3.0, dt.powi(2) / 2.0; dt.powi(2) / 2.0, dt] * q,
        matrix![1.0, 0.0],
        matrix![0.05 * 0.05],
    );
    let mut state = Normal::independent(vector![0.0, 0.0], &vector![1.0, 1.0])?;
    for position in POSITIONS {
        let reading = Some(position).filter(|y| !y.is_nan());
        state = filter.step(&state, &[reading])?.posterior;
    }
    Ok([state.mean[1], state.sd()[1]])
}

fn main() -> Result<(), KalmanError> {
    let [speed, sd] = run()?;
    println!("{speed:.4} ± {sd:.4} m/s");
    Ok(())
}
