use bytes::Bytes;
use parquet::basic::{LogicalType, TimeUnit};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::schema::types::Type;

use crate::import::bounds::{LARGEST_FILE, check_cells, mib};
use crate::import::error::ImportError;
use crate::import::names;
use crate::import::table::{Cells, Column, Layout, Table};
use crate::parquet_text::broken;

/// Reads the flat columns of a Parquet file: uncompressed, Snappy or gzip, which is what most programs write.
pub(crate) fn read(bytes: Vec<u8>, name: &str) -> Result<Table, ImportError> {
    let broken = |error| ImportError::unreadable(name, broken(error).to_string());
    let reader = SerializedFileReader::new(Bytes::from(bytes)).map_err(broken)?;
    let fields = reader.metadata().file_metadata().schema().get_fields();
    let mut columns: Vec<Column> = fields.iter().map(|field| column(field)).collect();
    let (mut lines, mut left) = (Vec::new(), LARGEST_FILE as usize);
    // A run of equal values takes no more room in the file than one of them.
    for row in reader.get_row_iter(None).map_err(broken)? {
        lines.push(lines.len() as u64 + 1);
        check_cells(name, lines.len(), columns.len())?;
        for (column, (_, field)) in columns.iter_mut().zip(row.map_err(broken)?.get_column_iter()) {
            let text = cell(field);
            left = left.checked_sub(text.len()).ok_or_else(|| {
                let most = mib(LARGEST_FILE);
                ImportError::unreadable(
                    name,
                    format!("expected at most {most} MiB of text, found more: take a part of it"),
                )
            })?;
            column.cells.push(&text);
        }
    }
    if lines.is_empty() {
        return Err(ImportError::unreadable(name, "expected rows of numbers, found none"));
    }
    let layout = Layout { format: "Parquet".to_owned(), ..Layout::default() };
    Ok(Table { file: name.to_owned(), layout, columns, lines, ..Table::default() })
}

fn column(field: &Type) -> Column {
    let (name, unit) = names::take_apart(field.name());
    Column { name, heading: field.name().to_owned(), unit: time_unit(field).or(unit), cells: Cells::default() }
}

/// The unit of a timestamp or a time of day, which arrive as counts.
fn time_unit(field: &Type) -> Option<String> {
    let unit = match field.get_basic_info().logical_type_ref()? {
        LogicalType::Timestamp(kind) => kind.unit,
        LogicalType::Time(kind) => kind.unit,
        _ => return None,
    };
    let unit = match unit {
        TimeUnit::MILLIS => "ms",
        TimeUnit::MICROS => "us",
        TimeUnit::NANOS => "ns",
    };
    Some(unit.to_owned())
}

fn cell(field: &Field) -> String {
    match field {
        Field::Null => String::new(),
        Field::TimestampMillis(count) | Field::TimestampMicros(count) | Field::TimeMicros(count) => count.to_string(),
        Field::TimeMillis(count) => count.to_string(),
        Field::Float(value) => value.to_string(),
        Field::Double(value) => value.to_string(),
        Field::Str(text) => text.trim().to_owned(),
        other => other.to_string().trim_matches('"').to_owned(),
    }
}
