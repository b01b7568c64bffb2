use crate::Recordable;

/// Decay over a step of an exponential low-pass, τ L′ = y − L, exact for readings that change linearly between known
/// readings, for any step length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decay<T> {
    /// exp(-x), with x the step in time constants.
    pub end: T,
    /// Mean of the decay over the step.
    pub mean: T,
}

impl<T: Recordable> Decay<T> {
    /// Computes the decay over a step, s, with a time constant, s.
    #[must_use]
    pub fn over(dt_s: T, tau_s: T) -> Self {
        let x = dt_s / tau_s;
        Self { end: (-x).exp(), mean: if x > T::zero() { -(-x).exp_m1() / x } else { T::one() } }
    }

    /// Returns the low-pass at the end of a step in which the reading changes linearly from `last` to `reading`.
    #[must_use]
    pub fn moved(self, low_pass: T, last: T, reading: T) -> T {
        self.end * low_pass + (self.mean - self.end) * last + (T::one() - self.mean) * reading
    }
}
