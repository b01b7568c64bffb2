use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

use super::{Affine, Filter, KalmanError, Normal};

/// Kalman filter of a linear model with N states and M readings at once.
///
/// ```text
/// x′ = F x + B u + w,  w ~ N(0, Q)
/// y  = H x + v,        v ~ N(0, R)
/// ```
///
/// A value is the filter of one step; if something changes, the next step needs another one,
/// `Kalman { control: B * u, ..kalman }`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kalman<T, const N: usize, const M: usize> {
    /// F.
    pub transition: SMatrix<T, N, N>,
    /// Q.
    pub process_noise: SMatrix<T, N, N>,
    /// H.
    pub reading: SMatrix<T, M, N>,
    /// R.
    pub reading_noise: SMatrix<T, M, M>,
    /// B u: contribution of a known input to the state.
    pub control: SVector<T, N>,
}

impl<T: Scalar, const N: usize, const M: usize> Kalman<T, N, M> {
    /// Creates the filter with F, Q, H and R, without control.
    #[allow(non_snake_case, reason = "the letters of every textbook")]
    pub fn new(F: SMatrix<T, N, N>, Q: SMatrix<T, N, N>, H: SMatrix<T, M, N>, R: SMatrix<T, M, M>) -> Self {
        Self { transition: F, process_noise: Q, reading: H, reading_noise: R, control: SVector::zeros() }
    }
}

impl<T: Scalar, const N: usize, const M: usize> Filter<T, N, M> for Kalman<T, N, M> {
    fn transition_line(&self, state: &Normal<T, N>) -> Result<Affine<T, N, N>, KalmanError> {
        Affine::tangent(state.mean, self.transition * state.mean + self.control, self.transition, &self.process_noise)
            .ok_or(KalmanError::ProcessNoise)
    }

    fn reading_line(&self, state: &Normal<T, N>) -> Result<Affine<T, M, N>, KalmanError> {
        Affine::tangent(state.mean, self.reading * state.mean, self.reading, &self.reading_noise)
            .ok_or(KalmanError::ReadingNoise)
    }
}
