//! Recordings in tables: the columns of a trace CSV.

use std::ops::Range;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, RecordBatch};
use arrow_cast::cast;
use arrow_schema::{ArrowError, DataType, Schema};
use ohmstrain::{Error, Estimate, Filter, FilterBuilder, JointParams, Quantity, Reading, ReadingUnit, Sensor};
use ohmstrain_bench_data::{FrontEndSpec, JointSpec};
use pyo3::prelude::*;
use pyo3_arrow::PyTable;

use crate::error::{Place, Stopped, heed, of_library, raise};

/// What a table leaves unsaid: the lines above a trace CSV's header.
#[derive(Debug, Default, FromPyObject)]
#[pyo3(from_item_all)]
pub struct About {
    name: Option<String>,
    gauge_length_mm: Option<f64>,
    front_end: Option<String>,
    joint: Option<String>,
}

/// A recording as the library takes it. NaN stands for what is missing.
#[derive(Debug)]
pub struct Recording {
    /// What messages call it.
    pub name: Option<String>,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// Readings.
    pub readings: Vec<f64>,
    /// What a converter's codes tell beyond them: deviation, Ω, and whether it stood at an end of its scale.
    converter: Option<Vec<(f64, bool)>>,
    /// Unit of the readings.
    pub unit: ReadingUnit,
    /// The reference and what it measures.
    pub reference: Option<(Quantity, Vec<f64>)>,
    /// The joint that the sensor sits on.
    pub joint: Option<JointParams>,
}

/// Rows after which an interrupt is heeded.
const HEEDED: usize = 4096;

/// Exactly one of each of the first two groups, at most one of the third.
const TIMES: [&str; 2] = ["time_s", "time_us"];
const READINGS: [&str; 3] = ["resistance_ohm", "resistance_ratio", "adc"];
const REFERENCES: [&str; 3] = ["strain", "displacement_mm", "angle_deg"];

