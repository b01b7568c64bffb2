//! Calibration of a sensor from recordings with known strain: the law, noise and motion of its filters, the correction, and their
//! quality on held-out quarters.

pub(crate) mod best;
pub(crate) mod correction_fit;
pub(crate) mod correction_scale;
pub(crate) mod error_budget;
pub(crate) mod findings;
pub(crate) mod left_out;
pub(crate) mod noise_fit;
pub(crate) mod recipe;
pub(crate) mod scores;
pub(crate) mod settling;
pub(crate) mod simulated_motions;
pub(crate) mod training_rows;
pub(crate) mod unstated;
pub(crate) mod with_prior;

use std::collections::BTreeMap;

use crate::CalibrationError;
use crate::baselines::fit_static_cubic;
use crate::calibrate::best::{Best, StaticCubicAs};
use crate::calibrate::correction_fit::fit_correction;
use crate::calibrate::findings::{Check, Checked, LeftOutRow, seen};
use crate::calibrate::noise_fit::{FURTHER, NoiseProblem, REFINEMENT, SURVEY, Surveyed, survey, survey_evaluations};
use crate::calibrate::recipe::RECIPE;
use crate::law::fit::{CrossFit, LawOptions, fit_laws};
use crate::law::identifiability::identifiability;
use crate::law::structure::LawFit;
use crate::motion_stats::MotionStats;
use crate::order::median;
use crate::prior::{CorrectionPrior, Prior};
use crate::recording::arranged::Arranged;
use crate::recording::drift::drifts;
use crate::recording::repeats::longest_repeat_s;
use crate::recording::resolution::resolution;
use crate::recording::rest::rest_share;
use crate::recording::screen::{Distrusted, screen};
use crate::recording::sessions::sessions;
use crate::recording::turns::longest_unturned_s;
use crate::samples::{Samples, reading_range};
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::{
    CorrectionParams, EstimatorKind, EstimatorParams, FORMAT, FilterParts, Quantity, ReadingUnit, SensorParams,
    Summary, Validity,
};

/// Stage of a calibration, for a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Fitting the law.
    Law,
    /// Fitting noise and motion for an estimator.
    Noise {
        /// Evaluations of the score so far.
        done: u64,
        /// Evaluations expected.
        expected: u64,
    },
    /// Estimating every quarter of the recordings with the fit to the others.
    LeftOut,
}

/// A calibrated sensor, before it is written down.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Parameters of the sensor, but for those that [`into_sensor`](Self::into_sensor) is given.
    pub(crate) params: SensorParams,
    /// Rows of the recordings that were left out because they are far from their neighbours or from the law.
    pub distrusted: Vec<Distrusted>,
    /// R₀ of each recording.
    pub rest_readings: Vec<f64>,
    /// The rows of held-out parts; none if these cannot be estimated.
    pub left_out: Vec<LeftOutRow>,
}

impl Calibration {
    /// Returns the parameters of the sensor, in these units. R₀ is the median over the recordings. Fields that calibration does not
    /// determine (a joint, names and hashes of recordings) are left empty.
    #[must_use]
    pub fn into_sensor(self, made_by: &str, quantity: Quantity, reading: ReadingUnit) -> SensorParams {
        SensorParams { made_by: made_by.into(), quantity, reading, ..self.params }
    }
}

/// Returns R₀ of the sensor, the median over its recordings.
fn median_rest(rest_readings: &[f64]) -> f64 {
    median(rest_readings.iter().copied()).unwrap_or(f64::NAN)
}

/// Margin, in mean log density of the strain, by which a single Gaussian must be better than hypotheses: 10 % in the standard deviation.
/// Once a single Gaussian has taken the wrong direction it does not recover, which a short recording may not show.
const LOCK_IN: f64 = 0.1;

fn handicap(kind: EstimatorKind) -> f64 {
    if kind.has_phases() { 0.0 } else { LOCK_IN }
}

