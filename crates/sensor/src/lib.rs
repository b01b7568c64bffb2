//! A calibrated soft strain sensor: its parameters, and the filters and smoothers that run from them.
//!
//! [`SensorParams`] is the content of `sensor.toml`; [`SensorParams::validate`] checks the range of every number.
//! [`build_filter`] makes a live filter from it, [`build_smoother_with`] a smoother of whole recordings. [`PortableFilter`] is the
//! same filter as plain numbers, for programs that generate it in another language.
//!
//! # Policy
//! - No calibration: nothing is fitted or learned here.
//! - No file or clock is read. The same parameters and rows give the same estimates.
//! - A filter that cannot be built is reported as a [`SensorError`]; no parameter or reading causes a panic.

pub mod correction;
mod error;
pub mod fusion;
mod params;
mod run;
mod sizes;

pub use error::SensorError;
pub use params::correction::{
    CorrectionParams, CorrectorParams, FUTURE_FEATURES, InputScales, ProcessParams, SimulatedParams, TrainingRow,
};
pub use params::estimator::{EstimatorKind, EstimatorParams, MotionParams, NoParameters, NoiseParams, PhaseParams};
pub use params::findings::{ErrorBudget, ErrorShares, Findings, RecordingSummary, Scores, TENTHS};
pub use params::law::{LawParameter, LawParams, MOST_BRANCHES};
pub use params::static_cubic::StaticCubic;
pub use params::summary::{Limit, Summary, TestedSummary};
pub use params::temperature::TemperatureParams;
pub use params::unstated::Unstated;
pub use params::validate::FieldError;
pub use params::validate::table as ranges;
pub use params::{
    FORMAT, JointParams, LARGEST_SD_SCALE, Quantity, ReadingUnit, RecordingInfo, Resolution, SensorParams, Sessions,
    Uncertainty, Validity,
};
pub use run::build::{FilterParts, HISTORIES, HYPOTHESES, build_filter, build_filter_with, build_smoother_with};
pub use run::corrected::{future_features, outputs};
pub use run::known::{KnownErrors, KnownStrain, MOST_KNOWN, Stated};
pub use run::learned::Learned;
pub use run::options::Options;
pub use run::portable::{PortableCorrection, PortableFilter};
pub use run::turns::Turns;
pub use run::{Filter, Output, Rows, Smoother, Start, WayBack};
