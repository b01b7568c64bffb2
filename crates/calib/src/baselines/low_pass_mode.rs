use super::regression::{Features, Regression};
use super::sampling_interval_s;
use crate::CalibrationError;
use crate::low_pass::LowPass;
use crate::samples::Samples;

/// The reading, its square and cube, and its difference from one low-pass of it: a static cubic with one relaxation.
#[derive(Clone, Debug)]
pub struct LowPassMode {
    low_pass: LowPass,
}

/// Number of time constants tried, evenly spaced in their logarithm; over two decades, neighbours differ by a quarter.
const TIME_CONSTANTS: usize = 24;
/// Number of features: the constant and four others, few enough to need no ridge.
const FEATURES: usize = 5;

impl LowPassMode {
    /// Fits by least squares. The time constant is the one with the least cross-validation error, between three
    /// sampling intervals and a quarter of the longest recording, which is the length of a cross-validation block.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Regression<Self>, CalibrationError> {
        let shortest_s = 3.0 * sampling_interval_s(recordings);
        let longest_s = recordings.iter().map(Samples::duration_s).fold(0.0, f64::max);
        let ratio = (0.25 * longest_s / shortest_s).max(1.0);
        let share = |i: usize| i as f64 / (TIME_CONSTANTS - 1) as f64;
        let candidates =
            (0..TIME_CONSTANTS).map(|i| Self { low_pass: LowPass::new(shortest_s * ratio.powf(share(i))) });
        Regression::fit(recordings, candidates, FEATURES, &[0.0])
    }

    /// Returns the time constant, s.
    #[must_use]
    pub const fn tau_s(&self) -> f64 {
        self.low_pass.tau_s()
    }
}

impl Features for LowPassMode {
    fn next(&mut self, time_s: f64, reading: f64) -> Vec<f64> {
        vec![1.0, reading, reading.powi(2), reading.powi(3), reading - self.low_pass.next(time_s, reading)]
    }
}
