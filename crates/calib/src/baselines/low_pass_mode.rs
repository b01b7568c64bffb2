use super::regression::{Features, Regression};
use super::sampling_interval_s;
use crate::CalibrationError;
use crate::low_pass::LowPass;
use crate::samples::Samples;

/// The reading, squared and cubed, and its distance from one low-pass of it: a static cubic that knows one relaxation.
#[derive(Clone, Debug)]
pub struct LowPassMode {
    low_pass: LowPass,
}

/// Time constants tried, evenly spaced in their logarithm: neighbours differ by a quarter where they span two decades.
const TIME_CONSTANTS: usize = 24;
/// The constant and four features: few enough to do without a ridge.
const FEATURES: usize = 5;

impl LowPassMode {
    /// Least squares; the time constant, from three readings to a quarter of the longest recording, which is a block of
    /// the cross-validation, is the one with the least error there.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Regression<Self>, CalibrationError> {
        let shortest_s = 3.0 * sampling_interval_s(recordings);
        let longest_s = recordings
            .iter()
            .filter_map(|samples| Some(samples.time_s.last()? - samples.time_s.first()?))
            .fold(0.0, f64::max);
        let ratio = (0.25 * longest_s / shortest_s).max(1.0);
        let share = |i: usize| i as f64 / (TIME_CONSTANTS - 1) as f64;
        let candidates =
            (0..TIME_CONSTANTS).map(|i| Self { low_pass: LowPass::new(shortest_s * ratio.powf(share(i))) });
        Regression::fit(recordings, candidates, FEATURES, &[0.0])
    }

    /// The time constant, s.
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
