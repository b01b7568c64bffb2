//! Whole series of readings, without memory of its own: the belief stays taken apart from step to step.

use ohmstrain_model::Scalar;

use crate::kernel::Parts;
use crate::{Belief, Curve, LogLikelihood, Reading, Residual, SparseEkf, StepError, Switch};

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Log-likelihood of readings one step apart, the first one a step after `start`; `None` is a missing one.
    ///
    /// # Errors
    /// See [`StepError`]: that of the first step that failed.
    pub fn log_likelihood<const L: usize>(
        &self,
        start: &Belief<T, N, L>,
        readings: impl IntoIterator<Item = Option<Reading<T>>>,
    ) -> Result<T, StepError> {
        let (mut parts, mut sum) = (Parts::of(start), LogLikelihood::new());
        for reading in readings {
            if let Some(residual) = self.advance_or_again::<L>(&mut parts, reading)? {
                sum.add(&residual);
            }
        }
        Ok(sum.value())
    }

    /// The same, and the belief after every reading into `filtered`; stops with the shorter of both.
    ///
    /// # Errors
    /// See [`StepError`]: that of the first step that failed. What was before it is written.
    pub fn filter<const L: usize>(
        &self,
        start: &Belief<T, N, L>,
        readings: impl IntoIterator<Item = Option<Reading<T>>>,
        filtered: &mut [Belief<T, N, L>],
    ) -> Result<T, StepError> {
        let (mut parts, mut sum) = (Parts::of(start), LogLikelihood::new());
        for (reading, after) in readings.into_iter().zip(filtered) {
            if let Some(residual) = self.advance_or_again::<L>(&mut parts, reading)? {
                sum.add(&residual);
            }
            parts.put_into(after);
        }
        Ok(sum.value())
    }

    #[inline(always)]
    fn advance_or_again<const L: usize>(
        &self,
        parts: &mut Parts<T, B>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<Residual<T>>, StepError> {
        let before = *parts;
        let refused = match self.advance(parts, reading) {
            Err(refused) => refused,
            taken => return taken,
        };
        let mut belief: Belief<T, N, L> = before.together();
        let taken = self.step_again(&mut belief, reading, refused, Self::step_once)?;
        *parts = Parts::of(&belief);
        Ok(taken)
    }
}
