//! Exact diffuse start: parts of the first state about which nothing is known.
//!
//! Their variance is infinite, not a large number. The covariance is `P* + κ P∞` with κ → ∞, and the readings turn
//! infinite directions into finite ones, one each, until an ordinary [`Belief`] is left.
//!
//! P∞ is kept as a factor `A Aᵀ` whose columns are the directions still unknown. A reading that sees any of them fixes
//! exactly one: a reflection turns the columns until only the last one is seen, and that one is struck off. Counting
//! takes the place of a difference P∞ − M∞ M∞ᵀ/F∞ that rounding would keep from ever becoming zero.
//!
//! Source: Durbin & Koopman, *Time Series Analysis by State Space Methods*, 2nd ed. (2012), 5.2 and 7.2.2.

use nalgebra::SVector;
use ohmstrain_model::{Observation, Scalar, Transition};

use crate::ekf::{check_time_step, joseph, stand_still, update};
use crate::{Belief, Channel, DiffuseBelief, Dynamics, Reading, Step, StepError, Update};

/// [`Ekf`](crate::Ekf) from a diffuse start.
///
/// On a linear model this is exact. A nonlinear model is linearised at the mean, and told the covariance P* of what is
/// known: start the mean where the unknown component is expected, and keep to components that enter linearly, such as a
/// baseline, where that cannot be said.
///
/// A direction that no reading sees stays unknown for ever, without harm to the others. Once nothing is unknown, the
/// step is the one of [`Ekf`](crate::Ekf), and [`DiffuseBelief::settled`] hands over to it.
///
/// ```
/// use ohmstrain_ekf::{Belief, DiffuseBelief, DiffuseEkf, Reading};
/// use ohmstrain_model::*;
/// # let law = SensorLaw {
/// #     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
/// #     extend_viscosity_s: 0.02, retract_viscosity_s: -0.01, branches: [],
/// #     range: StrainRange { lower: 0.0, upper: 0.33 },
/// # };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 0.0, baseline_sd: 0.02, baseline_time_s: 30.0 };
/// let model = SwitchedModel::<f64, 2, 0, 3>::new(law, motion, noise)?;
/// // The rest resistance is not known: the baseline may be anything.
/// let start = DiffuseBelief::new(Belief::initial(&model), &[0.0, 0.0, 1.0]);
/// let step = DiffuseEkf::new(model).step(&start, 0.0, Some(Reading::from(0.4)))?;
/// let belief: Belief<f64, 3, 6> = step.posterior.settled().ok_or("one reading finds one baseline")?;
/// # assert!((belief.mean[2] + 1.9 * 0.1 - 0.028 - 0.4).abs() < 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseEkf<M> {
    model: M,
}

/// Everything one step from a diffuse belief computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseStep<T, const N: usize, const L: usize> {
    /// The transition from the old belief, as a smoother needs it.
    pub transition: Transition<T, N, L>,
    /// The belief before the reading.
    pub prior: DiffuseBelief<T, N, L>,
    /// The belief after it; the prior if the reading was missing.
    pub posterior: DiffuseBelief<T, N, L>,
    /// What the reading did; `None` if it was missing.
    pub update: Option<DiffuseUpdate<T, N>>,
}

/// What a reading did to a diffuse belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DiffuseUpdate<T, const N: usize> {
    /// It saw an unknown direction and fixed it: F∞ > 0.
    Fixed {
        /// The expected reading, its gradient H and noise variance R (the reading's own included).
        observation: Observation<T, N>,
        /// Reading minus expected reading. It says where the state is, nothing about whether the filter is right.
        innovation: T,
        /// `F* = H P* Hᵀ + R`, the finite part of the innovation's variance.
        finite_variance: T,
        /// `F∞ = H P∞ Hᵀ`.
        diffuse_variance: T,
        /// Gain `P∞ Hᵀ / F∞`.
        gain: SVector<T, N>,
    },
    /// It saw known directions only: F∞ = 0, an ordinary update.
    Ordinary(Update<T, N>),
}

