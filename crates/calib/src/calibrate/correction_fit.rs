use std::ops::Range;

use ohmstrain_ekf::Reading;
use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS};

use crate::CalibrationError;
use crate::calibrate::correction_scale::{each_row, reading_scale};
use crate::calibrate::left_out::relative_changes;
use crate::calibrate::simulated_motions::simulated_rows;
use crate::correction::simulated::{Distilled, SimulatedRow};
use crate::correction::{AllRows, Examples, Prepared, filter_corrector, smoother_corrector};
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

/// Pause inserted between recordings, s, so that noise correlated over seconds is not shared between them.
pub(crate) const PAUSE_S: f64 = 1000.0;
/// Largest number of rows that a correction learns from. With 100, errors are a tenth larger; with 400, no smaller.
const ROWS: usize = 200;
/// Largest number of rows of several recordings whose information is used. With twice as many, errors are no smaller.
const ALL_ROWS: usize = 3000;
/// Weight of the path length of the features, against time, in the choice of rows: long holds repeat the same row.
const BY_WAY: f64 = 0.8;

/// Learns the correction of a filter from the recordings of its calibration. `fit` is their law, `recipe` the filter's, `corrects` its
/// kind. With a prior for that filter, the rows of other sensors come first, followed by half as many of the sensor's own. Returns `None`
/// if nothing can be learned from them.
pub(crate) fn fit_correction(
    recordings: &[Samples],
    fit: &LawFit,
    limits: RangeParams,
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
        let Some(rows) = candidate_rows(samples, readings, &scale, start_s, recipe)? else { return Ok(None) };
        start_s = rows.last().map_or(start_s, |row: &TrainingRow| row.time_s + PAUSE_S);
        of_recordings.push(candidates.len()..candidates.len() + rows.len());
        candidates.extend(rows);
    }
    let all = if of_make.is_some() { None } else { AllOf::several(&candidates, &of_recordings) };
    let most = if rows.is_empty() { ROWS } else { prior::ROWS };
    rows.extend(chosen(&candidates, &of_recordings, most).iter().map(rounded));
    let steps_s = recordings.iter().flat_map(|of| of.time_s.windows(2).map(|pair| pair[1] - pair[0]));
    let simulated = simulated_rows(fit, &MotionStats::new(recordings), &scale, median(steps_s).unwrap_or(0.0));
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
    (corrects, readings): (EstimatorKind, CorrectionScale),
    rows: Vec<TrainingRow>,
    (all, reference_sd): (Option<AllOf>, f64),
    simulated: &[SimulatedRow],
    limits: RangeParams,
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

    pub(crate) fn of_filter(&self, limits: RangeParams) -> Examples<'_, FILTER_INPUTS> {
        let Columns { filter: inputs, strain, time_s, .. } = &self.few;
        let all = self.all.as_ref().map(|all| all.rows(&all.columns.filter));
        Examples { inputs, strain, time_s, limits, reference_sd: self.reference_sd, all }
    }

    pub(crate) fn of_smoother(&self, limits: RangeParams) -> Examples<'_, SMOOTHER_INPUTS> {
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

/// Returns all rows of a recording with reading and strain, as the calibrated filter and smoother see them; `None` if the estimator has no
/// smoother.
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

/// Chooses rows spread evenly over time and over the path length of the past features, in each recording by itself.
fn chosen(candidates: &[TrainingRow], recordings: &[Range<usize>], most: usize) -> Vec<TrainingRow> {
    let n = candidates.len();
    let sd = |i: usize| {
        let mean = candidates.iter().map(|row| row.past[i]).sum::<f64>() / n as f64;
        (candidates.iter().map(|row| (row.past[i] - mean).powi(2)).sum::<f64>() / n as f64).sqrt()
    };
    let sds: [f64; FEATURES] = std::array::from_fn(|i| sd(i).max(f64::MIN_POSITIVE));
    let step = |pair: &[TrainingRow]| {
        let square: f64 = (0..FEATURES).map(|i| ((pair[1].past[i] - pair[0].past[i]) / sds[i]).powi(2)).sum();
        square.sqrt()
    };
    let steps: Vec<Vec<f64>> =
        recordings.iter().map(|rows| candidates[rows.clone()].windows(2).map(step).collect()).collect();
    let counts: Vec<usize> = recordings.iter().map(Range::len).collect();
    let quotas = quotas(&shares(&steps, &counts), &counts, most);
    let each = recordings.iter().zip(&steps).zip(quotas);
    each.flat_map(|((rows, steps), quota)| spread(&candidates[rows.clone()], steps, quota)).collect()
}

/// Weight of the path against time; without a path all weight is time's.
fn by_way(way: f64) -> f64 {
    if way > 0.0 { BY_WAY } else { 0.0 }
}

