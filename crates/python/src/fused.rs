use std::sync::{Arc, Mutex, PoisonError};

use arrow_array::builder::StringBuilder;
use arrow_array::{ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch};
use arrow_schema::ArrowError;
use ohmstrain::trace::{HandDescription, HandJoint};
use ohmstrain::{FusedEstimate, FusedSensor as Fused, Reading};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;
use pyo3_arrow::{PyRecordBatch, PyTable};

use crate::about::About;
use crate::error::{Place, of_library, raise};
use crate::recording::Recording;
use crate::sensor::Sensor;

/// Several sensors that measure one strain.
#[pyclass(frozen, module = "ohmstrain._core")]
pub struct FusedSensor {
    sensor: Fused,
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
        let sensor = Fused::from_toml(sensors, text).map_err(|error| of_library(&error, file))?;
        Ok(Self { sensor })
    }

    fn to_toml(&self) -> PyResult<String> {
        self.sensor.to_toml().map_err(|error| of_library(&error, None))
    }

    fn filter(&self) -> PyResult<FusedFilter> {
        let filter = self.sensor.filter().map_err(|error| of_library(&error, None))?;
        Ok(FusedFilter { filter: Mutex::new(filter) })
    }

    /// Estimates a recording, given as a table for each channel with today's reading of its rested sensor.
    fn estimate(
        &self,
        py: Python,
        channels: Vec<(PyTable, About, Option<f64>)>,
        smooths: bool,
    ) -> PyResult<PyRecordBatch> {
        let (mut recordings, mut rest) = (Vec::new(), Vec::new());
        for (table, about, measured) in channels {
            recordings.push(Recording::new(table, about)?);
            rest.push(measured);
        }
        py.detach(|| estimated(&self.sensor, &recordings, &rest, smooths))
    }
}

fn estimated(fused: &Fused, recordings: &[Recording], rest: &[Option<f64>], smooths: bool) -> PyResult<PyRecordBatch> {
    let refused = |error: ohmstrain::Error| of_library(&error, None);
    let mut sensors = Vec::new();
    for (sensor, recording) in fused.sensors().iter().zip(recordings) {
        recording.check_kind(sensor)?;
        recording.check_unit(sensor, None)?;
        let sensor = sensor.clone();
        sensors.push(match recording.joint {
            Some(joint) => sensor.on_joint(joint).map_err(refused)?,
            None => sensor,
        });
    }
    let fused = Fused::new(sensors, fused.params().clone()).map_err(refused)?;
    let builders = fused.sensors().iter().zip(rest);
    let builders = builders.map(|(sensor, rest)| {
        let builder = sensor.filter();
        rest.map_or(builder, |measured| builder.rest_resistance(measured))
    });
    let time_s: &[f64] = recordings.first().map_or(&[], |recording| &recording.time_s);
    let readings = |recording: &Recording| (0..time_s.len()).map(|row| recording.row(row).1).collect::<Vec<Reading>>();
    let readings: Vec<Vec<Reading>> = recordings.iter().map(readings).collect();
    let rows: Vec<FusedEstimate> = if smooths {
        let slices: Vec<&[Reading]> = readings.iter().map(Vec::as_slice).collect();
        fused.smooth_of(builders.collect(), time_s, &slices).map_err(refused)?
    } else {
        let filters = builders.map(|builder| builder.build()).collect::<Result<_, _>>().map_err(refused)?;
        let mut filter = fused.filter_of(filters).map_err(refused)?;
        let step = |(row, time_s): (usize, &f64)| {
            filter.step(*time_s, &readings.iter().map(|readings| readings[row]).collect::<Vec<_>>())
        };
        time_s.iter().enumerate().map(step).collect::<Result<_, _>>().map_err(refused)?
    };
    table(&rows)
}

/// Returns rows as a table: unknown cells are null, flags of each channel are in a column of their own.
fn table(rows: &[FusedEstimate]) -> PyResult<PyRecordBatch> {
    let failed = |error: ArrowError| raise(&Place::default(), &error.to_string());
    let numbers =
        |of: fn(&FusedEstimate) -> Option<f64>| Arc::new(rows.iter().map(of).collect::<Float64Array>()) as ArrayRef;
    let faulty = |row: &FusedEstimate| row.faulty.and_then(|channel| i64::try_from(channel).ok());
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("time_s".into(), numbers(|row| Some(row.time_s))),
        ("strain".into(), numbers(|row| Some(row.strain))),
        ("strain_sd".into(), numbers(|row| Some(row.strain_sd))),
        ("angle_deg".into(), numbers(|row| row.angle_deg)),
        ("angle_sd".into(), numbers(|row| row.angle_sd)),
        ("faulty".into(), Arc::new(rows.iter().map(faulty).collect::<Int64Array>())),
        ("is_unlike".into(), Arc::new(rows.iter().map(|row| Some(row.is_unlike)).collect::<BooleanArray>())),
    ];
    for channel in 0..rows.first().map_or(0, |row| row.channels.len()) {
        let mut flags = StringBuilder::new();
        rows.iter().for_each(|row| flags.append_value(row.channels[channel].flags.to_string()));
        columns.push((format!("flags_{channel}"), Arc::new(flags.finish())));
    }
    Ok(RecordBatch::try_from_iter(columns).map_err(failed)?.into())
}

/// Reads the description of a hand: for each joint its name, the file of its fusion, the joint that it spans, and its channels with column,
/// sensor, reading at rest and electronics.
#[pyfunction]
#[pyo3(signature = (text, file))]
pub fn read_hand<'py>(py: Python<'py>, text: &str, file: &str) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let place = Place { file: Some(file), ..Place::default() };
    let hand = HandDescription::from_toml(text).map_err(|error| raise(&place, &error.to_string()))?;
    let of_joint = |joint: &HandJoint| {
        let cells = PyDict::new(py);
        cells.set_item("name", &joint.name)?;
        cells.set_item("fusion", &joint.fusion)?;
        cells.set_item("joint", joint.joint.map(|spec| spec.to_string()))?;
        let channels = joint.channels.iter().map(|channel| {
            let cells = PyDict::new(py);
            cells.set_item("column", &channel.column)?;
            cells.set_item("sensor", &channel.sensor)?;
            cells.set_item("rest_resistance", channel.rest_resistance)?;
            cells.set_item("front_end", channel.front_end.map(|spec| spec.to_string()))?;
            Ok(cells)
        });
        cells.set_item("channels", channels.collect::<PyResult<Vec<_>>>()?)?;
        Ok(cells)
    };
    hand.joints.iter().map(of_joint).collect()
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
        let flags: Vec<String> = row.channels.iter().map(|channel| channel.flags.to_string()).collect();
        cells.set_item("flags", flags)?;
        Ok(cells)
    }
}
