use bytes::Bytes;
use parquet::basic::{LogicalType, TimeUnit};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::schema::types::Type;

use crate::import::bytes::bounds::{LARGEST_FILE, check_cells, mib};
use crate::import::bytes::cell::{Cell, Cells};
use crate::import::error::ImportError;
use crate::metadata::Metadata;
use crate::parquet_text::{broken, metadata_of};

/// A column with a name and a unit from its container.
pub(crate) struct RawColumn {
    pub heading: String,
    /// The unit of the column's type, which is not part of its name.
    pub unit: Option<String>,
    pub cells: Cells,
}

/// Reads the flat columns and the metadata of a Parquet file, however its pages are compressed.
pub(crate) fn read(bytes: Vec<u8>, name: &str) -> Result<(Vec<RawColumn>, Metadata), ImportError> {
    let broken = |error| ImportError::unreadable(name, format!("cannot be read {}", broken(error)));
    let reader = SerializedFileReader::new(Bytes::from(bytes)).map_err(broken)?;
    let described = reader.metadata().file_metadata();
    let metadata = metadata_of(described).map_err(|error| ImportError::unreadable(name, error.to_string()))?;
    let fields = described.schema().get_fields();
    let column =
        |field: &Type| RawColumn { heading: field.name().to_owned(), unit: time_unit(field), cells: Cells::default() };
    let mut columns: Vec<RawColumn> = fields.iter().map(|field| column(field)).collect();
    let (mut rows, mut left) = (0, LARGEST_FILE as usize);
    // A run of equal values takes no more room in the file than a single value.
    for row in reader.get_row_iter(None).map_err(broken)? {
        rows += 1;
        check_cells(name, rows, columns.len())?;
        for (column, (_, field)) in columns.iter_mut().zip(row.map_err(broken)?.get_column_iter()) {
            left = left.checked_sub(column.cells.push_cell(&cell(field))).ok_or_else(|| {
                let most = mib(LARGEST_FILE);
                let what = format!("expected at most {most} MiB of text, found more: take a part of it");
                ImportError::unreadable(name, what)
            })?;
        }
    }
    if rows == 0 {
        return Err(ImportError::unreadable(name, "expected rows of numbers, found none"));
    }
    Ok((columns, metadata))
}

/// Returns the unit of a timestamp or a time of day, which are stored as counts.
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

fn cell(field: &Field) -> Cell<'_> {
    match field {
        Field::Null => Cell::Empty,
        Field::TimestampMillis(count) | Field::TimestampMicros(count) | Field::TimeMicros(count) => Cell::count(*count),
        Field::Long(count) => Cell::count(*count),
        Field::TimeMillis(count) | Field::Int(count) => Cell::Number(f64::from(*count)),
        // Single precision is read by its own shortest decimal digits: 0.1 means 0.1.
        Field::Float(value) => value.to_string().parse().map_or(Cell::Empty, Cell::Number),
        Field::Double(value) => Cell::Number(*value),
        Field::Str(text) => Cell::text(text),
        other => Cell::Text(other.to_string().trim_matches('"').to_owned().into()),
    }
}
