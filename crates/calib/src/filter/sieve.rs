use ohmstrain_ekf::{Reading, ReadingVerdict};

use crate::params::SensorParams;
use crate::params::estimator::news;
use crate::samples::Samples;

/// What a reading must be for a filter to see it at all, and what is made of one that comes again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sieve {
    /// Least and largest R/R₀ - 1 that can be a reading of this sensor.
    pub(crate) plausible: (f64, f64),
    /// Longest time, s, for which a working sensor repeats one number.
    pub(crate) longest_repeat_s: f64,
    /// How far a reading is from another one, R/R₀ - 1, where it has jumped.
    pub(crate) jump: f64,
    /// Time, s, over which errors of the readings are alike.
    error_time_s: f64,
}

/// The last reading, and how long the same number has been coming.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Repeats {
    value: f64,
    count: u32,
    since_s: f64,
    last_s: f64,
}

/// By what factor a reading may lie outside of the calibration's, and by how many ranges of them above: another day, drift
/// and strains that were not calibrated for do not double a resistance; a bad contact or a meter's overload does. No limit is set
/// to the step from one reading to the next: a filter that takes surprising readings with less weight does as well without one
/// against spikes, and better against what lasts, which such a limit has to let in after a while.
const OUTSIDE: f64 = 2.0;
/// Share of calibration's range of readings by which they have jumped.
const JUMP: f64 = 0.08;
/// A number that has come again for so many times the longest repetition in calibration, and so often, is stuck.
const LONGER: f64 = 3.0;
pub(crate) const MOST_REPEATS: u32 = 10;

impl Sieve {
    /// For a calibration, which sees to its readings itself.
    pub(crate) const OPEN: Self = Self {
        plausible: (f64::NEG_INFINITY, f64::INFINITY),
        longest_repeat_s: f64::INFINITY,
        jump: f64::INFINITY,
        error_time_s: 0.0,
    };

    /// What a sensor's calibration has seen, and far beyond it.
    pub(crate) fn new(params: &SensorParams) -> Self {
        let seen = &params.validity;
        let (low, high) = (seen.reading_lower, seen.reading_upper);
        let beyond = OUTSIDE * (high - low);
        let relative = |reading: f64| reading / params.rest_reading - 1.0;
        Self {
            plausible: (relative(low / OUTSIDE), relative((high + beyond).max(high * OUTSIDE))),
            longest_repeat_s: LONGER * seen.longest_repeat_s,
            jump: JUMP * (relative(high) - relative(low)),
            error_time_s: 0.0,
        }
    }

    /// For readings whose errors are alike over a time, s.
    pub(crate) const fn with_error_time(self, error_time_s: f64) -> Self {
        Self { error_time_s, ..self }
    }

    /// The reading as the filter is to see it, or why it is not to see it. A number that comes for the k-th time in a row is
    /// given k times the variance: what k equal readings tell grows with the logarithm of k only, as their errors, which are
    /// the same, do not average out. A reading soon after another one, whose error is still alike, is given so much more
    /// variance that readings tell as much in a second however many there are.
    pub(crate) fn pass(
        &self,
        repeats: &mut Option<Repeats>,
        time_s: f64,
        reading: Reading<f64>,
        reading_variance: f64,
    ) -> Result<Reading<f64>, ReadingVerdict> {
        let value = reading.value;
        if value.is_finite() && !(self.plausible.0 <= value && value <= self.plausible.1) {
            return Err(ReadingVerdict::Implausible);
        }
        let run = match *repeats {
            Some(run) if run.value == value => Repeats { count: run.count.saturating_add(1), last_s: time_s, ..run },
            _ => Repeats { value, count: 0, since_s: time_s, last_s: time_s },
        };
        let since_reading_s = repeats.map(|run| time_s - run.last_s);
        *repeats = Some(run);
        if run.count >= MOST_REPEATS && time_s - run.since_s > self.longest_repeat_s {
            return Err(ReadingVerdict::Stuck);
        }
        let alike = since_reading_s.map_or(0.0, |dt_s| 1.0 / news(dt_s, self.error_time_s) - 1.0);
        let more = f64::from(run.count) * (reading_variance + reading.extra_variance) + alike * reading_variance;
        Ok(Reading { extra_variance: reading.extra_variance + more, ..reading })
    }
}

/// The longest time, s, for which a number was repeated in recordings; missing readings do not end it.
pub(crate) fn longest_repeat_s(recordings: &[Samples]) -> f64 {
    let mut longest: f64 = 0.0;
    for samples in recordings {
        let mut run: Option<(f64, f64)> = None;
        let known = samples.time_s.iter().zip(samples.reading).filter(|(_, reading)| !reading.is_nan());
        for (&time_s, &reading) in known {
            match run {
                Some((value, since_s)) if value == reading => longest = longest.max(time_s - since_s),
                _ => run = Some((reading, time_s)),
            }
        }
    }
    longest
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::Reading;

    use super::Sieve;

    /// Information, in readings, that `seconds` of readings every `dt_s` bring if their errors are alike over `error_time_s`.
    fn information(dt_s: f64, seconds: f64, error_time_s: f64) -> f64 {
        let sieve = Sieve::OPEN.with_error_time(error_time_s);
        let mut repeats = None;
        let rows = (seconds / dt_s).round() as usize;
        let of_row = |k: usize| {
            let reading = Reading { value: 0.1 + (k % 2) as f64, extra_variance: 0.0 };
            let seen = sieve.pass(&mut repeats, dt_s * k as f64, reading, 1.0).unwrap();
            1.0 / (1.0 + seen.extra_variance)
        };
        (0..=rows).map(of_row).sum()
    }

    /// The first reading counts as one, each other one as 1 - exp(-dt/T): together 1 + t/T for small steps, to dt/2T.
    #[test]
    fn readings_with_errors_alike_tell_as_much_in_a_second_however_many() {
        let (seconds, error_time_s) = (40.0, 2.0);
        for dt_s in [0.001, 0.01, 0.1] {
            let expected = 1.0 + seconds / error_time_s;
            let relative = (information(dt_s, seconds, error_time_s) / expected - 1.0).abs();
            assert!(relative <= 0.5 * dt_s / error_time_s, "{dt_s}: {relative}");
        }
        // Errors of their own: every reading is one.
        assert_eq!(information(0.1, seconds, 0.0), 401.0);
        // Far apart readings are, too: exp(-20) of one is left out, 40 s / 40 s + 1 of them.
        assert!((information(40.0, seconds, 2.0) - 2.0).abs() < 1e-8);
    }
}
