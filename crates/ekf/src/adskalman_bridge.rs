use adskalman::{ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
use nalgebra::{SMatrix, SVector, U1};
use ohmstrain_model::{Observation, Scalar, Transition};

/// A linearised step as adskalman's transition and observation model, so that its Kalman filter can be driven with any
/// of our models.
///
/// The step is affine, `x' = mean + F (x - x̂)` and `y = value + H (x - x̂′)`; the offsets are kept, so nonlinear laws
/// go through unchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearStep<T, const N: usize> {
    from: SVector<T, N>,
    to: SVector<T, N>,
    transition: SMatrix<T, N, N>,
    transition_transposed: SMatrix<T, N, N>,
    noise: SMatrix<T, N, N>,
    at: SVector<T, N>,
    value: SVector<T, 1>,
    gradient: SMatrix<T, 1, N>,
    gradient_transposed: SVector<T, N>,
    variance: SMatrix<T, 1, 1>,
}

impl<T: Scalar, const N: usize> LinearStep<T, N> {
    /// - `from`: the state at which `transition` was linearised.
    /// - `at`: the state at which `observation` was linearised, usually `transition.mean`.
    #[must_use]
    pub fn new<const L: usize>(
        from: SVector<T, N>,
        transition: &Transition<T, N, L>,
        at: SVector<T, N>,
        observation: &Observation<T, N>,
    ) -> Self {
        Self {
            from,
            to: transition.mean,
            transition: transition.jacobian,
            transition_transposed: transition.jacobian.transpose(),
            noise: transition.noise.to_matrix(),
            at,
            value: SVector::from([observation.value]),
            gradient: observation.gradient.transpose(),
            gradient_transposed: observation.gradient,
            variance: SMatrix::from([[observation.variance]]),
        }
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl<T: Scalar, const N: usize> TransitionModelLinearNoControl<T, nalgebra::Const<N>> for LinearStep<T, N> {
    fn F(&self) -> &SMatrix<T, N, N> {
        &self.transition
    }

    fn FT(&self) -> &SMatrix<T, N, N> {
        &self.transition_transposed
    }

    fn Q(&self) -> &SMatrix<T, N, N> {
        &self.noise
    }

    fn predict(
        &self,
        previous: &StateAndCovariance<T, nalgebra::Const<N>>,
    ) -> StateAndCovariance<T, nalgebra::Const<N>> {
        let state = self.to + self.transition * (previous.state() - self.from);
        let covariance = self.transition * previous.covariance() * self.transition_transposed + self.noise;
        StateAndCovariance::new(state, covariance)
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl<T: Scalar, const N: usize> ObservationModel<T, nalgebra::Const<N>, U1> for LinearStep<T, N> {
    fn H(&self) -> &SMatrix<T, 1, N> {
        &self.gradient
    }

    fn HT(&self) -> &SMatrix<T, N, 1> {
        &self.gradient_transposed
    }

    fn R(&self) -> &SMatrix<T, 1, 1> {
        &self.variance
    }

    fn predict_observation(&self, state: &SVector<T, N>) -> SVector<T, 1> {
        self.value + self.gradient * (state - self.at)
    }
}
