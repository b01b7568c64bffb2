//! Models that several tests share. The oracles stand in the tests themselves.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Channel, Dynamics};
use ohmstrain_model::{Direction, Observation, Scalar, Symmetric, Transition};

/// A linear model with fixed matrices, the same for every step: `x' = F x + n`, `y = H x + w`.
#[derive(Clone, Copy, Debug)]
pub struct Linear<T, const N: usize> {
    /// Transition F.
    pub transition: SMatrix<T, N, N>,
    /// Covariance Q of n.
    pub noise: SMatrix<T, N, N>,
    /// Observation row H.
    pub gradient: SVector<T, N>,
    /// Variance R of w.
    pub variance: T,
}

impl<T: Scalar, const N: usize, const L: usize> Dynamics<T, N, L> for Linear<T, N> {
    type Prepared = ();

    fn prepare(&self, _dt_s: T) {}

    fn transition(&self, (): &(), state: &SVector<T, N>, _: Direction<T>) -> Transition<T, N, L> {
        Transition {
            mean: self.transition * state,
            jacobian: self.transition,
            noise: Symmetric::from_lower(&self.noise),
        }
    }
}

impl<T: Scalar, const N: usize> Channel<T, N> for Linear<T, N> {
    fn observe(&self, state: &SVector<T, N>, _: Direction<T>) -> Observation<T, N> {
        Observation { value: self.gradient.dot(state), gradient: self.gradient, variance: self.variance }
    }
}
