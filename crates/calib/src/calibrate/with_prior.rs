use super::{Calibration, Stage, calibrate_once};
use crate::CalibrationError;
use crate::law::fit::LawOptions;
use crate::prior::Prior;
use crate::samples::Samples;
use ohmstrain_sensor::EstimatorKind;

/// Duration of a recording, as a fraction of that of the other sensors' recordings, from which on it is also calibrated without them.
const ALONE: f64 = 1.0 / 3.0;

/// Calibrates law, noise and motion on recordings with known strain. Deterministic: same samples, same result, in any order of the
/// recordings. Outliers, and rows far from the law, are left out ([`screen`](crate::screen)).
///
/// Estimators are tried with a law for each of `structures` and each strength of ridge, but for the further candidates of the correction.
/// The pair with the best score on held-out blocks determines the law. Every estimator, and the extended Kalman filter in any case, is then
/// fitted to that law; the one of `kinds` with the best score on every row of those blocks becomes the default. Near ties go to the one that
/// keeps hypotheses. [`EstimatorKind::Corrected`] is the default if it is requested; it corrects the best of its candidates, and is learned
/// last, from the same rows. If [`EstimatorKind::StaticCubic`] is requested as well, the better of the two on held-out quarters is the default.
///
/// A prior is for one more sensor of a known make. It determines the law's structure; `structures` applies only without one. Noise and
/// motion start from the prior, and the filter that the others correct is the only candidate for a correction.
///
/// A recording a third as long as those of the others may contain more information than the prior. It is also calibrated without the prior,
/// and the calibration with the smaller error on held-out quarters is returned.
///
/// # Errors
/// If the recordings are too short or vary too little to learn a law from, if the law explains nothing, or if `structures` or `kinds` is
/// empty.
pub fn calibrate(
    recordings: &[Samples],
    structures: &[LawOptions],
    kinds: &[EstimatorKind],
    prior: Option<&Prior>,
    mut progress: impl FnMut(Stage),
) -> Result<Calibration, CalibrationError> {
    let with_prior = calibrate_once(recordings, structures, kinds, prior, &mut progress);
    let longest_s = recordings.iter().map(Samples::duration_s).fold(0.0, f64::max);
    if prior.is_none_or(|prior| longest_s < ALONE * prior.validity.duration_s) {
        return with_prior;
    }
    let error =
        |made: &Calibration| made.params.findings.as_ref().map_or(f64::INFINITY, |findings| findings.filter.rmse);
    match (with_prior, calibrate_once(recordings, structures, kinds, None, progress)) {
        (Ok(with_prior), Ok(alone)) => Ok(if error(&alone) < error(&with_prior) { alone } else { with_prior }),
        (Ok(with_prior), Err(_)) => Ok(with_prior),
        (Err(_), alone) => alone,
    }
}
