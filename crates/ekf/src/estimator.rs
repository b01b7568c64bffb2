use ohmstrain_model::Scalar;

use crate::{Belief, Gaussian, Reading, StepError};

/// Common interface of all estimators: a state that a prepared step turns into the next one.
///
/// The estimator is configuration, the state is the caller's; an error leaves it as it was. Outlier guards
/// ([`Guard`](crate::Guard)) and smoothing of past steps ([`smooth_back_through`](crate::smooth_back_through)) work on any of
/// them.
pub trait Estimator<T: Scalar, const N: usize, const L: usize> {
    /// State carried from step to step.
    type State: State<T, N, L>;
    /// Values that depend on the length of a step only.
    type Prepared: Copy;

    /// Prepares steps of `dt_s ≥ 0` seconds.
    fn prepare(&self, dt_s: T) -> Self::Prepared;

    /// The longest step, s, over which a prediction is as good as many short ones; [`Substeps`](crate::Substeps) divides longer
    /// ones. Infinite by default.
    fn longest_step_s(&self) -> T {
        T::one() / T::zero()
    }

    /// Length, s, of the step that is prepared for one of `dt_s`: that itself, unless steps that differ by rounding are one.
    fn length_s(&self, dt_s: T) -> T {
        dt_s
    }

    /// Predicts over a prepared step, then takes the reading; without one it is a prediction.
    ///
    /// # Errors
    /// See [`StepError`].
    fn advance(
        &self,
        state: &Self::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<Self::State, T>, StepError>;

    /// [`Self::advance`] into a state that is there already, whatever it was: nothing need be moved. After an error it means
    /// nothing.
    ///
    /// # Errors
    /// See [`StepError`].
    fn advance_into(
        &self,
        state: &Self::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
        next: &mut Self::State,
    ) -> Result<Option<Innovation<T>>, StepError> {
        let Advanced { state, innovation } = self.advance(state, prepared, reading)?;
        *next = state;
        Ok(innovation)
    }

    /// One step backwards: the state at time k given all readings, from `filtered` at k, the step that led from there to
    /// k+1, and `next`, the state at k+1 given all readings. `None` if the estimator has no smoother.
    ///
    /// # Errors
    /// See [`StepError`]; a step that went forward goes backward.
    fn smooth_back(
        &self,
        _filtered: &Self::State,
        _prepared: &Self::Prepared,
        _reading: Option<Reading<T>>,
        _next: &Self::State,
    ) -> Result<Option<Self::State>, StepError> {
        Ok(None)
    }
}

/// State that an estimator carries from step to step.
pub trait State<T: Scalar, const N: usize, const L: usize>: Clone {
    /// The Gaussian with its mean and covariance.
    fn moments(&self) -> Belief<T, N, L>;

    /// Mean and variance of one of its components.
    fn marginal(&self, index: usize) -> Gaussian<T> {
        let belief = self.moments();
        Gaussian { mean: belief.mean[index], variance: belief.covariance[(index, index)] }
    }

    /// Visits what the state is a mixture of: weights that sum to one, and Gaussians.
    fn each(&self, visit: &mut dyn FnMut(T, &Belief<T, N, L>));

    /// Probability of each phase, in the order of [`Phase::ALL`](ohmstrain_model::Phase::ALL); `None` if the estimator
    /// has no phases.
    fn phases(&self) -> Option<[T; 3]>;

    /// Returns the same state with less confidence: covariances times `factor`.
    #[must_use]
    fn inflated(&self, factor: T) -> Self;

    /// Returns the state with another one beside it that has `share` of the weight, 0 to 1, from which a filter that has lost its
    /// way may find it. In a filter of hypotheses it gets a free place or that of the lightest; a state without room for another stays as it is.
    #[must_use]
    fn beside(&self, _other: &Self, _share: T) -> Self {
        self.clone()
    }

    /// Returns the state, of which steps keep at most that many hypotheses; a state that is no mixture stays as it is.
    #[must_use]
    fn keeping(self, _most: usize) -> Self {
        self
    }
}

/// Result of one step of any estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Advanced<S, T> {
    /// The state after the reading.
    pub state: S,
    /// Comparison of the reading with its prediction; `None` if the reading was missing.
    pub innovation: Option<Innovation<T>>,
}

/// A reading compared with its prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Innovation<T> {
    /// Reading minus expected reading.
    pub value: T,
    /// Its variance.
    pub variance: T,
    /// Normalised innovation squared: χ² with one degree of freedom if the estimator is consistent.
    pub nis: T,
    /// Log density of the reading before it was seen, constant included.
    pub log_likelihood: T,
}
