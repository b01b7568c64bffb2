//! Calibration of soft strain sensors: from bench recordings with known strain to the parameters of a filter.
//!
//! [`calibrate`] fits a law per strength of ridge, and noise and motion to each of them such that the filter's posterior fits
//! the known strain. The law with the best filter is chosen. [`fit_law`] fits a law by itself.
//! [`SensorParams`](ohmstrain_sensor::SensorParams) is the stored result, from which a filter runs.
//!
//! # Policy
//! - Works on samples ([`Samples`]), not on files.
//! - Deterministic: the same samples give the same parameters. Random numbers have fixed seeds, no clock is read.
//! - A calibration that cannot be made is a [`CalibrationError`]; nothing panics on recorded data.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod baselines;
mod calibrate;
pub mod closed_form;
mod correction;
mod dense;
mod digits;
mod enough;
mod error;
mod format_8;
mod fusion;
mod law;
pub mod likelihood;
mod low_pass;
mod marks;
mod motion_stats;
mod optimise;
mod order;
mod prior;
mod recording;
mod samples;
mod sd_scale;
mod temperature;

pub use baselines::{
    Baseline, Baselines, Features, Fir, LeakyBank, LowPassMode, PhaseRows, PublishedLaw, Regression, running_cubic,
};
pub use calibrate::findings::LeftOutRow;
pub use calibrate::recipe::{RECIPE, Recipe};
pub use calibrate::scores::{ScoredRow, score};
pub use calibrate::simulated_motions::SIMULATED_SEED;
pub use calibrate::unstated::unstated;
pub use calibrate::with_prior::calibrate;
pub use calibrate::{Calibration, Stage};
pub use error::CalibrationError;
pub use format_8::CorrectionOfFormat8;
pub use fusion::{FusionChannel, FusionFit, fit_fusion};
pub use law::advice::OnBound;
pub use law::bootstrap::{Bootstrap, bootstrap_law};
pub use law::compare::{StructureScore, compare_structures};
pub use law::fit::{CrossFit, LawOptions, fit_law};
pub use law::identifiability::{Identifiability, identifiability};
pub use law::structure::{GaugeFamily, LawFit};
pub use marks::{Mark, MarkedReference, MarksError, marked_references};
pub use prior::{CorrectionPrior, EstimatorPrior, LawPrior, PRIOR_FORMAT, Prior};
pub use recording::holds::{Hold, holds};
pub use recording::lag::{Lag, LagError, aligned, clock_lag, reference_lag};
pub use recording::screen::{Distrusted, Doubt, Screened, screen};
pub use samples::{Samples, SamplesError};
pub use temperature::{Confounded, TemperatureCoefficients, TemperatureFit, fit_temperature};
