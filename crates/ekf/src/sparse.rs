//! The EKF of the sensor's own model at a fixed rate, without a multiplication by zero.
//!
//! Branches and baseline never touch each other in F, and a reading contains each of them with factor one. What depends on
//! the step's length only is folded into constants beforehand. The variance of the rate after the step, which the choice of
//! direction needs, is the one that the prediction computes anyway.
//!
//! # Policy
//! As [`Ekf`](crate::Ekf), with two differences, both for microcontrollers: the belief is changed in place (an error leaves
//! it as it was), and the covariance is updated as `P - (P Hᵀ)(P Hᵀ)ᵀ/S`, without Joseph's form; a variance that rounding
//! has made negative is an error. Only innovation, its variance and the NIS are returned; nothing takes a logarithm unless
//! asked. Multiplications and additions are rounded one by one, in the order in which they are written.

use core::marker::PhantomData;

use ohmstrain_model::{Scalar, SwitchedModel};

use crate::curve::Regions;
use crate::sparse_constants::{Gains, StepConstants};
use crate::sparse_parts::Parts;
use crate::sparse_update::ReadingLaw;
use crate::switch::RateSpread;
use crate::{AnyCurve, Belief, Curve, Reading, Residual, StepError, Switch};

/// The EKF of a [`SwitchedModel`] with Ornstein-Uhlenbeck motion, for steps of one length.
///
/// `S` is [`Compact`](crate::Compact) or, to agree with [`Ekf`](crate::Ekf) to rounding, [`Logistic`](crate::Logistic). `G`
/// is the family of the gauge: [`Cubic`](crate::Cubic) saves the code of the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseEkf<T, S, const B: usize, const N: usize, G = AnyCurve<T>> {
    pub(crate) step: StepConstants<T, B>,
    pub(crate) gains: Regions<T, [Gains<T>; B]>,
    pub(crate) reading: ReadingLaw<T, G>,
    model: SwitchedModel<T, 2, B, N>,
    dt_s: T,
    switch: PhantomData<S>,
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// A filter for steps of `dt_s` seconds.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number, or the model's gauge is of another family than `G`.
    pub fn new(model: SwitchedModel<T, 2, B, N>, dt_s: T) -> Result<Self, StepError> {
        crate::ekf::check_time_step(dt_s)?;
        if dt_s.is_zero() {
            return Err(StepError::NegativeTimeStep);
        }
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
    pub const fn model(&self) -> &SwitchedModel<T, 2, B, N> {
        &self.model
    }

    /// Length of a step, s.
    pub const fn dt_s(&self) -> T
    where
        T: Copy,
    {
        self.dt_s
    }

    /// Predicts one step ahead and takes the reading; without one it is a prediction and returns `None`.
    ///
    /// # Errors
    /// See [`StepError`]; the belief is untouched.
    #[inline]
    pub fn step<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<Residual<T>>, StepError> {
        let mut parts = Parts::of(belief);
        let spread = self.predict(&mut parts, None);
        let residual = match reading {
            Some(reading) => Some(self.update(&mut parts, reading, None, spread)?),
            None if parts.is_sound::<N>(parts.variances::<N>()) => None,
            None => return Err(StepError::NonFiniteState),
        };
        parts.put_into(belief);
        Ok(residual)
    }
}
