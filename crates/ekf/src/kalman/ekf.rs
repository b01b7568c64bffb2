use nalgebra::SMatrix;
use ohmstrain_model::Scalar;

use super::{Affine, Differentiable, Filter, KalmanError, Normal};

/// Extended Kalman filter: both functions of the model are linearised at the mean.
///
/// A value is the filter of one step; if model, Q or R change, the next step needs another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ekf<D, T, const N: usize, const M: usize> {
    /// The model's functions and Jacobians.
    pub model: D,
    /// Q: covariance of the process noise of the step.
    pub process_noise: SMatrix<T, N, N>,
    /// R: covariance of the readings' noise.
    pub reading_noise: SMatrix<T, M, M>,
}

impl<D, T, const N: usize, const M: usize> Ekf<D, T, N, M> {
    /// Creates the filter of a model with Q and R.
    #[allow(non_snake_case, reason = "the letters of every textbook")]
    pub const fn new(model: D, Q: SMatrix<T, N, N>, R: SMatrix<T, M, M>) -> Self {
        Self { model, process_noise: Q, reading_noise: R }
    }
}

impl<T: Scalar, D: Differentiable<T, N, M>, const N: usize, const M: usize> Filter<T, N, M> for Ekf<D, T, N, M> {
    fn transition_line(&self, state: &Normal<T, N>) -> Result<Affine<T, N, N>, KalmanError> {
        let (x, model) = (state.mean, &self.model);
        Affine::tangent(x, model.transition(&x), model.transition_jacobian(&x), &self.process_noise)
            .ok_or(KalmanError::ProcessNoise)
    }

    fn reading_line(&self, state: &Normal<T, N>) -> Result<Affine<T, M, N>, KalmanError> {
        let (x, model) = (state.mean, &self.model);
        Affine::tangent(x, model.reading(&x), model.reading_jacobian(&x), &self.reading_noise)
            .ok_or(KalmanError::ReadingNoise)
    }
}
