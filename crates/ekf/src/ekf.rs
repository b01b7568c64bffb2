use nalgebra::SVector;
use ohmstrain_model::{Observation, Scalar, Symmetric, Transition};

use crate::clock::check_time_step;
use crate::smooth::rts_step;
use crate::substeps::{Pause, is_one_step};
use crate::{Advanced, Belief, Channel, Dynamics, Estimator, Innovation, Reading, State, StepError};

/// Extended Kalman filter: one Gaussian, linearised at its mean.
///
/// The smallest estimator. It takes the direction of motion from its own prediction, so it can lock onto the wrong
/// direction where stretching and releasing both raise the reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ekf<M> {
    model: M,
}

/// Results of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<T, const N: usize, const L: usize> {
    /// Transition from the old belief, for a smoother.
    pub transition: Transition<T, N, L>,
    /// The belief before the reading.
    pub prior: Belief<T, N, L>,
    /// The belief after it; the prior if the reading was missing.
    pub posterior: Belief<T, N, L>,
    /// Effect of the reading; `None` if it was missing.
    pub update: Option<Update<T, N>>,
}

/// Effect of a reading on a belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update<T, const N: usize> {
    /// The expected reading, its gradient H and noise variance R (the reading's own included).
    pub observation: Observation<T, N>,
    /// Reading minus expected reading, ν.
    pub innovation: T,
    /// Its variance `S = H P Hᵀ + R`.
    pub innovation_variance: T,
    /// Normalised innovation squared ν²/S: χ² with one degree of freedom if the filter is consistent.
    pub nis: T,
    /// Predictive log density of the reading, including the constant.
    pub log_likelihood: T,
    /// Kalman gain K.
    pub gain: SVector<T, N>,
}

impl<M> Ekf<M> {
    /// Creates a filter for `model`.
    pub const fn new(model: M) -> Self {
        Self { model }
    }

    /// The model.
    pub const fn model(&self) -> &M {
        &self.model
    }

