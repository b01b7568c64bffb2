use std::io::Write;

use ohmstrain::{Column, Estimate, Flag, Flags, Sensor};
use ohmstrain_bench_data::RowWriter;

use crate::args::Format;
use crate::error::CliError;
use crate::parquet_table::ParquetTable;

/// Writer of estimates: one row per reading, with empty cells for unknown values.
pub struct EstimateWriter<W: Write + Send> {
    rows: RowSink<W>,
    columns: Vec<Column>,
    count: u64,
}

enum RowSink<W: Write + Send> {
    Csv(RowWriter<W>),
    Parquet(Box<ParquetTable<W>>),
}

impl<W: Write + Send> EstimateWriter<W> {
    /// Writes the header of `columns`.
    pub fn new(out: W, format: Format, columns: Vec<Column>) -> Result<Self, CliError> {
        let rows = match format {
            Format::Csv => {
                let mut rows = RowWriter::new(out);
                columns.iter().for_each(|column| rows.text(column.name()));
                rows.end()?;
                RowSink::Csv(rows)
            }
            Format::Parquet => {
                let named = columns.iter().map(|column| (column.name(), !column.is_flags()));
                RowSink::Parquet(Box::new(ParquetTable::new(out, named)?))
            }
        };
        Ok(Self { rows, columns, count: 0 })
    }

    /// Writes one row.
    pub fn write(&mut self, row: &Estimate) -> Result<(), CliError> {
        let number = |column: &Column| column.number(row);
        self.count += 1;
        write_row(&mut self.rows, &self.columns, number, row.flags)
    }

    /// Writes one row that [`Packed`] has packed.
    fn write_packed(&mut self, row: &[u8]) -> Result<(), CliError> {
        let (numbers, flags) = row.split_at(row.len().saturating_sub(FLAG_BYTES));
        let mut numbers = numbers.as_chunks::<NUMBER_BYTES>().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
        let bits = flags.iter().rev().fold(0, |bits, byte| bits << 8 | u16::from(*byte));
        let flags =
            Flag::ALL.into_iter().fold(Flags::NONE, |flags, flag| flags.with(flag, bits >> flag as u16 & 1 == 1));
        self.count += 1;
        write_row(&mut self.rows, &self.columns, |_| numbers.next().unwrap_or(f64::NAN), flags)
    }

    /// Passes everything written so far on to the reader, as far as the format allows.
    pub fn flush(&mut self) -> Result<(), CliError> {
        match &mut self.rows {
            RowSink::Csv(rows) => Ok(rows.flush()?),
            RowSink::Parquet(_) => Ok(()),
        }
    }

    /// Writes the end, and returns the number of rows.
    pub fn finish(self) -> Result<u64, CliError> {
        match self.rows {
            RowSink::Csv(mut rows) => rows.flush()?,
            RowSink::Parquet(rows) => rows.finish()?.flush()?,
        }
        Ok(self.count)
    }
}

/// Writes one row, calling `number` for each column in order.
fn write_row<W: Write + Send>(
    rows: &mut RowSink<W>,
    columns: &[Column],
    mut number: impl FnMut(&Column) -> f64,
    flags: Flags,
) -> Result<(), CliError> {
    for column in columns {
        let value = number(column);
        match (&mut *rows, column.is_flags()) {
            (RowSink::Csv(rows), true) => rows.words(flags.names()),
            (RowSink::Csv(rows), false) => rows.number(value),
            (RowSink::Parquet(rows), true) => rows.text(Some(&flags.to_string())),
            (RowSink::Parquet(rows), false) => rows.number(value),
        }
    }
    Ok(match rows {
        RowSink::Csv(rows) => rows.end(),
        RowSink::Parquet(rows) => rows.end(),
    }?)
}

const NUMBER_BYTES: usize = size_of::<f64>();
const FLAG_BYTES: usize = size_of::<u16>();

/// Packer of rows into bytes of equal length: the numbers of some columns, then the flags.
pub struct Packed {
    columns: Vec<Column>,
}

impl Packed {
    /// Creates a packer for these columns.
    pub const fn new(columns: Vec<Column>) -> Self {
        Self { columns }
    }

    /// Returns the length of a row in bytes.
    pub fn row_len(&self) -> usize {
        self.columns.len() * NUMBER_BYTES + FLAG_BYTES
    }

    /// Appends a row.
    pub fn push(&self, row: &Estimate, out: &mut Vec<u8>) {
        for column in &self.columns {
            out.extend(column.number(row).to_le_bytes());
        }
        let bits = Flag::ALL.into_iter().fold(0_u16, |bits, flag| bits | u16::from(row.flags.has(flag)) << flag as u16);
        out.extend(bits.to_le_bytes());
    }

    /// Writes packed rows.
    pub fn unpack<W: Write + Send>(&self, rows: &[u8], writer: &mut EstimateWriter<W>) -> Result<(), CliError> {
        rows.chunks_exact(self.row_len()).try_for_each(|row| writer.write_packed(row))
    }
}

/// Returns the requested columns of a sensor's estimates; all if none is named.
pub fn columns(sensor: &Sensor, chosen: &[String]) -> Result<Vec<Column>, CliError> {
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
