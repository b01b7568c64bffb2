use std::sync::{Mutex, MutexGuard, PoisonError};

use ohmstrain::{Column, Error, Estimate, Known, Stored, Thermometer};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;
use pyo3_arrow::PyTable;

use crate::about::About;
use crate::error::{Place, of_library, raise};
use crate::recording::Recording;
use crate::sensor::on_joint;
use crate::table::Estimates;
use crate::watch::{Doubtful, Watch};

/// A running filter.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct LiveFilter {
    running: Mutex<Running>,
    sensor: ohmstrain::Sensor,
    columns: Vec<Column>,
    known: Vec<Known>,
}

struct Running {
    filter: ohmstrain::Filter,
    thermometer: Thermometer,
    watch: Watch,
    /// Reading of the rested sensor, if it differs from that in calibration.
    rest_resistance: Option<f64>,
    /// True after the first reading, whose unit was that of the calibration.
    is_begun: bool,
    /// Time of 0 s in tables with dates and times, ns since 1970.
    zero_ns: Option<i64>,
}

/// A running fixed-lag filter.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct LaggedFilter {
    filter: Mutex<(ohmstrain::LaggedFilter, Thermometer)>,
    columns: Vec<Column>,
}

/// Warning of readings without temperatures for a filter that takes them.
const BLIND: &str =
    "no column `temperature_c`: intervals are too narrow; use the filter of sensor.without_temperature()";

/// Locks a filter for one caller at a time, who waits without holding the interpreter. A step either succeeds or leaves the
/// filter as it was, even if it panics.
fn locked<'a, T>(filter: &'a Mutex<T>, py: Python) -> MutexGuard<'a, T> {
    filter.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
}

fn refused(error: Error) -> PyErr {
    of_library(&error, None)
}

/// Converts a reading to the reference temperature; returns the thermometer after it, too, since a refused row changes nothing.
fn at_reference(mut thermometer: Thermometer, reading: Option<f64>, temperature_c: Option<f64>) -> (Thermometer, f64) {
    let reading = thermometer.at_reference(reading.unwrap_or(f64::NAN), temperature_c.unwrap_or(f64::NAN));
    (thermometer, reading)
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
        let thermometer = Thermometer::new(&sensor);
        let running = Running { filter, thermometer, watch, rest_resistance, is_begun: false, zero_ns: None };
        Self { running: Mutex::new(running), sensor, columns, known }
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
        let (zero_ns, is_begun) = (stored.zero_ns, stored.is_begun());
        let thermometer = Thermometer::new(&sensor).after(stored.temperature_c);
        let mut watch = Watch::new(&sensor, rest_resistance, &known);
        if given.is_none() {
            watch.go_on(stored);
        }
        let running = Running { filter, thermometer, watch, rest_resistance, is_begun, zero_ns };
        Self { running: Mutex::new(running), sensor, columns, known }
    }

    /// Refuses a recording on another joint than the filter's.
    fn check_joint(&self, recording: &Recording) -> PyResult<()> {
        let sensor = on_joint(self.sensor.clone(), recording.joint, recording.name.as_deref())?;
        if sensor.params().joint == self.sensor.params().joint {
            return Ok(());
        }
        let place = Place { file: recording.name.as_deref(), ..Place::default() };
        Err(raise(&place, "joint: expected that of the filter; create one on this joint with sensor.filter(joint=…)"))
    }
}

/// Parses the text of a state.
pub fn stored(text: &str, file: Option<&str>) -> PyResult<Stored> {
    Stored::from_toml(text).map_err(|error| of_library(&error, file))
}

impl LaggedFilter {
    pub(crate) fn new(
        filter: ohmstrain::LaggedFilter,
        sensor: &ohmstrain::Sensor,
        columns: Vec<Column>,
        last_c: Option<f64>,
    ) -> Self {
        Self { filter: Mutex::new((filter, Thermometer::new(sensor).after(last_c))), columns }
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
        let (thermometer, reading) = at_reference(running.thermometer, reading, temperature_c);
        let estimate = running.filter.step(time_s, reading).map_err(refused)?;
        running.thermometer = thermometer;
        running.is_begun |= reading.is_finite();
        row(py, &self.columns, &estimate)
    }

    /// Takes the rows of a table, whose 0 s is at `zero_ns`; the next call continues after the last one.
    #[pyo3(signature = (table, about, zero_ns=None))]
    fn run(&self, py: Python, table: PyTable, about: About, zero_ns: Option<i64>) -> PyResult<Doubtful> {
        let mut recording = Recording::new(table, about)?;
        self.check_joint(&recording)?;
        let mut running = locked(&self.running, py);
        let Running { filter, thermometer, watch, rest_resistance, is_begun, zero_ns: running_zero_ns } = &mut *running;
        recording.convert(*thermometer);
        recording.check_kind(&self.sensor)?;
        if !*is_begun {
            recording.check_unit(&self.sensor, *rest_resistance)?;
            let is_blind = !recording.has_temperatures() && thermometer.last_c().is_none();
            if is_blind && self.sensor.params().temperature.is_some() {
                watch.warnings.push(format!("{}{BLIND}", recording.before()));
            }
        }
        watch.warnings.extend(recording.use_doubts(&self.sensor, !*is_begun));
        let mut estimates = Estimates::new(self.columns.clone(), recording.time_s.len());
        py.detach(|| {
            recording.filtered(filter, |row, estimate| {
                // Rows that are refused change neither.
                let _ = thermometer.at_reference(f64::NAN, recording.temperature_c(row));
                *running_zero_ns = running_zero_ns.or(zero_ns);
                *is_begun |= recording.readings[row].is_finite();
                estimates.put(row, std::slice::from_ref(estimate));
                watch.see(&recording, row, estimate.strain_rate);
                watch.see_rest(&recording, estimate);
            })
        })?;
        Ok((estimates.into_batch()?, std::mem::take(&mut watch.warnings)))
    }

    #[getter]
    fn zero_ns(&self, py: Python) -> Option<i64> {
        locked(&self.running, py).zero_ns
    }

    /// Stores everything that the next row depends on, as TOML, with the time of 0 s.
    fn store(&self, py: Python) -> PyResult<String> {
        let running = locked(&self.running, py);
        let mut stored = running.filter.store().map_err(refused)?;
        stored.zero_ns = running.zero_ns;
        stored.rest_resistance = running.rest_resistance;
        stored.temperature_c = running.thermometer.last_c();
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
        let (after, reading) = at_reference(*thermometer, reading, temperature_c);
        let rows = filter.step(time_s, reading).map_err(refused)?;
        *thermometer = after;
        rows.iter().map(|estimate| row(py, &self.columns, estimate)).collect()
    }

    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let mut filter = locked(&self.filter, py);
        let rows = filter.0.finish().map_err(refused)?;
        rows.iter().map(|estimate| row(py, &self.columns, estimate)).collect()
    }

    /// Stores everything that the next row depends on, as TOML.
    fn store(&self, py: Python) -> PyResult<String> {
        let guard = locked(&self.filter, py);
        let mut stored = guard.0.store().map_err(refused)?;
        stored.temperature_c = guard.1.last_c();
        stored.to_toml().map_err(refused)
    }

    fn rest_resistance(&self, py: Python, measured: f64) -> PyResult<()> {
        locked(&self.filter, py).0.rest_resistance(measured).map_err(refused)
    }
}
