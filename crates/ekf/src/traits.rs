use nalgebra::SVector;
use ohmstrain_model::{Direction, Observation, Scalar, SwitchedModel, SwitchedStep, Symmetric, Transition};

/// How the state moves in time. `L = N (N + 1) / 2`.
pub trait Dynamics<T: Scalar, const N: usize, const L: usize> {
    /// What depends on the length of a step only.
    type Prepared: Copy;

    /// Prepares steps of `dt_s ≥ 0` seconds.
    fn prepare(&self, dt_s: T) -> Self::Prepared;

    /// The transition over a prepared step, linearised at `state`. Models of one phase ignore the direction.
    fn transition(&self, step: &Self::Prepared, state: &SVector<T, N>, direction: Direction<T>) -> Transition<T, N, L>;

    /// `F P Fᵀ + Q`. The default multiplies full matrices; a model that knows where its zeros are can do better.
    fn propagate(&self, covariance: &Symmetric<T, N, L>, transition: &Transition<T, N, L>) -> Symmetric<T, N, L> {
        covariance.congruence(&transition.jacobian).plus(&transition.noise)
    }
}

/// How a scalar reading depends on the state.
pub trait Channel<T: Scalar, const N: usize> {
    /// The reading expected at `state`, its gradient and the variance of its noise.
    fn observe(&self, state: &SVector<T, N>, direction: Direction<T>) -> Observation<T, N>;
}

impl<T: Scalar, const M: usize, const B: usize, const N: usize, const L: usize> Dynamics<T, N, L>
    for SwitchedModel<T, M, B, N>
{
    type Prepared = SwitchedStep<T, M, B>;

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        self.prepare(dt_s)
    }

    fn transition(&self, step: &Self::Prepared, state: &SVector<T, N>, direction: Direction<T>) -> Transition<T, N, L> {
        self.transition(step, state, direction)
    }
}

impl<T: Scalar, const M: usize, const B: usize, const N: usize> Channel<T, N> for SwitchedModel<T, M, B, N> {
    fn observe(&self, state: &SVector<T, N>, direction: Direction<T>) -> Observation<T, N> {
        self.observe(state, direction)
    }
}

/// A reading with the variance that it brings along, from an analogue front end for instance; the channel's own
/// variance is added to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<T> {
    /// The reading, in the channel's unit.
    pub value: T,
    /// Variance beyond the channel's own.
    pub extra_variance: T,
}

impl<T: Scalar> From<T> for Reading<T> {
    fn from(value: T) -> Self {
        Self { value, extra_variance: T::zero() }
    }
}
