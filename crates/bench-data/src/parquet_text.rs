use std::fs::File;
use std::io::{self, Cursor, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use parquet::errors::ParquetError;
use parquet::file::metadata::FileMetaData;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::reader::RowIter;
use parquet::record::{Field, Row};
use parquet::schema::types::Type;

use crate::columns::Column;
use crate::metadata::Metadata;
use crate::rows::append_number;

/// First bytes of a Parquet file.
const MAGIC: &[u8; 4] = b"PAR1";
/// Number of rows that are converted to text at once.
const ROWS_AT_ONCE: usize = 256;
/// Longest text in a cell, bytes. Only numbers have a meaning, and messages are shorter.
const LONGEST_TEXT: usize = 1024;

/// A trace in a Parquet file as the text of the equivalent trace CSV: line 1 is the header, data row k is line k + 1.
///
/// The file is read page by page, whatever its size and compression (Snappy, Zstandard, LZ4, gzip, brotli). Columns without a meaning in a
/// trace are skipped unread. Numbers are unchanged.
///
/// ```no_run
/// use ohmstrain_bench_data::{ParquetText, TraceReader};
/// let text = ParquetText::new(std::fs::File::open("trace.parquet")?)?;
/// let metadata = text.metadata().clone();
/// for row in TraceReader::with_overrides(text, "trace.parquet", &metadata)? {
///     println!("{}", row?.reading.value);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ParquetText {
    rows: RowIter<'static>,
    metadata: Metadata,
    /// True for each column of the file that is read, in its order.
    is_read: Vec<bool>,
    pending: Cursor<Vec<u8>>,
}

impl ParquetText {
    /// True if the first bytes are those of a Parquet file.
    #[must_use]
    pub fn is_one(head: &[u8]) -> bool {
        head.starts_with(MAGIC)
    }

    /// Reads schema and metadata of a file.
    ///
    /// # Errors
    /// If it is not a Parquet file, or its metadata on the recording are invalid.
    pub fn new(file: File) -> io::Result<Self> {
        let reader = guarded(|| SerializedFileReader::new(file).map_err(broken))?;
        let described = reader.metadata().file_metadata();
        let metadata = metadata_of(described)?;
        let is_known =
            |field: &Type| field.is_primitive() && Column::ALL.iter().any(|known| known.name() == field.name().trim());
        let root = described.schema().name().to_owned();
        let fields = described.schema().get_fields();
        let is_read = fields.iter().map(|field| is_known(field)).collect();
        let wanted = fields.iter().filter(|field| is_known(field)).map(Arc::clone).collect();
        let mut header = Vec::new();
        for field in fields {
            push_text(field.name(), &mut header);
            header.push(b',');
        }
        end_line(&mut header);
        // The name of a schema's root depends on the program that wrote the file.
        let wanted = Type::group_type_builder(&root).with_fields(wanted).build().map_err(broken)?;
        let rows = RowIter::from_file_into(Box::new(reader)).project(Some(wanted)).map_err(broken)?;
        Ok(Self { rows, metadata, is_read, pending: Cursor::new(header) })
    }

    /// Returns the recording's metadata from the file's key-value metadata: the keys of a trace CSV.
    #[must_use]
    pub const fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Returns the text of some more rows; empty at the end.
    fn more(&mut self, mut text: Vec<u8>) -> io::Result<Vec<u8>> {
        text.clear();
        for _ in 0..ROWS_AT_ONCE {
            let Some(row) = guarded(|| self.rows.next().transpose().map_err(broken))? else { break };
            push_row(&row, &self.is_read, &mut text);
        }
        Ok(text)
    }
}

impl Read for ParquetText {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.pending.position() == self.pending.get_ref().len() as u64 {
            let text = std::mem::take(self.pending.get_mut());
            self.pending = Cursor::new(self.more(text)?);
        }
        self.pending.read(out)
    }
}

/// Returns the recording's metadata: those pairs whose key has a meaning in a trace.
pub(crate) fn metadata_of(described: &FileMetaData) -> io::Result<Metadata> {
    let mut metadata = Metadata::default();
    let is_known = |key: &str| Metadata::KEYS.contains(&key) || key == Metadata::TIME_UNIT;
    for pair in described.key_value_metadata().into_iter().flatten() {
        if let Some(value) = pair.value.as_ref().filter(|_| is_known(&pair.key)) {
            let taken = metadata.take_line(&format!("# {} = {value}", pair.key));
            taken.map_err(|fault| {
                io::Error::new(
                    io::ErrorKind::InvalidData,
                    format!("expected {}, found {}", fault.expected, fault.found),
                )
            })?;
        }
    }
    Ok(metadata)
}

fn push_row(row: &Row, is_read: &[bool], out: &mut Vec<u8>) {
    let mut cells = row.get_column_iter();
    for is_read in is_read {
        if let Some((_, cell)) = is_read.then(|| cells.next()).flatten() {
            push_cell(cell, out);
        }
        out.push(b',');
    }
    end_line(out);
}

fn push_cell(cell: &Field, out: &mut Vec<u8>) {
    match cell {
        Field::Null => {}
        Field::Double(value) if value.is_finite() => append_number(out, *value),
        Field::Double(value) => out.extend(value.to_string().bytes()),
        // Single precision is written by its own shortest decimal digits: 0.1 means 0.1.
        Field::Float(value) => out.extend(value.to_string().bytes()),
        Field::Str(text) => push_text(text, out),
        other => push_text(&other.to_string(), out),
    }
}

/// Appends text as a cell on one line, in quotation marks if it needs them.
fn push_text(text: &str, out: &mut Vec<u8>) {
    let text = text.trim();
    let text = text.chars().take(LONGEST_TEXT).collect::<String>().replace(char::is_control, " ");
    if text.contains([',', '"']) {
        out.extend(format!("\"{}\"", text.replace('"', "\"\"")).bytes());
    } else {
        out.extend(text.bytes());
    }
}

/// Replaces the comma after the last cell by a line end.
fn end_line(out: &mut [u8]) {
    if let Some(last) = out.last_mut() {
        *last = b'\n';
    }
}

/// Calls the library, which panics on some damaged files.
fn guarded<T>(read: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let damaged = |_| Err(io::Error::new(io::ErrorKind::InvalidData, DAMAGED));
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(damaged)
}

/// Message on a file on which the library has panicked.
pub(crate) const DAMAGED: &str = "as Parquet: expected pages of values, found others";

/// Returns the error for a file that is not Parquet, or another kind of it.
pub(crate) fn broken(error: ParquetError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("as Parquet: {error}"))
}
