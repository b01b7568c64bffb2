use std::str::FromStr;

use ohmstrain_ekf::live::news;
use ohmstrain_ekf::{Dwell, Settling};
use ohmstrain_model::{ModelNoise, Motion, ParameterError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

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
    /// Most probable phase histories.
    Hypotheses,
    /// A filter with the learned correction of its strain.
    Corrected,
    /// Strain as a cubic of the reading, with the extended Kalman filter's rate and protections. Later readings and a strain known at the
    /// start do not change it; a correction for known strains does.
    StaticCubic,
}

/// Error of a sensor file without parameters for an estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the sensor file has no parameters for `{0}`; calibrate with `{0}` as the estimator", kind.name())]
pub struct NoParameters {
    /// Kind of estimator.
    pub kind: EstimatorKind,
}

impl EstimatorKind {
    /// All estimators.
    pub const ALL: [Self; 7] =
        [Self::Ekf, Self::Ukf, Self::Imm, Self::SignSplit, Self::Hypotheses, Self::Corrected, Self::StaticCubic];

    /// Returns each kind once, in order of first occurrence.
    #[must_use]
    pub fn distinct(kinds: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut seen = Vec::new();
        for kind in kinds {
            if !seen.contains(&kind) {
                seen.push(kind);
            }
        }
        seen
    }

    /// True if it keeps hypotheses about the phase; the others keep one Gaussian.
    #[must_use]
    pub const fn has_phases(self) -> bool {
        !matches!(self, Self::Ekf | Self::Ukf | Self::StaticCubic)
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
            Self::Corrected => "corrected",
            Self::StaticCubic => "static-cubic",
        }
    }
}

/// Parses a name; the error also lists `auto`, which callers take for no choice.
impl FromStr for EstimatorKind {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| format!("expected auto or {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// Noise and motion of one estimator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorParams {
    /// Mean negative log density of the true strain, in spans, that the fit reached; smaller is better.
    pub score: f64,
    /// Factor on the filter's standard deviation of strain, from the coverage of its 95 % interval on held-out blocks
    /// of the calibration.
    pub strain_sd_scale: f64,
    /// Factor for the smoother, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothed_sd_scale: Option<f64>,
    /// Parameters of the body's motion.
    pub motion: MotionParams,
    /// Noise: the part of the reading that the law does not explain.
    pub noise: NoiseParams,
    /// Durations and order of phases, for estimators that keep phase hypotheses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phases: Option<PhaseParams>,
    /// Relaxation of the readings while the strain is held; `None` if the calibration has no holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settling: Option<Settling<f64>>,
}

/// Durations and order of phases.
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

impl PhaseParams {
    /// Returns the dwell model: durations of phases and transitions between them.
    ///
    /// # Errors
    /// If a number is out of its range.
    pub fn dwell(&self) -> Result<Dwell<f64>, ParameterError> {
        Dwell::new(self.hold_time_s, self.move_time_s, self.reversal)
    }

    /// True if the body rests at times.
    #[must_use]
    pub fn rests(&self) -> bool {
        self.hold_time_s > 0.0 && self.reversal < 1.0
    }
}

/// Noise of the law, relative to R₀.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseParams {
    /// Standard deviation of a reading's error beyond the baseline.
    pub reading_sd: f64,
    /// Correlation time T of these errors, s; 0 if they are independent. A fraction 1 - exp(-dt/T) of the information in a
    /// reading, dt after the previous one, is new, so that the same parameters fit any sampling rate.
    #[serde(default)]
    pub reading_time_s: f64,
    /// Long-run standard deviation of each branch around its law.
    pub branch_sd: f64,
    /// Long-run standard deviation of the baseline.
    pub baseline_sd: f64,
    /// Correlation time of the baseline, s.
    pub baseline_time_s: f64,
}

impl NoiseParams {
    /// Converts it to the model's noise, for a single reading.
    #[must_use]
    pub const fn to_model(self) -> ModelNoise<f64> {
        let Self { reading_sd, branch_sd, baseline_sd, baseline_time_s, .. } = self;
        ModelNoise { reading_sd, branch_sd, baseline_sd, baseline_time_s }
    }

    /// Converts it to the model's noise, for readings every `dt_s` seconds.
    #[must_use]
    pub fn every(self, dt_s: f64) -> ModelNoise<f64> {
        let reading_sd = self.reading_sd / news(dt_s, self.reading_time_s).sqrt();
        ModelNoise { reading_sd, ..self.to_model() }
    }
}

/// Parameters of the body's motion: an Ornstein-Uhlenbeck rate, given by standard deviations of strain and rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "MotionTable", from = "MotionTable")]
pub struct MotionParams {
    /// Correlation time of the rate, s.
    pub rate_time_s: f64,
    /// Standard deviation of the rate, per second.
    pub rate_sd_per_s: f64,
    /// Mean strain.
    pub strain_mean: f64,
    /// Standard deviation of the strain.
    pub strain_sd: f64,
}

/// A motion in the form of a sensor's file.
#[derive(Serialize, Deserialize)]
#[serde(tag = "family", rename_all = "kebab-case", deny_unknown_fields)]
enum MotionTable {
    OrnsteinUhlenbeck { rate_time_s: f64, rate_sd_per_s: f64, strain_mean: f64, strain_sd: f64 },
}

impl From<MotionParams> for MotionTable {
    fn from(motion: MotionParams) -> Self {
        let MotionParams { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } = motion;
        Self::OrnsteinUhlenbeck { rate_time_s, rate_sd_per_s, strain_mean, strain_sd }
    }
}

impl From<MotionTable> for MotionParams {
    fn from(table: MotionTable) -> Self {
        let MotionTable::OrnsteinUhlenbeck { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } = table;
        Self { rate_time_s, rate_sd_per_s, strain_mean, strain_sd }
    }
}

impl MotionParams {
    /// Converts it to the model's motion.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn to_model(self) -> Result<Motion<f64>, ParameterError> {
        Motion::ornstein_uhlenbeck(self.rate_time_s, self.rate_sd_per_s, self.strain_mean, self.strain_sd)
    }
}