/// Calibrates once, with or without a prior; see [`calibrate`](with_prior::calibrate).
pub(crate) fn calibrate_once(
    recordings: &[Samples],
    structures: &[LawOptions],
    kinds: &[EstimatorKind],
    prior: Option<&Prior>,
    progress: impl FnMut(Stage),
) -> Result<Calibration, CalibrationError> {
    let arranged = Arranged::new(recordings);
    let mut made = calibrate_arranged(&arranged.recordings, structures, kinds, prior, progress)
        .map_err(|error| arranged.callers_error(error))?;
    made.rest_readings = arranged.in_callers_order(&made.rest_readings);
    made.distrusted.iter_mut().for_each(|row| row.recording = arranged.caller(row.recording));
    made.distrusted.sort_by_key(|row| (row.recording, row.row));
    made.left_out.iter_mut().for_each(|row| row.recording = arranged.caller(row.recording));
    made.left_out.sort_by_key(|row| row.recording);
    Ok(made)
}

/// Calibrates on recordings in their canonical order, which all indices of the result refer to.
fn calibrate_arranged(
    recordings: &[Samples],
    structures: &[LawOptions],
    kinds: &[EstimatorKind],
    prior: Option<&Prior>,
    mut progress: impl FnMut(Stage),
) -> Result<Calibration, CalibrationError> {
    progress(Stage::Law);
    let screened = screen(recordings)?;
    let recordings: &[Samples] = &screened.samples();
    let laws = match prior {
        Some(prior) => vec![prior.law.posterior(recordings)?],
        None => fit_laws(recordings, structures)?,
    };
    let stats = MotionStats::new(recordings);
    let asked = Asked::new(kinds, prior, &stats);
    let mut steps = Steps { done: 0, expected: asked.expected_evaluations(&laws), progress };
    let surveyed = survey_all(recordings, &laws, stats, &asked, prior, &mut || steps.evaluated())?;
    let Some(fit) = cheapest(surveyed.iter()).map(|best| best.law) else {
        return Err(CalibrationError::Unsupported("a calibration without an estimator".into()));
    };
    let wanted = asked.all();
    let mut estimators = BTreeMap::new();
    for kind in EstimatorKind::distinct(wanted.iter().copied().chain([EstimatorKind::Ekf])) {
        let problem = NoiseProblem::new(recordings, fit, stats, kind)
            .with_prior(prior.and_then(|prior| prior.estimators.get(&kind)));
        let params = refined(&problem, kind, &asked, (fit, &surveyed), &mut || steps.evaluated())?;
        estimators.insert(kind, params);
    }
    let score =
        |kind: &EstimatorKind| estimators.get(kind).map_or(f64::INFINITY, |params| params.score + handicap(*kind));
    let best_of = |kinds: &[EstimatorKind]| kinds.iter().copied().min_by(|a, b| score(a).total_cmp(&score(b)));
    let (corrected, best) = (best_of(asked.candidates), best_of(&wanted).unwrap_or(EstimatorKind::Ekf));
    estimators.retain(|kind, _| Some(*kind) == corrected || *kind == EstimatorKind::Ekf || asked.named.contains(kind));
    let of_make = prior.and_then(|prior| prior.correction.as_ref());
    let correction =
        corrected.map(|kind| correction(recordings, fit, (kind, of_make), &estimators)).transpose()?.flatten();
    let filter = correction.as_ref().map_or((best, best), |correction| (EstimatorKind::Corrected, correction.corrects));
    let limits = fit.law.law.range;
    (steps.progress)(Stage::LeftOut);
    let identifiability = identifiability(recordings, &fit.law.law).ok();
    let seen = seen(recordings, limits, &stats);
    let check = |(kind, filter)| {
        let strokes = stats.strokes;
        Check { recordings, strokes, fit, kind, filter, estimators: &estimators, of_make }
            .checked(seen, &identifiability)
    };
    let Best { default: default_estimator, smoother, checked } = Best::on_held_out(filter, asked.static_cubic, check);
    let correction = correction.filter(|_| smoother == EstimatorKind::Corrected);
    if default_estimator == EstimatorKind::StaticCubic && correction.is_none() {
        estimators.retain(|kind, _| *kind == EstimatorKind::Ekf || asked.named.contains(kind));
    }
    let (unstated, findings, left_out) = checked.map_or_else(Default::default, |checked| {
        let Checked { findings, unstated, rows } = checked;
        (unstated, Some(findings), rows)
    });
    let rest_readings = fit.law.rest_readings.clone();
    let rest_reading = median_rest(&rest_readings);
    let own = validity(recordings, &fit.law, limits, &stats);
    let params = SensorParams {
        format: FORMAT,
        made_by: String::new(),
        quantity: Quantity::Strain,
        reading: ReadingUnit::Ohm,
        rest_reading,
        measured_rest: rest_share(recordings, &rest_readings, limits.span()).map(|share| share * rest_reading),
        default_estimator,
        summary: findings.as_ref().map(Summary::from),
        tested: None,
        limits,
        validity: prior.map_or(own, |prior| prior.joined(own, rest_reading)),
        sessions: sessions(recordings, &rest_readings, limits.span()),
        unstated,
        temperature: None,
        static_cubic: fit_static_cubic(recordings, limits)?,
        joint: None,
        law: fit.law.law.clone(),
        estimators,
        recordings: vec![],
        uncertainty: identifiability.map(|found| found.off_bounds()),
        findings,
        correction,
    };
    Ok(Calibration { params, distrusted: screened.distrusted.clone(), rest_readings, left_out })
}

