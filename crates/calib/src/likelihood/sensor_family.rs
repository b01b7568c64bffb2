use ohmstrain_ekf::Belief;
use ohmstrain_model::{ModelNoise, Motion, ParameterError, Scalar, SensorLaw, SwitchedModel};

use super::ModelFamily;
use ohmstrain_sensor::{MotionParams, NoiseParams};

/// A parameter of noise or motion that readings alone may determine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseParameter {
    /// White noise of a reading, relative to R₀.
    ReadingSd,
    /// Long-run standard deviation of each branch, relative to R₀.
    BranchSd,
    /// Long-run standard deviation of the baseline, relative to R₀.
    BaselineSd,
    /// Correlation time of the baseline, s.
    BaselineTime,
    /// Standard deviation of the rate, 1/s.
    RateSd,
    /// Correlation time of the rate, s.
    RateTime,
}

impl NoiseParameter {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::ReadingSd, Self::BranchSd, Self::BaselineSd, Self::BaselineTime, Self::RateSd, Self::RateTime];

    /// Returns its name in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ReadingSd => "reading_sd",
            Self::BranchSd => "branch_sd",
            Self::BaselineSd => "baseline_sd",
            Self::BaselineTime => "baseline_time_s",
            Self::RateSd => "rate_sd_per_s",
            Self::RateTime => "rate_time_s",
        }
    }

    /// Returns its value in a pair of noise and motion.
    #[must_use]
    pub fn get(self, noise: &NoiseParams, motion: &MotionParams) -> f64 {
        match self {
            Self::ReadingSd => noise.reading_sd,
            Self::BranchSd => noise.branch_sd,
            Self::BaselineSd => noise.baseline_sd,
            Self::BaselineTime => noise.baseline_time_s,
            Self::RateSd => motion.rate_sd_per_s,
            Self::RateTime => motion.rate_time_s,
        }
    }
}

/// Noise and motion around a known law, N = B + 3; `free` are the parameters that the likelihood varies.
pub(super) struct SensorFamily<'a, const B: usize> {
    pub law: SensorLaw<f64, B>,
    pub noise: NoiseParams,
    pub motion: MotionParams,
    pub free: &'a [NoiseParameter],
}

impl<const B: usize> SensorFamily<'_, B> {
    fn value<T: Scalar>(&self, parameter: NoiseParameter, values: &[T]) -> T {
        let mut found = self.free.iter().zip(values).filter(|(free, _)| **free == parameter);
        found.next().map_or_else(|| T::of(parameter.get(&self.noise, &self.motion)), |(_, value)| *value)
    }

    fn noise<T: Scalar>(&self, values: &[T]) -> ModelNoise<T> {
        ModelNoise {
            reading_sd: self.value(NoiseParameter::ReadingSd, values),
            branch_sd: self.value(NoiseParameter::BranchSd, values),
            baseline_sd: self.value(NoiseParameter::BaselineSd, values),
            baseline_time_s: self.value(NoiseParameter::BaselineTime, values),
        }
    }

    /// Returns the motion. Mean and standard deviation of strain are fixed: they set the scale against which readings
    /// are judged.
    fn motion<T: Scalar>(&self, values: &[T]) -> Result<Motion<T>, ParameterError> {
        let (rate_sd, rate_time_s) =
            (self.value(NoiseParameter::RateSd, values), self.value(NoiseParameter::RateTime, values));
        let MotionParams { strain_mean, strain_sd, .. } = self.motion;
        Motion::ornstein_uhlenbeck(rate_time_s, rate_sd, T::of(strain_mean), T::of(strain_sd))
    }
}

impl<const B: usize, const N: usize, const L: usize> ModelFamily<N, L> for SensorFamily<'_, B> {
    type Model<T: Scalar> = SwitchedModel<T, B, N>;

    fn model<T: Scalar>(&self, values: &[T]) -> Result<Self::Model<T>, ParameterError> {
        SwitchedModel::new(self.law.to(), self.motion(values)?, self.noise(values))
    }

    fn start<T: Scalar>(&self, model: &Self::Model<T>) -> Belief<T, N, L> {
        Belief::initial(model)
    }
}
