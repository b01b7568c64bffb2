//! Recordings in tables with the columns of a trace CSV.

use std::ops::Range;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, RecordBatch};
use arrow_cast::cast;
use arrow_schema::{ArrowError, DataType, Schema};
use ohmstrain::{
    Error, Estimate, Filter, FilterBuilder, Interface, JointParams, Quantity, Reading, ReadingUnit, Sensor,
    Thermometer, UseDoubt,
};
use ohmstrain_calib::Samples;
use pyo3::prelude::*;
use pyo3_arrow::PyTable;

use crate::about::About;
use crate::error::{Place, Stopped, check_signals, of_library, raise};

/// A recording in the form that the library takes. Missing values are NaN.
#[derive(Debug)]
pub struct Recording {
    /// Name in messages.
    pub name: Option<String>,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// Readings.
    pub readings: Vec<f64>,
    /// Per converter code: its deviation, Ω, and true if it was at an end of the scale.
    converter: Option<Vec<(f64, bool)>>,
    /// Unit of the readings.
    pub unit: ReadingUnit,
    /// Temperatures, °C, if the table has them.
    temperature_c: Option<Vec<f64>>,
    /// Quantity and values of the reference.
    pub reference: Option<(Quantity, Vec<f64>)>,
    /// The joint that the sensor is mounted on.
    pub joint: Option<JointParams>,
    /// Number of temperatures that counted as missing.
    far_temperatures: usize,
    /// True if the user has given the unit of the strains.
    knows_strain_unit: bool,
    /// True if the user, or electronics, have given the unit of the readings.
    knows_resistance_unit: bool,
}

/// Number of rows between checks for an interrupt.
const ROWS_PER_CHECK: usize = 4096;

/// Key of a schema's metadata with the names of all columns of the user's table, of which it has some.
const NAMES: &str = "ohmstrain_columns";

/// Groups of columns: a table has exactly one of each of the first two groups, and at most one of the others.
const TIMES: [&str; 2] = ["time_s", "time_us"];
const READINGS: [&str; 3] = ["resistance_ohm", "resistance_ratio", "adc"];
const TEMPERATURES: [&str; 1] = ["temperature_c"];
const REFERENCES: [&str; 3] = ["strain", "displacement_mm", "angle_deg"];

impl Recording {
    /// Extracts a recording from a table.
    pub fn new(table: PyTable, about: About) -> PyResult<Self> {
        let (batches, schema) = table.into_inner();
        let about = about.completed(&schema)?;
        let file = about.name.as_deref();
        let needed = |group: &[&'static str]| {
            one_of(&schema, group, file)?.ok_or_else(|| {
                let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
                let names = schema.metadata().get(NAMES).cloned().unwrap_or_else(|| names.join(","));
                let expected = group.join("` or `");
                let text = format!("expected a column `{expected}`, found `{names}`");
                raise(&Place { file, ..Place::default() }, &text)
            })
        };
        let (time, reading) = (needed(&TIMES)?, needed(&READINGS)?);
        let reference = one_of(&schema, &REFERENCES, file)?;
        let column = |name| numbers(&batches, &schema, name, file);
        let mut time_s = column(time)?;
        if time == "time_us" {
            time_s.iter_mut().for_each(|time| *time /= 1e6);
        }
        check_times(&time_s, time, file)?;
        let (readings, converter) = about.readings(reading, column(reading)?)?;
        let temperature_c = one_of(&schema, &TEMPERATURES, file)?.map(column).transpose()?;
        let joint_spec = about.joint_spec()?;
        let reference = match reference {
            Some(name) => Some(about.reference(name, column(name)?, joint_spec.as_ref())?),
            None => None,
        };
        let unit = if reading == "resistance_ratio" { ReadingUnit::Ratio } else { ReadingUnit::Ohm };
        let joint = about.joint()?;
        let knows_strain_unit = about.strain_unit.is_some();
        let knows_resistance_unit = about.resistance_unit.is_some() || converter.is_some();
        if time_s.is_empty() {
            return Err(raise(&Place { file, ..Place::default() }, "expected at least one row, found none"));
        }
        Ok(Self {
            name: about.name,
            time_s,
            readings,
            converter,
            unit,
            temperature_c,
            far_temperatures: 0,
            reference,
            joint,
            knows_strain_unit,
            knows_resistance_unit,
        })
    }

