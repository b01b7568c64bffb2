//! Calibration as by `ohmstrain calibrate`, with progress.

use js_sys::{Date, Function};
use ohmstrain::trace::{self, TraceFile};
use ohmstrain::{Calibration, Closing, EstimatorKind, GaugeFamily, LeftOutRow, Stage, Tested};
use serde::Deserialize;
use wasm_bindgen::prelude::*;

use crate::doubts::on_one_clock;
use crate::estimator::estimator;
use crate::json::{json, parsed, refused};
use crate::recording::Recording;
use crate::sensor::Sensor;

/// Choices of a calibration; each has a default.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Choices {
    estimator: Option<String>,
    branches: Option<usize>,
    gauge: Option<String>,
    /// True if a late reference is moved.
    align: bool,
    from: Option<f64>,
    until: Option<f64>,
    /// Name of the sensor's file in messages.
    file: Option<String>,
}

impl Choices {
    /// Returns the chosen estimator, if there is one.
    fn chosen(&self) -> Result<Option<EstimatorKind>, String> {
        self.estimator.as_deref().filter(|name| *name != "auto").map(estimator).transpose()
    }

    fn calibration(&self) -> Result<Calibration<'static>, String> {
        let mut calibration = Calibration::new();
        if let Some(kind) = self.chosen()? {
            calibration = calibration.estimator(kind);
        }
        if let Some(branches) = self.branches {
            if branches > 4 {
                return Err(format!("branches: expected 0 to 4, found {branches}"));
            }
            calibration = calibration.branches(branches);
        }
        let Some(wanted) = self.gauge.as_deref().filter(|name| *name != "auto") else { return Ok(calibration) };
        let family: Result<GaugeFamily, String> = wanted.parse();
        Ok(calibration.gauge(family.map_err(|expected| format!("gauge: {expected}, found `{wanted}`"))?))
    }
}

