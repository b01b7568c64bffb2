use ohmstrain_model::Scalar;

use crate::{Belief, Gaussian, Reading, StepError};

/// Common interface of all estimators: a prepared step maps a state to the next one.
///
/// The estimator is configuration, and the state belongs to the caller; an error leaves the state unchanged. Outlier guards
/// ([`Guard`](crate::Guard)) and smoothing of past steps ([`smooth_back_through`](crate::smooth_back_through)) work on any of
/// them.
pub trait Estimator<T: Scalar, const N: usize, const L: usize> {
    /// State carried from step to step.
    type State: State<T, N, L>;
    /// Values that depend only on the length of a step.
    type Prepared: Copy;

    /// Prepares steps of `dt_s ≥ 0` seconds.
    fn prepare(&self, dt_s: T) -> Self::Prepared;

    /// Longest step, s, over which one prediction is as accurate as many short ones; [`Substeps`](crate::Substeps) divides
    /// longer steps. Infinite by default.
    fn longest_step_s(&self) -> T {
        T::one() / T::zero()
    }

    /// Length, s, of the step prepared for `dt_s`: `dt_s` itself, unless lengths that differ only by rounding are merged.
    fn length_s(&self, dt_s: T) -> T {
        dt_s
    }

    /// Predicts over a prepared step, then takes the reading, if there is one.
    ///
    /// # Errors
    /// See [`StepError`].
    fn advance(
        &self,
        state: &Self::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<Self::State, T>, StepError>;

    /// Writes the result of [`Self::advance`] into an existing state, which saves a move. After an error that state is
    /// meaningless.
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

    /// Smooths one step backwards. Returns the state at time k given all readings, from `filtered` at k, the step from k
    /// to k+1, and `next`, the smoothed state at k+1.
    ///
    /// # Errors
    /// [`StepError::NoSmoother`] by default. Otherwise a step that succeeded forward also succeeds backward.
    fn smooth_back(
        &self,
        _filtered: &Self::State,
        _prepared: &Self::Prepared,
        _reading: Option<Reading<T>>,
        _next: &Self::State,
    ) -> Result<Self::State, StepError> {
        Err(StepError::NoSmoother)
    }
}

/// State that an estimator carries from step to step.
pub trait State<T: Scalar, const N: usize, const L: usize>: Clone {
    /// Returns the Gaussian with the mean and covariance of the state.
    fn moments(&self) -> Belief<T, N, L>;

    /// Returns mean and variance of one component.
    fn marginal(&self, index: usize) -> Gaussian<T> {
        let belief = self.moments();
        Gaussian { mean: belief.mean[index], variance: belief.covariance[(index, index)] }
    }

    /// Visits the components of the mixture: weights that sum to one, and Gaussians.
    fn each(&self, visit: &mut dyn FnMut(T, &Belief<T, N, L>));

    /// Probability of each phase, in the order of [`Phase::ALL`](ohmstrain_model::Phase::ALL); `None` if the estimator
    /// has no phases.
    fn phases(&self) -> Option<[T; 3]>;

    /// Returns the same state with its covariances multiplied by `factor`.
    #[must_use]
    fn inflated(&self, factor: T) -> Self;

    /// Returns the state with another one added, which gets `share` of the weight, 0 to 1, so that a filter that has diverged can
    /// recover. In a mixture it takes a free slot, or that of the hypothesis of least weight; a state without slots is returned
    /// unchanged.
    #[must_use]
    fn beside(&self, _other: &Self, _share: T) -> Self {
        self.clone()
    }

    /// Returns the state limited to that many hypotheses in further steps; a state that is not a mixture is returned
    /// unchanged.
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
    /// Variance of the innovation.
    pub variance: T,
    /// Normalised innovation squared: χ² with one degree of freedom if the estimator is consistent.
    pub nis: T,
    /// Predictive log density of the reading, including the constant.
    pub log_likelihood: T,
}
