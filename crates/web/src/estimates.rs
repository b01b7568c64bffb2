//! Filtering and smoothing of a recording: the rows of `estimates.csv`.

use std::io;

use ohmstrain::trace::TraceFile;
use ohmstrain::{Column, Estimate, Interface, QuietWatch, Sensor, ValidityWatch};
use ohmstrain_bench_data::RowWriter;
use wasm_bindgen::prelude::*;

use crate::json::refused;
use crate::recording::seated;

/// Number of readings at the start of a recording that are checked before it is filtered, and number of rows that are searched
/// for them.
const FIRST_READINGS: usize = 100;
const MOST_FIRST_ROWS: usize = 10 * FIRST_READINGS;

/// Estimates, one for each row of a recording.
#[wasm_bindgen]
pub struct Estimates {
    rows: Vec<Estimate>,
    columns: Vec<Column>,
    warnings: Vec<String>,
}

#[wasm_bindgen]
impl Estimates {
    /// Returns the names of the columns.
    pub fn columns(&self) -> Vec<String> {
        self.columns.iter().map(|column| column.name().to_owned()).collect()
    }

    /// Returns the numbers of a column, counted from 0; NaN if they are unknown, and for the flags.
    pub fn column(&self, index: usize) -> Vec<f64> {
        let numbers = |column: &Column| self.rows.iter().map(|row| column.number(row)).collect();
        self.columns.get(index).map_or_else(Vec::new, numbers)
    }

    /// Returns them in the form of `estimates.csv`.
    pub fn csv(&self) -> Result<Vec<u8>, JsError> {
        let mut bytes = Vec::new();
        self.write(&mut bytes).map_err(refused)?;
        Ok(bytes)
    }

    /// Returns the warnings about them.
    pub fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }
}

impl Estimates {
    fn write(&self, bytes: &mut Vec<u8>) -> io::Result<()> {
        let mut out = RowWriter::new(bytes);
        self.columns.iter().for_each(|column| out.text(column.name()));
        out.end()?;
        for row in &self.rows {
            for column in &self.columns {
                if column.is_flags() {
                    out.words(row.flags.names());
                } else {
                    out.number(column.number(row));
                }
            }
            out.end()?;
        }
        out.flush()
    }
}

/// Filters a recording row by row.
pub fn filtered(sensor: &Sensor, recording: &TraceFile) -> Result<Estimates, String> {
    let recording = &*recording.at_reference_temperature(sensor);
    let sensor = seated(sensor, recording)?;
    check_readings(&sensor, recording, first_rows(recording))?;
    let mut filter = sensor.filter().build().map_err(|error| error.to_string())?;
    let mut quiet = QuietWatch::new(&sensor, None, &[]);
    let mut rows = Vec::with_capacity(recording.trace.len());
    for row in 0..recording.trace.len() {
        let (time_s, reading) = recording.reading(row);
        let at = |error| format!("{}: data row {}: {error}", recording.name, recording.first_row + row + 1);
        rows.push(filter.step(time_s, reading).map_err(at)?);
    }
    let mut estimates = made(&sensor, recording, rows);
    let rests = estimates.rows.iter().filter_map(|row| quiet.see(row));
    let rests = rests.map(|rest| format!("{}: {}", recording.name, rest.text(Interface::CommandLine)));
    estimates.warnings.extend(rests);
    Ok(estimates)
}

/// Smooths a recording.
pub fn smoothed(sensor: &Sensor, recording: &TraceFile) -> Result<Estimates, String> {
    let recording = &*recording.at_reference_temperature(sensor);
    let sensor = seated(sensor, recording)?;
    check_readings(&sensor, recording, recording.trace.len())?;
    let readings: Vec<_> = (0..recording.trace.len()).map(|row| recording.reading(row).1).collect();
    let rows = sensor.filter().smooth_readings(&recording.trace.time_s, &readings);
    Ok(made(&sensor, recording, rows.map_err(|error| format!("{}: {error}", recording.name))?))
}

/// Returns the number of rows that are searched first.
fn first_rows(recording: &TraceFile) -> usize {
    let is_known = |row: &usize| recording.trace.readings.values[*row].is_finite();
    let enough = (0..recording.trace.len()).filter(is_known).nth(FIRST_READINGS - 1);
    enough.map_or(recording.trace.len(), |row| row + 1).min(MOST_FIRST_ROWS)
}

/// Refuses readings in another unit than the sensor's.
fn check_readings(sensor: &Sensor, recording: &TraceFile, rows: usize) -> Result<(), String> {
    let first = recording.trace.readings.values.iter().take(rows).copied();
    sensor
        .check_unit(first, None)
        .map_err(|doubt| format!("{}: {}", recording.header, doubt.text(Interface::CommandLine)))
}

fn made(sensor: &Sensor, recording: &TraceFile, rows: Vec<Estimate>) -> Estimates {
    let mut watch = ValidityWatch::new(sensor, None);
    let mut warnings = Vec::new();
    for row in &rows {
        let reading = row.resistance.unwrap_or(f64::NAN);
        for warning in watch.see(row.time_s, reading, row.strain_rate, f64::NAN) {
            warnings.push(format!("{}: {warning}", recording.name));
        }
    }
    Estimates { rows, columns: sensor.columns(), warnings }
}
