use ohmstrain_ekf::{Reading, ReadingVerdict};

use crate::params::SensorParams;
use crate::samples::Samples;

/// What a reading must be for a filter to see it at all, and what is made of one that comes again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sieve {
    /// Least and largest R/R₀ - 1 that can be a reading of this sensor.
    plausible: (f64, f64),
    /// Longest time, s, for which a working sensor repeats one number.
    longest_repeat_s: f64,
}

/// How long the same number has been coming.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Repeats {
    value: f64,
    count: u32,
    since_s: f64,
}

/// By how many ranges of the calibration's readings, and by what factor, a reading may lie outside of them: drift and strains
/// that were not calibrated for do not change a resistance tenfold, an open circuit or a meter's overload does.
const OUTSIDE: f64 = 10.0;
/// A number that has come again for so many times the longest repetition in calibration, and so often, is stuck.
const LONGER: f64 = 3.0;
const MOST_REPEATS: u32 = 10;

impl Sieve {
    /// For a calibration, which sees to its readings itself.
    pub(crate) const OPEN: Self =
        Self { plausible: (f64::NEG_INFINITY, f64::INFINITY), longest_repeat_s: f64::INFINITY };

    /// What a sensor's calibration has seen, and far beyond it.
    pub(crate) fn new(params: &SensorParams) -> Self {
        let seen = &params.validity;
        let (low, high) = (seen.reading_lower, seen.reading_upper);
        let beyond = OUTSIDE * (high - low);
        let relative = |reading: f64| reading / params.rest_reading - 1.0;
        Self {
            plausible: (relative(low / OUTSIDE), relative((high + beyond).max(high * OUTSIDE))),
            longest_repeat_s: LONGER * seen.longest_repeat_s,
        }
    }

    /// The reading as the filter is to see it, or why it is not to see it. A number that comes for the k-th time in a row is
    /// given k times the variance: what k equal readings tell grows with the logarithm of k only, as their errors, which are
    /// the same, do not average out.
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
            Some(run) if run.value == value => Repeats { count: run.count.saturating_add(1), ..run },
            _ => Repeats { value, count: 0, since_s: time_s },
        };
        *repeats = Some(run);
        if run.count >= MOST_REPEATS && time_s - run.since_s > self.longest_repeat_s {
            return Err(ReadingVerdict::Stuck);
        }
        let more = f64::from(run.count) * (reading_variance + reading.extra_variance);
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
