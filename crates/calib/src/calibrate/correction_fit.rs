use ohmstrain_ekf::Reading;
use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS};

use crate::CalibrationError;
use crate::calibrate::correction_scale::{each_row, reading_scale};
use crate::calibrate::simulated_motions::simulated_rows;
use crate::correction::simulated::{Distilled, SimulatedRow};
use crate::correction::{Examples, Prepared, filter_corrector, smoother_corrector};
use crate::digits::digits;
use crate::law::structure::LawFit;
use crate::motion_stats::MotionStats;
use crate::order::median;
use crate::prior::{self, CorrectionPrior};
use crate::samples::Samples;
use ohmstrain_sensor::correction::SMOOTHER_INPUTS;
use ohmstrain_sensor::{
    CorrectionParams, CorrectionScale, EstimatorKind, FilterParts, RangeParams, TrainingRow, future_features, outputs,
};

/// Pause between recordings, s: noise that lasts for seconds is not shared by them.
pub(crate) const PAUSE_S: f64 = 1000.0;
/// Rows that a correction learns from at most. With a hundred errors are a tenth larger, with four hundred no smaller.
const ROWS: usize = 200;
/// How much of the choice of rows follows the way that the features go, rather than time: long holds are one row over and
/// over again.
const BY_WAY: f64 = 0.8;

/// Learns the correction of a filter from the recordings that it was calibrated on, whose law is `fit`; `recipe`
/// says what the filter is made of, `corrects` names it. With a prior of that filter the rows of other sensors come first, and half as many
/// of their own follow. None if nothing can be learned from them.
pub(crate) fn fit_correction(
    recordings: &[Samples],
    fit: &LawFit,
    limits: RangeParams,
    (corrects, recipe): (EstimatorKind, FilterParts<'_>),
    of_make: Option<&CorrectionPrior>,
) -> Result<Option<CorrectionParams>, CalibrationError> {
    let of_make = of_make.filter(|prior| prior.corrects == corrects);
    let relative = |(samples, rest): (&Samples, &f64)| {
        let relative = |r: &f64| r.is_finite().then(|| Reading::from(r / rest - 1.0));
        samples.reading.iter().map(relative).collect::<Vec<Option<Reading<f64>>>>()
    };
    let readings: Vec<Vec<Option<Reading<f64>>>> = recordings.iter().zip(&fit.rest_readings).map(relative).collect();
    let own_scale = || reading_scale(recordings, &readings);
    let Some(scale) = of_make.map_or_else(own_scale, |prior| Some(prior.readings)) else { return Ok(None) };
    let mut rows: Vec<TrainingRow> = of_make.map_or_else(Vec::new, |prior| prior.rows.clone());
    let mut candidates = Vec::new();
    let mut start_s = rows.last().map_or(0.0, |row| row.time_s + PAUSE_S);
    for (samples, readings) in recordings.iter().zip(&readings) {
        let Some(rows) = candidate_rows(samples, readings, &scale, start_s, recipe)? else { return Ok(None) };
        start_s = rows.last().map_or(start_s, |row: &TrainingRow| row.time_s + PAUSE_S);
        candidates.extend(rows);
    }
    let most = if rows.is_empty() { ROWS } else { prior::ROWS };
    rows.extend(chosen(&candidates, most).iter().map(rounded));
    let steps_s = recordings.iter().flat_map(|of| of.time_s.windows(2).map(|pair| pair[1] - pair[0]));
    let simulated = simulated_rows(fit, &MotionStats::new(recordings), &scale, median(steps_s).unwrap_or(0.0));
    Ok(learn(corrects, scale, rows, &simulated, limits))
}

fn learn(
    corrects: EstimatorKind,
    readings: CorrectionScale,
    rows: Vec<TrainingRow>,
    simulated: &[SimulatedRow],
    limits: RangeParams,
) -> Option<CorrectionParams> {
    let distilled = Distilled::fit(simulated, &rows, limits)?;
    let inputs = CorrectorInputs::new(&rows);
    let simulated = Prepared::new(inputs.of_filter(limits)).simulated(&distilled)?;
    let filter = filter_corrector(inputs.of_filter(limits), &simulated)?;
    let smoother = smoother_corrector(inputs.of_smoother(limits))?;
    Some(CorrectionParams { corrects, readings, filter, smoother, simulated, rows })
}

/// Training rows by what filter and smoother see of them.
pub(crate) struct CorrectorInputs {
    filter: Vec<[f64; FILTER_INPUTS]>,
    smoother: Vec<[f64; SMOOTHER_INPUTS]>,
    strain: Vec<f64>,
    time_s: Vec<f64>,
}

impl CorrectorInputs {
    pub(crate) fn new(rows: &[TrainingRow]) -> Self {
        Self {
            filter: rows.iter().map(TrainingRow::filter_inputs).collect(),
            smoother: rows.iter().map(TrainingRow::smoother_inputs).collect(),
            strain: rows.iter().map(|row| row.strain).collect(),
            time_s: rows.iter().map(|row| row.time_s).collect(),
        }
    }

    pub(crate) fn of_filter(&self, limits: RangeParams) -> Examples<'_, FILTER_INPUTS> {
        Examples { inputs: &self.filter, strain: &self.strain, time_s: &self.time_s, limits }
    }

    pub(crate) fn of_smoother(&self, limits: RangeParams) -> Examples<'_, SMOOTHER_INPUTS> {
        Examples { inputs: &self.smoother, strain: &self.strain, time_s: &self.time_s, limits }
    }
}

