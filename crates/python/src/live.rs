use std::sync::{Mutex, MutexGuard, PoisonError};

use ohmstrain::{Column, Error, Estimate, Known, Stored, Thermometer};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;
use pyo3_arrow::PyTable;

use crate::about::About;
use crate::error::of_library;
use crate::recording::Recording;
use crate::table::Estimates;
use crate::watch::{Doubtful, Watch};

/// A running filter.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct LiveFilter {
    running: Mutex<Running>,
    sensor: ohmstrain::Sensor,
    columns: Vec<Column>,
    known: Vec<Known>,
    /// Time of 0 s in the state that it resumes from, ns since 1970.
    #[pyo3(get)]
    zero_ns: Option<i64>,
}

struct Running {
    filter: ohmstrain::Filter,
    thermometer: Thermometer,
    watch: Watch,
    /// Reading of the rested sensor, if it differs from that in calibration.
    rest_resistance: Option<f64>,
}

/// A running fixed-lag filter.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct LaggedFilter {
    filter: Mutex<(ohmstrain::LaggedFilter, Thermometer)>,
    columns: Vec<Column>,
}

/// Locks a filter for one caller at a time, who waits without holding the interpreter. A step either succeeds or leaves the
/// filter as it was, even if it panics.
fn locked<'a, T>(filter: &'a Mutex<T>, py: Python) -> MutexGuard<'a, T> {
    filter.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
}

fn refused(error: Error) -> PyErr {
    of_library(&error, None)
}

/// Converts a reading to the reference temperature.
fn at_reference(thermometer: &mut Thermometer, reading: Option<f64>, temperature_c: Option<f64>) -> Option<f64> {
    reading.map(|reading| thermometer.at_reference(reading, temperature_c.unwrap_or(f64::NAN)))
}

/// Converts a row to a dictionary with the names of the columns; `None` for unknown values.
fn row<'py>(py: Python<'py>, columns: &[Column], row: &Estimate) -> PyResult<Bound<'py, PyDict>> {
    let cells = PyDict::new(py);
    for column in columns {
        if column.is_flags() {
            cells.set_item(column.name(), row.flags.to_string())?;
        } else {
            let known = Some(column.number(row)).filter(|number| !number.is_nan());
            cells.set_item(column.name(), known)?;
        }
    }
    Ok(cells)
}

impl LiveFilter {
    pub(crate) fn new(
        filter: ohmstrain::Filter,
        sensor: ohmstrain::Sensor,
        columns: Vec<Column>,
        rest_resistance: Option<f64>,
        known: Vec<Known>,
    ) -> Self {
        let watch = Watch::new(&sensor, rest_resistance, &known);
        Self::watched(filter, watch, sensor, columns, rest_resistance, known)
    }

    /// Creates a filter that resumes from a state.
    pub(crate) fn resumed(
        filter: ohmstrain::Filter,
        sensor: ohmstrain::Sensor,
        columns: Vec<Column>,
        given: Option<f64>,
        known: Vec<Known>,
        stored: Stored,
    ) -> Self {
        let rest_resistance = given.or(stored.rest_resistance);
        let (mut watch, zero_ns) = (Watch::new(&sensor, rest_resistance, &known), stored.zero_ns);
        if given.is_none() {
            watch.go_on(stored);
        }
        Self { zero_ns, ..Self::watched(filter, watch, sensor, columns, rest_resistance, known) }
    }

    fn watched(
        filter: ohmstrain::Filter,
        watch: Watch,
        sensor: ohmstrain::Sensor,
        columns: Vec<Column>,
        rest_resistance: Option<f64>,
        known: Vec<Known>,
    ) -> Self {
        let running = Mutex::new(Running { filter, thermometer: Thermometer::new(&sensor), watch, rest_resistance });
        Self { running, sensor, columns, known, zero_ns: None }
    }
}

/// Parses the text of a state.
pub fn stored(text: &str, file: Option<&str>) -> PyResult<Stored> {
    Stored::from_toml(text).map_err(|error| of_library(&error, file))
}

impl LaggedFilter {
    pub(crate) fn new(filter: ohmstrain::LaggedFilter, sensor: &ohmstrain::Sensor, columns: Vec<Column>) -> Self {
        Self { filter: Mutex::new((filter, Thermometer::new(sensor))), columns }
    }
}

#[pymethods]
impl LiveFilter {
    #[pyo3(signature = (time_s, reading=None, temperature_c=None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        time_s: f64,
        reading: Option<f64>,
        temperature_c: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut running = locked(&self.running, py);
        let Running { filter, thermometer, .. } = &mut *running;
        let estimate = filter.step(time_s, at_reference(thermometer, reading, temperature_c)).map_err(refused)?;
        row(py, &self.columns, &estimate)
    }

    /// Takes the rows of a table; the next call continues after the last one.
    fn run(&self, py: Python, table: PyTable, about: About) -> PyResult<Doubtful> {
        let mut recording = Recording::new(table, about)?;
        recording.convert_for(&self.sensor);
        let mut running = locked(&self.running, py);
        let Running { filter, watch, rest_resistance, .. } = &mut *running;
        recording.check_unit(&self.sensor, *rest_resistance)?;
        let mut estimates = Estimates::new(self.columns.clone(), recording.time_s.len());
        py.detach(|| {
            recording.filtered(filter, |row, estimate| {
                estimates.put(row, std::slice::from_ref(estimate));
                watch.see(&recording, row, estimate.strain_rate);
                watch.see_rest(&recording, estimate);
            })
        })?;
        Ok((estimates.into_batch()?, std::mem::take(&mut watch.warnings)))
    }

    /// Stores everything that the next row depends on, as TOML, with the time of 0 s.
    #[pyo3(signature = (zero_ns=None))]
    fn store(&self, py: Python, zero_ns: Option<i64>) -> PyResult<String> {
        let running = locked(&self.running, py);
        let mut stored = running.filter.store().map_err(refused)?;
        stored.zero_ns = zero_ns;
        stored.rest_resistance = running.rest_resistance;
        running.watch.store(&mut stored);
        stored.to_toml().map_err(refused)
    }

    fn rest_resistance(&self, py: Python, measured: f64) -> PyResult<()> {
        let mut running = locked(&self.running, py);
        running.filter.rest_resistance(measured).map_err(refused)?;
        running.rest_resistance = Some(measured);
        running.watch = Watch::new(&self.sensor, Some(measured), &self.known);
        Ok(())
    }
}

#[pymethods]
impl LaggedFilter {
    #[pyo3(signature = (time_s, reading=None, temperature_c=None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        time_s: f64,
        reading: Option<f64>,
        temperature_c: Option<f64>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let mut guard = locked(&self.filter, py);
        let (filter, thermometer) = &mut *guard;
        let rows = filter.step(time_s, at_reference(thermometer, reading, temperature_c)).map_err(refused)?;
        rows.iter().map(|estimate| row(py, &self.columns, estimate)).collect()
    }

    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let mut filter = locked(&self.filter, py);
        let rows = filter.0.finish().map_err(refused)?;
        rows.iter().map(|estimate| row(py, &self.columns, estimate)).collect()
    }

    /// Stores everything that the next row depends on, as TOML.
    fn store(&self, py: Python) -> PyResult<String> {
        locked(&self.filter, py).0.store().and_then(|stored| stored.to_toml()).map_err(refused)
    }

    fn rest_resistance(&self, py: Python, measured: f64) -> PyResult<()> {
        locked(&self.filter, py).0.rest_resistance(measured).map_err(refused)
    }
}
