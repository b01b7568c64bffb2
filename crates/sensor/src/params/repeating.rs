use ohmstrain_ekf::live::{MOST_CODE_REPEATS, MOST_REPEATS};

use crate::params::Resolution;

/// Probability that a still sensor repeats a reading so often that it counts as stuck.
const FALSE_ALARM: f64 = 1e-6;
/// Number of the noise's standard deviations from which a step is coarse: a still sensor may then repeat one reading for
/// ever.
const COARSE: f64 = 4.0;

/// Repetition of one reading by a still sensor, from the resolution of its readings and their noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Repeating {
    /// True where the step is coarse: no repetition is a fault.
    pub is_endless: bool,
    /// Largest plausible number of repetitions.
    pub most: f64,
    /// Variance of a converter's error, (R/R₀)², above which its step is coarse.
    pub fine_variance: f64,
}

impl Repeating {
    /// Repetition for files without step and noise: ten repetitions, and no converter is coarse.
    pub(super) const UNKNOWN: Self = Self { is_endless: false, most: MOST_REPEATS as f64, fine_variance: 1.0 };

    /// Computes the repetition of readings relative to a rest resistance. The noise is assumed Gaussian, and the resistance in the
    /// middle of a step, where repetitions are most frequent.
    pub(super) fn new(resolution: Resolution, rest_reading: f64) -> Self {
        let Resolution { step, noise_sd } = resolution;
        let coarse = COARSE * noise_sd;
        let is_endless = step >= coarse;
        let leaves = libm::erfc(step / noise_sd / 8.0_f64.sqrt());
        let most = if is_endless { f64::INFINITY } else { (FALSE_ALARM.ln() / (-leaves).ln_1p()).ceil() };
        Self {
            is_endless,
            most: most.clamp(Self::UNKNOWN.most, f64::from(MOST_CODE_REPEATS)),
            fine_variance: (coarse / rest_reading).powi(2) / 12.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Repeating;
    use crate::params::Resolution;

    /// Returns the longest repetition in simulated readings of a still sensor in the middle of a step, with noise from a sum of
    /// twelve uniform numbers.
    fn longest_of_still_sensor(step_in_sds: f64, rows: usize) -> usize {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut longest, mut run, mut last) = (0, 0, f64::NAN);
        for _ in 0..rows {
            let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            let code = (noise / step_in_sds).round();
            run = if code == last { run + 1 } else { 0 };
            (longest, last) = (longest.max(run), code);
        }
        longest
    }

    /// Tests a still sensor: in 20 000 rows, a reading repeats that often with a probability of two per cent, and half as often
    /// almost surely.
    #[test]
    fn a_still_sensor_is_not_stuck() {
        for step_in_sds in [1.0, 1.5, 2.0] {
            let most = Repeating::new(Resolution { step: step_in_sds, noise_sd: 1.0 }, 1000.0).most;
            let longest = longest_of_still_sensor(step_in_sds, 20_000) as f64;
            assert!(0.4 * most < longest && longest < most, "{step_in_sds}: {longest} of {most}");
        }
        // A step of a twentieth of the noise: ten repetitions as before. A whole ohm with noise of a tenth: any number.
        assert_eq!(Repeating::new(Resolution { step: 0.05, noise_sd: 1.0 }, 1000.0).most, 10.0);
        assert!(Repeating::new(Resolution { step: 1.0, noise_sd: 0.1 }, 1000.0).is_endless);
        assert!(Repeating::new(Resolution { step: 1.0, noise_sd: 0.0 }, 1000.0).is_endless);
    }
}
