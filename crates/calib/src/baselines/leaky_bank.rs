use super::regression::{Features, RIDGES, Regression};
use crate::CalibrationError;
use crate::inverse::{LowPasses, with_products};
use crate::samples::Samples;

/// The reading, its distances from four low-passes of it, and all products of two of them.
///
/// Distances span the same as the low-passes themselves, and are much less alike: the ridge penalises what each low-pass
/// adds, not what all have in common.
#[derive(Clone, Debug)]
pub struct LeakyBank(LowPasses);

impl LeakyBank {
    /// Ridge regression of strain.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Regression<Self>, CalibrationError> {
        Regression::fit(recordings, [Self(LowPasses::new())], 1, &RIDGES)
    }
}

impl Features for LeakyBank {
    fn next(&mut self, time_s: f64, reading: f64) -> Vec<f64> {
        let [a, b, c, d] = self.0.distances(time_s, reading);
        with_products(&[reading, a, b, c, d])
    }
}
