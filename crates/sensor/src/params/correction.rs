use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS, FeatureScale, OUTPUTS, filter_inputs};
use serde::{Deserialize, Serialize};

use crate::params::estimator::EstimatorKind;

/// Number of features of the future: the features of the past, computed backwards in time, without the reading itself.
pub const FUTURE_FEATURES: usize = FEATURES - 1;

/// Learned correction of the strain of a filter and a smoother.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionParams {
    /// The filter that it corrects.
    pub corrects: EstimatorKind,
    /// Scale of the readings.
    pub readings: FeatureScale<f64>,
    /// Correction of the filter.
    pub filter: CorrectorParams,
    /// Correction of the smoother.
    pub smoother: CorrectorParams,
    /// Process for the filter of simulated motions, which are not in the recordings.
    pub simulated: SimulatedParams,
    /// Rows of the calibration for which both have weights, in order of time.
    pub rows: Vec<TrainingRow>,
}

/// The law in simulated motions: a process of the features with a few inducing rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedParams {
    /// Mean strain.
    pub mean: f64,
    /// Standard deviation of the strain that the process leaves unexplained.
    pub sd: f64,
    /// Length scale of all inputs, in standard deviations of the input.
    pub length: f64,
    /// Weight of each row.
    pub weights: Vec<f64>,
    /// Features of the readings up to each row.
    pub rows: Vec<[f64; FEATURES]>,
}

/// Parameters of the correction of one estimate, the filter's or the smoother's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectorParams {
    /// Factor on the corrected strain's standard deviation, from held-out blocks.
    pub sd_scale: f64,
    /// Standard deviation of the strain over the training rows.
    pub strain_sd: f64,
    /// Indices of [`CorrectionParams::rows`], inducing rows first.
    pub order: Vec<usize>,
    /// Scales of the inputs over the training rows.
    pub inputs: InputScales,
    /// Strain from the features of the readings.
    pub direct: ProcessParams,
    /// Residual process: the error of the filter's strain, from its outputs and the features.
    pub residual: ProcessParams,
    /// Strain from the features of the past alone, and from those of the future alone; empty for a filter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub one_sided: Vec<ProcessParams>,
}

/// Location and range of each input of a corrector: the filter's outputs, features of the past, features of the future.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputScales {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations; 0 for a constant input, which has no effect.
    pub sd: Vec<f64>,
    /// Smallest values.
    pub lower: Vec<f64>,
    /// Largest values.
    pub upper: Vec<f64>,
}

/// A row of a calibration recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingRow {
    /// Time, s; recordings are joined with a long pause in between.
    pub time_s: f64,
    /// The true strain.
    pub strain: f64,
    /// Features of the readings up to this row.
    pub past: [f64; FEATURES],
    /// Features of the readings from this row on.
    pub future: [f64; FUTURE_FEATURES],
    /// Output of the filter: strain, rate, relaxation, baseline, probabilities of stretching and releasing.
    pub filtered: [f64; OUTPUTS],
    /// Output of the smoother.
    pub smoothed: [f64; OUTPUTS],
}

/// Number of inputs of the smoother's correction.
pub const SMOOTHER_INPUTS: usize = FILTER_INPUTS + FUTURE_FEATURES;
/// Number of one-sided processes of the smoother's correction.
pub const SIDES: usize = 2;

impl TrainingRow {
    /// Returns the inputs of the filter's correction.
    #[must_use]
    pub fn filter_inputs(&self) -> [f64; FILTER_INPUTS] {
        filter_inputs(&self.filtered, &self.past)
    }

    /// Returns the inputs of the smoother's correction.
    #[must_use]
    pub fn smoother_inputs(&self) -> [f64; SMOOTHER_INPUTS] {
        smoother_inputs(&self.smoothed, &self.past, &self.future)
    }
}

/// Returns the inputs of the smoother's correction.
#[must_use]
pub fn smoother_inputs(
    outputs: &[f64; OUTPUTS],
    past: &[f64; FEATURES],
    future: &[f64; FUTURE_FEATURES],
) -> [f64; SMOOTHER_INPUTS] {
    let mut inputs = [0.0; SMOOTHER_INPUTS];
    inputs.iter_mut().zip(outputs.iter().chain(past).chain(future)).for_each(|(place, value)| *place = *value);
    inputs
}

/// Parameters of a learned Gaussian process: see [`Process`](ohmstrain_ekf::correction::Process).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessParams {
    /// Factor on the process' standard deviation, from held-out blocks.
    pub sd_scale: f64,
    /// Mean of the targets.
    pub mean: f64,
    /// Prior standard deviation where the kernel is 1.
    pub sd: f64,
    /// Smallest prior standard deviation.
    pub least_sd: f64,
    /// Standard deviation of the noise.
    pub noise_sd: f64,
    /// Indices of the process' inputs among the corrector's. The linear part of the kernel takes the first.
    pub inputs: Vec<usize>,
    /// Length scale of each input, in its standard deviations; the longer, the less the input counts.
    pub lengths: Vec<f64>,
    /// Weight of each row, in the corrector's order.
    pub weights: Vec<f64>,
    /// Rows of the upper triangle W, one after the other: with kernels k of the m inducing rows, |W k|² of the prior variance is
    /// explained. It has m (m + 1)/2 entries.
    pub explained: Vec<f64>,
}
