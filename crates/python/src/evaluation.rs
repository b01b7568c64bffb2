use ohmstrain::{Scores, Sensor};
use ohmstrain_bench_data::segment;
use ohmstrain_calib::{Baseline, Baselines, CalibrationError, PublishedLaw, Samples, ScoredRow, screen};
use pyo3::prelude::*;

use crate::error::{Place, of_library, raise};
use crate::options::Options;
use crate::recording::Recording;

/// Names of the scored estimators, and their scores as JSON.
pub type Scored = Vec<(&'static str, String)>;

/// Scores filter, smoother and static cubic on the rows at a time or later; the filter starts at the first row.
pub fn with_sensor(
    py: Python,
    recording: &Recording,
    sensor: &Sensor,
    options: &Options,
    from_s: f64,
) -> PyResult<Scored> {
    let truth = truth(recording)?;
    let file = recording.name.as_deref();
    let params = sensor.params();
    if recording.reference.as_ref().map(|(quantity, _)| *quantity) != Some(params.quantity) {
        let text = format!("expected a reference in `{}`, as the calibration has it", params.quantity.name());
        return Err(raise(&Place { file, ..Place::default() }, &text));
    }
    let checked = sensor.check_reference(truth.iter().copied());
    checked.map_err(|doubt| of_library(&doubt.into(), file))?;
    let moved = params.rest_reading / sensor.rest_reading(options.rest_resistance(sensor)?);
    let part = Part { recording, truth, first: recording.time_s.partition_point(|time_s| *time_s < from_s) };
    let scores = py.detach(|| {
        let mut scores = part.of_estimates(sensor, options)?;
        scores.push(("static_cubic", part.of_baseline(ohmstrain_calib::running_cubic(params.static_cubic), moved)));
        Ok::<_, PyErr>(scores)
    })?;
    named(scores, file)
}

/// Scores them together with the baselines, fitted to the same first `rows` rows as the sensor; also the sensor without its
/// correction, if it has one.
pub fn after_split(py: Python, recording: &Recording, rows: usize, sensor: &Sensor) -> PyResult<Scored> {
    let (truth, file) = (truth(recording)?, recording.name.as_deref());
    let part = Part { recording, truth, first: rows };
    let scores = py.detach(|| {
        let corrected = Options::default().with_correction();
        let mut scores = part.of_estimates(sensor, &corrected)?;
        let baselines = fitted(recording, rows).map_err(|error| of_library(&error.into(), file))?;
        scores.push(("static_cubic", part.of_baseline(ohmstrain_calib::running_cubic(baselines.static_cubic), 1.0)));
        scores.push(("fir_20s", part.of_baseline(baselines.fir.start(), 1.0)));
        scores.push(("low_pass_mode", part.of_baseline(baselines.low_pass_mode.start(), 1.0)));
        scores.push(("leaky_bank", part.of_baseline(baselines.leaky_bank.start(), 1.0)));
        if let Some(published) = published(recording, rows, truth) {
            scores.push(("relaxing_modulus", part.of_baseline(published, 1.0)));
        }
        Ok::<_, PyErr>(scores)
    })?;
    named(scores, file)
}

fn fitted(recording: &Recording, rows: usize) -> Result<Baselines, CalibrationError> {
    let (time_s, reading, strain) = recording.until(rows);
    let samples = [Samples::new(time_s, reading, strain.unwrap_or(&[])).map_err(CalibrationError::from)?];
    Baselines::fit(&screen(&samples)?.samples())
}

/// Fits the published law to the rows before `rows`, and supplies the phases.
fn published(recording: &Recording, rows: usize, truth: &[f64]) -> Option<impl Baseline> {
    let (time_s, reading, strain) = recording.until(rows);
    let samples = [Samples::new(time_s, reading, strain.unwrap_or(&[])).ok()?];
    let phases = |time_s: &[f64], strain: &[f64]| segment(time_s, strain).into_iter().map(|s| (s.phase, s.rows));
    let law = PublishedLaw::fit(&samples, &[phases(time_s, samples[0].strain()).collect()]).ok()?;
    let time_s = &recording.time_s;
    let starts = phases(time_s, truth).map(|(phase, rows)| (time_s[rows.start], phase)).collect();
    Some(law.start(starts, truth.first().copied().unwrap_or(f64::NAN)))
}

fn truth(recording: &Recording) -> PyResult<&[f64]> {
    let missing = || {
        let place = Place { file: recording.name.as_deref(), column: Some("strain"), row: None };
        raise(&place, "expected a reference (strain, displacement_mm or angle_deg), found none")
    };
    recording.reference.as_ref().map(|(_, values)| values.as_slice()).ok_or_else(missing)
}

fn named(scores: Vec<(&'static str, Option<Scores>)>, file: Option<&str>) -> PyResult<Scored> {
    let place = Place { file, ..Place::default() };
    let text = |(name, scores): (&'static str, Option<Scores>)| {
        let scores = scores.ok_or_else(|| raise(&place, "expected a reference in the rows to score, found none"))?;
        let text = serde_json::to_string(&scores).map_err(|error| raise(&place, &error.to_string()))?;
        Ok((name, text))
    };
    scores.into_iter().map(text).collect()
}

/// The scored rows: all from `first` on.
struct Part<'a> {
    recording: &'a Recording,
    truth: &'a [f64],
    first: usize,
}

impl Part<'_> {
    fn scores(&self, estimate: impl Fn(usize) -> (f64, Option<f64>)) -> Option<Scores> {
        let row = |row: usize| {
            let (strain, sd) = estimate(row);
            ScoredRow { time_s: self.recording.time_s[row], truth: self.truth[row], strain, sd }
        };
        ohmstrain_calib::score(&(self.first..self.truth.len()).map(row).collect::<Vec<_>>())
    }

    fn of_baseline(&self, mut baseline: impl Baseline, moved: f64) -> Option<Scores> {
        let rows = self.recording.time_s.iter().zip(&self.recording.readings);
        let strains: Vec<f64> = rows.map(|(time_s, reading)| baseline.strain(*time_s, moved * reading)).collect();
        self.scores(|row| (strains[row], None))
    }

    /// Returns the scores of filter and smoother.
    fn of_estimates(&self, sensor: &Sensor, options: &Options) -> PyResult<Vec<(&'static str, Option<Scores>)>> {
        let len = self.truth.len();
        let mut filter = options.builder(sensor)?.build().map_err(|error| self.recording.refused(&error))?;
        let mut filtered = Vec::with_capacity(len);
        self.recording.filtered(&mut filter, |_, row| filtered.push((row.strain, Some(row.strain_sd))))?;
        let mut smoothed = vec![(f64::NAN, None); len];
        self.recording.smoothed(options.builder(sensor)?, |rows, segment| {
            let cells = smoothed[rows].iter_mut().zip(segment);
            cells.for_each(|(cell, row)| *cell = (row.strain, Some(row.strain_sd)));
        })?;
        Ok(vec![("filter", self.scores(|row| filtered[row])), ("smoother", self.scores(|row| smoothed[row]))])
    }
}
