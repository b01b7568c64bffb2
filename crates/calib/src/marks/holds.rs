//! Holds around marks, detected from the speed of the readings.

use crate::order::{self, extent, sorted};
use crate::samples::{Samples, central_rate};

/// Half-width of the window over which readings and their rates are averaged, s.
const AVERAGED_S: f64 = 0.15;
/// Speed below which readings count as still, as a fraction of their 90 % quantile.
const STILL: f64 = 0.12;
/// Minimum duration of a hold, as a fraction of the time between the neighbouring marks, and in standard deviations of a mark's time.
const LEAST_OF_GAP: f64 = 0.25;
const LEAST_SDS: f64 = 4.0;
/// Largest change over a hold's second half, as a fraction of that over the first half, or over the whole hold, as a fraction of the
/// readings' range. A held sensor relaxes, so its readings slow down; readings that do not are a slow move.
const RELAXES: f64 = 0.6;
const RESTS: f64 = 0.08;

/// Averaged readings, without the missing ones, and their speeds.
pub(crate) struct Stillness {
    time_s: Vec<f64>,
    reading: Vec<f64>,
    speed: Vec<f64>,
    still: f64,
    range: f64,
}

impl Stillness {
    pub(crate) fn new(samples: &Samples) -> Self {
        let rows = || (0..samples.len()).filter(|&k| samples.reading[k].is_finite());
        let time_s: Vec<f64> = rows().map(|k| samples.time_s[k]).collect();
        let reading = averaged(&time_s, &rows().map(|k| samples.reading[k]).collect::<Vec<_>>());
        let speed = averaged(&time_s, &central_rate(&time_s, &reading).iter().map(|v| v.abs()).collect::<Vec<_>>());
        let ranked = sorted(speed.iter().copied());
        let still = STILL * ranked.get(ranked.len() * 9 / 10).copied().unwrap_or(0.0);
        let (low, high) = extent(reading.iter().copied());
        Self { time_s, reading, speed, still, range: high - low }
    }

    /// Returns the start and end, s, of the hold around `time_s`, which lies between the marks at `before_s` and `after_s`; `None` if the
    /// readings move. `time_sd_s` is the standard deviation of the mark's time.
    pub(crate) fn hold(&self, time_s: f64, (before_s, after_s): (f64, f64), time_sd_s: f64) -> Option<(f64, f64)> {
        let row = |time_s: f64| self.time_s.partition_point(|t| *t < time_s);
        let near = row(time_s - 2.0 * time_sd_s)..row(time_s + 2.0 * time_sd_s);
        let stillest = near.min_by(|a, b| self.speed[*a].total_cmp(&self.speed[*b]))?;
        let is_still = |k: &usize| self.speed[*k] < self.still;
        let first = (row(before_s)..=stillest).rev().take_while(is_still).last()?;
        let last = (stillest..(row(after_s) + 1).min(self.time_s.len())).take_while(is_still).last()?;
        let duration_s = self.time_s[last] - self.time_s[first];
        let least_s = (LEAST_SDS * time_sd_s).max(LEAST_OF_GAP * (after_s - before_s));
        (duration_s > least_s && self.relaxes(first, last)).then(|| (self.time_s[first], self.time_s[last]))
    }

    /// True if the reading comes to rest between two rows.
    fn relaxes(&self, first: usize, last: usize) -> bool {
        let change = |a: usize, b: usize| (self.reading[b] - self.reading[a]).abs();
        let middle = usize::midpoint(first, last);
        change(first, last) <= RESTS * self.range || change(middle, last) <= RELAXES * change(first, middle)
    }
}

/// Returns the mean over [`AVERAGED_S`] to each side.
fn averaged(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    let row = |t: f64| time_s.partition_point(|s| *s < t);
    let mean = |t: &f64| order::mean(values[row(t - AVERAGED_S)..row(t + AVERAGED_S).max(row(*t) + 1)].iter().copied());
    time_s.iter().map(mean).collect()
}
