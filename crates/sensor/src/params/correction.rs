use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS, FeatureScale, OUTPUTS, Starts, filter_inputs, settled};
use serde::{Deserialize, Serialize};

use crate::params::estimator::EstimatorKind;

/// Features of the readings to come: those of the past read backwards, but for the reading itself.
pub const FUTURE_FEATURES: usize = FEATURES - 1;

/// The learned correction of a filter's and a smoother's strain, as calibration has learned it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionParams {
    /// The filter that it corrects.
    pub corrects: EstimatorKind,
    /// Scale of the readings.
    pub readings: CorrectionScale,
    /// Correction of the filter.
    pub filter: CorrectorParams,
    /// Correction of the smoother.
    pub smoother: CorrectorParams,
    /// Process of simulated motions, which the sensor was not seen in, for the filter.
    pub simulated: SimulatedParams,
    /// Rows of the calibration that both have weights for, in order of time.
    pub rows: Vec<TrainingRow>,
}

/// The law in simulated motions: a process of the features, by a few rows that stand for all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedParams {
    /// Mean strain.
    pub mean: f64,
    /// Standard deviation of the strain that it leaves.
    pub sd: f64,
    /// Length scale of all inputs, in standard deviations of the input.
    pub length: f64,
    /// Weight of each row.
    pub weights: Vec<f64>,
    /// Features of the readings up to each row.
    pub rows: Vec<[f64; FEATURES]>,
}

/// The scale on which a correction sees readings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionScale {
    /// The change of resistance `R/R₀ - 1` that counts as zero.
    pub centre: f64,
    /// Distance from there that counts as one.
    pub half_range: f64,
    /// Usual sizes of the readings' two rates.
    pub rates: [f64; 2],
    /// Usual values of the low-passes at a reading y, a + b y: their starting values at the first reading.
    pub starts: Starts<f64>,
}

/// Parameters of the correction of one of the two estimates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectorParams {
    /// Factor on the corrected strain's standard deviation, from blocks left out.
    pub sd_scale: f64,
    /// Standard deviation of the strain over the rows that it was learned from.
    pub strain_sd: f64,
    /// Indices of [`CorrectionParams::rows`], inducing rows first.
    pub order: Vec<usize>,
    /// Scales of the inputs over the rows that it was learned from.
    pub inputs: InputScales,
    /// Strain from the features of the readings.
    pub direct: ProcessParams,
    /// Residual process: the error of the filter's strain, from its outputs and the features.
    pub residual: ProcessParams,
    /// Strain from the features of the past alone, and from those of the future: a smoother's, none of a filter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub one_sided: Vec<ProcessParams>,
}

/// Location and range of each input of a corrector: the filter's outputs, features of the past, features of the future.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputScales {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations; 0 for an input that never changes, which tells nothing.
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
    /// Time, s; recordings follow each other with a long pause.
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

/// Inputs of the smoother's.
pub const SMOOTHER_INPUTS: usize = FILTER_INPUTS + FUTURE_FEATURES;
/// One-sided processes of the smoother's.
pub const SIDES: usize = 2;

impl CorrectionScale {
    /// Returns the scale for features of the past.
    #[must_use]
    pub const fn past(self) -> FeatureScale<f64> {
        let Self { centre, half_range, rates, starts } = self;
        FeatureScale { centre, half_range, rates, starts }
    }

    /// Returns the scale for features of the future. Their low-passes start settled on the last reading: with fitted starts smoothers
    /// were too sure of other motions.
    #[must_use]
    pub fn future(self) -> FeatureScale<f64> {
        FeatureScale { starts: settled(), ..self.past() }
    }
}

impl TrainingRow {
    /// Inputs of the filter's correction.
    #[must_use]
    pub fn filter_inputs(&self) -> [f64; FILTER_INPUTS] {
        filter_inputs(&self.filtered, &self.past)
    }

    /// Inputs of the smoother's.
    #[must_use]
    pub fn smoother_inputs(&self) -> [f64; SMOOTHER_INPUTS] {
        smoother_inputs(&self.smoothed, &self.past, &self.future)
    }
}

/// Inputs of the smoother's correction.
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

/// A Gaussian process as calibration has learned it: see [`Process`](ohmstrain_ekf::correction::Process).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessParams {
    /// Factor on the process' standard deviation, from blocks left out.
    pub sd_scale: f64,
    /// Mean of the targets.
    pub mean: f64,
    /// Prior standard deviation where the kernel is 1.
    pub sd: f64,
    /// Least prior standard deviation.
    pub least_sd: f64,
    /// Standard deviation of the noise.
    pub noise_sd: f64,
    /// Places of the inputs that the process sees, among the corrector's. The linear part of the kernel takes the first.
    pub inputs: Vec<usize>,
    /// Length scale of each, in standard deviations of the input: the longer, the less it counts.
    pub lengths: Vec<f64>,
    /// Weight of each row, in the corrector's order.
    pub weights: Vec<f64>,
    /// Rows of the upper triangle W, one after the other: with kernels k of the m inducing rows, |W k|² of the prior variance is
    /// explained. It has m (m + 1)/2 entries.
    pub explained: Vec<f64>,
}
