use ohmstrain_model::{
    Direction, Number, Observation, Phase, Scalar, SwitchedModel, SwitchedStep, Symmetric, Transition,
};

use crate::Belief;

/// Model of the state's motion in time. `L = N (N + 1) / 2`.
pub trait Dynamics<T: Scalar, const N: usize, const L: usize> {
    /// Values that depend only on the length of a step.
    type Prepared: Copy;

    /// Prepares steps of `dt_s ≥ 0` seconds.
    fn prepare(&self, dt_s: T) -> Self::Prepared;

    /// Longest step, s, over which [`Self::transition`] is as accurate as many short ones; infinite by default.
    fn longest_step_s(&self) -> T {
        T::one() / T::zero()
    }

    /// Returns the transition over a prepared step, linearised at the belief's mean. `phase` is a hypothesis; with
    /// `None` the model infers the direction from the belief. Models without phases ignore it.
    fn transition(&self, step: &Self::Prepared, from: &Belief<T, N, L>, phase: Option<Phase>) -> Transition<T, N, L>;

    /// Returns `F P Fᵀ + Q`. The default multiplies full matrices; a model with known zeros in F can be faster.
    fn propagate(&self, covariance: &Symmetric<T, N, L>, transition: &Transition<T, N, L>) -> Symmetric<T, N, L> {
        covariance.congruence(&transition.jacobian).plus(&transition.noise)
    }
}

/// Model of a scalar reading as a function of the state.
pub trait Channel<T: Scalar, const N: usize, const L: usize> {
    /// Returns the reading expected at the belief's mean, its gradient and the variance of its noise; `phase` as for
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

/// Returns the direction at the time of a reading.
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

/// A reading with its own extra variance, for example from an analogue front end, which adds to the channel's variance.
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
    /// Returns the reading with additional noise, so that the innovation variance S becomes S/w. The gain, and so the correction of
    /// the state, is then w times as large.
    #[must_use]
    pub fn weighted(self, weight: T, variance: T) -> Self {
        Self { extra_variance: self.extra_variance + variance * (T::one() / weight - T::one()), ..self }
    }

    /// Returns the reading with its noise increased by a factor, for a reading too exact for floating-point numbers with this
    /// `rounding`, given the channel's own `variance`; `None` if it is so far away that noise does not help.
    #[must_use]
    pub fn coarser(self, variance: T, rounding: T) -> Option<Self> {
        // Resolution of a relative reading of order one.
        let noise = self.extra_variance + variance + rounding * rounding;
        // A reading so far away that its square overflows is not just too exact.
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
