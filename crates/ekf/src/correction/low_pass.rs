use crate::Real;

/// Exponential low-pass, τ L′ = y − L, exact for readings that move linearly from one known reading to the next, however
/// long the step. It starts settled on the first reading, unless it is told where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass<T> {
    tau_s: T,
    last: Option<T>,
    value: T,
}

impl<T: Real> LowPass<T> {
    /// Before the first reading; the time constant, s, is positive.
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

    /// Takes the first reading, at which the low-pass is said to be at `value`, and returns that.
    pub fn start(&mut self, reading: T, value: T) -> T {
        (self.last, self.value) = (Some(reading), value);
        value
    }

    /// Takes a reading `dt_s` seconds after the one before, at least zero, and returns the low-pass at its time.
    pub fn next(&mut self, dt_s: T, reading: T) -> T {
        self.value = match self.last {
            None => reading,
            Some(last) => {
                let x = dt_s / self.tau_s;
                // exp(-x), and its mean over the step.
                let (decay, mean_decay) = ((-x).exp(), if x > T::zero() { -(-x).exp_m1() / x } else { T::one() });
                decay * self.value + (mean_decay - decay) * last + (T::one() - mean_decay) * reading
            }
        };
        self.last = Some(reading);
        self.value
    }
}