impl<T: Scalar, const N: usize> DiffuseUpdate<T, N> {
    /// Diffuse log-likelihood, the limit of the log density plus ½ ln κ for each direction fixed: `-½ (ln 2π + ln F∞)`,
    /// or the log density where the update is ordinary.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        match self {
            Self::Fixed { .. } => self.log_likelihood_without_constant() - T::of(0.5) * T::two_pi().ln(),
            Self::Ordinary(update) => update.log_likelihood,
        }
    }

    /// The same without ½ ln 2π for readings that fixed a direction, as the R package KFAS counts.
    #[must_use]
    pub fn log_likelihood_without_constant(&self) -> T {
        match self {
            Self::Fixed { diffuse_variance, .. } => T::of(-0.5) * diffuse_variance.ln(),
            Self::Ordinary(update) => update.log_likelihood,
        }
    }
}

impl<M> DiffuseEkf<M> {
    /// A filter for `model`.
    pub const fn new(model: M) -> Self {
        Self { model }
    }

    /// The model.
    pub const fn model(&self) -> &M {
        &self.model
    }

    /// Predicts `dt_s ≥ 0` seconds ahead, then takes the reading.
    ///
    /// # Errors
    /// See [`StepError`]; the belief passed in is untouched.
    pub fn step<T: Scalar, const N: usize, const L: usize>(
        &self,
        belief: &DiffuseBelief<T, N, L>,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<DiffuseStep<T, N, L>, StepError>
    where
        M: Dynamics<T, N, L> + Channel<T, N, L>,
    {
        check_time_step(dt_s)?;
        let (transition, prior) = self.predict(belief, dt_s);
        let (posterior, update) = match reading {
            None => (prior, None),
            Some(reading) => {
                let (posterior, update) = take(&prior, self.model.observe(&prior.finite, None), reading)?;
                (posterior, Some(update))
            }
        };
        if !posterior.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        Ok(DiffuseStep { transition, prior, posterior, update })
    }

    fn predict<T: Scalar, const N: usize, const L: usize>(
        &self,
        belief: &DiffuseBelief<T, N, L>,
        dt_s: T,
    ) -> (Transition<T, N, L>, DiffuseBelief<T, N, L>)
    where
        M: Dynamics<T, N, L>,
    {
        if dt_s.is_zero() {
            return (stand_still(&belief.finite), *belief);
        }
        let transition = self.model.transition(&self.model.prepare(dt_s), &belief.finite, None);
        let covariance = self.model.propagate(&belief.finite.covariance, &transition);
        (transition, belief.led(Belief { mean: transition.mean, covariance }, &transition.jacobian))
    }
}

/// The update with one reading. The covariance of what is known is Joseph's form with the gain of either case.
#[allow(non_snake_case, reason = "H, P, K are the letters of every textbook; NOTATION.md has the table")]
fn take<T: Scalar, const N: usize, const L: usize>(
    prior: &DiffuseBelief<T, N, L>,
    mut observation: Observation<T, N>,
    reading: Reading<T>,
) -> Result<(DiffuseBelief<T, N, L>, DiffuseUpdate<T, N>), StepError> {
    let mut posterior = *prior;
    let Some((diffuse_variance, K)) = posterior.fix_direction(&observation.gradient) else {
        let (finite, update) = update(&prior.finite, observation, reading)?;
        posterior.finite = finite;
        return Ok((posterior, DiffuseUpdate::Ordinary(update)));
    };
    if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
        return Err(StepError::NonFiniteReading);
    }
    observation.variance += reading.extra_variance;
    let (H, P) = (&observation.gradient, &prior.finite.covariance);
    let PHt = P.mul(H);
    let finite_variance = H.dot(&PHt) + observation.variance;
    if !(finite_variance >= T::zero()) {
        return Err(StepError::NonPositiveInnovationVariance);
    }
    let innovation = reading.value - observation.value;
    posterior.finite.mean += K * innovation;
    posterior.finite.covariance = joseph(P, &PHt, &K, H, observation.variance);
    let update = DiffuseUpdate::Fixed { observation, innovation, finite_variance, diffuse_variance, gain: K };
    Ok((posterior, update))
}

/// A step of [`Ekf`](crate::Ekf), for a recording whose later part it filtered.
impl<T: Scalar, const N: usize, const L: usize> From<Step<T, N, L>> for DiffuseStep<T, N, L> {
    fn from(step: Step<T, N, L>) -> Self {
        Self {
            transition: step.transition,
            prior: step.prior.into(),
            posterior: step.posterior.into(),
            update: step.update.map(DiffuseUpdate::Ordinary),
        }
    }
}