    /// Returns its name as the beginning of a message.
    pub fn before(&self) -> String {
        self.name.as_deref().map_or_else(String::new, |name| format!("{name}: "))
    }

    /// Returns the first and the last time, s.
    pub fn times(&self) -> (f64, f64) {
        let ends = (self.time_s.first(), self.time_s.last());
        (ends.0.copied().unwrap_or(f64::NAN), ends.1.copied().unwrap_or(f64::NAN))
    }

    /// Returns the first `rows` rows.
    pub fn until(&self, rows: usize) -> (&[f64], &[f64], Option<&[f64]>) {
        let reference = self.reference.as_ref().map(|(_, values)| &values[..rows]);
        (&self.time_s[..rows], &self.readings[..rows], reference)
    }

    /// Converts its readings to the reference temperature of a sensor; returns the sensor for it, with wider intervals if it has no
    /// temperatures.
    pub fn convert_for(&mut self, sensor: &Sensor) -> Sensor {
        let sensor = sensor.clone();
        let sensor = if self.temperature_c.is_some() { sensor } else { sensor.without_temperature() };
        self.convert(Thermometer::new(&sensor));
        sensor
    }

    /// Converts its readings to a thermometer's reference temperature.
    pub fn convert(&mut self, mut thermometer: Thermometer) {
        let before = thermometer.implausible();
        for row in 0..self.readings.len() {
            self.readings[row] = thermometer.at_reference(self.readings[row], self.temperature_c(row));
        }
        self.far_temperatures = thermometer.implausible() - before;
    }

    /// Returns warnings of temperatures that counted as missing, and of times that may be milliseconds, in the first rows of a filter.
    pub fn use_doubts(&self, sensor: &Sensor, are_first: bool) -> Vec<String> {
        let count = self.far_temperatures;
        let far = (count > 0).then_some(UseDoubt::FarTemperatures { count });
        let clock = sensor.clock_doubt(self.time_s.iter().copied()).filter(|_| are_first);
        far.into_iter().chain(clock).map(|doubt| self.doubted(doubt)).collect()
    }

    /// Returns a doubt about this recording as a warning.
    pub fn doubted(&self, doubt: UseDoubt) -> String {
        format!("{}{}", self.before(), doubt.text(Interface::Python))
    }

    /// True if it has a column of temperatures.
    pub const fn has_temperatures(&self) -> bool {
        self.temperature_c.is_some()
    }

    /// Returns the temperature of a row, °C; NaN if it was not measured.
    pub fn temperature_c(&self, row: usize) -> f64 {
        self.temperature_c.as_ref().map_or(f64::NAN, |temperature_c| temperature_c[row])
    }

    /// Returns samples of it in the form that the library calibrates on.
    pub fn known<'a>(&'a self, samples: &Samples<'a>) -> Result<ohmstrain::Recording<'a>, Error> {
        let mut one = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
        if let Some(temperature_c) = &self.temperature_c {
            one = one.at_temperatures_c(&temperature_c[..samples.len()])?;
        }
        if self.unit == ReadingUnit::Ratio {
            one = one.of_ratios();
        }
        if self.reference.as_ref().is_some_and(|(quantity, _)| *quantity == Quantity::AngleDeg) {
            one = one.of_angles_deg();
        }
        if self.knows_strain_unit {
            one = one.strain_unit_is_known();
        }
        if self.knows_resistance_unit {
            one = one.resistance_unit_is_known();
        }
        Ok(self.joint.map_or(one, |joint| one.on_joint(joint)))
    }

    /// Returns time, s, and reading of a row.
    pub fn row(&self, row: usize) -> (f64, Reading) {
        let (sd, saturated) = self.converter.as_ref().map_or((0.0, false), |converter| converter[row]);
        (self.time_s[row], Reading { value: self.readings[row], sd, saturated })
    }

