//! Reading of files: traces as the command line reads them, all others by the importer.

use std::collections::HashMap;
use std::fs::File;
use std::io::{Cursor, Read};
use std::str::FromStr;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_schema::{ArrowError, Field, Schema};
use ohmstrain_bench_data::import::{Plan, Recipe, read_table};
use ohmstrain_bench_data::{Metadata, ParquetText, ReadingKind, ReferenceQuantity, Trace, TraceError, TraceReader};
use pyo3::prelude::*;
use pyo3_arrow::PyRecordBatch;

use crate::about::{ABOUT, About, parsed};
use crate::error::{Place, raise};

/// Answers about files: the flags of `ohmstrain import`, and the units of a trace's columns.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub struct Arguments {
    preset: Option<String>,
    columns: Vec<(String, String)>,
    units: Vec<(String, String)>,
    decimal: Vec<String>,
    skip: Vec<String>,
    sheet: Option<String>,
    rows: Vec<String>,
    recording: Option<usize>,
    missing: Vec<String>,
    magnitude: Vec<String>,
    drop_zeros: Vec<String>,
    zero: Vec<(String, f64)>,
    fold_polarity: bool,
    align: Option<String>,
    rate_hz: Option<f64>,
    gauge_length_mm: Option<f64>,
    front_end: Option<String>,
    joint: Option<String>,
    strain_unit: Option<String>,
    resistance_unit: Option<String>,
}

/// Parses the value of an argument; an error names the argument and the value.
fn value<T: FromStr<Err: std::fmt::Display>>(argument: &str, text: &str) -> PyResult<T> {
    text.parse().map_err(|error: T::Err| raise(&Place::default(), &format!("{argument}: {error}, found `{text}`")))
}

fn values<T: FromStr<Err: std::fmt::Display>>(argument: &str, texts: &[String]) -> PyResult<Vec<T>> {
    texts.iter().map(|text| value(argument, text)).collect()
}

fn pairs<K: FromStr<Err: std::fmt::Display>, V: Clone, T>(
    argument: &str,
    given: &[(String, V)],
    of: impl Fn(V) -> PyResult<T>,
) -> PyResult<Vec<(K, T)>> {
    given.iter().map(|(key, given)| Ok((value(argument, key)?, of(given.clone())?))).collect()
}

impl Arguments {
    fn metadata(&self) -> PyResult<Metadata> {
        Ok(Metadata {
            gauge_length_mm: self.gauge_length_mm,
            front_end: parsed("front_end", self.front_end.as_deref(), None)?,
            joint: parsed("joint", self.joint.as_deref(), None)?,
            strain_unit: parsed("strain_unit", self.strain_unit.as_deref(), None)?,
            resistance_unit: parsed("resistance_unit", self.resistance_unit.as_deref(), None)?,
            ..Metadata::default()
        })
    }

    fn recipe(&self) -> PyResult<Recipe> {
        let metadata = self.metadata()?;
        let mut units = pairs("units", &self.units, Ok)?;
        for (role, unit) in [("strain", &self.strain_unit), ("resistance", &self.resistance_unit)] {
            // Inserted before the arguments by role, which override them.
            units.splice(0..0, unit.clone().map(|unit| Ok::<_, PyErr>((value("units", role)?, unit))).transpose()?);
        }
        Ok(Recipe {
            preset: self.preset.as_deref().map(|text| value("preset", text)).transpose()?,
            columns: pairs("columns", &self.columns, |column: String| value("columns", &column))?,
            units,
            decimal: values("decimal", &self.decimal)?,
            skip: values("skip", &self.skip)?,
            sheet: self.sheet.clone(),
            rows: values("where", &self.rows)?,
            recording: self.recording,
            missing: self.missing.clone(),
            magnitude: values("magnitude", &self.magnitude)?,
            drop_zeros: values("drop_zeros", &self.drop_zeros)?,
            zero: pairs("zero", &self.zero, Ok)?,
            fold_polarity: self.fold_polarity,
            align: self.align.as_deref().map(|text| value("align", text)).transpose()?,
            rate_hz: self.rate_hz,
            gauge_length_mm: metadata.gauge_length_mm,
            front_end: metadata.front_end,
            joint: metadata.joint,
        })
    }

    /// True if all answers apply to a trace.
    fn is_of_trace(recipe: &Recipe) -> bool {
        let (front_end, joint, gauge_length_mm) = (recipe.front_end, recipe.joint, recipe.gauge_length_mm);
        let mut bare = Recipe { front_end, joint, gauge_length_mm, ..Recipe::default() };
        bare.units.clone_from(&recipe.units);
        bare == *recipe
    }
}

