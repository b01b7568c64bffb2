use super::regression::{BASELINE_RIDGES, Features, Regression};
use crate::CalibrationError;
use crate::low_pass::LowPass;
use crate::samples::Samples;

/// The reading, its differences from four low-passes of it, and all products of two of them.
///
/// The differences span the same space as the low-passes but are much less alike, so the ridge penalises what each
/// low-pass adds, not what they share.
#[derive(Clone, Debug)]
pub struct LeakyBank([LowPass; TIME_CONSTANTS_S.len()]);

/// Time constants of the low-passes, s.
const TIME_CONSTANTS_S: [f64; 4] = [0.5, 2.0, 8.0, 32.0];

impl LeakyBank {
    /// Fits a ridge regression of strain.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Regression<Self>, CalibrationError> {
        Regression::fit(recordings, [Self(TIME_CONSTANTS_S.map(LowPass::new))], 1, &BASELINE_RIDGES)
    }
}

impl Features for LeakyBank {
    fn next(&mut self, time_s: f64, reading: f64) -> Vec<f64> {
        let [a, b, c, d] = self.0.each_mut().map(|low_pass| reading - low_pass.next(time_s, reading));
        with_products(&[reading, a, b, c, d])
    }
}

/// Returns the constant, the linear regressors and the products of any two of them.
fn with_products(linear: &[f64]) -> Vec<f64> {
    let mut regressors = vec![1.0];
    regressors.extend(linear);
    for (i, a) in linear.iter().enumerate() {
        regressors.extend(linear[i..].iter().map(|b| a * b));
    }
    regressors
}
