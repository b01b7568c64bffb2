use super::regression::{Features, RIDGES, Regression};
use crate::CalibrationError;
use crate::low_pass::LowPass;
use crate::samples::Samples;

/// The reading, its distances from four low-passes of it, and all products of two of them.
///
/// Distances span the same as the low-passes themselves, and are much less alike: the ridge penalises what each low-pass
/// adds, not what all have in common.
#[derive(Clone, Debug)]
pub struct LeakyBank {
    low_passes: [LowPass; 4],
}

/// Time constants, s, a factor of four apart.
const TIME_CONSTANTS_S: [f64; 4] = [0.5, 2.0, 8.0, 32.0];

impl LeakyBank {
    /// Ridge regression of strain.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant or the readings do not vary.
    pub fn fit(recordings: &[Samples]) -> Result<Regression<Self>, CalibrationError> {
        Regression::fit(recordings, [Self { low_passes: TIME_CONSTANTS_S.map(LowPass::new) }], 1, &RIDGES)
    }
}

impl Features for LeakyBank {
    fn next(&mut self, time_s: f64, reading: f64) -> Vec<f64> {
        let mut features = vec![1.0, reading];
        features.extend(self.low_passes.iter_mut().map(|low_pass| reading - low_pass.next(time_s, reading)));
        let linear = features.len();
        for i in 1..linear {
            for j in i..linear {
                features.push(features[i] * features[j]);
            }
        }
        features
    }
}
