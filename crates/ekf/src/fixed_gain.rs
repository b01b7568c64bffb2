//! A filter that stops computing its gain once that has settled.
//!
//! At a fixed rate the covariance of a linear model converges, and the gain with it. From then on only the mean is
//! predicted and corrected. A missing reading, a step of another length or a reading of another variance ends that: the
//! full filter goes on from the frozen covariance, until the gain has settled again.
//!
//! # What freezing costs
//! On a model that is linear and does not change: nothing beyond the tolerance. The sensor's switched model is neither.
//! F depends on direction and strain, H on strain, and a gain that was frozen while stretching stays when the body turns
//! around: the branches' gains then have the wrong size or sign. The filter cannot notice by itself. The mean keeps
//! following the full, nonlinear law; the deviations reported are those of the moment of freezing.
//!
//! Measured on a simulated sensor with two branches and a baseline that moves all the time, an hour at 20 Hz:
//!
//! | tolerance | steps with a frozen gain | RMSE of strain | 95 % intervals that cover |
//! |---|---|---|---|
//! | full filter | – | 0.0268 | 75 % |
//! | 0.03 | 1 % | 0.0268 | 75 % |
//! | 0.1 | 55 % | 0.0346 | 71 % |
//! | 0.2 | 84 % | 0.0463 | 59 % |
//! | 0.5 | 92 % | diverges | |
//!
//! So this is for sensors (or ranges) whose gains hardly differ between directions and whose gauge curve is nearly
//! straight. `transition` and `observe` are called as ever, Jacobian included, since a model has no other way to say
//! where its mean goes; what is saved are the covariance's prediction and update.

use nalgebra::SVector;
use ohmstrain_model::{ParameterError, Problem, Scalar, Symmetric};

use crate::ekf::check_time_step;
use crate::{Belief, Channel, Dynamics, Ekf, Reading, Step, StepError, Update};

/// An [`Ekf`] for a fixed rate that freezes its gain.
///
/// ```
/// use ohmstrain_ekf::{Belief, FixedGain, FixedGainState, Reading};
/// # use ohmstrain_model::*;
/// # let law = SensorLaw {
/// #     gauge: Gauge::Polynomial { coefficients: [1.9, 0.0, 0.0] },
/// #     extend_viscosity_s: 0.0, retract_viscosity_s: 0.0, branches: [],
/// #     range: StrainRange { lower: 0.0, upper: 0.33 },
/// # };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 0.0, baseline_sd: 0.0, baseline_time_s: 1.0 };
/// # let model = SwitchedModel::<f64, 2, 0, 2>::new(law, motion, noise)?;
/// let mut state: FixedGainState<f64, 2, 3> = Belief::initial(&model).into();
/// let filter = FixedGain::new::<2, 3>(model, 0.01, 1e-3)?;
/// for _ in 0..200 {
///     state = filter.step(&state, 0.01, Some(Reading::from(0.2)))?.next;
/// }
/// assert!(state.is_frozen());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedGain<M, T, P> {
    ekf: Ekf<M>,
    dt_s: T,
    prepared: P,
    tolerance: T,
}

/// What a [`FixedGain`] filter knows: the belief, and how far its gain has settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedGainState<T, const N: usize, const L: usize> {
    belief: Belief<T, N, L>,
    progress: Progress<T, N, L>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Progress<T, const N: usize, const L: usize> {
    /// No uniform step with a reading before this one.
    Interrupted,
    /// Still moving.
    Settling(Settling<T, N, L>),
    /// The gain has settled.
    Frozen(Frozen<T, N, L>),
}

/// What the step before left to compare with.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Settling<T, const N: usize, const L: usize> {
    prior_covariance: Symmetric<T, N, L>,
    extra_variance: T,
    /// How far the covariance had moved; infinite if there was nothing to compare with.
    moved: T,
    /// For how many steps in a row it has been close to its limit.
    close: usize,
}

