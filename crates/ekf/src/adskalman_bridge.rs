//! Any of our models through adskalman's Kalman filter: for those who use it already, and for several readings at once.
//!
//! Readings whose noises are independent can be taken one after the other with [`Ekf::step`](crate::Ekf::step), steps of
//! zero seconds in between, at less cost and with the second channel linearised where the first one led to. Readings
//! with correlated noise (two sensors on one supply) need the vector form: [`LinearStep::with_noise`].
//!
//! adskalman treats a vector with one NaN as missing altogether. [`LinearStep::take`] takes single components out
//! instead. In debug builds adskalman refuses covariances that are asymmetric by more than 1e-5 of an entry; ours are
//! symmetric.

use adskalman::{ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
use nalgebra::{Const, DimMin, SMatrix, SVector};
use ohmstrain_model::{Observation, Phase, Scalar, Symmetric, Transition};

use crate::{Belief, Channel, Dynamics, Reading, StepError};

/// A linearised step as adskalman's transition and observation model, with `M` readings at once.
///
/// The step is affine, `x' = mean + F (x - x̂)` and `y = value + H (x - x̂′)`; the offsets are kept, so nonlinear laws
/// go through unchanged. For a nonlinear law make a new one at every step. `examples/adskalman.rs` does.
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
    /// The readings' noises are taken as independent.
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

    /// A prepared step of `model` from `belief`, and what `channels` see after it, all linearised as [`Ekf`](crate::Ekf)
    /// does.
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

    /// The same with another covariance R of the readings' noise, that of correlated noises for instance.
    #[must_use]
    pub fn with_noise(self, variance: SMatrix<T, M, M>) -> Self {
        Self { variance, ..self }
    }

    /// The step with only those readings that came, and the vector to hand to adskalman with it.
    ///
    /// A missing reading's row of H becomes zero, its noise one and independent, and its value what is expected, so it
    /// moves nothing. Extra variances are added to R. If no reading came, all values are NaN: for adskalman a prediction.
    ///
    /// # Errors
    /// [`StepError::NonFiniteReading`], where adskalman would take the whole vector as missing.
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

    /// The step without reading `i < M`, if the expected value is handed to adskalman in its place.
    fn without(mut self, i: usize) -> Self {
        self.gradient.row_mut(i).fill(T::zero());
        self.gradient_transposed.column_mut(i).fill(T::zero());
        self.variance.row_mut(i).fill(T::zero());
        self.variance.column_mut(i).fill(T::zero());
        self.variance[(i, i)] = T::one();
        self
    }
}

/// adskalman's form of a belief.
impl<T: Scalar, const N: usize, const L: usize> From<Belief<T, N, L>> for StateAndCovariance<T, Const<N>> {
    fn from(belief: Belief<T, N, L>) -> Self {
        Self::new(belief.mean, belief.covariance.to_matrix())
    }
}

/// The lower triangle of adskalman's covariance is read.
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
