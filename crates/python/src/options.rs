use ohmstrain::{Column, EstimatorKind, FilterBuilder, Known, Sensor, influence};
use pyo3::prelude::*;

use crate::error::{Place, of_library, raise};

/// Options of a filter: the flags of `ohmstrain filter`.
#[derive(Clone, Debug, Default, FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    estimator: Option<String>,
    correction: bool,
    /// Strain at the first row, if it is known.
    pub initial_strain: Option<f64>,
    /// Strains known at later times.
    #[pyo3(from_py_with = known)]
    pub known: Vec<Known>,
    rest_resistance: Option<Rest>,
    gate: Option<f64>,
    influence: Option<String>,
    columns: Option<Vec<String>>,
}

/// Present reading of the rested sensor.
#[derive(Clone, Debug, FromPyObject)]
enum Rest {
    Reading(f64),
    Named(String),
}

impl Options {
    /// Returns the present reading of the rested sensor, if it was given.
    pub fn rest_resistance(&self, sensor: &Sensor) -> PyResult<Option<f64>> {
        match &self.rest_resistance {
            None => Ok(None),
            Some(Rest::Reading(measured)) => {
                sensor.check_rest_resistance(*measured).map_err(|refused| of_library(&refused, None))?;
                Ok(Some(*measured))
            }
            Some(Rest::Named(name)) if name == "calibrated" => Ok(Some(sensor.params().rested())),
            Some(Rest::Named(name)) => {
                let message = format!("rest_resistance: expected a positive number or calibrated, found `{name}`");
                Err(raise(&Place::default(), &message))
            }
        }
    }

    /// Returns the requested columns of a sensor's estimates; all if none is named.
    pub fn columns(&self, sensor: &Sensor) -> PyResult<Vec<Column>> {
        let known = sensor.columns();
        let Some(chosen) = &self.columns else { return Ok(known) };
        let wrong = |found: &str| {
            let names: Vec<&str> = known.iter().map(Column::name).collect();
            raise(&Place::default(), &format!("columns: expected some of {}, found {found}", names.join(",")))
        };
        if chosen.is_empty() {
            return Err(wrong("none"));
        }
        let column = |name: &String| {
            let found = known.iter().copied().find(|column| column.name() == name);
            found.ok_or_else(|| wrong(&format!("`{name}`")))
        };
        chosen.iter().map(column).collect()
    }

    /// Turns on the learned correction, if the sensor has one.
    pub fn with_correction(self) -> Self {
        Self { correction: true, ..self }
    }

    /// Returns the builder of a sensor's filter with these options.
    pub fn builder<'a>(&'a self, sensor: &'a Sensor) -> PyResult<FilterBuilder<'a>> {
        self.known.iter().try_for_each(check_known)?;
        let mut builder = sensor.filter().known(&self.known);
        if let Some(kind) = self.estimator.as_deref().map(estimator).transpose()?.flatten() {
            builder = builder.estimator(kind);
        }
        if !self.correction {
            builder = builder.without_correction();
        }
        if let Some(strain) = self.initial_strain {
            builder = builder.initial_strain(strain);
        }
        if let Some(measured) = self.rest_resistance(sensor)? {
            builder = builder.rest_resistance(measured);
        }
        if let Some(nis) = self.gate {
            builder = builder.gate(nis);
        }
        if let Some(text) = &self.influence {
            builder = builder.influence(influence(text).map_err(|expected| wrong("influence", expected, text))?);
        }
        Ok(builder)
    }
}

/// Parses known strains: time, strain and, optionally, deviation.
fn known(given: &Bound<PyAny>) -> PyResult<Vec<Known>> {
    let strains: Vec<(f64, f64, Option<f64>)> = given.extract()?;
    Ok(strains.into_iter().map(|(time_s, strain, sd)| Known { time_s, strain, sd }).collect())
}

/// Refuses a known strain that is not finite.
fn check_known(known: &Known) -> PyResult<()> {
    let Known { time_s, strain, sd } = known;
    if time_s.is_finite() && strain.is_finite() && sd.is_none_or(|sd| sd.is_finite() && sd > 0.0) {
        return Ok(());
    }
    let sd = sd.map_or_else(String::new, |sd| format!(", {sd}"));
    let expected = "expected (time_s, strain) or (time_s, strain, sd), finite numbers and a positive sd";
    Err(raise(&Place::default(), &format!("known: {expected}, found ({time_s}, {strain}{sd})")))
}

/// Returns an estimator by its name; `None` for `auto`.
pub fn estimator(name: &str) -> PyResult<Option<EstimatorKind>> {
    if name == "auto" {
        return Ok(None);
    }
    name.parse().map(Some).map_err(|expected| wrong("estimator", expected, name))
}

/// Creates the error of an option with another text than those expected.
pub fn wrong(option: &str, expected: String, found: &str) -> PyErr {
    raise(&Place::default(), &format!("{option}: {expected}, found `{found}`"))
}
