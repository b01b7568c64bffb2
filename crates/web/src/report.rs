//! The HTML report on a recording, and its figures.

use ohmstrain::trace::TraceFile;
use ohmstrain::verdict::{Known, verdict};
use ohmstrain::{MADE_BY, ScoredRow, Scores, Sensor, Tested};
use ohmstrain_calib::Baseline;
use ohmstrain_report::{FigureFiles, Report, ReportInput, Sample, ScoreRow, Scored};
use wasm_bindgen::prelude::*;

/// A report and its figures.
#[wasm_bindgen]
pub struct Drawn {
    html: String,
    figures: Vec<FigureFiles>,
}

#[wasm_bindgen]
impl Drawn {
    /// Returns the report, one self-contained page of HTML.
    #[wasm_bindgen(getter)]
    pub fn html(&self) -> String {
        self.html.clone()
    }

    /// Returns names and contents of the figures' files, alternating.
    pub fn figures(&self) -> Vec<String> {
        let files = |figure: &FigureFiles| {
            let name = &figure.name;
            [format!("{name}.svg"), figure.svg.clone(), format!("{name}.csv"), figure.csv.clone()]
        };
        self.figures.iter().flat_map(files).collect()
    }
}

/// Filters and smooths a recording, scores the estimates and draws the report.
pub fn drawn(
    sensor: &Sensor,
    recording: &TraceFile,
    facts: &[(&'static str, String)],
    tested: Option<&Tested>,
) -> Result<Drawn, String> {
    let (recording, sensor) = (&*recording.at_reference_temperature(sensor), &recording.sensor_for(sensor));
    let named = |error: ohmstrain::Error| format!("{}: {error}", recording.name);
    let (params, trace) = (sensor.params(), &recording.trace);
    let builder = sensor.filter().estimator(params.default_estimator);
    let mut filter = builder.build().map_err(named)?;
    let mut filtered = Vec::with_capacity(trace.len());
    for row in 0..trace.len() {
        let (time_s, reading) = recording.reading(row);
        filtered.push(filter.step(time_s, reading).map_err(named)?);
    }
    let mut smoothed = Vec::with_capacity(trace.len());
    let keep = |_, segment: &[ohmstrain::Estimate]| {
        smoothed.extend(segment.iter().rev());
        Ok::<(), ohmstrain::Error>(())
    };
    builder.smooth_backward(trace.len(), |row| recording.reading(row), keep).map_err(named)?;
    smoothed.reverse();
    let rest_reading = sensor.rest_reading(None);
    let moved = params.rest_reading / rest_reading;
    let of = |rows: &[ohmstrain::Estimate]| score(recording, |k| (rows[k].strain, Some(rows[k].strain_sd)));
    let mut cubic = ohmstrain_calib::running_cubic(params.static_cubic);
    let readings = trace.time_s.iter().zip(&trace.readings.values);
    let cubics: Vec<f64> = readings.map(|(&time_s, &reading)| cubic.strain(time_s, moved * reading)).collect();
    let filter = of(&filtered);
    let static_cubic = score(recording, |k| (cubics[k], None));
    let rows = [("filter", filter), ("smoother", of(&smoothed)), ("static cubic", static_cubic)];
    let scores: Vec<ScoreRow> =
        rows.into_iter().filter_map(|(name, scores)| scores.map(|scores| ScoreRow { name, scores })).collect();
    let sample = Sample::of(&trace.time_s, &recording.sha256, params, Scored::default());
    let left_out = params.summary.as_ref().filter(|_| sample != Sample::Out).map(Known::from);
    let verdict = filter.map(|filter| {
        let known = [Known::new(&filter, static_cubic.as_ref())].into_iter();
        verdict(&known.chain(left_out).chain(tested.map(Known::from)).collect::<Vec<_>>())
    });
    let input = ReportInput {
        title: &recording.name,
        made_by: MADE_BY,
        time_s: &trace.time_s,
        reading: &trace.readings.values,
        truth: trace.reference.as_ref().map(|reference| reference.values.as_slice()),
        filtered: &filtered,
        smoothed: &smoothed,
        params,
        rest_reading,
        scored: Scored::default(),
        sample,
        estimator: params.default_estimator,
        scores: &scores,
        verdict,
        facts,
    };
    let failed = |error: ohmstrain_report::ReportError| error.to_string();
    let report = Report::new(&input).map_err(failed)?;
    Ok(Drawn { html: report.html().map_err(failed)?, figures: report.figures().map_err(failed)? })
}

/// Scores all rows; `None` without a reference.
fn score(recording: &TraceFile, estimate: impl Fn(usize) -> (f64, Option<f64>)) -> Option<Scores> {
    let row = |k: usize| {
        let (strain, sd) = estimate(k);
        ScoredRow { time_s: recording.trace.time_s[k], truth: recording.truth(k), strain, sd }
    };
    ohmstrain_calib::score(&(0..recording.trace.len()).map(row).collect::<Vec<_>>())
}
