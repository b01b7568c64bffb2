use ohmstrain_model::{
    Direction, Number, Observation, Phase, Scalar, SwitchedModel, SwitchedStep, Symmetric, Transition,
};

use crate::Belief;

/// Model of the state's motion in time. `L = N (N + 1) / 2`.
pub trait Dynamics<T: Scalar, const N: usize, const L: usize> {
    /// Values that depend on the length of a step only.
    type Prepared: Copy;

    /// Prepares steps of `dt_s ≥ 0` seconds.
    fn prepare(&self, dt_s: T) -> Self::Prepared;

    /// The longest step, s, over which [`Self::transition`] is as good as many short ones; infinite by
    /// default.
    fn longest_step_s(&self) -> T {
        T::one() / T::zero()
    }

    /// The transition over a prepared step, linearised at the belief's mean. `phase` is a hypothesis; with `None` the
    /// model makes the best of the belief. Models of one phase ignore it.
    fn transition(&self, step: &Self::Prepared, from: &Belief<T, N, L>, phase: Option<Phase>) -> Transition<T, N, L>;

    /// `F P Fᵀ + Q`. The default multiplies full matrices; a model that knows where its zeros are can do better.
    fn propagate(&self, covariance: &Symmetric<T, N, L>, transition: &Transition<T, N, L>) -> Symmetric<T, N, L> {
        covariance.congruence(&transition.jacobian).plus(&transition.noise)
    }
}

/// Model of a scalar reading as a function of the state.
pub trait Channel<T: Scalar, const N: usize, const L: usize> {
    /// The reading expected at the belief's mean, its gradient and the variance of its noise; `phase` as for
    /// [`Dynamics::transition`].
    fn observe(&self, at: &Belief<T, N, L>, phase: Option<Phase>) -> Observation<T, N>;
}

impl<T: Scalar, const B: usize, const N: usize, const L: usize> Dynamics<T, N, L> for SwitchedModel<T, B, N> {
    type Prepared = SwitchedStep<T, B>;

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        self.prepare(dt_s)
    }

    fn longest_step_s(&self) -> T {
        self.longest_step_s()
    }

    fn transition(&self, step: &Self::Prepared, from: &Belief<T, N, L>, phase: Option<Phase>) -> Transition<T, N, L> {
        let direction = match phase {
            Some(phase) => Direction::Known(phase),
            None => self.uncertain_direction(step, &from.covariance),
        };
        self.transition(step, &from.mean, direction)
    }

    fn propagate(&self, covariance: &Symmetric<T, N, L>, transition: &Transition<T, N, L>) -> Symmetric<T, N, L> {
        self.propagate(covariance, transition)
    }
}

/// The direction at the instant of a reading.
fn at_reading<T: Scalar>(rate_variance: T) -> Direction<T> {
    Direction::Uncertain { rate_sd: rate_variance.max(T::zero()).sqrt(), persistence: T::one() }
}

impl<T: Scalar, const B: usize, const N: usize, const L: usize> Channel<T, N, L> for SwitchedModel<T, B, N> {
    fn observe(&self, at: &Belief<T, N, L>, phase: Option<Phase>) -> Observation<T, N> {
        let direction = match phase {
            Some(phase) => Direction::Known(phase),
            None => at_reading(at.covariance[(1, 1)]),
        };
        self.observe(&at.mean, direction)
    }
}

/// A reading with the variance that it brings along, from an analogue front end for instance; the channel's own
/// variance is added to it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading<T> {
    /// The reading, in the channel's unit.
    pub value: T,
    /// Variance beyond the channel's own.
    pub extra_variance: T,
}

impl<T: Number> Reading<T> {
    /// Returns the reading with so much more noise that the innovation's variance S becomes S/w: the gain, and with it the step, is w
    /// times as large.
    #[must_use]
    pub fn weighted(self, weight: T, variance: T) -> Self {
        Self { extra_variance: self.extra_variance + variance * (T::one() / weight - T::one()), ..self }
    }

    /// Returns the reading with more noise, by a factor, if it is more exact than numbers of such a rounding allow beside a channel's own
    /// `variance`; `None` if it is so far away that noise is of no use.
    #[must_use]
    pub fn coarser(self, variance: T, rounding: T) -> Option<Self> {
        // A relative reading of order one is not known better than this.
        let noise = self.extra_variance + variance + rounding * rounding;
        // What is so far away that its square overflows is not too exact.
        let is_near = (self.value * self.value / noise).is_finite();
        is_near.then(|| Self { extra_variance: T::of(COARSER) * noise, ..self })
    }
}

/// Growth of a reading's variance from one try to the next.
const COARSER: f64 = 16.0;

impl<T: Scalar> From<T> for Reading<T> {
    fn from(value: T) -> Self {
        Self { value, extra_variance: T::zero() }
    }
}