    /// Predicts `dt_s ≥ 0` seconds ahead, in as many steps as the model needs, then takes the reading.
    ///
    /// # Errors
    /// See [`StepError`]; the belief passed in is unchanged.
    pub fn step<T: Scalar, const N: usize, const L: usize>(
        &self,
        belief: &Belief<T, N, L>,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<Step<T, N, L>, StepError>
    where
        M: Dynamics<T, N, L> + Channel<T, N, L>,
    {
        check_time_step(dt_s)?;
        if !dt_s.is_zero() && is_one_step(dt_s, self.model.longest_step_s()) {
            return self.step_prepared(belief, &self.model.prepare(dt_s), reading);
        }
        let (transition, prior) =
            if dt_s.is_zero() { (stand_still(belief), *belief) } else { self.predict_over(belief, dt_s) };
        self.finish(transition, prior, reading)
    }

    /// Returns the transition over a pause of several steps, and the belief after it.
    #[cold]
    #[inline(never)]
    fn predict_over<T: Scalar, const N: usize, const L: usize>(
        &self,
        belief: &Belief<T, N, L>,
        dt_s: T,
    ) -> (Transition<T, N, L>, Belief<T, N, L>)
    where
        M: Dynamics<T, N, L>,
    {
        let from = (stand_still(belief), *belief);
        Pause::none(self.model.longest_step_s()).after(dt_s).steps().fold(from, |(transition, prior), length_s| {
            let (onward, prior) = self.predict(&prior, &self.model.prepare(length_s));
            (followed_by(&transition, &onward), prior)
        })
    }

    /// Steps with a prepared step, for sensors read at a fixed rate.
    ///
    /// # Errors
    /// See [`StepError`]; the belief passed in is unchanged.
    #[inline]
    pub fn step_prepared<T: Scalar, const N: usize, const L: usize>(
        &self,
        belief: &Belief<T, N, L>,
        prepared: &M::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Step<T, N, L>, StepError>
    where
        M: Dynamics<T, N, L> + Channel<T, N, L>,
    {
        let (transition, prior) = self.predict(belief, prepared);
        self.finish(transition, prior, reading)
    }

    /// Returns the transition over a prepared step, and the belief after it.
    #[inline]
    fn predict<T: Scalar, const N: usize, const L: usize>(
        &self,
        belief: &Belief<T, N, L>,
        prepared: &M::Prepared,
    ) -> (Transition<T, N, L>, Belief<T, N, L>)
    where
        M: Dynamics<T, N, L>,
    {
        let transition = self.model.transition(prepared, belief, None);
        let covariance = self.model.propagate(&belief.covariance, &transition);
        (transition, Belief { mean: transition.mean, covariance })
    }

    #[inline]
    fn finish<T: Scalar, const N: usize, const L: usize>(
        &self,
        transition: Transition<T, N, L>,
        prior: Belief<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Step<T, N, L>, StepError>
    where
        M: Channel<T, N, L>,
    {
        let (posterior, update) = match reading {
            None => (prior, None),
            Some(reading) => {
                let (posterior, update) = update(&prior, self.model.observe(&prior, None), reading)?;
                (posterior, Some(update))
            }
        };
        if !posterior.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        Ok(Step { transition, prior, posterior, update })
    }
}

impl<T, M, const N: usize, const L: usize> Estimator<T, N, L> for Ekf<M>
where
    T: Scalar,
    M: Dynamics<T, N, L> + Channel<T, N, L>,
{
    type State = Belief<T, N, L>;
    type Prepared = M::Prepared;

    fn prepare(&self, dt_s: T) -> M::Prepared {
        self.model.prepare(dt_s)
    }

    fn longest_step_s(&self) -> T {
        self.model.longest_step_s()
    }

    fn advance(
        &self,
        state: &Belief<T, N, L>,
        prepared: &M::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<Belief<T, N, L>, T>, StepError> {
        let step = self.step_prepared(state, prepared, reading)?;
        let innovation = step.update.map(|update| Innovation {
            value: update.innovation,
            variance: update.innovation_variance,
            nis: update.nis,
            log_likelihood: update.log_likelihood,
        });
        Ok(Advanced { state: step.posterior, innovation })
    }

    fn smooth_back(
        &self,
        filtered: &Belief<T, N, L>,
        prepared: &M::Prepared,
        _: Option<Reading<T>>,
        next: &Belief<T, N, L>,
    ) -> Result<Belief<T, N, L>, StepError> {
        let (transition, prior) = self.predict(filtered, prepared);
        Ok(rts_step(filtered, &transition, &prior, next))
    }
}

/// Returns the composition of two transitions.
fn followed_by<T: Scalar, const N: usize, const L: usize>(
    first: &Transition<T, N, L>,
    second: &Transition<T, N, L>,
) -> Transition<T, N, L> {
    Transition {
        mean: second.mean,
        jacobian: second.jacobian * first.jacobian,
        noise: first.noise.congruence(&second.jacobian).plus(&second.noise),
    }
}

/// Returns the transition of a step of zero seconds.
pub(crate) fn stand_still<T: Scalar, const N: usize, const L: usize>(belief: &Belief<T, N, L>) -> Transition<T, N, L> {
    Transition { mean: belief.mean, jacobian: nalgebra::SMatrix::identity(), noise: Symmetric::zeros() }
}

/// Updates the prior with one scalar reading. The covariance is in Joseph's form `(I - K H) P (I - K H)ᵀ + K R Kᵀ`,
/// which stays positive semi-definite under rounding where `P - K S Kᵀ` does not.
#[inline]
#[allow(non_snake_case, reason = "H, P, S, K are the letters of every textbook; NOTATION.md has the table")]
pub(crate) fn update<T: Scalar, const N: usize, const L: usize>(
    prior: &Belief<T, N, L>,
    mut observation: Observation<T, N>,
    reading: Reading<T>,
) -> Result<(Belief<T, N, L>, Update<T, N>), StepError> {
    if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
        return Err(StepError::NonFiniteReading);
    }
    if reading.extra_variance < T::zero() {
        return Err(StepError::NegativeVariance);
    }
    observation.variance += reading.extra_variance;
    let (H, R) = (&observation.gradient, observation.variance);
    let P = &prior.covariance;
    let PHt = P.mul(H);
    let S = H.dot(&PHt) + R;
    if !(S > T::zero() && S.is_finite()) {
        return Err(StepError::NonPositiveInnovationVariance);
    }
    let K = PHt / S;
    let innovation = reading.value - observation.value;
    let mean = prior.mean + K * innovation;
    let covariance = joseph(P, &PHt, &K, H, R);
    let nis = innovation * innovation / S;
    if !nis.is_finite() {
        return Err(StepError::NonFiniteState);
    }
    let log_likelihood = T::of(-0.5) * (nis + S.ln() + T::two_pi().ln());
    let update = Update { observation, innovation, innovation_variance: S, nis, log_likelihood, gain: K };
    Ok((Belief { mean, covariance }, update))
}

/// `A - (A Hᵀ) Kᵀ + K R Kᵀ` with `A = (I - K H) P`, in the lower triangle; valid for any K, optimal or not.
#[allow(non_snake_case, reason = "as in `update`")]
pub(crate) fn joseph<T: Scalar, const N: usize, const L: usize>(
    P: &Symmetric<T, N, L>,
    PHt: &SVector<T, N>,
    K: &SVector<T, N>,
    H: &SVector<T, N>,
    R: T,
) -> Symmetric<T, N, L> {
    let A = |i: usize, j: usize| P[(i, j)] - K[i] * PHt[j];
    let AHt = SVector::<T, N>::from_fn(|i, _| (0..N).fold(T::zero(), |sum, j| sum + A(i, j) * H[j]));
    let mut out = Symmetric::zeros();
    for i in 0..N {
        for j in 0..=i {
            out[(i, j)] = A(i, j) + (R * K[i] - AHt[i]) * K[j];
        }
    }
    out
}

impl<T: Scalar, const N: usize, const L: usize> State<T, N, L> for Belief<T, N, L> {
    fn moments(&self) -> Self {
        *self
    }

    fn each(&self, visit: &mut dyn FnMut(T, &Self)) {
        visit(T::one(), self);
    }

    fn phases(&self) -> Option<[T; 3]> {
        None
    }

    fn inflated(&self, factor: T) -> Self {
        Self { covariance: self.covariance.scaled(factor), ..*self }
    }
}
