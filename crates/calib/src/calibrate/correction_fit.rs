use std::ops::Range;

use ohmstrain_ekf::Reading;
use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale};
use ohmstrain_model::StrainRange;

use crate::CalibrationError;
use crate::calibrate::correction_scale::{each_row, reading_scale};
use crate::calibrate::left_out::relative_changes;
use crate::calibrate::simulated_motions::simulated_rows;
use crate::calibrate::training_rows::chosen;
use crate::correction::simulated::{Distilled, SimulatedRow};
use crate::correction::{AllRows, Examples, Prepared, filter_corrector, smoother_corrector};
use crate::digits::digits;
use crate::law::structure::LawFit;
use crate::motion_stats::MotionStats;
use crate::order::median;
use crate::prior::{self, CorrectionPrior};
use crate::samples::{Samples, usual_step_s};
use ohmstrain_sensor::correction::SMOOTHER_INPUTS;
use ohmstrain_sensor::{CorrectionParams, EstimatorKind, FilterParts, TrainingRow, future_features, outputs};

/// Pause inserted between recordings, s, so that noise correlated over seconds is not shared between them.
pub(crate) const PAUSE_S: f64 = 1000.0;
/// Largest number of rows that a correction learns from. With 100, errors are a tenth larger; with 400, no smaller.
const ROWS: usize = 200;
/// Largest number of rows of several recordings whose information is used. With twice as many, errors are no smaller.
const ALL_ROWS: usize = 3000;

