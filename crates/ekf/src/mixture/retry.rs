//! Repetition of a refused step with increasing noise of its reading, which is too exact for the floating-point precision, and
//! with decreasing correlations, which rounding may have made larger than possible.

use ohmstrain_model::Scalar;

use crate::kernel::MOST_TRIES;
use crate::mixture::state::Share;
use crate::{Curve, Reading, SparseEkf, StepError, Switch};

/// Growth, from one try to the next, of the share that correlations lose.
const LOOSER: f64 = 16.0;

/// Reading of a step, present or missing. There are two types, so that a program that always has a reading contains no
/// code for pauses.
pub(crate) trait StepReading<T: Scalar>: Copy + From<Reading<T>> {
    fn as_option(self) -> Option<Reading<T>>;

    /// Returns the reading for another try of a refused step, or the refusal if another try does not help.
    fn for_retry<S: Switch<T>, const B: usize, const N: usize, G: Curve<T>>(
        self,
        kernel: &SparseEkf<T, S, B, N, G>,
        tries: u32,
        refused: StepError,
    ) -> Result<Self, StepError> {
        match self.as_option() {
            None if refused.is_of_the_reading() && tries <= MOST_TRIES => Ok(self),
            reading => kernel.coarser(reading, tries, refused).map(Self::from),
        }
    }
}

impl<T: Scalar> StepReading<T> for Reading<T> {
    #[inline(always)]
    fn as_option(self) -> Option<Self> {
        Some(self)
    }
}

impl<T: Scalar> StepReading<T> for Option<Reading<T>> {
    #[inline(always)]
    fn as_option(self) -> Self {
        self
    }
}

/// Reduces correlations by a share that grows over a few tries, from rounding to all of them.
#[cold]
#[inline(never)]
pub(crate) fn loosen<T: Scalar, const N: usize, const L: usize>(shares: &mut [Share<T, N, L>], tries: u32) {
    let share = (0..tries).fold(T::default_epsilon(), |share, _| share * T::of(LOOSER)).min(T::one());
    for Share { belief, .. } in shares {
        let mut row = belief.covariance.packed_mut().iter_mut();
        for i in 0..N {
            row.by_ref().take(i).for_each(|covariance| *covariance *= T::one() - share);
            row.next();
        }
    }
}
