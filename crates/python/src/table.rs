use std::sync::Arc;

use arrow_array::builder::StringBuilder;
use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_buffer::{BooleanBuffer, NullBuffer};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use ohmstrain::{Column, Estimate};
use pyo3::prelude::*;
use pyo3_arrow::PyRecordBatch;

use crate::error::{Place, raise};

/// Estimates under construction, column by column; unknown cells are null.
#[derive(Debug)]
pub struct Estimates {
    columns: Vec<Column>,
    /// NaN for unknown values; empty for flags.
    numbers: Vec<Vec<f64>>,
    flags: Vec<ohmstrain::Flags>,
}

impl Estimates {
    /// Allocates estimates for this number of rows.
    pub fn new(columns: Vec<Column>, rows: usize) -> Self {
        let room = |column: &Column| if column.is_flags() { vec![] } else { vec![f64::NAN; rows] };
        let numbers = columns.iter().map(room).collect();
        Self { columns, numbers, flags: vec![ohmstrain::Flags::NONE; rows] }
    }

    /// Stores rows from `first` on.
    pub fn put(&mut self, first: usize, rows: &[Estimate]) {
        for (column, numbers) in self.columns.iter().zip(&mut self.numbers) {
            if let Some(cells) = numbers.get_mut(first..first + rows.len()) {
                cells.iter_mut().zip(rows).for_each(|(cell, row)| *cell = column.number(row));
            }
        }
        if let Some(flags) = self.flags.get_mut(first..first + rows.len()) {
            flags.iter_mut().zip(rows).for_each(|(flags, row)| *flags = row.flags);
        }
    }

    /// Converts it to a table of one batch, which Arrow's Python handles faster than several.
    pub fn into_batch(self) -> PyResult<PyRecordBatch> {
        let failed = |error: ArrowError| raise(&Place::default(), &error.to_string());
        let (mut fields, mut arrays): (Vec<Field>, Vec<ArrayRef>) = (Vec::new(), Vec::new());
        for (column, numbers) in self.columns.iter().zip(self.numbers) {
            let kind = if column.is_flags() { DataType::Utf8 } else { DataType::Float64 };
            fields.push(Field::new(column.name(), kind, !column.is_flags()));
            arrays.push(if column.is_flags() { texts(&self.flags) } else { nullable(numbers) });
        }
        Ok(RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(failed)?.into())
    }
}

fn nullable(numbers: Vec<f64>) -> ArrayRef {
    // Mostly all values are known.
    let unknown = numbers.iter().fold(false, |unknown, number| unknown | number.is_nan());
    let known = unknown.then(|| BooleanBuffer::collect_bool(numbers.len(), |row| !numbers[row].is_nan()));
    Arc::new(Float64Array::new(numbers.into(), known.map(NullBuffer::new)))
}

fn texts(flags: &[ohmstrain::Flags]) -> ArrayRef {
    let mut texts = StringBuilder::with_capacity(flags.len(), flags.len());
    for flags in flags {
        // Mostly there are no flags.
        if *flags == ohmstrain::Flags::NONE { texts.append_value("") } else { texts.append_value(flags.to_string()) }
    }
    Arc::new(texts.finish())
}
