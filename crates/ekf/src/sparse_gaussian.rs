use ohmstrain_model::{Phase, Scalar, Symmetric};

use crate::gaussian::{Real, density, upper_tail};
use crate::{Belief, Gaussian, StepError};

/// A belief while a step works on it: the lower triangle by rows of known length, so that indices in loops need no check
/// at run time.
#[derive(Clone, Copy)]
pub(crate) struct Working<T, const N: usize> {
    pub x: [T; N],
    pub p: [[T; N]; N],
}

impl<T: Scalar, const N: usize> Working<T, N> {
    pub(crate) fn zeros() -> Self {
        Self { x: [T::zero(); N], p: [[T::zero(); N]; N] }
    }

    #[inline(always)]
    pub(crate) fn of<const L: usize>(belief: &Belief<T, N, L>) -> Self {
        let mut out = Self { x: belief.mean.into(), ..Self::zeros() };
        let mut entries = belief.covariance.packed().iter();
        for i in 0..N {
            for j in 0..=i {
                if let Some(entry) = entries.next() {
                    out.p[i][j] = *entry;
                }
            }
        }
        out
    }

    #[inline(always)]
    pub(crate) fn belief<const L: usize>(&self) -> Belief<T, N, L> {
        let mut out = [T::zero(); L];
        let mut entries = out.iter_mut();
        for i in 0..N {
            for j in 0..=i {
                if let Some(entry) = entries.next() {
                    *entry = self.p[i][j];
                }
            }
        }
        Belief { mean: self.x.into(), covariance: Symmetric::from_packed(out) }
    }

    /// Refuses what is not finite, and a variance that rounding has made negative.
    #[inline(always)]
    pub(crate) fn check(&self) -> Result<(), StepError> {
        // Whatever is not finite makes this sum not finite, or a comparison false.
        let mut sum = T::zero();
        for i in 0..N {
            if !(self.p[i][i] >= T::zero()) {
                return Err(StepError::NonFiniteState);
            }
            sum += self.x[i] + self.p[i][i];
        }
        if sum.is_finite() { Ok(()) } else { Err(StepError::NonFiniteState) }
    }

    /// Draws the rate anew, independent of everything else.
    #[inline(always)]
    pub(crate) fn renew_rate(&mut self, fresh: &Gaussian<T>) {
        self.p[1] = [T::zero(); N];
        for row in &mut self.p[2..] {
            row[1] = T::zero();
        }
        self.x[1] = fresh.mean;
        self.p[1][1] = fresh.variance;
    }
}

impl<T: Real, const N: usize> Working<T, N> {
    /// Restricts the rate to the sign of a moving phase; what that leaves of the Gaussian. Tails beyond `clear` squared
    /// deviations are not cut off.
    #[inline(always)]
    pub(crate) fn cut_rate(&mut self, phase: Phase, clear: T) -> T {
        let variance = self.p[1][1];
        let side = if phase == Phase::Retract { -T::one() } else { T::one() };
        let toward = side * self.x[1];
        if variance <= T::zero() {
            return if toward < T::zero() { T::zero() } else { T::one() };
        }
        if toward > T::zero() && toward * toward > clear * variance {
            return T::one();
        }
        let sd = variance.sqrt();
        let zero_at = -toward / sd;
        let mass = upper_tail(zero_at);
        let shift = density(zero_at) / mass;
        let kept = (T::one() + zero_at * shift - shift * shift).max(T::zero()).min(T::one());
        // Everything else follows along its regression on the rate, whose slope is its covariance over the variance.
        let with_rate: [T; N] = core::array::from_fn(|i| if i == 0 { self.p[1][0] } else { self.p[i][1] });
        let (moves, narrows) = (side * shift / sd, (kept - T::one()) / variance);
        for i in 0..N {
            self.x[i] += with_rate[i] * moves;
            let narrowing = with_rate[i] * narrows;
            for j in 0..=i {
                self.p[i][j] += narrowing * with_rate[j];
            }
        }
        mass
    }
}