    /// Filters the rows in turn, and passes each estimate to `take`; an interrupt stops it.
    pub fn filtered(&self, filter: &mut Filter, mut take: impl FnMut(usize, &Estimate)) -> PyResult<()> {
        for row in 0..self.time_s.len() {
            if row % ROWS_PER_CHECK == ROWS_PER_CHECK - 1 {
                check_signals()?;
            }
            let (time_s, reading) = self.row(row);
            let estimate = filter.step(time_s, reading).map_err(|error| match error {
                Error::Step(source) => self.refused(&Error::Row { row, source }),
                other => self.refused(&other),
            })?;
            take(row, &estimate);
        }
        Ok(())
    }

    /// Smooths the rows in segments, from the last to the first; an interrupt stops the backward pass.
    pub fn smoothed(&self, builder: FilterBuilder, mut take: impl FnMut(Range<usize>, &[Estimate])) -> PyResult<()> {
        let done = builder.smooth_backward(
            self.time_s.len(),
            |row| self.row(row),
            |rows, segment| {
                take(rows, segment);
                check_signals().map_err(Stopped::Interrupted)
            },
        );
        done.map_err(|stopped| match stopped {
            Stopped::Refused(error) => self.refused(&error),
            Stopped::Interrupted(interrupt) => interrupt,
        })
    }

    /// Converts an error of the library about this recording.
    pub fn refused(&self, error: &Error) -> PyErr {
        of_library(error, self.name.as_deref())
    }

    /// Refuses ratios for a sensor that reads ohms, and the reverse.
    pub fn check_kind(&self, sensor: &Sensor) -> PyResult<()> {
        if self.unit == sensor.params().reading {
            return Ok(());
        }
        let place = Place { file: self.name.as_deref(), ..Place::default() };
        Err(raise(&place, "expected readings in the unit of the sensor's calibration, ohms or ratios"))
    }

    /// Refuses readings that seem to be in another unit than the sensor's.
    pub fn check_unit(&self, sensor: &Sensor, rest_resistance: Option<f64>) -> PyResult<()> {
        let checked = sensor.check_unit(self.readings.iter().copied(), rest_resistance);
        checked.map_err(|doubt| self.refused(&doubt.into()))
    }
}

/// Returns the only column of a group in a table.
fn one_of(schema: &Schema, group: &[&'static str], file: Option<&str>) -> PyResult<Option<&'static str>> {
    let names = schema.fields().iter().map(|field| field.name());
    let found: Vec<&'static str> = names.filter_map(|name| group.iter().copied().find(|known| known == name)).collect();
    match found[..] {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        [first, second, ..] => {
            let text = format!("expected one of the columns `{}`, found `{first}` and `{second}`", group.join("`, `"));
            Err(raise(&Place { file, ..Place::default() }, &text))
        }
    }
}

/// Returns a column of numbers; NaN where there is none.
fn numbers(batches: &[RecordBatch], schema: &Arc<Schema>, name: &str, file: Option<&str>) -> PyResult<Vec<f64>> {
    let place = || Place { file, column: Some(name), ..Place::default() };
    let wrong = |error: ArrowError| raise(&place(), &format!("expected numbers: {error}"));
    let index = schema.index_of(name).map_err(wrong)?;
    let kind = schema.field(index).data_type();
    // A column of nulls alone has no other type.
    if !kind.is_numeric() && !kind.is_null() {
        return Err(raise(&place(), &format!("expected numbers, found {kind}")));
    }
    let mut values = Vec::with_capacity(batches.iter().map(RecordBatch::num_rows).sum());
    for batch in batches {
        let column = cast(batch.column(index), &DataType::Float64).map_err(wrong)?;
        let column = column.as_primitive::<Float64Type>();
        if column.null_count() == 0 {
            values.extend_from_slice(column.values());
        } else {
            values.extend(column.iter().map(|value| value.unwrap_or(f64::NAN)));
        }
    }
    Ok(values)
}

fn check_times(time_s: &[f64], column: &str, file: Option<&str>) -> PyResult<()> {
    let at = |row| Place { file, row: Some(row), column: Some(column) };
    if let Some(row) = time_s.iter().position(|time| !time.is_finite()) {
        return Err(raise(&at(row), &format!("expected a time, found {}", time_s[row])));
    }
    match time_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        None => Ok(()),
        Some(row) => {
            let text = format!("expected a time after {} s, found {} s", time_s[row], time_s[row + 1]);
            Err(raise(&at(row + 1), &text))
        }
    }
}