impl Recording {
    /// Takes a table apart.
    pub fn new(table: PyTable, about: About) -> PyResult<Self> {
        let (batches, schema) = table.into_inner();
        let file = about.name.as_deref();
        let needed = |group: &[&'static str]| {
            one_of(&schema, group, file)?.ok_or_else(|| {
                let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
                let expected = group.join("` or `");
                let text = format!("expected a column `{expected}`, found `{}`", names.join(","));
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
        let joint_spec = about.joint_spec()?;
        let reference = match reference {
            Some(name) => Some(about.reference(name, column(name)?, joint_spec.as_ref())?),
            None => None,
        };
        let unit = if reading == "resistance_ratio" { ReadingUnit::Ratio } else { ReadingUnit::Ohm };
        let joint = about.joint()?;
        if time_s.is_empty() {
            return Err(raise(&Place { file, ..Place::default() }, "expected at least one row, found none"));
        }
        Ok(Self { name: about.name, time_s, readings, converter, unit, reference, joint })
    }

    /// Rows from the first one up to one.
    pub fn until(&self, rows: usize) -> (&[f64], &[f64], Option<&[f64]>) {
        let reference = self.reference.as_ref().map(|(_, values)| &values[..rows]);
        (&self.time_s[..rows], &self.readings[..rows], reference)
    }

    /// Time, s, and reading of a row.
    pub fn row(&self, row: usize) -> (f64, Reading) {
        let (sd, saturated) = self.converter.as_ref().map_or((0.0, false), |converter| converter[row]);
        (self.time_s[row], Reading { value: self.readings[row], sd, saturated })
    }

    /// What a filter makes of each row, in turn; heeds an interrupt.
    pub fn filtered(&self, filter: &mut Filter, mut take: impl FnMut(usize, &Estimate)) -> PyResult<()> {
        for row in 0..self.time_s.len() {
            if row % HEEDED == HEEDED - 1 {
                heed()?;
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

    /// What a smoother makes of the rows, in segments from the last to the first; heeds an interrupt on its way back.
    pub fn smoothed(&self, builder: FilterBuilder, mut take: impl FnMut(Range<usize>, &[Estimate])) -> PyResult<()> {
        let done = builder.smooth_backward(
            self.time_s.len(),
            |row| self.row(row),
            |rows, segment| {
                take(rows, segment);
                heed().map_err(Stopped::Interrupted)
            },
        );
        done.map_err(|stopped| match stopped {
            Stopped::Refused(error) => self.refused(&error),
            Stopped::Interrupted(interrupt) => interrupt,
        })
    }

    /// What the library refuses of it.
    pub fn refused(&self, error: &Error) -> PyErr {
        of_library(error, self.name.as_deref())
    }

    /// Refuses readings in another unit than the sensor's, or that seem to be.
    pub fn check_unit(&self, sensor: &Sensor, rest_resistance: Option<f64>) -> PyResult<()> {
        let place = Place { file: self.name.as_deref(), ..Place::default() };
        if self.unit != sensor.params().reading {
            return Err(raise(&place, "expected readings in the unit of the sensor's calibration, ohms or ratios"));
        }
        let checked = sensor.check_unit(self.readings.iter().copied(), rest_resistance);
        checked.map_err(|doubt| self.refused(&doubt.into()))
    }
}

impl About {
    fn place(&self) -> Place<'_> {
        Place { file: self.name.as_deref(), ..Place::default() }
    }

    fn joint_spec(&self) -> PyResult<Option<JointSpec>> {
        parsed("joint", self.joint.as_deref(), self.name.as_deref())
    }

    /// The joint that the sensor sits on.
    pub fn joint(&self) -> PyResult<Option<JointParams>> {
        Ok(self.joint_spec()?.map(|joint| JointParams {
            prestrain: joint.prestrain,
            moment_arm_mm: joint.moment_arm_mm,
            gauge_length_mm: joint.gauge_length_mm,
        }))
    }

    #[expect(clippy::type_complexity, reason = "two columns of a recording")]
    fn readings(&self, name: &'static str, values: Vec<f64>) -> PyResult<(Vec<f64>, Option<Vec<(f64, bool)>>)> {
        let file = self.name.as_deref();
        if name != "adc" {
            let wrong = values.iter().position(|value| value.is_infinite() || *value <= 0.0);
            return match wrong {
                None => Ok((values, None)),
                Some(row) => {
                    let place = Place { file, row: Some(row), column: Some(name) };
                    Err(raise(&place, &format!("expected a positive number, found {}", values[row])))
                }
            };
        }
        let Some(spec) = parsed::<FrontEndSpec>("front_end", self.front_end.as_deref(), file)? else {
            let place = Place { column: Some(name), ..self.place() };
            return Err(raise(&place, "expected `front_end` to be given, as in `# front_end = …` of a trace CSV"));
        };
        let front_end = spec.build().map_err(|error| raise(&self.place(), &format!("front_end: {error}")))?;
        let (mut readings, mut converter) = (Vec::with_capacity(values.len()), Vec::with_capacity(values.len()));
        for (row, value) in values.into_iter().enumerate() {
            let code = (value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0).then_some(value as u32);
            if code.is_none() && !value.is_nan() {
                let place = Place { file, row: Some(row), column: Some(name) };
                return Err(raise(&place, &format!("expected a converter's code, found {value}")));
            }
            let (ohm, sd, saturated) = match code.map(|code| front_end.read(code)) {
                None => (f64::NAN, f64::NAN, false),
                Some(ohmstrain_model::AdcCode::Saturated) => (f64::NAN, f64::NAN, true),
                Some(ohmstrain_model::AdcCode::Reading(ohms)) => (ohms.resistance_ohm, ohms.sd_ohm, false),
            };
            readings.push(ohm);
            converter.push((sd, saturated));
        }
        Ok((readings, Some(converter)))
    }

    fn reference(
        &self,
        name: &'static str,
        mut values: Vec<f64>,
        joint: Option<&JointSpec>,
    ) -> PyResult<(Quantity, Vec<f64>)> {
        let file = self.name.as_deref();
        if let Some(row) = values.iter().position(|value| value.is_infinite()) {
            let place = Place { file, row: Some(row), column: Some(name) };
            return Err(raise(&place, &format!("expected a finite number, found {}", values[row])));
        }
        match (name, joint) {
            ("displacement_mm", _) => {
                let Some(length) = self.gauge_length_mm.filter(|length| length.is_finite() && *length > 0.0) else {
                    let place = Place { column: Some(name), ..self.place() };
                    return Err(raise(&place, "expected `gauge_length_mm` to be given, a positive number"));
                };
                values.iter_mut().for_each(|value| *value /= length);
                Ok((Quantity::Strain, values))
            }
            ("angle_deg", None) => Ok((Quantity::AngleDeg, values)),
            ("angle_deg", Some(joint)) => {
                let joint = joint.build().map_err(|error| raise(&self.place(), &format!("joint: {error}")))?;
                values.iter_mut().for_each(|value| *value = joint.strain(value.to_radians()));
                Ok((Quantity::Strain, values))
            }
            _ => Ok((Quantity::Strain, values)),
        }
    }
}

fn parsed<T: std::str::FromStr>(key: &str, text: Option<&str>, file: Option<&str>) -> PyResult<Option<T>>
where
    T::Err: std::fmt::Display,
{
    let wrong = |error: T::Err| raise(&Place { file, ..Place::default() }, &format!("{key}: {error}"));
    text.map(|text| text.parse().map_err(wrong)).transpose()
}

/// The one column of a group that a table has.
fn one_of(schema: &Schema, group: &[&'static str], file: Option<&str>) -> PyResult<Option<&'static str>> {
    let found: Vec<&'static str> =
        group.iter().copied().filter(|name| schema.fields().iter().any(|field| field.name() == name)).collect();
    match found[..] {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        [first, second, ..] => {
            let text = format!("expected one of the columns `{}`, found `{first}` and `{second}`", group.join("`, `"));
            Err(raise(&Place { file, ..Place::default() }, &text))
        }
    }
}

/// A column of numbers; NaN where there is none.
fn numbers(batches: &[RecordBatch], schema: &Arc<Schema>, name: &str, file: Option<&str>) -> PyResult<Vec<f64>> {
    let place = || Place { file, column: Some(name), ..Place::default() };
    let wrong = |error: ArrowError| raise(&place(), &format!("expected numbers: {error}"));
    let index = schema.index_of(name).map_err(wrong)?;
    let kind = schema.field(index).data_type();
    // A column of nulls alone has no other kind.
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
