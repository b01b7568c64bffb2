use nalgebra::{DMatrix, SMatrix, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics};
use ohmstrain_model::{Observation, Phase, Symmetric, Transition};

use crate::Draws;

/// A random stationary process dx = A x dt + noise: with stationary covariance C, `F = exp(A dt)` and `Q = C - F C Fᵀ`.
#[derive(Clone, Copy, Debug)]
pub struct Flow<const N: usize> {
    drift: SMatrix<f64, N, N>,
    stationary: SMatrix<f64, N, N>,
    gradient: SVector<f64, N>,
}

impl<const N: usize> Flow<N> {
    /// `A = (K - D/2) C⁻¹` with K antisymmetric solves `A C + C Aᵀ = -D`.
    ///
    /// # Panics
    /// Never: a covariance without small eigenvalues is invertible.
    #[must_use]
    pub fn random(draws: &mut Draws) -> Self {
        let (stationary, diffusion, raw) = (draws.covariance::<N>(), draws.covariance::<N>(), draws.matrix::<N>());
        let drift = (raw - raw.transpose() - diffusion / 2.0)
            * stationary.try_inverse().unwrap_or_else(|| unreachable!("C is regular"));
        Self { drift, stationary, gradient: draws.vector() }
    }
}

impl<const N: usize, const L: usize> Dynamics<f64, N, L> for Flow<N> {
    type Prepared = SMatrix<f64, N, N>;

    fn prepare(&self, dt_s: f64) -> SMatrix<f64, N, N> {
        let exponential = DMatrix::from_fn(N, N, |i, j| self.drift[(i, j)] * dt_s).exp();
        SMatrix::from_fn(|i, j| exponential[(i, j)])
    }

    fn transition(&self, f: &Self::Prepared, from: &Belief<f64, N, L>, _: Option<Phase>) -> Transition<f64, N, L> {
        let noise = Symmetric::from_lower(&(self.stationary - f * self.stationary * f.transpose()));
        Transition { mean: f * from.mean, jacobian: *f, noise }
    }
}

impl<const N: usize, const L: usize> Channel<f64, N, L> for Flow<N> {
    fn observe(&self, at: &Belief<f64, N, L>, _: Option<Phase>) -> Observation<f64, N> {
        Observation { value: self.gradient.dot(&at.mean), gradient: self.gradient, variance: 0.3 }
    }
}
