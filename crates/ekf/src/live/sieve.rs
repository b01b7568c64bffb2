use super::Protections;
use crate::{Reading, ReadingVerdict, Recordable};

/// Plausibility check of readings before the filter uses them, with limits on repeated numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sieve<T> {
    /// Smallest and largest plausible reading of this sensor, R/R₀ - 1.
    pub plausible: (T, T),
    /// Longest time, s, for which a working sensor repeats one number; infinite if unknown.
    pub longest_repeat_s: T,
    /// Number of repeats from which a number is stuck, [`MOST_REPEATS`] or more.
    pub most_repeats: T,
    /// Largest variance of a reading's own error, (R/R₀)², at which equal numbers are a fault: a coarser converter repeats one
    /// code as long as the sensor is still.
    pub fine_variance: T,
    /// Difference of two readings, R/R₀ - 1, beyond which it is a jump.
    pub jump: T,
    /// Correlation time of the readings' errors, s.
    pub error_time_s: T,
}

impl Sieve<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> Sieve<T> {
        Sieve {
            plausible: (T::of(self.plausible.0), T::of(self.plausible.1)),
            longest_repeat_s: T::of(self.longest_repeat_s),
            most_repeats: T::of(self.most_repeats),
            fine_variance: T::of(self.fine_variance),
            jump: T::of(self.jump),
            error_time_s: T::of(self.error_time_s),
        }
    }
}

/// Number of repeats from which a number is stuck, for readings with fine resolution.
pub const MOST_REPEATS: u32 = 10;
/// The same for the coarsest resolution at which repeats count: a still sensor repeats one code that often.
pub const MOST_CODE_REPEATS: u32 = 300;

impl<T: Recordable> Sieve<T> {
    /// Returns the sieve that accepts everything.
    #[must_use]
    pub fn open() -> Self {
        let endless = T::one() / T::zero();
        Self {
            plausible: (-endless, endless),
            longest_repeat_s: endless,
            most_repeats: T::of(f64::from(MOST_REPEATS)),
            fine_variance: T::one(),
            jump: endless,
            error_time_s: T::zero(),
        }
    }

    /// Returns the sieve without the checks whose protections are off: no number is then implausible or stuck, or readings
    /// never jump.
    #[must_use]
    pub fn under(self, protections: Protections) -> Self {
        let open = Self::open();
        let (plausible, longest_repeat_s) = if protections.plausibility {
            (self.plausible, self.longest_repeat_s)
        } else {
            (open.plausible, open.longest_repeat_s)
        };
        let jump = if protections.second_look { self.jump } else { open.jump };
        Self { plausible, longest_repeat_s, jump, ..self }
    }

    /// Sets the correlation time of the readings' errors, s.
    #[must_use]
    pub fn with_error_time(self, error_time_s: T) -> Self {
        Self { error_time_s, ..self }
    }
}

/// Returns the fraction of a reading's information that is new `since_s` seconds after another one, for errors with
/// correlation time `error_time_s`: 1 - exp(-t/T), bounded below by rounding.
pub fn news<T: Recordable>(since_s: T, error_time_s: T) -> T {
    if error_time_s > T::zero() {
        let own = -(-since_s / error_time_s).exp_m1();
        own.max(T::of(f64::from(f32::EPSILON)))
    } else {
        T::one()
    }
}

/// The last reading, the time since then, and the time for which the same number has repeated.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Repeats<T> {
    pub(crate) last: Option<T>,
    pub(crate) since_s: T,
    pub(crate) repeated_s: T,
    /// Number of repeats so far.
    pub(crate) count: T,
}

impl<T: Recordable> Repeats<T> {
    /// Starts before any reading.
    #[must_use]
    pub fn none() -> Self {
        Self { last: None, since_s: T::zero(), repeated_s: T::zero(), count: T::zero() }
    }

    /// Advances by `dt_s` seconds.
    pub fn pass(&mut self, dt_s: T) {
        self.since_s += dt_s;
        self.repeated_s += dt_s;
    }

