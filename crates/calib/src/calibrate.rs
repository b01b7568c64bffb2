use std::collections::BTreeMap;

use crate::CalibrationError;
use crate::baselines::StaticCubic;
use crate::estimator_params::{EstimatorKind, EstimatorParams};
use crate::law_fit::{CrossFit, LawOptions, fit_laws};
use crate::law_params::LawParams;
use crate::motion_stats::MotionStats;
use crate::noise_fit::{NoiseProblem, REFINEMENT, RESURVEY, SURVEY, Tuned};
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
    /// The estimator that did best.
    pub default_estimator: EstimatorKind,
    /// Noise and motion, per estimator.
    pub estimators: BTreeMap<EstimatorKind, EstimatorParams>,
    /// The range of the reference.
    pub limits: RangeParams,
    /// What was seen.
    pub validity: Validity,
    /// The static inverse fitted to the same rows.
    pub static_cubic: StaticCubic,
}

/// How much better, in mean log density of the strain, a single Gaussian must be than hypotheses: once it has taken the
/// wrong direction it does not come back, and a short recording may not show that. Ten per cent in the deviation.
const LOCK_IN: f64 = 0.1;

fn handicap(kind: EstimatorKind) -> f64 {
    if kind.has_phases() { 0.0 } else { LOCK_IN }
}

/// Calibrates law, noise and motion on recordings with known strain. Deterministic: same samples, same result.
///
/// Every estimator of `kinds` is tried with a law per strength of ridge; the pair with the best score on blocks that the
/// law has not seen gives the law. To that law every one of them, what smooths in its place, and the extended Kalman filter
/// in any case, is then fitted, and the best of `kinds` becomes the default. Near ties go to the one that keeps hypotheses.
///
/// # Errors
/// If the recordings are too short or too plain to learn a law from, or `kinds` is empty.
pub fn calibrate(
    recordings: &[Samples],
    options: LawOptions,
    kinds: &[EstimatorKind],
    mut progress: impl FnMut(Stage),
) -> Result<Calibration, CalibrationError> {
    progress(Stage::Law);
    let laws = fit_laws(recordings, options)?;
    let stats = MotionStats::new(recordings);
    let mut all_kinds: Vec<EstimatorKind> = kinds.to_vec();
    for needed in kinds.iter().map(|kind| kind.smoother()).chain([EstimatorKind::Ekf]) {
        if !all_kinds.contains(&needed) {
            all_kinds.push(needed);
        }
    }
    let surveys = SURVEY.evaluations() + (laws.len() as u64 - 1) * RESURVEY.evaluations();
    let expected = kinds.len() as u64 * surveys
        + (all_kinds.len() - kinds.len()) as u64 * SURVEY.evaluations()
        + all_kinds.len() as u64 * REFINEMENT.evaluations();
    let mut done = 0;
    let mut evaluated = || {
        done += 1;
        progress(Stage::Noise { done, expected });
    };
    let mut surveyed = Vec::new();
    for &kind in kinds {
        let mut before: Option<Tuned> = None;
        for law in &laws {
            let problem = NoiseProblem::new(recordings, law, stats, kind);
            let search = if before.is_none() { SURVEY } else { RESURVEY };
            let tuned = problem.search(before.as_ref(), search, &mut evaluated)?;
            before = Some(tuned.clone());
            surveyed.push((kind, law, tuned));
        }
    }
    let cost = |(kind, _, tuned): &(EstimatorKind, &CrossFit, Tuned)| tuned.cost + handicap(*kind);
    let best = surveyed.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
    let Some(&(_, fit, _)) = best else {
        return Err(CalibrationError::Unsupported("a calibration without an estimator".into()));
    };
    let mut estimators = BTreeMap::new();
    for kind in all_kinds {
        let problem = NoiseProblem::new(recordings, fit, stats, kind);
        let known = surveyed.iter().find(|(k, law, _)| *k == kind && std::ptr::eq(*law, fit));
        let from = match known {
            Some((_, _, tuned)) => tuned.clone(),
            None => problem.search(None, SURVEY, &mut evaluated)?,
        };
        let tuned = problem.search(Some(&from), REFINEMENT, &mut evaluated)?;
        estimators.insert(kind, problem.finish(&tuned));
    }
    let score =
        |kind: &EstimatorKind| estimators.get(kind).map_or(f64::INFINITY, |params| params.score + handicap(*kind));
    let default_estimator = kinds.iter().copied().min_by(|a, b| score(a).total_cmp(&score(b)));
    let limits = fit.law.law.range;
    Ok(Calibration {
        default_estimator: default_estimator.unwrap_or(EstimatorKind::Ekf),
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
        uncertainty: fit.uncertainty.clone(),
        rest_readings: fit.law.rest_readings.clone(),
        law: fit.law.law.clone(),
    })
}
