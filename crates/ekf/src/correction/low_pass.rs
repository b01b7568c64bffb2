use crate::Recordable;

/// Exponential low-pass, τ L′ = y − L, exact for readings that change linearly between known readings, for any step
/// length. It starts settled on the first reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass<T> {
    tau_s: T,
    last: Option<T>,
    value: T,
}

impl<T: Recordable> LowPass<T> {
    /// Creates a low-pass before the first reading; the time constant, s, is positive.
    #[must_use]
    pub fn new(tau_s: T) -> Self {
        Self { tau_s, last: None, value: T::zero() }
    }

    /// The time constant, s.
    #[must_use]
    pub const fn tau_s(&self) -> T {
        self.tau_s
    }

    /// The low-pass at the last reading; zero before the first.
    #[must_use]
    pub const fn value(&self) -> T {
        self.value
    }

    /// Takes a reading `dt_s ≥ 0` seconds after the previous one, and returns the low-pass at its time.
    pub fn next(&mut self, dt_s: T, reading: T) -> T {
        self.value = self.last.map_or(reading, |last| Decay::over(dt_s, self.tau_s).moved(self.value, last, reading));
        self.last = Some(reading);
        self.value
    }
}

/// Decay of a low-pass over a step.
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