/// A row with the digits that are kept.
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

/// All rows of a recording with reading and strain, as the calibrated filter and smoother see them; none if the estimator
/// has no smoother.
fn candidate_rows(
    samples: &Samples,
    readings: &[Option<Reading<f64>>],
    scale: &CorrectionScale,
    start_s: f64,
    recipe: FilterParts<'_>,
) -> Result<Option<Vec<TrainingRow>>, CalibrationError> {
    let failed = |row: usize, source| CalibrationError::Filter { time_s: samples.time_s[row], source };
    let mut filter = recipe.filter(None)?;
    let mut filtered = Vec::with_capacity(readings.len());
    for (row, (&time_s, &reading)) in samples.time_s.iter().zip(readings).enumerate() {
        filter.step(time_s, reading).map_err(|error| failed(row, error))?;
        filtered.push(outputs(&filter.output()));
    }
    let smoothed =
        recipe.smoother(None)?.smooth(samples.time_s, readings).map_err(|(row, error)| failed(row, error))?;
    let Some(smoothed) = smoothed else { return Ok(None) };
    let mut past = Vec::with_capacity(readings.len());
    each_row(samples.time_s, readings, scale.past(), |_, _, now| past.push(now));
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
    Ok(Some(samples.complete_rows().filter_map(row).collect()))
}

/// Rows that are spread evenly over time and the way that the features of the past go.
fn chosen(candidates: &[TrainingRow], most: usize) -> Vec<TrainingRow> {
    let n = candidates.len();
    let most = most.min(n);
    let sd = |i: usize| {
        let mean = candidates.iter().map(|row| row.past[i]).sum::<f64>() / n as f64;
        (candidates.iter().map(|row| (row.past[i] - mean).powi(2)).sum::<f64>() / n as f64).sqrt()
    };
    let sds: [f64; FEATURES] = std::array::from_fn(|i| sd(i).max(f64::MIN_POSITIVE));
    let step = |pair: &[TrainingRow]| {
        let square: f64 = (0..FEATURES).map(|i| ((pair[1].past[i] - pair[0].past[i]) / sds[i]).powi(2)).sum();
        square.sqrt()
    };
    let steps: Vec<f64> = candidates.windows(2).map(step).collect();
    let way = steps.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mut gone = 0.0;
    let mut rows: Vec<TrainingRow> = candidates.first().copied().into_iter().collect();
    for (k, (row, step)) in candidates.iter().skip(1).zip(&steps).enumerate() {
        gone += BY_WAY * step / way + (1.0 - BY_WAY) / (n - 1) as f64;
        // As many as should have been chosen by now, and no more than rows are left for.
        let due = gone * (most - 1) as f64 + 1.0 + 1e-9 >= (rows.len() + 1) as f64;
        let needed = most - rows.len() >= n - 1 - k;
        if rows.len() < most && (due || needed) {
            rows.push(*row);
        }
    }
    rows
}
