//! The EKF of the sensor's own model at a fixed rate, without multiplications by zero.
//!
//! Branches and baseline are not coupled in F, and a reading contains each of them with factor one. Terms that depend only
//! on the step's length are precomputed. The variance of the rate after the step, needed for the direction, is a by-product
//! of the prediction.
//!
//! # Policy
//! As [`Ekf`](crate::Ekf), with two differences, both for microcontrollers: the belief is changed in place (an error leaves
//! it unchanged), and the covariance is updated as `P - (P Hᵀ)(P Hᵀ)ᵀ/S`, without Joseph's form. If rounding makes a
//! variance negative, the reading is too exact for the floating-point precision: it is taken again with increasing noise
//! until no variance is negative. Only the innovation, its variance and the NIS are returned; logarithms are computed on
//! request only. Multiplications and additions are rounded one by one, in the order in which they are written.

use core::marker::PhantomData;

use ohmstrain_model::{Scalar, SwitchedModel};

use super::{AnyCurve, Course, Curve, Gains, Parts, RateSpread, ReadingLaw, Regions, StepConstants, Switch, refusal};
use crate::clock::check_time_step;
use crate::{Belief, Reading, Residual, StepError};

/// The EKF of a [`SwitchedModel`] with Ornstein-Uhlenbeck motion, for steps of one length.
///
/// `S` is [`Compact`](crate::Compact) or, to agree with [`Ekf`](crate::Ekf) to rounding, [`Logistic`](crate::Logistic). `G`
/// is the family of the gauge: [`Cubic`](crate::Cubic) saves the code of the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseEkf<T, S, const B: usize, const N: usize, G = AnyCurve<T>> {
    pub(crate) step: StepConstants<T, B>,
    pub(crate) gains: Regions<T, [Gains<T>; B]>,
    pub(crate) reading: ReadingLaw<T, G>,
    model: SwitchedModel<T, B, N>,
    pub(crate) dt_s: T,
    switch: PhantomData<S>,
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Creates a filter for steps of `dt_s` seconds.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number, or the model's gauge is not of the family `G`.
    pub fn new(model: SwitchedModel<T, B, N>, dt_s: T) -> Result<Self, StepError> {
        check_step_length(dt_s)?;
        Self::of_any_length(model, dt_s)
    }

    /// Creates a filter whose own step has zero length, an update without a prediction; use it with steps that it
    /// [prepares](crate::Estimator::prepare).
    ///
    /// # Errors
    /// If the model's gauge is not of the family `G`.
    pub fn at_a_moment(model: SwitchedModel<T, B, N>) -> Result<Self, StepError> {
        Self::of_any_length(model, T::zero())
    }

    /// Creates a filter for steps of `dt_s` seconds, or of zero length.
    pub(crate) fn of_any_length(model: SwitchedModel<T, B, N>, dt_s: T) -> Result<Self, StepError> {
        check_time_step(dt_s)?;
        Ok(Self {
            step: StepConstants::new(&model, dt_s, RateSpread::<T, S>::clear()),
            gains: Gains::by_region(model.law()),
            reading: ReadingLaw::new(&model).ok_or(StepError::OtherGauge)?,
            model,
            dt_s,
            switch: PhantomData,
        })
    }

    /// The model.
    pub const fn model(&self) -> &SwitchedModel<T, B, N> {
        &self.model
    }

    /// Length of a step, s.
    pub const fn dt_s(&self) -> T {
        self.dt_s
    }

    /// Changes the length of steps. The current length costs only a comparison; another one costs as much as a new
    /// filter.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number; the filter is then unchanged.
    #[inline]
    pub fn retime(&mut self, dt_s: T) -> Result<(), StepError> {
        if dt_s == self.dt_s { Ok(()) } else { self.set_time_step(dt_s) }
    }

    #[cold]
    #[inline(never)]
    fn set_time_step(&mut self, dt_s: T) -> Result<(), StepError> {
        check_step_length(dt_s)?;
        self.set_length(dt_s);
        Ok(())
    }

    /// Changes the length of steps without a check, for a length that was checked, or whose effects are rejected later.
    pub(crate) fn set_length(&mut self, dt_s: T) {
        self.step = StepConstants::new(&self.model, dt_s, RateSpread::<T, S>::clear());
        self.dt_s = dt_s;
    }

    /// Predicts one step ahead and takes the reading. Without a reading it only predicts, and returns `None`.
    ///
    /// # Errors
    /// See [`StepError`]; the belief is unchanged.
    #[inline]
    pub fn step<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<Residual<T>>, StepError> {
        self.step_with(belief, reading, None)
    }

    /// Steps with a gate: a reading whose normalised innovation squared exceeds `gate` is compared but not taken. The gate is
    /// applied before the belief is written, so that a rejected reading costs no second step. χ² with one degree of freedom exceeds
    /// 10.8 once in a thousand.
    ///
    /// A gate without readmission can lock a filter out; [`Guard`](crate::Guard) has readmission.
    ///
    /// # Errors
    /// See [`StepError`]; the belief is unchanged.
    #[inline]
    pub fn step_gated<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        reading: Reading<T>,
        gate: T,
    ) -> Result<Residual<T>, StepError> {
        // A reading always has a residual.
        self.step_with(belief, Some(reading), Some(gate))?.ok_or(StepError::NonFiniteState)
    }

    #[inline(always)]
    fn step_with<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        reading: Option<Reading<T>>,
        gate: Option<T>,
    ) -> Result<Option<Residual<T>>, StepError> {
        match self.step_once(belief, reading, gate) {
            Err(refused) => self.retry_step(belief, reading, gate, refused),
            taken => taken,
        }
    }

    /// Steps once. Never inlined: next to a second try, a compiler would compute and store their common part in advance.
    #[inline(never)]
    fn step_once<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        reading: Option<Reading<T>>,
        gate: Option<T>,
    ) -> Result<Option<Residual<T>>, StepError> {
        let mut parts = Parts::of(belief);
        let spread = self.predict::<T, S>(&mut parts, Course::Uncertain);
        let residual = match reading {
            Some(reading) => {
                let is_taken = |nis| gate.is_none_or(|gate| nis <= gate);
                let (residual, sound) = self.update(&mut parts, reading, None, spread, true, is_taken);
                if !sound {
                    return Err(refusal(Some(reading), &residual));
                }
                Some(residual)
            }
            None if parts.is_sound::<N>(parts.variances::<N>()) => None,
            None => return Err(StepError::NonFiniteState),
        };
        parts.put_into(belief);
        Ok(residual)
    }

    /// Repeats a `refused` step with increasing noise of the reading.
    #[cold]
    #[inline(never)]
    fn retry_step<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        mut reading: Option<Reading<T>>,
        gate: Option<T>,
        mut refused: StepError,
    ) -> Result<Option<Residual<T>>, StepError> {
        let mut tries = 0;
        loop {
            tries += 1;
            reading = Some(self.coarser(reading, tries, refused)?);
            match self.step_once(belief, reading, gate) {
                Err(error) => refused = error,
                taken => return taken,
            }
        }
    }

    /// Returns a refused reading with more noise, or the refusal if more noise does not help.
    #[cold]
    #[inline(never)]
    pub(crate) fn coarser(
        &self,
        reading: Option<Reading<T>>,
        tries: u32,
        refused: StepError,
    ) -> Result<Reading<T>, StepError> {
        let Some(reading) = reading.filter(|_| refused.is_of_the_reading() && tries <= MOST_TRIES) else {
            return Err(refused);
        };
        reading.coarser(self.reading.variance, T::default_epsilon()).ok_or(refused)
    }
}

/// Maximum number of tries of a step after the first.
pub(crate) const MOST_TRIES: u32 = 12;

/// Rejects a step length that is not a positive number.
fn check_step_length<T: Scalar>(dt_s: T) -> Result<(), StepError> {
    check_time_step(dt_s)?;
    if dt_s.is_zero() { Err(StepError::NegativeTimeStep) } else { Ok(()) }
}
