//! Content of `sensor.toml`, and the range of each of its numbers. It does not depend on the calibration that makes it.

pub(crate) mod correction;
pub(crate) mod estimator;
pub(crate) mod findings;
pub(crate) mod law;
mod live;
mod repeating;
pub(crate) mod static_cubic;
pub(crate) mod summary;
pub(crate) mod temperature;
pub(crate) mod unstated;
pub(crate) mod validate;

use std::collections::BTreeMap;

use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

use crate::params::correction::CorrectionParams;
use crate::params::estimator::{EstimatorKind, EstimatorParams, NoParameters};
use crate::params::findings::Findings;
use crate::params::law::LawParams;
use crate::params::static_cubic::StaticCubic;
use crate::params::summary::{Summary, TestedSummary};
use crate::params::temperature::TemperatureParams;
use crate::params::unstated::Unstated;

/// Largest factor on the deviations of a calibrated filter. A larger factor is a sign of another error; calibrations report
/// when they reach it.
pub const LARGEST_SD_SCALE: f64 = 5.0;
/// Version of the parameter file this code reads and writes.
pub const FORMAT: u32 = 9;

/// Parameters of a sensor, everything that a filter needs: the content of `sensor.toml`.
///
/// "Strain" means the reference quantity; with [`Quantity::AngleDeg`], strains are in degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorParams {
    /// Version of the format, [`FORMAT`].
    pub format: u32,
    /// Program and version that made it.
    pub made_by: String,
    /// The estimated quantity.
    pub quantity: Quantity,
    /// Unit of the readings.
    pub reading: ReadingUnit,
    /// R₀ of the law, to which everything is relative; Ω, or a ratio. It is fitted, not measured: see `measured_rest`.
    pub rest_reading: f64,
    /// Measured resistance at rest in calibration, before the first movement, in the same unit; `None` if no recording begins
    /// at rest. Later resistances at rest are compared with this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_rest: Option<f64>,
    /// Default estimator.
    pub default_estimator: EstimatorKind,
    /// Summary of the calibration; `None` if nothing could be scored on held-out parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub summary: Option<Summary>,
    /// Scores on test rows, which the calibration did not use; `None` if there were none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tested: Option<TestedSummary>,
    /// Range of the output: the reference's range in calibration, or a joint's stops.
    pub limits: StrainRange<f64>,
    /// Calibrated range.
    pub validity: Validity,
    /// Differences between sessions; `None` for a calibration on one session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sessions: Option<Sessions>,
    /// Errors beyond those that the estimators state, from rows to which the calibration was not fitted.
    #[serde(default, skip_serializing_if = "Unstated::is_none")]
    pub unstated: Unstated,
    /// Effect of temperature; `None` if the calibration has no temperatures, or none that moved enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<TemperatureParams>,
    /// Static inverse, for comparison.
    pub static_cubic: StaticCubic,
    /// Geometry of the joint, if the sensor is glued across one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointParams>,
    /// The sensor's law.
    pub law: LawParams,
    /// Noise and motion, per estimator.
    pub estimators: BTreeMap<EstimatorKind, EstimatorParams>,
    /// Recordings used for the calibration.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<RecordingInfo>,
    /// Standard errors of the law's parameters from the recordings alone, without the ridge that the filter's law has. Parameters
    /// that the recordings do not determine are missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
    /// Scores on held-out parts, content of the recordings and contributions to the error; `None` if nothing could be scored, or in
    /// files of earlier versions. No computation uses it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub findings: Option<Findings>,
    /// Learned correction of the filter's error, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction: Option<CorrectionParams>,
}

/// The quantity that the reference measures and the filter estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Engineering strain.
    Strain,
    /// An angle in degrees, without a joint's geometry.
    AngleDeg,
}

impl Quantity {
    /// Name in messages and columns.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Strain => "strain",
            Self::AngleDeg => "angle_deg",
        }
    }
}

/// Unit of the readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReadingUnit {
    /// Ω.
    Ohm,
    /// A ratio to a resistance at rest.
    Ratio,
}

/// Calibrated range; outside it, results are extrapolations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Validity {
    /// Smallest strain.
    pub lower: f64,
    /// Largest strain.
    pub upper: f64,
    /// Smallest reading.
    pub reading_lower: f64,
    /// Largest reading.
    pub reading_upper: f64,
    /// Fastest rate (99th percentile), per second.
    pub fastest_rate_per_s: f64,
    /// Longest recording, s.
    pub duration_s: f64,
    /// True if readings drifted during a recording: a longer run drifts farther. False in files of earlier versions.
    #[serde(default)]
    pub drifts: bool,
    /// Longest time for which a reading stayed equal to the last digit, s.
    pub longest_repeat_s: f64,
    /// Longest time between two turns of the readings, s: see [`Self::turn`]. `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest_unturned_s: Option<f64>,
    /// Resolution of the readings; `None` in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolution: Option<Resolution>,
}

/// Smallest reversal of the readings that counts as a turn, as a fraction of their range and in standard deviations of their
/// noise; the larger applies.
const TURN: (f64, f64) = (0.03, 6.0);

impl Validity {
    /// Returns the smallest reversal of the readings that counts as a turn, in their unit.
    #[must_use]
    pub fn turn(&self) -> f64 {
        let (share, deviations) = TURN;
        let noise_sd = self.resolution.map_or(0.0, |resolution| resolution.noise_sd);
        (share * (self.reading_upper - self.reading_lower)).max(deviations * noise_sd)
    }
}

