//! Tables as Parquet: optional columns of numbers and of text, row by row.

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as PhysicalType};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use ohmstrain::MADE_BY;

/// Number of rows that are buffered until they are written.
const ROWS_AT_ONCE: usize = 1 << 16;

/// Writer of a table. Cells arrive row by row, in the order of the columns.
pub struct ParquetTable<W: Write + Send> {
    out: SerializedFileWriter<W>,
    columns: Vec<Cells>,
    /// Index of the column of the next cell.
    next: usize,
}

/// Buffered cells, with definition level 0 for each unknown one.
enum Cells {
    Numbers(Vec<f64>, Vec<i16>),
    Words(Vec<ByteArray>, Vec<i16>),
}

impl<W: Write + Send> ParquetTable<W> {
    /// Creates a table; each column has a name and is numeric if true.
    pub fn new<'a>(out: W, columns: impl Iterator<Item = (&'a str, bool)>) -> io::Result<Self> {
        let (mut fields, mut cells) = (Vec::new(), Vec::new());
        for (name, is_number) in columns {
            let physical = if is_number { PhysicalType::DOUBLE } else { PhysicalType::BYTE_ARRAY };
            let logical = (!is_number).then_some(LogicalType::String);
            let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
            fields.push(Arc::new(field.with_logical_type(logical).build().map_err(failed)?));
            cells.push(if is_number { Cells::Numbers(vec![], vec![]) } else { Cells::Words(vec![], vec![]) });
        }
        let schema = Type::group_type_builder("schema").with_fields(fields).build().map_err(failed)?;
        let properties =
            WriterProperties::builder().set_compression(Compression::SNAPPY).set_created_by(MADE_BY.to_owned());
        let out = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties.build())).map_err(failed)?;
        Ok(Self { out, columns: cells, next: 0 })
    }

    /// Appends a cell with a number; an empty one for NaN.
    pub fn number(&mut self, value: f64) {
        if let Some(Cells::Numbers(values, levels)) = self.columns.get_mut(self.next) {
            levels.push(i16::from(!value.is_nan()));
            values.extend((!value.is_nan()).then_some(value));
        }
        self.next += 1;
    }

    /// Appends a cell with text, or an empty one.
    pub fn text(&mut self, text: Option<&str>) {
        if let Some(Cells::Words(values, levels)) = self.columns.get_mut(self.next) {
            levels.push(i16::from(text.is_some()));
            values.extend(text.map(ByteArray::from));
        }
        self.next += 1;
    }

    /// Ends the row.
    pub fn end(&mut self) -> io::Result<()> {
        self.next = 0;
        let rows = self.columns.first().map_or(0, Cells::len);
        if rows < ROWS_AT_ONCE { Ok(()) } else { self.write_rows() }
    }

    /// Writes the end of the table.
    pub fn finish(mut self) -> io::Result<W> {
        self.write_rows()?;
        self.out.into_inner().map_err(failed)
    }

    fn write_rows(&mut self) -> io::Result<()> {
        if self.columns.first().map_or(0, Cells::len) == 0 {
            return Ok(());
        }
        let mut group = self.out.next_row_group().map_err(failed)?;
        for cells in &mut self.columns {
            cells.write(&mut group).map_err(failed)?;
        }
        group.close().map(drop).map_err(failed)
    }
}

impl Cells {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(_, levels) | Self::Words(_, levels) => levels.len(),
        }
    }

    /// Writes all buffered cells.
    fn write<W: Write + Send>(&mut self, group: &mut SerializedRowGroupWriter<W>) -> Result<(), ParquetError> {
        let Some(mut column) = group.next_column()? else { return Ok(()) };
        match self {
            Self::Numbers(values, levels) => {
                column.typed::<DoubleType>().write_batch(values, Some(levels), None)?;
                values.clear();
                levels.clear();
            }
            Self::Words(values, levels) => {
                column.typed::<ByteArrayType>().write_batch(values, Some(levels), None)?;
                values.clear();
                levels.clear();
            }
        }
        column.close()
    }
}

/// Returns the error of the underlying writer, so that a closed pipe stays one.
fn failed(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
