//! A pendulum whose horizontal deflection is read. Prints the rms error of its angle, rad: EKF, UKF and smoother.

use nalgebra::{Vector2, matrix, vector};
use ohmstrain_ekf::kalman::{Ekf, Filter, KalmanError, Normal, Ukf, smooth};

const DT: f64 = 0.05;

/// Returns the next angle, rad, and its rate, rad/s.
pub fn swing(x: &Vector2<f64>) -> Vector2<f64> {
    let rate = x[1] - 9.81 * x[0].sin() * DT;
    vector![x[0] + rate * DT, rate]
}

/// Returns the printed numbers.
pub fn run() -> Result<[f64; 3], KalmanError> {
    let jacobian = |x: &Vector2<f64>| matrix![1.0 - 9.81 * x[0].cos() * DT * DT, DT; -9.81 * x[0].cos() * DT, 1.0];
    let (deflection, gradient) = (|x: &Vector2<f64>| vector![x[0].sin()], |x: &Vector2<f64>| matrix![x[0].cos(), 0.0]);
    let (q, r) = (matrix![1e-6, 1e-5; 1e-5, 5e-4], matrix![0.01]);
    let ekf = Ekf::new((swing, jacobian, deflection, gradient), q, r);
    let ukf = Ukf::new((swing, deflection), q, r);
    let truth: Vec<_> = std::iter::successors(Some(swing(&vector![1.5, 0.0])), |x| Some(swing(x))).take(200).collect();
    let mut extended = Normal::independent(vector![1.2, 0.0], &vector![0.1, 0.1])?;
    let (mut unscented, mut steps, mut squares) = (extended, vec![], [0.0; 3]);
    for (k, x) in (0_i32..).zip(&truth) {
        let reading = [Some(x[0].sin() + 0.14 * f64::from(k * k).sin())];
        steps.push(ekf.step(&extended, &reading)?);
        extended = steps[steps.len() - 1].posterior;
        unscented = ukf.step(&unscented, &reading)?.posterior;
        squares[0] += (extended.mean[0] - x[0]).powi(2);
        squares[1] += (unscented.mean[0] - x[0]).powi(2);
    }
    let mut smoothed = vec![extended; 200];
    smooth(&steps, &mut smoothed)?;
    squares[2] = smoothed.iter().zip(&truth).map(|(found, x)| (found.mean[0] - x[0]).powi(2)).sum();
    Ok(squares.map(|sum| (sum / 200.0).sqrt()))
}

fn main() {
    println!("{:.4?} rad", run());
}
