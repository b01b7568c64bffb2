//! A running filter: readings in, estimates out.

use ohmstrain::Column;
use serde::Deserialize;
use wasm_bindgen::prelude::*;

use crate::estimator::estimator;
use crate::json::{json, refused};

/// Options of a filter; each has a default.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase", deny_unknown_fields)]
pub struct Wishes {
    estimator: Option<String>,
    rest_resistance: Option<f64>,
    initial_strain: Option<f64>,
    gate: Option<f64>,
}

/// A running filter.
#[wasm_bindgen]
pub struct Filter {
    filter: ohmstrain::Filter,
    columns: Vec<Column>,
}

impl Filter {
    pub(crate) fn new(sensor: &ohmstrain::Sensor, wishes: &Wishes) -> Result<Self, String> {
        // Readings come without temperatures.
        let sensor = &sensor.clone().without_temperature();
        let mut builder = sensor.filter();
        if let Some(name) = wishes.estimator.as_deref().filter(|name| *name != "auto") {
            builder = builder.estimator(estimator(name)?);
        }
        if let Some(measured) = wishes.rest_resistance {
            builder = builder.rest_resistance(measured);
        }
        if let Some(strain) = wishes.initial_strain {
            builder = builder.initial_strain(strain);
        }
        if let Some(nis) = wishes.gate {
            builder = builder.gate(nis);
        }
        let filter = builder.build().map_err(|error| error.to_string())?;
        Ok(Self { filter, columns: sensor.columns() })
    }
}

#[wasm_bindgen]
impl Filter {
    /// Takes a reading, in the sensor's unit, at a time, s; a missing reading is NaN. The estimate has the names of
    /// `estimates.csv`. An error leaves the filter as it was.
    #[wasm_bindgen(unchecked_return_type = "Estimate")]
    pub fn step(&mut self, time_s: f64, reading: f64) -> Result<JsValue, JsError> {
        json(&self.filter.step(time_s, reading).map_err(refused)?)
    }

    /// Takes many readings at once, and returns the columns of their estimates one after another, in the order of the sensor's
    /// columns.
    #[wasm_bindgen(js_name = stepAll)]
    pub fn step_all(&mut self, time_s: &[f64], reading: &[f64]) -> Result<Vec<f64>, JsError> {
        let rows = time_s.iter().zip(reading).map(|(time_s, reading)| self.filter.step(*time_s, *reading));
        let rows: Vec<_> = rows.collect::<Result<_, _>>().map_err(refused)?;
        Ok(self.columns.iter().flat_map(|column| rows.iter().map(|row| column.number(row))).collect())
    }

    /// Takes a strain known now and its standard deviation; at rest the strain is 0.
    pub fn know(&mut self, strain: f64, sd: f64) -> Result<(), JsError> {
        self.filter.know(strain, sd).map(|_| ()).map_err(refused)
    }

    /// Sets the present reading of the rested sensor.
    #[wasm_bindgen(js_name = restResistance)]
    pub fn rest_resistance(&mut self, measured: f64) -> Result<(), JsError> {
        self.filter.rest_resistance(measured).map_err(refused)
    }
}
