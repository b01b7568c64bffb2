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

mod advice;
mod baselines;
mod blocks;
#[cfg(feature = "bootstrap")]
mod bootstrap;
mod build_filter;
mod calibrate;
pub mod closed_form;
mod corrected;
mod correction_fit;
mod correction_params;
mod correction_scale;
mod corrector;
mod design;
mod error;
mod error_budget;
mod estimator_params;
mod filter;
mod findings;
mod gaussian_process;
mod identifiability;
mod known;
mod lag;
mod law_fit;
mod law_params;
mod law_regression;
mod law_structure;
mod law_structures;
mod law_uncertainty;
mod least_squares;
mod left_out;
pub mod likelihood;
mod low_pass;
mod motion_stats;
mod noise_fit;
mod optimise;
mod order;
mod params;
mod portable;
mod prior;
mod recipe;
mod rest;
mod robust_loss;
mod running;
mod samples;
mod scores;
mod screen;
mod sd_scale;
mod sieve;
mod sizes;
mod sparse_estimator;
mod stepper;
mod summary;
mod validate;
mod way_back;

pub use baselines::{
    Baseline, Baselines, Features, Fir, LeakyBank, LowPassMode, PhaseRows, PublishedLaw, Regression, StaticCubic,
};
#[cfg(feature = "bootstrap")]
pub use bootstrap::{Bootstrap, bootstrap_law};
pub use build_filter::{HISTORIES, HYPOTHESES, PARTICLE_SEED, build_filter};
pub use calibrate::{Calibration, Stage, calibrate};
pub use corrected::SURPRISING_NIS;
pub use correction_params::{CorrectionParams, CorrectionScale, CorrectorParams, FUTURE_FEATURES, TrainingRow};
pub use error::CalibrationError;
pub use error_budget::{ErrorBudget, ErrorShares, Limit};
pub use estimator_params::{EstimatorKind, EstimatorParams, MotionParams, NoiseParams, PhaseParams};
pub use filter::{Filter, Output, Rows, Start, WayBack};
pub use findings::{Findings, Seen};
pub use gaussian_process::ProcessParams;
pub use identifiability::{Identifiability, OnBound, identifiability};
pub use lag::{Lag, aligned, lag_out_of_reach, reference_lag};
pub use law_fit::{CrossFit, GaugeFamily, LawFit, LawOptions, fit_law};
pub use law_params::{BranchParams, GaugeParams, LawParams};
pub use law_structures::{StructureScore, compare_structures};
pub use params::{
    FORMAT, JointParams, Quantity, RangeParams, ReadingUnit, RecordingInfo, SensorParams, Uncertainty, Validity,
};
pub use portable::{PortableCorrection, PortableFilter, PortableProcess, PortableSieve};
pub use prior::{CorrectionPrior, EstimatorPrior, FEWEST_SENSORS, LawPrior, PRIOR_FORMAT, Prior, calibrate_with_prior};
pub use recipe::{RECIPE, Recipe};
pub use samples::{Samples, SamplesError};
pub use scores::{ScoredRow, Scores};
pub use screen::{Distrusted, Doubt, Screened, screen};
pub use sd_scale::LARGEST_SD_SCALE;
pub use summary::Summary;
pub use validate::FieldError;
