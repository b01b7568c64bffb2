use std::collections::VecDeque;

use super::regression::{BASELINE_RIDGES, Features, Regression};
use super::sampling_interval_s;
use crate::CalibrationError;
use crate::samples::Samples;

/// Readings of the last 20 s on a uniform grid: a finite impulse response filter.
///
/// Readings are interpolated linearly onto the grid; times before the first reading take its value.
#[derive(Clone, Debug)]
pub struct Fir {
    spacing_s: f64,
    taps: usize,
    /// Times and readings in the window, and the last one before it.
    recent: VecDeque<(f64, f64)>,
}

/// Length of the window of readings, s.
const WINDOW_S: f64 = 20.0;
/// Largest number of readings on the grid.
const MOST_TAPS: usize = 40;

impl Fir {
    /// Fits a ridge regression of strain. The grid spacing is half a second, or the sampling interval if that is
    /// longer.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Regression<Self>, CalibrationError> {
        let spacing_s = sampling_interval_s(recordings).max(WINDOW_S / MOST_TAPS as f64);
        let taps = ((WINDOW_S / spacing_s) as usize).clamp(1, MOST_TAPS);
        Regression::fit(recordings, [Self { spacing_s, taps, recent: VecDeque::new() }], 1, &BASELINE_RIDGES)
    }

    /// Returns the spacing of the grid, s.
    #[must_use]
    pub const fn spacing_s(&self) -> f64 {
        self.spacing_s
    }

    /// Returns the number of readings on the grid, the present one included.
    #[must_use]
    pub const fn taps(&self) -> usize {
        self.taps
    }

    fn interpolated(&self, time_s: f64) -> f64 {
        let after = self.recent.partition_point(|(time, _)| *time < time_s);
        let Some(&(after_s, reading)) = self.recent.get(after).or(self.recent.back()) else { return 0.0 };
        match after.checked_sub(1).and_then(|before| self.recent.get(before)) {
            Some(&(before_s, before)) if after_s > before_s => {
                before + (time_s - before_s) / (after_s - before_s) * (reading - before)
            }
            _ => reading,
        }
    }
}

impl Features for Fir {
    fn next(&mut self, time_s: f64, reading: f64) -> Vec<f64> {
        self.recent.push_back((time_s, reading));
        let lags_s = (0..self.taps).map(|tap| tap as f64 * self.spacing_s);
        let oldest_s = time_s - (self.taps - 1) as f64 * self.spacing_s;
        while self.recent.get(1).is_some_and(|(second_s, _)| *second_s <= oldest_s) {
            self.recent.pop_front();
        }
        std::iter::once(1.0).chain(lags_s.map(|lag_s| self.interpolated(time_s - lag_s))).collect()
    }
}
