use std::sync::{Mutex, PoisonError};

use ohmstrain::Reading;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;

use crate::error::of_library;
use crate::sensor::Sensor;

/// Several sensors that measure one strain.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct FusedSensor {
    sensor: ohmstrain::FusedSensor,
}

/// A running filter of several channels.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct FusedFilter {
    filter: Mutex<ohmstrain::FusedFilter>,
}

#[pymethods]
impl FusedSensor {
    #[new]
    #[pyo3(signature = (sensors, text, file=None))]
    fn new(sensors: Vec<PyRef<Sensor>>, text: &str, file: Option<&str>) -> PyResult<Self> {
        let sensors = sensors.iter().map(|sensor| sensor.sensor.clone()).collect();
        let sensor = ohmstrain::FusedSensor::from_toml(sensors, text).map_err(|error| of_library(&error, file))?;
        Ok(Self { sensor })
    }

    fn to_toml(&self) -> PyResult<String> {
        self.sensor.to_toml().map_err(|error| of_library(&error, None))
    }

    fn filter(&self) -> PyResult<FusedFilter> {
        let filter = self.sensor.filter().map_err(|error| of_library(&error, None))?;
        Ok(FusedFilter { filter: Mutex::new(filter) })
    }
}

#[pymethods]
impl FusedFilter {
    fn step<'py>(&self, py: Python<'py>, time_s: f64, readings: Vec<Option<f64>>) -> PyResult<Bound<'py, PyDict>> {
        let readings: Vec<Reading> = readings.into_iter().map(Reading::from).collect();
        let mut filter = self.filter.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner);
        let row = filter.step(time_s, &readings).map_err(|error| of_library(&error, None))?;
        let cells = PyDict::new(py);
        cells.set_item("time_s", row.time_s)?;
        cells.set_item("strain", row.strain)?;
        cells.set_item("strain_sd", row.strain_sd)?;
        cells.set_item("angle_deg", row.angle_deg)?;
        cells.set_item("angle_sd", row.angle_sd)?;
        cells.set_item("faulty", row.faulty)?;
        cells.set_item("is_unlike", row.is_unlike)?;
        Ok(cells)
    }
}