/// Resolution of the calibration's readings, in their unit. It determines how often a still sensor repeats a reading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resolution {
    /// Distance between neighbouring values.
    pub step: f64,
    /// Standard deviation of the white noise.
    pub noise_sd: f64,
}

/// Differences between recordings; each is a session with its own R₀.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sessions {
    /// Standard deviation of ln R₀ between sessions.
    pub rest_sd: f64,
    /// Standard deviation, between sessions that begin at rest, of the logarithm of the first reading over R₀.
    pub start_sd: f64,
}

impl Sessions {
    /// Returns the weight of a session's first reading in the best linear estimate of ln R₀.
    #[must_use]
    pub fn weight(&self) -> f64 {
        let (rest, start) = (self.rest_sd.powi(2), self.start_sd.powi(2));
        rest / (rest + start)
    }

    /// Returns the standard deviation of ln R₀ given the first reading.
    #[must_use]
    pub fn left_sd(&self) -> f64 {
        self.start_sd * self.weight().sqrt()
    }
}

/// Geometry of a joint: `ε = prestrain + moment_arm θ / gauge_length`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointParams {
    /// Strain at angle zero.
    pub prestrain: f64,
    /// Distance of the sensor from the axis, mm.
    pub moment_arm_mm: f64,
    /// Length of the unstretched sensor, mm.
    pub gauge_length_mm: f64,
}

/// A recording used in the calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingInfo {
    /// Its name.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Rows used, and the times of the first and the last of them, s.
    pub rows: usize,
    /// See [`Self::rows`].
    pub first_s: f64,
    /// See [`Self::rows`].
    pub last_s: f64,
    /// R₀ of this recording.
    pub rest_reading: f64,
}

/// Uncertainty of the law's parameters, robust against residuals that are correlated or heteroscedastic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uncertainty {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Their values.
    pub values: Vec<f64>,
    /// Their standard errors.
    pub standard_errors: Vec<f64>,
    /// Their covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl Uncertainty {
    /// Returns the correlations of the parameters, row by row; zero where a parameter has no variance.
    #[must_use]
    pub fn correlation(&self) -> Vec<Vec<f64>> {
        let errors = &self.standard_errors;
        let entry = |i: usize, j: usize| {
            if i == j {
                return 1.0;
            }
            let scale = errors[i] * errors[j];
            if scale > 0.0 { self.covariance[i][j] / scale } else { 0.0 }
        };
        (0..errors.len()).map(|i| (0..errors.len()).map(|j| entry(i, j)).collect()).collect()
    }
}

impl SensorParams {
    /// Returns the filter behind an estimator: itself, the one whose strain is corrected, or the one beside the static cubic.
    #[must_use]
    pub fn filter_of(&self, kind: EstimatorKind) -> EstimatorKind {
        if kind == EstimatorKind::StaticCubic { EstimatorKind::Ekf } else { self.without_correction(kind) }
    }

    /// Returns an estimator without the learned correction: the filter that is corrected, or the estimator itself.
    #[must_use]
    pub fn without_correction(&self, kind: EstimatorKind) -> EstimatorKind {
        match &self.correction {
            Some(correction) if kind == EstimatorKind::Corrected => correction.corrects,
            _ => kind,
        }
    }

    /// Returns the estimator that smooths for an estimator: itself. A sensor whose default is the static cubic has a correction only if that
    /// smooths better.
    #[must_use]
    pub fn smoother_of(&self, kind: EstimatorKind) -> EstimatorKind {
        let is_default = kind == EstimatorKind::StaticCubic && self.default_estimator == kind;
        if is_default && self.correction.is_some() { EstimatorKind::Corrected } else { kind }
    }

    /// Returns `filter`, `smoother` or both: those of the default estimator, or of the filter that it corrects, whose intervals
    /// were widened by the maximum, [`LARGEST_SD_SCALE`](crate::LARGEST_SD_SCALE), although the held-out blocks may need more.
    #[must_use]
    pub fn widened_most(&self) -> Vec<&'static str> {
        let of = |kind: EstimatorKind| self.estimators.get(&self.filter_of(kind));
        let kind = self.default_estimator;
        let scaled = |kind: &EstimatorKind| *kind != EstimatorKind::StaticCubic;
        let filter = Some(kind).filter(scaled).and_then(of).map(|params| params.strain_sd_scale);
        let smoother =
            Some(self.smoother_of(kind)).filter(scaled).and_then(of).and_then(|params| params.smoothed_sd_scale);
        let widened = [("filter", filter), ("smoother", smoother)];
        let at_most = |scale: Option<f64>| scale.is_some_and(|scale| scale >= LARGEST_SD_SCALE);
        widened.into_iter().filter(|(_, scale)| at_most(*scale)).map(|(name, _)| name).collect()
    }

    /// Returns the reading at rest in calibration, in its unit; R₀ of the law if nothing was read at rest.
    #[must_use]
    pub fn rested(&self) -> f64 {
        self.measured_rest.unwrap_or(self.rest_reading)
    }

    /// Returns R₀ of the law for a session in which the rested sensor reads `measured`, in its unit.
    #[must_use]
    pub fn rest_reading_of(&self, measured: f64) -> f64 {
        self.rest_reading * (measured / self.rested())
    }

    /// Returns the parameters of an estimator.
    ///
    /// # Errors
    /// If the file has no parameters for it.
    pub fn estimator(&self, kind: EstimatorKind) -> Result<&EstimatorParams, NoParameters> {
        self.estimators.get(&kind).ok_or(NoParameters { kind })
    }
}
