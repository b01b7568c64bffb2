//! Models of this crate in adskalman's Kalman filter: for existing users of adskalman, and for several readings at
//! once.
//!
//! Readings with independent noise can be taken one after the other with [`Ekf::step`](crate::Ekf::step), in steps of
//! zero seconds. That costs less, and the second channel is linearised at the result of the first. Readings with
//! correlated noise (two sensors on one supply) need the vector form: [`LinearStep::with_noise`].
//!
//! adskalman treats a vector with one NaN as missing altogether. [`LinearStep::take`] removes single components
//! instead. In debug builds adskalman rejects covariances that are asymmetric by more than 1e-5 of an entry; those of
//! this crate are symmetric.

use adskalman::{ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
use nalgebra::{Const, DimMin, SMatrix, SVector};
use ohmstrain_model::{Observation, Phase, Scalar, Symmetric, Transition};

use crate::{Belief, Channel, Dynamics, Reading, StepError};

/// A linearised step as adskalman's transition and observation model, with `M` readings at once.
///
/// The step is affine, `x' = mean + F (x - x̂)` and `y = value + H (x - x̂′)`; the offsets are kept, so that nonlinear
/// laws give the same result as in [`Ekf`](crate::Ekf). For a nonlinear law, create a new one at every step, as in
/// `examples/adskalman.rs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearStep<T, const N: usize, const M: usize> {
    from: SVector<T, N>,
    to: SVector<T, N>,
    transition: SMatrix<T, N, N>,
    transition_transposed: SMatrix<T, N, N>,
    noise: SMatrix<T, N, N>,
    at: SVector<T, N>,
    value: SVector<T, M>,
    gradient: SMatrix<T, M, N>,
    gradient_transposed: SMatrix<T, N, M>,
    variance: SMatrix<T, M, M>,
}

impl<T: Scalar, const N: usize, const M: usize> LinearStep<T, N, M> {
    /// - `from`: the state at which `transition` was linearised.
    /// - `at`: the state at which the observations were linearised, usually `transition.mean`.
    ///
    /// The readings' noises are assumed independent.
    #[must_use]
    pub fn new<const L: usize>(
        from: SVector<T, N>,
        transition: &Transition<T, N, L>,
        at: SVector<T, N>,
        observations: &[Observation<T, N>; M],
    ) -> Self {
        let gradient_transposed = SMatrix::from_columns(&observations.map(|observation| observation.gradient));
        Self {
            from,
            to: transition.mean,
            transition: transition.jacobian,
            transition_transposed: transition.jacobian.transpose(),
            noise: transition.noise.to_matrix(),
            at,
            value: SVector::from(observations.map(|observation| observation.value)),
            gradient: gradient_transposed.transpose(),
            gradient_transposed,
            variance: SMatrix::from_diagonal(&SVector::from(observations.map(|observation| observation.variance))),
        }
    }

    /// Linearises a prepared step of `model` from `belief`, and the readings of `channels` after it, as
    /// [`Ekf`](crate::Ekf) does.
    #[must_use]
    pub fn linearise<D: Dynamics<T, N, L>, const L: usize>(
        model: &D,
        channels: [&dyn Channel<T, N, L>; M],
        prepared: &D::Prepared,
        belief: &Belief<T, N, L>,
        phase: Option<Phase>,
    ) -> Self {
        let transition = model.transition(prepared, belief, phase);
        let covariance = model.propagate(&belief.covariance, &transition);
        let prior = Belief { mean: transition.mean, covariance };
        let observations = channels.map(|channel| channel.observe(&prior, phase));
        Self::new(belief.mean, &transition, prior.mean, &observations)
    }

    /// Returns the same step with another covariance R of the readings' noise, for example with correlations.
    #[must_use]
    pub fn with_noise(self, variance: SMatrix<T, M, M>) -> Self {
        Self { variance, ..self }
    }

    /// Returns the step with only the available readings, and the vector of readings to pass to adskalman with it.
    ///
    /// For a missing reading the row of H becomes zero, its noise independent with variance one, and its value the
    /// expected one, so that it has no effect. Extra variances are added to R. If all readings are missing, all values
    /// are NaN, which adskalman treats as a prediction.
    ///
    /// # Errors
    /// [`StepError::NonFiniteReading`], where adskalman would treat the whole vector as missing.
    pub fn take(&self, readings: &[Option<Reading<T>>; M]) -> Result<(Self, SVector<T, M>), StepError> {
        let mut step = *self;
        let mut values = self.value;
        for (i, reading) in readings.iter().enumerate() {
            match reading {
                Some(reading) => {
                    if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
                        return Err(StepError::NonFiniteReading);
                    }
                    values[i] = reading.value;
                    step.variance[(i, i)] += reading.extra_variance;
                }
                None => step = step.without(i),
            }
        }
        if readings.iter().all(Option::is_none) {
            values.fill(T::of(f64::NAN));
        }
        Ok((step, values))
    }

    /// Returns the step without reading `i < M`; the expected value is passed to adskalman in its place.
    fn without(mut self, i: usize) -> Self {
        self.gradient.row_mut(i).fill(T::zero());
        self.gradient_transposed.column_mut(i).fill(T::zero());
        self.variance.row_mut(i).fill(T::zero());
        self.variance.column_mut(i).fill(T::zero());
        self.variance[(i, i)] = T::one();
        self
    }
}

/// Converts a belief to adskalman's form.
impl<T: Scalar, const N: usize, const L: usize> From<Belief<T, N, L>> for StateAndCovariance<T, Const<N>> {
    fn from(belief: Belief<T, N, L>) -> Self {
        Self::new(belief.mean, belief.covariance.to_matrix())
    }
}

/// Reads the lower triangle of adskalman's covariance.
impl<T: Scalar, const N: usize, const L: usize> From<&StateAndCovariance<T, Const<N>>> for Belief<T, N, L> {
    fn from(estimate: &StateAndCovariance<T, Const<N>>) -> Self {
        Self { mean: *estimate.state(), covariance: Symmetric::from_lower(estimate.covariance()) }
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl<T: Scalar, const N: usize, const M: usize> TransitionModelLinearNoControl<T, Const<N>> for LinearStep<T, N, M> {
    fn F(&self) -> &SMatrix<T, N, N> {
        &self.transition
    }

    fn FT(&self) -> &SMatrix<T, N, N> {
        &self.transition_transposed
    }

    fn Q(&self) -> &SMatrix<T, N, N> {
        &self.noise
    }

    fn predict(&self, previous: &StateAndCovariance<T, Const<N>>) -> StateAndCovariance<T, Const<N>> {
        let state = self.to + self.transition * (previous.state() - self.from);
        let covariance = self.transition * previous.covariance() * self.transition_transposed + self.noise;
        StateAndCovariance::new(state, covariance)
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl<T: Scalar, const N: usize, const M: usize> ObservationModel<T, Const<N>, Const<M>> for LinearStep<T, N, M>
where
    Const<M>: DimMin<Const<M>, Output = Const<M>>,
{
    fn H(&self) -> &SMatrix<T, M, N> {
        &self.gradient
    }

    fn HT(&self) -> &SMatrix<T, N, M> {
        &self.gradient_transposed
    }

    fn R(&self) -> &SMatrix<T, M, M> {
        &self.variance
    }

    fn predict_observation(&self, state: &SVector<T, N>) -> SVector<T, M> {
        self.value + self.gradient * (state - self.at)
    }
}