/// Reads the recording in files; returns remarks on the roles of columns and on data left out, one line each.
#[pyfunction]
pub fn read(py: Python, paths: Vec<String>, arguments: Arguments) -> PyResult<(PyRecordBatch, Vec<String>)> {
    let (recipe, metadata) = (arguments.recipe()?, arguments.metadata()?);
    let (trace, remarks) = py.detach(|| match &paths[..] {
        [path] if arguments.units.is_empty() && Arguments::is_of_trace(&recipe) => match trace(path, &metadata)? {
            Some(trace) => Ok((trace, vec![])),
            None => imported(&paths, &recipe),
        },
        _ => imported(&paths, &recipe),
    })?;
    Ok((table(&trace, &paths)?, remarks))
}

fn refused(error: impl std::fmt::Display) -> PyErr {
    raise(&Place::default(), &error.to_string())
}

/// Reads a trace; `None` if the file is something else.
fn trace(path: &str, overrides: &Metadata) -> PyResult<Option<Trace>> {
    let mut file = File::open(path)?;
    let mut head = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut head)?;
    let read = if ParquetText::is_one(&head) {
        let Ok(text) = ParquetText::new(File::open(path)?) else { return Ok(None) };
        let mut metadata = text.metadata().clone();
        metadata.override_with(overrides);
        TraceReader::with_overrides(Box::new(text) as Box<dyn Read>, path, &metadata)
    } else {
        TraceReader::with_overrides(Box::new(Cursor::new(head).chain(file)) as Box<dyn Read>, path, overrides)
    };
    match read.and_then(Trace::collect) {
        Ok(trace) => Ok(Some(trace)),
        Err(TraceError::Content(fault)) if fault.is_foreign => Ok(None),
        Err(error) => Err(refused(error)),
    }
}

/// Number of first bytes by which the kind of a file is recognised.
const HEAD: u64 = 4096;

/// Imports a trace from a lab's files.
fn imported(paths: &[String], recipe: &Recipe) -> PyResult<(Trace, Vec<String>)> {
    let table = |(index, path): (usize, &String)| {
        read_table(std::fs::read(path)?, path, &recipe.read_options(index)).map_err(refused)
    };
    let tables = paths.iter().enumerate().map(table).collect::<PyResult<Vec<_>>>()?;
    let plan = Plan::new(&tables, recipe).map_err(refused)?;
    let imported = plan.import(&tables).map_err(refused)?;
    Ok((imported.trace, imported.remarks))
}

/// Returns its columns in their internal units; the schema's metadata contain its other metadata.
fn table(trace: &Trace, paths: &[String]) -> PyResult<PyRecordBatch> {
    let failed = |error: ArrowError| refused(error);
    let numbers = |values: &[f64]| -> ArrayRef {
        Arc::new(Float64Array::from_iter(values.iter().map(|value| Some(*value).filter(|value| !value.is_nan()))))
    };
    let mut columns = vec![("time_s", numbers(&trace.time_s))];
    columns.push(match (&trace.readings.converter, trace.readings.kind) {
        (Some(converter), _) => {
            ("adc", Arc::new(Float64Array::from_iter(converter.codes.iter().map(|code| code.map(f64::from)))))
        }
        (None, ReadingKind::Ohm) => ("resistance_ohm", numbers(&trace.readings.values)),
        (None, ReadingKind::Ratio) => ("resistance_ratio", numbers(&trace.readings.values)),
    });
    if let Some(reference) = &trace.reference {
        let name = if reference.quantity == ReferenceQuantity::Strain { "strain" } else { "angle_deg" };
        columns.push((name, numbers(&reference.values)));
    }
    columns.extend(trace.temperature_c.as_ref().map(|values| ("temperature_c", numbers(values))));
    let metadata = &trace.metadata;
    let about = About {
        name: Some(paths.join(", ")),
        gauge_length_mm: metadata.gauge_length_mm,
        front_end: metadata.front_end.map(|spec| spec.to_string()),
        joint: metadata.joint.map(|spec| spec.to_string()),
        strain_unit: metadata.strain_unit.map(|unit| unit.name().to_owned()),
        resistance_unit: metadata.resistance_unit.map(|unit| unit.name().to_owned()),
    };
    let about = serde_json::to_string(&about).map_err(refused)?;
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) =
        columns.into_iter().map(|(name, array)| (Field::new(name, array.data_type().clone(), true), array)).unzip();
    let schema = Schema::new_with_metadata(fields, HashMap::from([(ABOUT.to_owned(), about)]));
    Ok(RecordBatch::try_new(Arc::new(schema), arrays).map_err(failed)?.into())
}