/// Result of a calibration.
#[wasm_bindgen]
pub struct Calibrated {
    sensor: ohmstrain::Sensor,
    lines: Vec<(&'static str, String)>,
    facts: Vec<(&'static str, String)>,
    tested: Option<Tested>,
    advice: Vec<String>,
    warnings: Vec<String>,
    is_better: Option<bool>,
    left_out: Vec<LeftOutRow>,
    times: Vec<Vec<f64>>,
}

/// Calibrates a sensor on recordings with known strain. `progress` is called with the stage in words and its completed share, 0
/// to 1.
#[wasm_bindgen]
pub fn calibrate(
    recordings: Vec<Recording>,
    #[wasm_bindgen(unchecked_param_type = "Choices | undefined")] choices: JsValue,
    #[wasm_bindgen(unchecked_param_type = "((stage: string, share: number) => void) | undefined")] progress: JsValue,
) -> Result<Calibrated, JsError> {
    let choices = parsed::<Choices>(&choices, "choices").map_err(refused)?;
    let progress = progress.dyn_into::<Function>().ok();
    run(recordings.into_iter().map(|recording| recording.file).collect(), &choices, progress.as_ref()).map_err(refused)
}

fn run(wholes: Vec<TraceFile>, choices: &Choices, progress: Option<&Function>) -> Result<Calibrated, String> {
    let mut recordings = Vec::new();
    for whole in &wholes {
        let part = whole.rows(whole.between(choices.from, choices.until));
        if part.trace.is_empty() && !whole.trace.is_empty() {
            return Err(whole.no_rows(choices.from, choices.until).to_string());
        }
        if part.marks().is_some() {
            let what = "its strain is known in holds only; `ohmstrain calibrate` finds the motion between them, and this page does not";
            return Err(format!("{}: {what}", part.name));
        }
        recordings.push(part);
    }
    let mut warnings = Vec::new();
    let lags_s = recordings.iter_mut().map(|one| on_one_clock(one, choices.align, &mut warnings));
    let lags_s: Vec<f64> = lags_s.collect::<Result<_, _>>()?;
    let start_ms = Date::now();
    let (calibration, warn) = (choices.calibration()?, |warning| warnings.push(warning));
    if recordings.is_empty() {
        return Err("expected a recording, found none".into());
    }
    let calibrated = trace::calibrate(&recordings, calibration, warn, |stage| tell(progress, stage))
        .map_err(|error| error.to_string())?;
    let calibration_s = (Date::now() - start_ms) / 1e3;
    let kept = wholes.into_iter().zip(&recordings).zip(lags_s);
    let kept = kept.filter(|((whole, part), _)| part.trace.len() < whole.trace.len());
    let kept = kept.map(|((whole, part), lag_s)| (whole, part.first_row..part.first_row + part.trace.len(), lag_s));
    let (sensor, tested) = trace::tested_on(calibrated.sensor, kept).map_err(|error| error.to_string())?;
    let closing = Closing {
        file: choices.file.as_deref(),
        params: sensor.params(),
        findings: calibrated.findings.as_ref(),
        tested: tested.as_ref(),
        calibration_s: Some(calibration_s),
        more: "--explain",
    };
    let (lines, facts, is_better) = (closing.lines(), closing.facts(), closing.is_better());
    warnings.extend(closing.warning(choices.chosen()?));
    let advice = calibrated.findings.as_ref().map_or_else(Vec::new, |found| found.advice.clone());
    let times = recordings.into_iter().map(|recording| recording.trace.time_s).collect();
    Ok(Calibrated { lines, facts, is_better, advice, warnings, tested, times, left_out: calibrated.left_out, sensor })
}

/// Reports the stage of a calibration.
fn tell(progress: Option<&Function>, stage: Stage) {
    let Some(progress) = progress else { return };
    let (words, share) = match stage {
        Stage::Law => ("fitting the law", 0.0),
        Stage::Noise { done, expected } => ("fitting noise and motion", done as f64 / expected.max(done).max(1) as f64),
        Stage::LeftOut => ("checking parts left out", 1.0),
    };
    // A callback that fails does not stop a calibration.
    let _ = progress.call2(&JsValue::NULL, &words.into(), &share.into());
}

#[wasm_bindgen]
impl Calibrated {
    /// Returns the sensor.
    pub fn sensor(&self) -> Sensor {
        Sensor::new(self.sensor.clone(), self.facts.clone(), self.tested)
    }

    /// Returns the verdict and its basis: names and sentences, as `ohmstrain calibrate` prints them.
    #[wasm_bindgen(unchecked_return_type = "[string, string][]")]
    pub fn lines(&self) -> Result<JsValue, JsError> {
        json(&self.lines)
    }

    /// Returns the advice on the next recordings, the most important first.
    pub fn advice(&self) -> Vec<String> {
        self.advice.clone()
    }

    /// Returns the warnings about the result.
    pub fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// True if its errors are below 0.9 times those of a static curve; undefined if they are unknown.
    #[wasm_bindgen(getter, js_name = isBetter)]
    pub fn is_better(&self) -> Option<bool> {
        self.is_better
    }

    /// Returns the held-out rows, in the order of recordings and times, as six consecutive columns: recording, time in s,
    /// reference, strain, its deviation, and the static cubic's strain.
    #[wasm_bindgen(js_name = leftOut)]
    pub fn left_out(&self) -> Vec<f64> {
        let mut rows = self.left_out.clone();
        rows.sort_by_key(|row| (row.recording, row.row));
        let time = |row: &LeftOutRow| self.times[row.recording].get(row.row).copied().unwrap_or(f64::NAN);
        let columns: [&dyn Fn(&LeftOutRow) -> f64; 6] =
            [&|row| row.recording as f64, &time, &|row| row.truth, &|row| row.strain, &|row| row.strain_sd, &|row| {
                row.static_cubic
            }];
        columns.iter().flat_map(|column| rows.iter().map(column)).collect()
    }
}
