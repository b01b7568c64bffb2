//! A calibrated sensor.

use ohmstrain::{EstimatorKind, Tested};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::estimates::{self, Estimates};
use crate::estimator::estimator;
use crate::firmware::{self, Firmware};
use crate::json::{json, parsed, refused};
use crate::live::{Filter, Wishes};
use crate::recording::Recording;
use crate::report::{self, Drawn};
use crate::stream::Stream;

/// A calibrated sensor: the content of a `sensor.toml`.
#[wasm_bindgen]
#[derive(Clone)]
pub struct Sensor {
    sensor: ohmstrain::Sensor,
    /// Facts about its calibration, if it was calibrated here.
    facts: Vec<(&'static str, String)>,
    tested: Option<Tested>,
}

impl Sensor {
    pub(crate) fn new(sensor: ohmstrain::Sensor, facts: Vec<(&'static str, String)>, tested: Option<Tested>) -> Self {
        Self { sensor, facts, tested }
    }
}

#[derive(Serialize)]
struct Described {
    estimator: &'static str,
    estimators: Vec<&'static str>,
    quantity: &'static str,
    unit: &'static str,
    rest: f64,
    limits: [f64; 2],
    columns: Vec<&'static str>,
}

#[wasm_bindgen]
impl Sensor {
    /// Reads a `sensor.toml`; `name` is its name in messages.
    #[wasm_bindgen(js_name = fromToml)]
    pub fn from_toml(text: &str, name: Option<String>) -> Result<Sensor, JsError> {
        let name = name.unwrap_or_else(|| "sensor.toml".into());
        let sensor = ohmstrain::Sensor::from_toml(text).map_err(|error| refused(error.in_file(&name)))?;
        Ok(Self::new(sensor, vec![], None))
    }

    /// Returns its `sensor.toml`.
    #[wasm_bindgen(js_name = toToml)]
    pub fn to_toml(&self) -> Result<String, JsError> {
        self.sensor.to_toml().map_err(|error| refused(format!("cannot write parameters: {error}")))
    }

    /// Describes its quantity, its readings and its estimators.
    #[wasm_bindgen(unchecked_return_type = "SensorDescription")]
    pub fn described(&self) -> Result<JsValue, JsError> {
        let params = self.sensor.params();
        let known = EstimatorKind::ALL.into_iter().filter(|kind| self.sensor.filter().estimator(*kind).build().is_ok());
        let columns = self.sensor.columns();
        json(&Described {
            estimator: params.default_estimator.name(),
            estimators: known.map(EstimatorKind::name).collect(),
            quantity: params.quantity.name(),
            unit: if columns[1].name() == "resistance_ohm" { "ohm" } else { "ratio" },
            rest: self.sensor.params().rested(),
            limits: [params.limits.lower, params.limits.upper],
            columns: columns.iter().map(|column| column.name()).collect(),
        })
    }

    /// Creates a filter for live readings.
    pub fn filter(
        &self,
        #[wasm_bindgen(unchecked_param_type = "Wishes | undefined")] wishes: JsValue,
    ) -> Result<Filter, JsError> {
        parsed(&wishes, "wishes").and_then(|wishes: Wishes| Filter::new(&self.sensor, &wishes)).map_err(refused)
    }

    /// Creates a filter for the lines of a board; without `header`, the board sends one. See [`Stream`].
    pub fn stream(&self, header: Option<String>, front_end: Option<String>) -> Result<Stream, JsError> {
        Stream::new(&self.sensor, header.as_deref(), front_end.as_deref()).map_err(refused)
    }

    /// Filters a recording, as `ohmstrain filter` does.
    #[wasm_bindgen(js_name = filterRecording)]
    pub fn filter_recording(&self, recording: &Recording) -> Result<Estimates, JsError> {
        estimates::filtered(&self.sensor, &recording.file).map_err(refused)
    }

    /// Smooths a recording, as `ohmstrain smooth` does.
    #[wasm_bindgen(js_name = smoothRecording)]
    pub fn smooth_recording(&self, recording: &Recording) -> Result<Estimates, JsError> {
        estimates::smoothed(&self.sensor, &recording.file).map_err(refused)
    }

    /// Draws the report on a recording, with its figures.
    pub fn report(&self, recording: &Recording) -> Result<Drawn, JsError> {
        report::drawn(&self.sensor, &recording.file, &self.facts, self.tested.as_ref()).map_err(refused)
    }

    /// Exports its filter as source code for a microcontroller, as `ohmstrain export` writes it. `target` is `c` or `rust`,
    /// `budget` is that of `--budget`; without one, the whole filter is exported.
    pub fn firmware(
        &self,
        target: &str,
        dt_s: f64,
        budget: Option<String>,
        prefix: Option<String>,
    ) -> Result<Firmware, JsError> {
        firmware::of(self.sensor.params(), target, dt_s, budget.as_deref(), prefix.as_deref()).map_err(refused)
    }

    /// Returns the sensor with another default estimator.
    #[wasm_bindgen(js_name = withEstimator)]
    pub fn with_estimator(&self, name: &str) -> Result<Sensor, JsError> {
        let kind = estimator(name).map_err(refused)?;
        let mut params = self.sensor.params().clone();
        params.default_estimator = kind;
        let sensor = ohmstrain::Sensor::from_params(params).map_err(refused)?;
        Ok(Self { sensor, ..self.clone() })
    }
}