/// That many steps in a row must be close: where the limit is approached in oscillations, one step alone may look close
/// at a turning point.
const CLOSE_STEPS: usize = 5;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Frozen<T, const N: usize, const L: usize> {
    prior_covariance: Symmetric<T, N, L>,
    gain: SVector<T, N>,
    innovation_variance: T,
    extra_variance: T,
}

/// A step and the state after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedGainStep<T, const N: usize, const L: usize> {
    /// What [`Ekf::step`] returns. With a frozen gain the covariances, the gain and the innovation's variance are the
    /// frozen ones.
    pub step: Step<T, N, L>,
    /// Whether the frozen gain was used.
    pub frozen: bool,
    /// The state to go on with.
    pub next: FixedGainState<T, N, L>,
}

impl<T: Scalar, const N: usize, const L: usize> FixedGainState<T, N, L> {
    /// Mean, and covariance; the frozen one while the gain is frozen.
    #[must_use]
    pub const fn belief(&self) -> &Belief<T, N, L> {
        &self.belief
    }

    /// Whether the next reading, if it comes in time, will be taken with the frozen gain.
    #[must_use]
    pub const fn is_frozen(&self) -> bool {
        matches!(self.progress, Progress::Frozen(_))
    }
}

impl<T: Scalar, const N: usize, const L: usize> From<Belief<T, N, L>> for FixedGainState<T, N, L> {
    fn from(belief: Belief<T, N, L>) -> Self {
        Self { belief, progress: Progress::Interrupted }
    }
}

impl<M, T: Scalar, P: Copy> FixedGain<M, T, P> {
    /// A filter for `model`, read every `dt_s > 0` seconds.
    ///
    /// `tolerance`, 0 to 1: how far from its limit the covariance may be when the gain is frozen, relative to the
    /// variances themselves. The distance is extrapolated from how fast successive covariances come closer to each other.
    /// In `f32` slow modes may end in rounding before they get there. A step counts as one of `dt_s` if it differs from it
    /// by no more than `tolerance`, relative.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new<const N: usize, const L: usize>(model: M, dt_s: T, tolerance: T) -> Result<Self, ParameterError>
    where
        M: Dynamics<T, N, L, Prepared = P>,
    {
        if !(dt_s > T::zero() && dt_s.is_finite()) {
            return Err(ParameterError::new("dt_s", Problem::NotPositive));
        }
        if !(tolerance > T::zero() && tolerance < T::one()) {
            return Err(ParameterError::new("tolerance", Problem::OutOfRange));
        }
        let prepared = model.prepare(dt_s);
        Ok(Self { ekf: Ekf::new(model), dt_s, prepared, tolerance })
    }

    /// The model.
    pub const fn model(&self) -> &M {
        self.ekf.model()
    }

