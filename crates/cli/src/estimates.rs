use std::io::Write;

use ohmstrain::{Column, Estimate, Sensor};
use ohmstrain_bench_data::RowWriter;

use crate::error::CliError;

/// Writes `estimates.csv`: one row per reading, cells that are not known left empty.
pub struct EstimateWriter<W: Write> {
    rows: RowWriter<W>,
    columns: Vec<Column>,
}

impl<W: Write> EstimateWriter<W> {
    /// Writes the header. `chosen` are the columns wanted, all if empty.
    pub fn new(out: W, sensor: &Sensor, chosen: &[String]) -> Result<Self, CliError> {
        let columns = columns(sensor, chosen)?;
        let mut rows = RowWriter::new(out);
        columns.iter().for_each(|column| rows.text(column.name()));
        rows.end()?;
        Ok(Self { rows, columns })
    }

    /// Writes one row.
    pub fn write(&mut self, row: &Estimate) -> Result<(), CliError> {
        for column in &self.columns {
            if column.is_flags() {
                self.rows.words(row.flags.names());
            } else {
                self.rows.number(column.number(row));
            }
        }
        Ok(self.rows.end()?)
    }

    /// Hands everything written so far on to the reader.
    pub fn flush(&mut self) -> Result<(), CliError> {
        Ok(self.rows.flush()?)
    }

    /// What is written to.
    pub const fn get_mut(&mut self) -> &mut W {
        self.rows.get_mut()
    }

    /// What was written to, without a flush.
    pub fn into_inner(self) -> W {
        self.rows.into_inner()
    }
}

/// The columns of a sensor that are wanted.
fn columns(sensor: &Sensor, chosen: &[String]) -> Result<Vec<Column>, CliError> {
    let known = sensor.columns();
    if chosen.is_empty() {
        return Ok(known);
    }
    let column = |name: &String| {
        known.iter().copied().find(|column| column.name() == name).ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(Column::name).collect();
            CliError::Arguments(format!("--columns: expected some of {}, found `{name}`", names.join(",")))
        })
    };
    chosen.iter().map(column).collect()
}
