use std::collections::BTreeMap;

use crate::CalibrationError;
use crate::baseline::StaticCubic;
use crate::estimator_params::{EstimatorKind, EstimatorParams};
use crate::law_fit::{CrossFit, LawOptions, fit_law};
use crate::law_params::LawParams;
use crate::motion_stats::MotionStats;
use crate::noise_fit::NoiseProblem;
use crate::params::{RangeParams, Uncertainty, Validity};
use crate::samples::Samples;

/// What calibration is doing, for a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Fitting the law.
    Law,
    /// Fitting noise and motion for an estimator: evaluations done and expected.
    Noise {
        /// Evaluations of the score so far.
        done: u64,
        /// Evaluations expected.
        expected: u64,
    },
}

/// A calibrated sensor, before it is written down.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The law.
    pub law: LawParams,
    /// R₀ of each recording.
    pub rest_readings: Vec<f64>,
    /// Standard errors of the law's parameters.
    pub uncertainty: Uncertainty,
    /// Root mean squared error of the law on blocks left out, relative to R₀.
    pub law_error: f64,
    /// Noise and motion, per estimator.
    pub estimators: BTreeMap<EstimatorKind, EstimatorParams>,
    /// The range of the reference.
    pub limits: RangeParams,
    /// What was seen.
    pub validity: Validity,
    /// The static inverse fitted to the same rows.
    pub static_cubic: StaticCubic,
}

/// Calibrates law, noise and motion on recordings with known strain. Deterministic: same samples, same result.
///
/// # Errors
/// If the recordings are too short or too plain to learn a law from.
pub fn calibrate(
    recordings: &[Samples],
    options: LawOptions,
    kinds: &[EstimatorKind],
    mut progress: impl FnMut(Stage),
) -> Result<Calibration, CalibrationError> {
    progress(Stage::Law);
    let fit: CrossFit = fit_law(recordings, options)?;
    let limits = fit.law.law.range;
    let problem = NoiseProblem::new(recordings, &fit, limits);
    let mut estimators = BTreeMap::new();
    for &kind in kinds {
        estimators.insert(kind, problem.fit(kind, &mut progress)?);
    }
    let stats = MotionStats::new(recordings);
    Ok(Calibration {
        estimators,
        static_cubic: StaticCubic::fit(recordings, limits)?,
        validity: Validity {
            lower: limits.lower,
            upper: limits.upper,
            fastest_rate_per_s: stats.fastest_rate,
            duration_s: stats.longest_s,
        },
        limits,
        law_error: fit.law.cross_validated_error,
        uncertainty: fit.uncertainty,
        rest_readings: fit.law.rest_readings,
        law: fit.law.law,
    })
}
