//! A vehicle's position at irregular times; a camera's reading is correct but arrives 0.4 s late. Prints the position,
//! m, at the end.

use nalgebra::{matrix, vector};
use ohmstrain_ekf::kalman::{Kalman, KalmanError, Normal, Rewind};

/// Time, s, and position, m, in the order in which they arrive; the reading of 0.55 s is the camera's.
pub const ARRIVALS: [(f64, f64); 8] =
    [(0.1, 0.22), (0.3, 0.58), (0.5, 1.07), (0.6, 1.16), (0.8, 1.63), (0.95, 1.86), (0.55, 1.10), (1.1, 2.25)];

/// Returns the filter of a step from one time to another, s.
pub fn filter(from_s: f64, to_s: f64) -> Kalman<f64, 2, 1> {
    let dt = to_s - from_s;
    let noise = matrix![dt.powi(3) / 3.0, dt.powi(2) / 2.0; dt.powi(2) / 2.0, dt] * 0.1;
    let error: f64 = if to_s == 0.55 { 0.01 } else { 0.05 };
    Kalman::new(matrix![1.0, dt; 0.0, 1.0], noise, matrix![1.0, 0.0], matrix![error.powi(2)])
}

/// Returns the printed numbers.
pub fn run() -> Result<[f64; 2], KalmanError> {
    let start = Normal::independent(vector![0.0, 0.0], &vector![1.0, 10.0])?;
    let mut rewind = Rewind::<_, _, 2, 1, 8>::new(filter, 0.0, start);
    let mut state = start;
    for (time_s, position) in ARRIVALS {
        state = rewind.take(time_s, [Some(position)])?;
    }
    Ok([state.mean[0], state.sd()[0]])
}

fn main() -> Result<(), KalmanError> {
    let [position, sd] = run()?;
    println!("{position:.4} ± {sd:.4} m");
    Ok(())
}