    /// Predicts `dt_s ≥ 0` seconds ahead, then takes the reading, with the frozen gain where that is allowed.
    ///
    /// # Errors
    /// See [`StepError`]; the state passed in is untouched.
    pub fn step<const N: usize, const L: usize>(
        &self,
        state: &FixedGainState<T, N, L>,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<FixedGainStep<T, N, L>, StepError>
    where
        M: Dynamics<T, N, L, Prepared = P> + Channel<T, N, L>,
    {
        check_time_step(dt_s)?;
        let uniform = (dt_s - self.dt_s).abs() <= self.tolerance * self.dt_s;
        if let (true, Some(reading), Progress::Frozen(frozen)) = (uniform, reading, &state.progress)
            && reading.extra_variance == frozen.extra_variance
        {
            let step = self.correct_mean(&state.belief, frozen, reading)?;
            return Ok(FixedGainStep { step, frozen: true, next: FixedGainState { belief: step.posterior, ..*state } });
        }
        let step = if uniform {
            self.ekf.step_prepared(&state.belief, &self.prepared, reading)?
        } else {
            self.ekf.step(&state.belief, dt_s, reading)?
        };
        let progress = match (uniform, reading, &step.update) {
            (true, Some(reading), Some(update)) => {
                self.progress(&state.progress, reading.extra_variance, &step.prior.covariance, update)
            }
            _ => Progress::Interrupted,
        };
        Ok(FixedGainStep { step, frozen: false, next: FixedGainState { belief: step.posterior, progress } })
    }

    /// Prediction and correction of the mean only.
    fn correct_mean<const N: usize, const L: usize>(
        &self,
        belief: &Belief<T, N, L>,
        frozen: &Frozen<T, N, L>,
        reading: Reading<T>,
    ) -> Result<Step<T, N, L>, StepError>
    where
        M: Dynamics<T, N, L, Prepared = P> + Channel<T, N, L>,
    {
        if !reading.value.is_finite() {
            return Err(StepError::NonFiniteReading);
        }
        let transition = self.model().transition(&self.prepared, belief, None);
        let prior = Belief { mean: transition.mean, covariance: frozen.prior_covariance };
        let mut observation = self.model().observe(&prior, None);
        observation.variance += reading.extra_variance;
        let innovation = reading.value - observation.value;
        let posterior = Belief { mean: prior.mean + frozen.gain * innovation, ..*belief };
        let variance = frozen.innovation_variance;
        let nis = innovation * innovation / variance;
        if !(posterior.mean.iter().all(|x| x.is_finite()) && nis.is_finite()) {
            return Err(StepError::NonFiniteState);
        }
        let update = Update {
            observation,
            innovation,
            innovation_variance: variance,
            nis,
            log_likelihood: T::of(-0.5) * (nis + variance.ln() + T::two_pi().ln()),
            gain: frozen.gain,
        };
        Ok(Step { transition, prior, posterior, update: Some(update) })
    }

    /// How far the gain has settled after a full, uniform step with a reading.
    fn progress<const N: usize, const L: usize>(
        &self,
        before: &Progress<T, N, L>,
        extra_variance: T,
        prior_covariance: &Symmetric<T, N, L>,
        update: &Update<T, N>,
    ) -> Progress<T, N, L> {
        let (prior_covariance, infinity) = (*prior_covariance, T::of(f64::INFINITY));
        let mut now = Settling { prior_covariance, extra_variance, moved: infinity, close: 0 };
        if let Progress::Settling(last) = before
            && last.extra_variance == extra_variance
        {
            now.moved = largest_change(&last.prior_covariance, &prior_covariance);
            let close = distance_left(last.moved, now.moved) <= self.tolerance;
            now.close = if close { last.close + 1 } else { 0 };
        }
        if now.close < CLOSE_STEPS {
            return Progress::Settling(now);
        }
        let (gain, innovation_variance) = (update.gain, update.innovation_variance);
        Progress::Frozen(Frozen { prior_covariance, gain, innovation_variance, extra_variance })
    }
}

/// The largest |ΔPᵢⱼ|/√(Pᵢᵢ Pⱼⱼ): a change without a unit. The whole covariance is looked at because a gain alone may
/// stand still for a moment while what it is made of moves on.
fn largest_change<T: Scalar, const N: usize, const L: usize>(last: &Symmetric<T, N, L>, now: &Symmetric<T, N, L>) -> T {
    let mut largest = T::zero();
    for i in 0..N {
        for j in 0..=i {
            let size = (now[(i, i)] * now[(j, j)]).sqrt();
            if size > T::zero() {
                largest = largest.max((now[(i, j)] - last[(i, j)]).abs() / size);
            }
        }
    }
    largest
}

/// How far a sequence whose last two changes were `last` and `moved` still has to go if it goes on like that: a geometric
/// series. Changes of a few roundings are none; growing ones give infinity,
/// and so does a first one.
fn distance_left<T: Scalar>(last: T, moved: T) -> T {
    if moved <= T::default_epsilon() * T::of(8.0) {
        return T::zero();
    }
    if !(moved < last && last.is_finite()) {
        return T::of(f64::INFINITY);
    }
    let ratio = moved / last;
    moved * ratio / (T::one() - ratio)
}
