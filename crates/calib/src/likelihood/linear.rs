use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics};
use ohmstrain_model::{Observation, Phase, Scalar, Symmetric, Transition};

/// A linear model that is the same at every step, whatever its length: `x' = F x + n`, `y = H x + w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearModel<T, const N: usize, const L: usize> {
    /// Transition F.
    pub transition: SMatrix<T, N, N>,
    /// Covariance Q of n.
    pub noise: Symmetric<T, N, L>,
    /// Observation row H.
    pub gradient: SVector<T, N>,
    /// Variance R of w.
    pub variance: T,
}

impl<T: Scalar, const N: usize, const L: usize> Dynamics<T, N, L> for LinearModel<T, N, L> {
    type Prepared = ();

    fn prepare(&self, _dt_s: T) {}

    fn transition(&self, (): &(), from: &Belief<T, N, L>, _: Option<Phase>) -> Transition<T, N, L> {
        Transition { mean: self.transition * from.mean, jacobian: self.transition, noise: self.noise }
    }
}

impl<T: Scalar, const N: usize, const L: usize> Channel<T, N, L> for LinearModel<T, N, L> {
    fn observe(&self, at: &Belief<T, N, L>, _: Option<Phase>) -> Observation<T, N> {
        Observation { value: self.gradient.dot(&at.mean), gradient: self.gradient, variance: self.variance }
    }
}
