//! What a reading must be for the filter to see it.

use ohmstrain_calib::PortableSieve;
use ohmstrain_ekf::{Reading, Real};

use super::parts::{flag, number};

/// What was seen of the readings.
#[derive(Clone, Copy)]
pub struct Seen<T> {
    sieve: PortableSieve,
    reading_variance: T,
    last: Option<T>,
    since_s: T,
    repeated_s: T,
    count: u32,
}

impl<T: Real> Seen<T> {
    /// Before the first one.
    pub fn new(sieve: PortableSieve, reading_variance: T) -> Self {
        Self { sieve, reading_variance, last: None, since_s: T::zero(), repeated_s: T::zero(), count: 0 }
    }

    /// How far a reading is from another one where it has jumped.
    pub fn jump(&self) -> T {
        number(self.sieve.jump)
    }

    /// Time has passed, s.
    pub fn pass(&mut self, dt_s: T) {
        self.since_s += dt_s;
        self.repeated_s += dt_s;
    }

    /// A reading as the filter is to see it, or a flag that says why it is not to see it.
    pub fn sieved(&mut self, reading: Reading<T>) -> Result<Reading<T>, u32> {
        let (sieve, seen) = (self.sieve, &mut *self);
        let (lower, upper): (T, T) = (number(sieve.plausible.0), number(sieve.plausible.1));
        if !(lower <= reading.value && reading.value <= upper) {
            return Err(flag::IMPLAUSIBLE);
        }
        let (is_first, since_s) = (seen.last.is_none(), seen.since_s);
        if seen.last == Some(reading.value) {
            seen.count += 1;
        } else {
            (seen.count, seen.repeated_s) = (0, T::zero());
        }
        (seen.last, seen.since_s) = (Some(reading.value), T::zero());
        let longest_s = sieve.longest_repeat_s;
        if longest_s.is_finite() && seen.count >= sieve.most_repeats && seen.repeated_s > number(longest_s) {
            return Err(flag::STUCK);
        }
        let variance = seen.reading_variance + reading.extra_variance;
        let mut extra_variance = reading.extra_variance + T::of(f64::from(seen.count)) * variance;
        if sieve.error_time_s > 0.0 && !is_first {
            let news = -(-since_s / number(sieve.error_time_s)).exp_m1();
            let least = T::of(f64::from(f32::EPSILON));
            let news = if news > least { news } else { least };
            extra_variance += (T::one() / news - T::one()) * seen.reading_variance;
        }
        Ok(Reading { extra_variance, ..reading })
    }
}