    /// Returns the reading for the filter, or the reason for withholding it. A number that comes for the k-th time in a row gets k
    /// times the variance, so that the information in k equal readings grows only with the logarithm of k: their equal errors do
    /// not average out. A reading soon after another one, whose errors are correlated, gets additional variance, so that the
    /// information per second does not depend on the sampling rate. `reading_variance` is the variance of the model's own noise.
    ///
    /// # Errors
    /// [`ReadingVerdict::Implausible`] or [`ReadingVerdict::Stuck`].
    pub fn sieved(
        &mut self,
        sieve: &Sieve<T>,
        reading: Reading<T>,
        reading_variance: T,
    ) -> Result<Reading<T>, ReadingVerdict> {
        let value = reading.value;
        if !(sieve.plausible.0 <= value && value <= sieve.plausible.1) {
            return Err(ReadingVerdict::Implausible);
        }
        let (is_first, since_s) = (self.last.is_none(), self.since_s);
        if self.last == Some(value) {
            self.count += T::one();
        } else {
            (self.count, self.repeated_s) = (T::zero(), T::zero());
        }
        (self.last, self.since_s) = (Some(value), T::zero());
        if self.is_stuck(sieve, reading.extra_variance) {
            return Err(ReadingVerdict::Stuck);
        }
        let variance = reading_variance + reading.extra_variance;
        let mut extra_variance = reading.extra_variance + self.count * variance;
        if sieve.error_time_s > T::zero() && !is_first {
            extra_variance += (T::one() / news(since_s, sieve.error_time_s) - T::one()) * reading_variance;
        }
        Ok(Reading { extra_variance, ..reading })
    }

    /// True if the number has repeated for longer than that of a still sensor. If the converter's step is not much smaller than the
    /// noise, more repetitions count as chance; if it is larger, repetition is never a fault.
    fn is_stuck(&self, sieve: &Sieve<T>, extra_variance: T) -> bool {
        let codes = T::of(f64::from(MOST_CODE_REPEATS));
        let most = if extra_variance > T::zero() { codes } else { sieve.most_repeats };
        self.count >= most && self.repeated_s > sieve.longest_repeat_s && extra_variance <= sieve.fine_variance
    }
}

#[cfg(test)]
mod tests {
    use super::{Repeats, Sieve};
    use crate::Reading;

    /// Returns the information, in independent readings, of `seconds` of readings every `dt_s` with error correlation time
    /// `error_time_s`.
    fn information(dt_s: f64, seconds: f64, error_time_s: f64) -> f64 {
        let sieve = Sieve::open().with_error_time(error_time_s);
        let mut repeats = Repeats::none();
        let rows = (seconds / dt_s).round() as usize;
        let of_row = |k: usize| {
            let reading = Reading { value: 0.1 + (k % 2) as f64, extra_variance: 0.0 };
            repeats.pass(if k > 0 { dt_s } else { 0.0 });
            repeats.sieved(&sieve, reading, 1.0).map_or(f64::NAN, |seen| 1.0 / (1.0 + seen.extra_variance))
        };
        (0..=rows).map(of_row).sum()
    }

    /// The first reading counts as one, each other one as 1 - exp(-dt/T): in total 1 + t/T for small steps, to a
    /// relative dt/2T.
    #[test]
    fn readings_with_errors_alike_tell_as_much_in_a_second_however_many() {
        let (seconds, error_time_s) = (40.0, 2.0);
        for dt_s in [0.001, 0.01, 0.1] {
            let expected = 1.0 + seconds / error_time_s;
            let relative = (information(dt_s, seconds, error_time_s) / expected - 1.0).abs();
            assert!(relative <= 0.5 * dt_s / error_time_s, "{dt_s}: {relative}");
        }
        // Independent errors: every reading counts as one.
        assert_eq!(information(0.1, seconds, 0.0), 401.0);
        // So does every reading far apart, to exp(-20); there are 40 s / 40 s + 1.
        assert!((information(40.0, seconds, 2.0) - 2.0).abs() < 1e-8);
    }
}