/// Estimators that a calibration tries.
struct Asked<'a> {
    /// Estimators that the caller requested by name.
    named: Vec<EstimatorKind>,
    /// Candidates for the correction: the best of them is corrected.
    candidates: &'a [EstimatorKind],
    /// Role of the static cubic.
    static_cubic: StaticCubicAs,
}

impl<'a> Asked<'a> {
    fn new(kinds: &[EstimatorKind], prior: Option<&'a Prior>, stats: &MotionStats) -> Self {
        let candidates = match prior.and_then(|prior| prior.correction.as_ref()) {
            _ if !kinds.contains(&EstimatorKind::Corrected) => &[],
            Some(of_make) => std::slice::from_ref(&of_make.corrects),
            None => RECIPE.candidates(stats.hold_s.is_some()),
        };
        let is_filter = |kind: &EstimatorKind| !matches!(kind, EstimatorKind::Corrected | EstimatorKind::StaticCubic);
        let mut named: Vec<EstimatorKind> = kinds.iter().copied().filter(is_filter).collect();
        let static_cubic = StaticCubicAs::of(kinds, stats.strokes);
        if static_cubic == StaticCubicAs::Default {
            named.push(EstimatorKind::Ekf);
        }
        Self { named, candidates, static_cubic }
    }

    fn all(&self) -> Vec<EstimatorKind> {
        EstimatorKind::distinct(self.candidates.iter().chain(&self.named).copied())
    }

    /// Returns the first candidate if this is one of those after it.
    fn first_before(&self, kind: EstimatorKind) -> Option<EstimatorKind> {
        let (first, further) = self.candidates.split_first()?;
        further.contains(&kind).then_some(*first)
    }

    /// Returns the approximate number of evaluations, for a progress bar: the searches for each filter and for the EKF.
    fn expected_evaluations(&self, laws: &[CrossFit]) -> u64 {
        let of_filter = |kind: EstimatorKind| match self.first_before(kind) {
            Some(_) => FURTHER.evaluations(),
            None => survey_evaluations(laws.len()) + REFINEMENT.evaluations(),
        };
        let fitted = EstimatorKind::distinct(self.all().into_iter().chain([EstimatorKind::Ekf]));
        let of_ekf = SURVEY.evaluations() + REFINEMENT.evaluations();
        let of_any = |kind| if self.all().contains(&kind) { of_filter(kind) } else { of_ekf };
        fitted.into_iter().map(of_any).sum()
    }
}

/// Returns the survey with the least cost, handicap included.
fn cheapest<'s, 'a: 's>(surveyed: impl Iterator<Item = &'s Surveyed<'a>>) -> Option<&'s Surveyed<'a>> {
    let cost = |one: &Surveyed| one.tuned.cost + handicap(one.kind);
    surveyed.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

