use std::collections::BTreeMap;

use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, ParameterError, SensorLaw, StrainRange};
use serde::{Deserialize, Serialize};

use crate::CalibrationError;
use crate::baseline::StaticCubic;

/// Version of the parameter file this code reads and writes.
pub const FORMAT: u32 = 1;

/// Everything a filter needs to know of a sensor: the content of `sensor.toml`.
///
/// Strains stand for the reference quantity; with [`Quantity::AngleDeg`] they are degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorParams {
    /// Version of the format, [`FORMAT`].
    pub format: u32,
    /// Program and version that made it.
    pub made_by: String,
    /// What is estimated.
    pub quantity: Quantity,
    /// What the readings are.
    pub reading: ReadingUnit,
    /// R₀: the reading at zero strain after everything has relaxed; Ω, or a ratio.
    pub rest_reading: f64,
    /// The estimator to use unless another is asked for.
    pub default_estimator: EstimatorKind,
    /// Range of the output: the reference's range in calibration, or a joint's stops.
    pub limits: RangeParams,
    /// What calibration has seen.
    pub validity: Validity,
    /// The static inverse to compare with.
    pub static_cubic: StaticCubic,
    /// A sensor glued across a joint, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointParams>,
    /// The sensor's law.
    pub law: LawParams,
    /// Noise and motion, per estimator.
    pub estimators: BTreeMap<EstimatorKind, EstimatorParams>,
    /// The recordings it was calibrated on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<RecordingInfo>,
    /// Standard errors of the law's parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
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
    /// Its name in messages and columns.
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
    /// A ratio to some resistance at rest.
    Ratio,
}

/// The estimators, by the names used on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorKind {
    /// Extended Kalman filter.
    Ekf,
    /// Unscented Kalman filter.
    Ukf,
    /// Interacting multiple models over extend, hold and retract.
    Imm,
    /// Gaussian hypotheses split by the sign of the rate.
    SignSplit,
    /// Best phase histories.
    Hypotheses,
}

impl EstimatorKind {
    /// All estimators.
    pub const ALL: [Self; 5] = [Self::Ekf, Self::Ukf, Self::Imm, Self::SignSplit, Self::Hypotheses];

    /// Whether it keeps hypotheses about the phase; the others are one Gaussian and have a smoother.
    #[must_use]
    pub const fn has_phases(self) -> bool {
        matches!(self, Self::Imm | Self::SignSplit | Self::Hypotheses)
    }

    /// Its name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ekf => "ekf",
            Self::Ukf => "ukf",
            Self::Imm => "imm",
            Self::SignSplit => "sign-split",
            Self::Hypotheses => "hypotheses",
        }
    }
}

/// An interval of strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeParams {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl RangeParams {
    /// As the model has it.
    #[must_use]
    pub const fn to_model(self) -> StrainRange<f64> {
        StrainRange { lower: self.lower, upper: self.upper }
    }

    /// Length.
    #[must_use]
    pub fn span(self) -> f64 {
        self.upper - self.lower
    }
}

/// What calibration has seen; outside of it results are extrapolations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Validity {
    /// Smallest strain.
    pub lower: f64,
    /// Largest strain.
    pub upper: f64,
    /// Fastest rate (99th percentile), per second.
    pub fastest_rate_per_s: f64,
    /// Longest recording, s.
    pub duration_s: f64,
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

/// The switched Kelvin-Voigt law with any number of branches up to four.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LawParams {
    /// Dash-pot while stretching, s (per unit of strain).
    pub extend_viscosity_s: f64,
    /// Dash-pot while releasing, s.
    pub retract_viscosity_s: f64,
    /// The strains it was fitted on; beyond them it goes on along the tangent.
    pub range: RangeParams,
    /// Quasi-static curve.
    pub gauge: GaugeParams,
    /// Relaxing branches, fastest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub branches: Vec<BranchParams>,
}

/// The quasi-static curve g(ε).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "family", rename_all = "kebab-case", deny_unknown_fields)]
pub enum GaugeParams {
    /// `a₁ ε + a₂ ε² + a₃ ε³`.
    Polynomial {
        /// a₁, a₂, a₃.
        coefficients: [f64; 3],
    },
    /// `G ε exp(-ε/ε₀)`.
    DecayingExponential {
        /// G.
        slope: f64,
        /// ε₀.
        decay_strain: f64,
    },
    /// `(1 + C ε) exp(A ε + W ε²) - 1`.
    Tunnelling {
        /// C.
        gap: f64,
        /// A.
        barrier: f64,
        /// W.
        path_loss: f64,
    },
}

impl GaugeParams {
    /// As the model has it.
    #[must_use]
    pub const fn to_model(self) -> Gauge<f64> {
        match self {
            Self::Polynomial { coefficients } => Gauge::Polynomial { coefficients },
            Self::DecayingExponential { slope, decay_strain } => Gauge::DecayingExponential { slope, decay_strain },
            Self::Tunnelling { gap, barrier, path_loss } => Gauge::Tunnelling { gap, barrier, path_loss },
        }
    }
}

