use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS, FeatureScale, OUTPUTS, Starts, filter_inputs, settled};
use serde::{Deserialize, Serialize};

use crate::digits::significant;
use crate::params::estimator::EstimatorKind;

/// Pause between recordings, s: noise that lasts for seconds is not shared by them.
pub(crate) const PAUSE_S: f64 = 1000.0;
/// Significant digits of what is written down. The fit sees the same numbers as the reader of the file.
const DIGITS: usize = 6;

/// Features of the readings to come: those of the past read backwards, but for the reading itself.
pub const FUTURE_FEATURES: usize = FEATURES - 1;

/// The learned correction: rows of the calibration, and what was chosen to learn from them. Weights are made of these when
/// a filter is built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionParams {
    /// The filter that it corrects.
    pub corrects: EstimatorKind,
    /// How it sees readings.
    pub readings: CorrectionScale,
    /// For the filter.
    pub filter: CorrectorParams,
    /// For the smoother.
    pub smoother: CorrectorParams,
    /// What both learn from, in order of time.
    pub rows: Vec<TrainingRow>,
    /// What the law says of motions that the sensor was not seen in, for the filter.
    pub simulated: SimulatedParams,
}

/// What a law says of motions that were simulated: of a few rows that stand for all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedParams {
    /// Standard deviation of the strain that they leave.
    pub sd: f64,
    /// The rows.
    pub rows: Vec<SimulatedRow>,
}

/// A row of a simulated motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedRow {
    /// Features of the readings up to this row.
    pub past: [f64; FEATURES],
    /// The strain, or what is said of it.
    pub strain: f64,
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
    /// Where low-passes usually are at a reading y, a + b y: where they start at the first one.
    pub starts: Starts<f64>,
}

/// How one of the two estimates is corrected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectorParams {
    /// Factor on the corrected strain's standard deviation, from blocks left out.
    pub sd_scale: f64,
    /// Strain from the features of the readings.
    pub direct: ProcessParams,
    /// What the filter's strain lacks, from its outputs and the features.
    pub residual: ProcessParams,
    /// Strain from the features of the past alone, and from those of the future: a smoother's, none of a filter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub one_sided: Vec<ProcessParams>,
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
    /// What the filter said: strain, rate, relaxation, baseline, probabilities of stretching and releasing.
    pub filtered: [f64; OUTPUTS],
    /// What the smoother said.
    pub smoothed: [f64; OUTPUTS],
}

/// Inputs of the smoother's.
pub(crate) const SMOOTHER_INPUTS: usize = FILTER_INPUTS + FUTURE_FEATURES;
/// One-sided processes of the smoother's.
pub(crate) const SIDES: usize = 2;

impl CorrectionScale {
    /// For the past.
    pub(crate) const fn past(self) -> FeatureScale<f64> {
        let Self { centre, half_range, rates, starts } = self;
        FeatureScale { centre, half_range, rates, starts }
    }

    /// For the future, whose low-passes start settled on the last reading: starts of their own made smoothers surer of other
    /// motions than they may be.
    pub(crate) fn future(self) -> FeatureScale<f64> {
        FeatureScale { starts: settled(), ..self.past() }
    }
}

impl TrainingRow {
    /// Inputs of the filter's correction.
    pub(crate) fn filter_inputs(&self) -> [f64; FILTER_INPUTS] {
        filter_inputs(&self.filtered, &self.past)
    }

    /// Inputs of the smoother's.
    pub(crate) fn smoother_inputs(&self) -> [f64; SMOOTHER_INPUTS] {
        smoother_inputs(&self.smoothed, &self.past, &self.future)
    }
}

pub(crate) fn smoother_inputs(
    outputs: &[f64; OUTPUTS],
    past: &[f64; FEATURES],
    future: &[f64; FUTURE_FEATURES],
) -> [f64; SMOOTHER_INPUTS] {
    let mut inputs = [0.0; SMOOTHER_INPUTS];
    inputs.iter_mut().zip(outputs.iter().chain(past).chain(future)).for_each(|(place, value)| *place = *value);
    inputs
}

/// What a Gaussian process was chosen to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessParams {
    /// Length scale of each input that the process sees, in standard deviations of the input: the longer, the less it counts.
    pub lengths: Vec<f64>,
    /// Noise that is correlated in time, relative to the targets' standard deviation.
    pub noise: f64,
    /// For how long it is, s.
    pub noise_time_s: f64,
    /// Factor on the process' standard deviation, from blocks left out.
    pub sd_scale: f64,
}

impl TrainingRow {
    /// With the digits that are written down.
    pub(crate) fn rounded(self) -> Self {
        Self {
            time_s: digits(self.time_s),
            strain: digits(self.strain),
            past: self.past.map(digits),
            future: self.future.map(digits),
            filtered: self.filtered.map(digits),
            smoothed: self.smoothed.map(digits),
        }
    }
}

pub(crate) fn digits(value: f64) -> f64 {
    significant(value, DIGITS)
}
