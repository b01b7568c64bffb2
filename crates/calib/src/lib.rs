//! Calibration of soft strain sensors: from bench recordings with known strain to the parameters a filter needs.
//!
//! [`calibrate`] fits a law per strength of ridge, and to each of them noise and motion so that the filter's own posterior
//! is right on the known strain; the law with which the filter does best is taken. [`fit_law`] fits a law by itself.
//! [`SensorParams`] is what is written down; [`build_filter`] makes a running filter of it.
//!
//! # Policy
//! - Knows samples ([`Samples`]), not files.
//! - Deterministic: the same samples give the same parameters. Nothing is random, no clock is read.
//! - A calibration that cannot be made is a [`CalibrationError`]; nothing panics on recorded data.

mod baselines;
mod calibrate;
pub mod closed_form;
mod correction;
mod digits;
mod enough;
mod error;
mod filter;
mod law;
pub mod likelihood;
mod low_pass;
mod motion_stats;
mod optimise;
mod order;
mod params;
mod prior;
mod recording;
mod samples;
mod sd_scale;
mod sizes;

pub use baselines::{Baseline, Baselines, Features, Fir, LeakyBank, LowPassMode, PhaseRows, PublishedLaw, Regression};
pub use calibrate::error_budget::ErrorShares;
pub use calibrate::scores::ScoredRow;
pub use calibrate::simulated_motions::SIMULATED_SEED;
pub use calibrate::with_prior::calibrate_with_prior;
pub use calibrate::{Calibration, Stage, calibrate};
pub use correction::owned::{OwnedCorrection, OwnedProcess, OwnedRows, OwnedSimulated, OwnedTriangle};
pub use error::CalibrationError;
pub use filter::build::{HISTORIES, HYPOTHESES, Options, build_filter, build_filter_with, build_smoother_with};
pub use filter::known::{KnownErrors, KnownStrain, MOST_KNOWN};
pub use filter::learned::Learned;
pub use filter::portable::{PortableCorrection, PortableFilter};
pub use filter::{Filter, Output, Rows, Smoother, Start, WayBack};
pub use law::advice::OnBound;
pub use law::bootstrap::{Bootstrap, bootstrap_law};
pub use law::compare::{StructureScore, compare_structures};
pub use law::fit::{CrossFit, LawOptions, fit_law};
pub use law::identifiability::{Identifiability, identifiability};
pub use law::structure::{GaugeFamily, LawFit};
pub use params::correction::{
    CorrectionParams, CorrectionScale, CorrectorParams, FUTURE_FEATURES, ProcessParams, SimulatedParams, SimulatedRow,
    TrainingRow,
};
pub use params::estimator::{
    EstimatorKind, EstimatorParams, MotionParams, NoParameters, NoiseParams, PhaseParams, SettlingParams,
};
pub use params::findings::{ErrorBudget, Findings, Scores, Seen};
pub use params::law::{BranchParams, GaugeParams, LawParameter, LawParams};
pub use params::recipe::{RECIPE, Recipe};
pub use params::static_cubic::StaticCubic;
pub use params::summary::{Limit, Summary, TestedSummary};
pub use params::validate::FieldError;
pub use params::{
    FORMAT, JointParams, LARGEST_SD_SCALE, Quantity, RangeParams, ReadingUnit, RecordingInfo, SensorParams, Sessions,
    Uncertainty, Validity,
};
pub use prior::{CorrectionPrior, EstimatorPrior, FEWEST_SENSORS, LawPrior, PRIOR_FORMAT, Prior};
pub use recording::holds::{Hold, holds};
pub use recording::lag::{Lag, LagError, aligned, clock_lag, reference_lag};
pub use recording::screen::{Distrusted, Doubt, Screened, screen};
pub use samples::{Samples, SamplesError};