/// One relaxing branch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BranchParams {
    /// Time constant, s.
    pub tau_s: f64,
    /// Gain while stretching.
    pub extend_gain: f64,
    /// Gain while releasing.
    pub retract_gain: f64,
    /// Growth of the stretching gain with strain.
    pub extend_gain_slope: f64,
    /// Growth of the releasing gain with strain.
    pub retract_gain_slope: f64,
}

impl LawParams {
    /// As the model has it; `None` unless there are exactly `B` branches.
    #[must_use]
    pub fn to_model<const B: usize>(&self) -> Option<SensorLaw<f64, B>> {
        let branches: Vec<Branch<f64>> = self
            .branches
            .iter()
            .map(|branch| Branch {
                tau_s: branch.tau_s,
                extend_gain: branch.extend_gain,
                retract_gain: branch.retract_gain,
                extend_gain_slope: branch.extend_gain_slope,
                retract_gain_slope: branch.retract_gain_slope,
            })
            .collect();
        Some(SensorLaw {
            gauge: self.gauge.to_model(),
            extend_viscosity_s: self.extend_viscosity_s,
            retract_viscosity_s: self.retract_viscosity_s,
            branches: branches.try_into().ok()?,
            range: self.range.to_model(),
        })
    }
}

/// Noise and motion as one estimator needs them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorParams {
    /// Mean negative log density of the true strain that the fit reached, in spans; smaller is better.
    pub score: f64,
    /// How the body moves.
    pub motion: MotionParams,
    /// What the law does not explain.
    pub noise: NoiseParams,
    /// How phases follow each other, for estimators that keep phase hypotheses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phases: Option<PhaseParams>,
}

/// How phases follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhaseParams {
    /// Mean duration of a hold, s.
    pub hold_time_s: f64,
    /// Mean duration of a movement in one direction, s.
    pub move_time_s: f64,
    /// Probability that a movement turns around without a hold; 1 for a body that never rests.
    pub reversal: f64,
    /// Mean speed of a movement, per second; 0 where the rate has no preferred value.
    pub speed_per_s: f64,
    /// Power to which a reading's likelihood enters the weights of the hypotheses.
    pub tempering: f64,
}

/// Noise of the law, relative to R₀.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseParams {
    /// White noise of a reading.
    pub reading_sd: f64,
    /// Wander of each branch.
    pub branch_sd: f64,
    /// Wander of the baseline.
    pub baseline_sd: f64,
    /// Correlation time of the baseline, s.
    pub baseline_time_s: f64,
}

impl NoiseParams {
    /// As the model has it.
    #[must_use]
    pub const fn to_model(self) -> ModelNoise<f64> {
        ModelNoise {
            reading_sd: self.reading_sd,
            branch_sd: self.branch_sd,
            baseline_sd: self.baseline_sd,
            baseline_time_s: self.baseline_time_s,
        }
    }
}

/// How the body moves: standard deviations of strain and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "family", rename_all = "kebab-case", deny_unknown_fields)]
pub enum MotionParams {
    /// Velocity forgets itself exponentially.
    OrnsteinUhlenbeck {
        /// Correlation time of the rate, s.
        rate_time_s: f64,
        /// Standard deviation of the rate, per second.
        rate_sd_per_s: f64,
        /// Mean strain.
        strain_mean: f64,
        /// Standard deviation of the strain.
        strain_sd: f64,
    },
    /// Acceleration is a state.
    Smooth {
        /// Standard deviation of the rate, per second.
        rate_sd_per_s: f64,
        /// Standard deviation of the acceleration, per second squared.
        acceleration_sd_per_s2: f64,
        /// Mean strain.
        strain_mean: f64,
        /// Standard deviation of the strain.
        strain_sd: f64,
    },
}

/// A motion prior with its number of states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnyMotion {
    /// Strain and rate.
    Two(Motion<f64, 2>),
    /// Strain, rate and acceleration.
    Three(Motion<f64, 3>),
}

impl MotionParams {
    /// As the model has it.
    ///
    /// # Errors
    /// Names the parameter that no motion can have.
    pub fn to_model(self) -> Result<AnyMotion, ParameterError> {
        Ok(match self {
            Self::OrnsteinUhlenbeck { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } => {
                AnyMotion::Two(Motion::ornstein_uhlenbeck(rate_time_s, rate_sd_per_s, strain_mean, strain_sd)?)
            }
            Self::Smooth { rate_sd_per_s, acceleration_sd_per_s2, strain_mean, strain_sd } => {
                AnyMotion::Three(Motion::smooth(rate_sd_per_s, acceleration_sd_per_s2, strain_mean, strain_sd)?)
            }
        })
    }
}

/// A recording that went into the calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingInfo {
    /// Its name.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Rows used.
    pub rows: usize,
    /// R₀ of this recording.
    pub rest_reading: f64,
}

/// Uncertainty of the law's parameters, robust against residuals that are neither white nor even.
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

impl SensorParams {
    /// The parameters of an estimator, or of the default one.
    ///
    /// # Errors
    /// If the file has none for it.
    pub fn estimator(&self, kind: Option<EstimatorKind>) -> Result<&EstimatorParams, CalibrationError> {
        let kind = kind.unwrap_or(self.default_estimator);
        self.estimators.get(&kind).ok_or_else(|| {
            CalibrationError::Unsupported(format!("the sensor file has no parameters for `{}`", kind.name()))
        })
    }
}