/// Learns the correction of a filter from the recordings of its calibration. `fit` is their law, `recipe` the filter's, `corrects` its
/// kind. With a prior for that filter, the rows of other sensors come first, followed by half as many of the sensor's own. Returns `None`
/// if nothing can be learned from them.
pub(crate) fn fit_correction(
    recordings: &[Samples],
    fit: &LawFit,
    limits: StrainRange<f64>,
    (corrects, recipe): (EstimatorKind, FilterParts<'_>),
    of_make: Option<&CorrectionPrior>,
) -> Result<Option<CorrectionParams>, CalibrationError> {
    let of_make = of_make.filter(|prior| prior.corrects == corrects);
    let relative = |(samples, rest): (&Samples, &f64)| relative_changes(samples.reading, *rest);
    let readings: Vec<Vec<Option<Reading<f64>>>> = recordings.iter().zip(&fit.rest_readings).map(relative).collect();
    let own_scale = || reading_scale(recordings, &readings);
    let Some(scale) = of_make.map_or_else(own_scale, |prior| Some(prior.readings)) else { return Ok(None) };
    let mut rows: Vec<TrainingRow> = of_make.map_or_else(Vec::new, |prior| prior.rows.clone());
    let (mut candidates, mut of_recordings) = (Vec::new(), Vec::new());
    let mut start_s = rows.last().map_or(0.0, |row| row.time_s + PAUSE_S);
    for (samples, readings) in recordings.iter().zip(&readings) {
        let rows = candidate_rows(samples, readings, &scale, start_s, recipe)?;
        start_s = rows.last().map_or(start_s, |row: &TrainingRow| row.time_s + PAUSE_S);
        of_recordings.push(candidates.len()..candidates.len() + rows.len());
        candidates.extend(rows);
    }
    let all = if of_make.is_some() { None } else { AllOf::several(&candidates, &of_recordings) };
    let most = if rows.is_empty() { ROWS } else { prior::ROWS };
    rows.extend(chosen(&candidates, &of_recordings, most).iter().map(rounded));
    let step_s = usual_step_s(recordings.iter().map(|samples| samples.time_s));
    let simulated = simulated_rows(fit, &MotionStats::new(recordings), &scale, step_s);
    Ok(learn((corrects, scale), rows, (all, reference_sd(recordings)), &simulated, limits))
}

/// Returns the root mean square of the reference's standard deviations.
fn reference_sd(recordings: &[Samples]) -> f64 {
    let variances =
        recordings.iter().flat_map(|samples| samples.complete_rows().map(|k| samples.sd_of_strain(k).powi(2)));
    let (sum, count) = variances.fold((0.0, 0.0), |(sum, count), variance| (sum + variance, count + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

fn learn(
    (corrects, readings): (EstimatorKind, FeatureScale<f64>),
    rows: Vec<TrainingRow>,
    (all, reference_sd): (Option<AllOf>, f64),
    simulated: &[SimulatedRow],
    limits: StrainRange<f64>,
) -> Option<CorrectionParams> {
    let distilled = Distilled::fit(simulated, &rows, limits)?;
    let inputs = CorrectorInputs { few: Columns::new(rows.iter()), all, reference_sd };
    let simulated = Prepared::new(inputs.of_filter(limits)).simulated(&distilled)?;
    let (filter, smoother) = rayon::join(
        || filter_corrector(inputs.of_filter(limits), &simulated),
        || smoother_corrector(inputs.of_smoother(limits)),
    );
    let (filter, smoother) = (filter?, smoother?);
    Some(CorrectionParams { corrects, readings, filter, smoother, simulated, rows })
}

/// Inputs of filter and smoother in the training rows, and in all the rows that these represent.
pub(crate) struct CorrectorInputs {
    few: Columns,
    all: Option<AllOf>,
    /// Root mean square of the reference's standard deviations.
    reference_sd: f64,
}

/// Rows of several recordings.
struct AllOf {
    columns: Columns,
    recordings: Vec<Range<usize>>,
    step_s: f64,
}

struct Columns {
    filter: Vec<[f64; FILTER_INPUTS]>,
    smoother: Vec<[f64; SMOOTHER_INPUTS]>,
    strain: Vec<f64>,
    time_s: Vec<f64>,
}

impl Columns {
    fn new<'a>(rows: impl Iterator<Item = &'a TrainingRow> + Clone) -> Self {
        Self {
            filter: rows.clone().map(TrainingRow::filter_inputs).collect(),
            smoother: rows.clone().map(TrainingRow::smoother_inputs).collect(),
            strain: rows.clone().map(|row| row.strain).collect(),
            time_s: rows.map(|row| row.time_s).collect(),
        }
    }
}

impl AllOf {
    /// Thins the rows of each recording by a stride; `None` for fewer than two recordings.
    fn several(candidates: &[TrainingRow], recordings: &[Range<usize>]) -> Option<Self> {
        let stride = candidates.len().div_ceil(ALL_ROWS).max(1);
        let thinned = |rows: &Range<usize>| candidates[rows.clone()].iter().step_by(stride).collect::<Vec<_>>();
        let parts: Vec<Vec<&TrainingRow>> = recordings.iter().map(thinned).filter(|rows| rows.len() > 1).collect();
        let steps_s = parts.iter().flat_map(|rows| rows.windows(2).map(|pair| pair[1].time_s - pair[0].time_s));
        let step_s = median(steps_s)?;
        let ends = parts.iter().scan(0, |end, rows| {
            *end += rows.len();
            Some(*end)
        });
        let recordings: Vec<Range<usize>> = ends.zip(&parts).map(|(end, rows)| end - rows.len()..end).collect();
        let columns = Columns::new(parts.iter().flatten().copied());
        (recordings.len() > 1).then_some(Self { columns, recordings, step_s })
    }

    fn rows<'a, const D: usize>(&'a self, inputs: &'a [[f64; D]]) -> AllRows<'a, D> {
        AllRows { inputs, strain: &self.columns.strain, recordings: &self.recordings, step_s: self.step_s }
    }
}

impl CorrectorInputs {
    /// Collects the inputs of rows that represent no others.
    pub(crate) fn new(rows: &[TrainingRow]) -> Self {
        Self { few: Columns::new(rows.iter()), all: None, reference_sd: 0.0 }
    }

    pub(crate) fn of_filter(&self, limits: StrainRange<f64>) -> Examples<'_, FILTER_INPUTS> {
        let Columns { filter: inputs, strain, time_s, .. } = &self.few;
        let all = self.all.as_ref().map(|all| all.rows(&all.columns.filter));
        Examples { inputs, strain, time_s, limits, reference_sd: self.reference_sd, all }
    }

    pub(crate) fn of_smoother(&self, limits: StrainRange<f64>) -> Examples<'_, SMOOTHER_INPUTS> {
        let Columns { smoother: inputs, strain, time_s, .. } = &self.few;
        let all = self.all.as_ref().map(|all| all.rows(&all.columns.smoother));
        Examples { inputs, strain, time_s, limits, reference_sd: self.reference_sd, all }
    }
}

/// Rounds a row to the digits that are stored.
pub(crate) fn rounded(row: &TrainingRow) -> TrainingRow {
    TrainingRow {
        time_s: digits(row.time_s),
        strain: digits(row.strain),
        past: row.past.map(digits),
        future: row.future.map(digits),
        filtered: row.filtered.map(digits),
        smoothed: row.smoothed.map(digits),
    }
}

/// Returns all rows of a recording with reading and strain, as the calibrated filter and smoother see them.
fn candidate_rows(
    samples: &Samples,
    readings: &[Option<Reading<f64>>],
    scale: &FeatureScale<f64>,
    start_s: f64,
    recipe: FilterParts<'_>,
) -> Result<Vec<TrainingRow>, CalibrationError> {
    let failed = |row: usize, source| CalibrationError::Filter { time_s: samples.time_s[row], source };
    let mut filter = recipe.filter(None)?;
    let mut filtered = Vec::with_capacity(readings.len());
    for (row, (&time_s, &reading)) in samples.time_s.iter().zip(readings).enumerate() {
        filter.step(time_s, reading).map_err(|error| failed(row, error))?;
        filtered.push(outputs(&filter.output()));
    }
    let smoothed =
        recipe.smoother(None)?.smooth(samples.time_s, readings).map_err(|(row, error)| failed(row, error))?;
    let mut past = Vec::with_capacity(readings.len());
    each_row(samples.time_s, readings, *scale, |_, _, now| past.push(now));
    let backwards: (Vec<f64>, Vec<Option<Reading<f64>>>) =
        (samples.time_s.iter().rev().copied().collect(), readings.iter().rev().copied().collect());
    let mut future = Vec::with_capacity(readings.len());
    each_row(&backwards.0, &backwards.1, scale.future(), |_, _, now| future.push(now));
    future.reverse();
    let first_s = samples.time_s.first().copied().unwrap_or(0.0);
    let row = |k: usize| {
        Some(TrainingRow {
            time_s: start_s + samples.time_s[k] - first_s,
            strain: samples.strain[k],
            past: past[k]?,
            future: future_features(future[k]?),
            filtered: filtered[k],
            smoothed: outputs(&smoothed[k]),
        })
    };
    Ok(samples.complete_rows().filter_map(row).collect())
}
