//! A step that is refused is taken again: with more and more noise in its reading, which is more exact than the numbers, and from
//! smaller and smaller correlations, which rounding may have made more than they can be.

use ohmstrain_model::Scalar;

use crate::kernel::MOST_TRIES;
use crate::mixture::state::Share;
use crate::{Curve, Reading, SparseEkf, StepError, Switch};

/// Growth of what correlations lose from one try to the next.
const LOOSER: f64 = 16.0;

/// Reading of a step, present or missing. There are two types: a program that always has a reading has no code for pauses.
pub(crate) trait StepReading<T: Scalar>: Copy {
    fn as_option(self) -> Option<Reading<T>>;

    /// Returns the reading for a further try of a refused step; the refusal if another try is of no use.
    fn again<S: Switch<T>, const B: usize, const N: usize, G: Curve<T>>(
        self,
        kernel: &SparseEkf<T, S, B, N, G>,
        tries: u32,
        refused: StepError,
    ) -> Result<Self, StepError>;
}

impl<T: Scalar> StepReading<T> for Reading<T> {
    #[inline(always)]
    fn as_option(self) -> Option<Self> {
        Some(self)
    }

    fn again<S: Switch<T>, const B: usize, const N: usize, G: Curve<T>>(
        self,
        kernel: &SparseEkf<T, S, B, N, G>,
        tries: u32,
        refused: StepError,
    ) -> Result<Self, StepError> {
        kernel.coarser(Some(self), tries, refused)
    }
}

impl<T: Scalar> StepReading<T> for Option<Reading<T>> {
    #[inline(always)]
    fn as_option(self) -> Self {
        self
    }

    fn again<S: Switch<T>, const B: usize, const N: usize, G: Curve<T>>(
        self,
        kernel: &SparseEkf<T, S, B, N, G>,
        tries: u32,
        refused: StepError,
    ) -> Result<Self, StepError> {
        match self {
            None if refused.is_of_the_reading() && tries <= MOST_TRIES => Ok(None),
            reading => kernel.coarser(reading, tries, refused).map(Some),
        }
    }
}

/// Makes correlations smaller, by a share that grows from rounding to all of them over a few tries.
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