/// Returns the share of each recording in all rows to choose, from its steps of the path and its number of rows.
fn shares(steps: &[Vec<f64>], counts: &[usize]) -> Vec<f64> {
    let (way, rows) = (steps.iter().flatten().sum::<f64>(), counts.iter().sum::<usize>() as f64);
    let by_way = by_way(way);
    let share = |(steps, count): (&Vec<f64>, &usize)| {
        by_way * steps.iter().sum::<f64>() / way.max(f64::MIN_POSITIVE) + (1.0 - by_way) * *count as f64 / rows
    };
    steps.iter().zip(counts).map(share).collect()
}

/// Divides `most` rows among recordings by their shares. Rows that a recording does not have go to the others, so that all are given away
/// as long as there are some.
fn quotas(shares: &[f64], counts: &[usize], most: usize) -> Vec<usize> {
    let mut quotas = vec![0; counts.len()];
    loop {
        let left = most.min(counts.iter().sum()) - quotas.iter().sum::<usize>();
        let open: Vec<usize> = (0..counts.len()).filter(|&k| quotas[k] < counts[k]).collect();
        let total: f64 = open.iter().map(|&k| shares[k]).sum();
        if left == 0 || open.is_empty() {
            return quotas;
        }
        let (mut share, mut given) = (0.0, 0);
        for k in open.iter().copied() {
            share += if total > 0.0 { shares[k] / total } else { 1.0 / open.len() as f64 };
            let due = (share * left as f64).round() as usize - given;
            given += due;
            quotas[k] = (quotas[k] + due).min(counts[k]);
        }
    }
}

/// Chooses `most` rows of a recording, the first one included, spread over time and over the path with these `steps`.
fn spread(candidates: &[TrainingRow], steps: &[f64], most: usize) -> Vec<TrainingRow> {
    let n = candidates.len();
    let most = most.min(n);
    if most == 0 {
        return vec![];
    }
    let way = steps.iter().sum::<f64>();
    let by_way = by_way(way);
    let mut gone = 0.0;
    let mut rows = vec![candidates[0]];
    for (k, (row, step)) in candidates.iter().skip(1).zip(steps).enumerate() {
        gone += by_way * step / way.max(f64::MIN_POSITIVE) + (1.0 - by_way) / (n - 1) as f64;
        // Due: fewer rows are chosen than should be by now. Needed: no more rows remain than are still wanted.
        let due = gone * (most - 1) as f64 + 1.0 + 1e-9 >= (rows.len() + 1) as f64;
        let needed = most - rows.len() >= n - 1 - k;
        if rows.len() < most && (due || needed) {
            rows.push(*row);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A row whose first past feature is given, at a time of its own.
    fn row(time_s: f64, feature: f64) -> TrainingRow {
        let mut past = [0.0; FEATURES];
        past[0] = feature;
        let (future, filtered, smoothed) = Default::default();
        TrainingRow { time_s, strain: 0.0, past, future, filtered, smoothed }
    }

    /// A long slow recording and a short fast one: the short one gives all of its rows, the long one the rest. Without a path rows
    /// are spread over time.
    #[test]
    fn all_rows_asked_for_are_chosen() {
        let slow = (0..5000).map(|k| row(f64::from(k), 1e-4 * f64::from(k)));
        let fast = (0..60).map(|k| row(6000.0 + f64::from(k), f64::from(k % 2)));
        let candidates: Vec<TrainingRow> = slow.chain(fast).collect();
        let rows = chosen(&candidates, &[0..5000, 5000..5060], 200);
        assert_eq!(rows.len(), 200);
        assert_eq!(rows.iter().filter(|row| row.time_s >= 6000.0).count(), 60);

        let still: Vec<TrainingRow> = (0..1000).map(|k| row(f64::from(k), 0.5)).collect();
        let times: Vec<f64> =
            chosen(&still, std::slice::from_ref(&(0..1000)), 50).iter().map(|row| row.time_s).collect();
        // Even to a row: 999 / 49.
        assert!(times.windows(2).all(|pair| (pair[1] - pair[0] - 999.0 / 49.0).abs() <= 1.0), "{times:?}");
    }

    proptest! {
        /// Quotas sum to the rows asked for or all there are, and no recording gives more than it has, in any division.
        #[test]
        fn quotas_add_up(parts in prop::collection::vec((0.0..1.0_f64, 0..300_usize), 1..9), most in 0..400_usize) {
            let (shares, counts): (Vec<f64>, Vec<usize>) = parts.into_iter().unzip();
            let quotas = quotas(&shares, &counts, most);
            prop_assert_eq!(quotas.iter().sum::<usize>(), most.min(counts.iter().sum()));
            prop_assert!(quotas.iter().zip(&counts).all(|(quota, count)| quota <= count));
        }
    }
}