/// Returns the calibrated ranges. Readings are relative to the R₀ of their recording; in ohms, the spread between sessions would hide how
/// far a strain moves the reading.
fn validity(recordings: &[Samples], fit: &LawFit, limits: StrainRange<f64>, stats: &MotionStats) -> Validity {
    let rest_readings = &fit.rest_readings;
    let rest = median_rest(rest_readings);
    let of_sensor = |of: f64, samples: &Samples| {
        let (low, high) = reading_range(std::slice::from_ref(samples));
        // A single recording keeps its readings to the last digit.
        if of == rest { (low, high) } else { (low / of * rest, high / of * rest) }
    };
    let ranges = recordings.iter().zip(rest_readings).map(|(samples, of)| of_sensor(*of, samples));
    let joined = |(low, high): (f64, f64), next: (f64, f64)| (low.min(next.0), high.max(next.1));
    let (reading_lower, reading_upper) = ranges.fold((f64::INFINITY, f64::NEG_INFINITY), joined);
    let seen = Validity {
        lower: limits.lower,
        upper: limits.upper,
        reading_lower,
        reading_upper,
        fastest_rate_per_s: stats.fastest_rate,
        duration_s: stats.longest_s,
        drifts: drifts(recordings, fit),
        longest_repeat_s: longest_repeat_s(recordings),
        longest_unturned_s: None,
        resolution: resolution(recordings),
    };
    let longest_s = longest_unturned_s(recordings, rest_readings, seen.turn() / rest);
    Validity { longest_unturned_s: (longest_s > 0.0).then_some(longest_s), ..seen }
}

/// Learns the correction of the calibrated filter; `None` if nothing can be learned.
fn correction(
    recordings: &[Samples],
    fit: &CrossFit,
    (kind, of_make): (EstimatorKind, Option<&CorrectionPrior>),
    estimators: &BTreeMap<EstimatorKind, EstimatorParams>,
) -> Result<Option<CorrectionParams>, CalibrationError> {
    let limits = fit.law.law.range;
    let Some(params) = estimators.get(&kind) else { return Ok(None) };
    let recipe = FilterParts::of_law(kind, &fit.law.law, *params, limits);
    fit_correction(recordings, &fit.law, limits, (kind, recipe), of_make)
}

/// Counts evaluations of the score.
struct Steps<P> {
    done: u64,
    expected: u64,
    progress: P,
}

impl<P: FnMut(Stage)> Steps<P> {
    fn evaluated(&mut self) {
        self.done += 1;
        (self.progress)(Stage::Noise { done: self.done, expected: self.expected });
    }
}

/// Surveys estimators under the laws, but for the further candidates for a correction.
fn survey_all<'a>(
    recordings: &[Samples],
    laws: &'a [CrossFit],
    stats: MotionStats,
    asked: &Asked,
    prior: Option<&Prior>,
    evaluated: &mut dyn FnMut(),
) -> Result<Vec<Surveyed<'a>>, CalibrationError> {
    let mut surveyed: Vec<Surveyed<'a>> = Vec::new();
    for kind in asked.all().into_iter().filter(|kind| asked.first_before(*kind).is_none()) {
        let of_make = prior.and_then(|prior| prior.estimators.get(&kind));
        surveyed.extend(survey(recordings, laws, stats, (kind, of_make), &mut *evaluated)?);
    }
    Ok(surveyed)
}

/// Fits noise and motion of an estimator under a law: from its survey; from that of the first candidate, if it is a further one; or from
/// its untuned values.
fn refined(
    problem: &NoiseProblem,
    kind: EstimatorKind,
    asked: &Asked,
    (fit, surveyed): (&CrossFit, &[Surveyed]),
    evaluated: &mut dyn FnMut(),
) -> Result<EstimatorParams, CalibrationError> {
    let found = |kind: EstimatorKind| surveyed.iter().find(|one| one.kind == kind && std::ptr::eq(one.law, fit));
    let (from, search) = match (found(kind), asked.first_before(kind).and_then(found)) {
        (Some(own), _) => (own.tuned.point.clone(), REFINEMENT),
        (None, Some(first)) => (problem.begun_at_end_of(&first.tuned), FURTHER),
        (None, None) => (problem.search(None, SURVEY, &mut *evaluated)?.point, REFINEMENT),
    };
    problem.refine(&from, search, &mut *evaluated)
}
