//! Contents of a file: gzip unpacked, containers opened, text decoded. Nothing here asks for the meaning of a cell.

pub(crate) mod bounds;
mod cell;
mod compound;
mod parquet;
mod sheet;
pub(crate) mod text;
mod workbook;
mod xls_size;
mod zipped;

use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::ParquetText;
use crate::import::error::ImportError;

use bounds::{LARGEST_FILE, MOST_WRAPPINGS, mib};
pub use cell::Cells;
pub(crate) use cell::{Cell, Rows};
pub(crate) use parquet::RawColumn;
pub(crate) use sheet::NamedSheets;

/// Contents of a file.
pub(crate) enum Contents {
    /// Text and its encoding.
    Text(String, &'static str),
    Sheets(NamedSheets),
    /// Columns, all of them with as many rows.
    Columns(Vec<RawColumn>),
}

/// The contents of a file of any kind, and how often it was packed in gzip. `sheet` is the one wanted of a workbook.
pub(crate) fn open(mut bytes: Vec<u8>, name: &str, sheet: Option<&str>) -> Result<(Contents, usize), ImportError> {
    let mut wrappings = 0;
    while bytes.starts_with(&[0x1f, 0x8b]) {
        wrappings += 1;
        if wrappings > MOST_WRAPPINGS {
            let what = format!("expected gzip data in at most {MOST_WRAPPINGS} wrappings, found more: unpack it first");
            return Err(ImportError::unreadable(name, what));
        }
        bytes = unpacked(&bytes, name)?;
    }
    let contents = if ParquetText::is_one(&bytes) {
        let expected = "cannot be read as Parquet: expected pages of values, found others";
        Contents::Columns(guarded(name, expected, || parquet::read(bytes, name))?)
    } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(&workbook::XLS) {
        let expected = "cannot be read as a workbook: expected records and places in a sheet, found others: save the sheet \
                        with the recording as CSV";
        Contents::Sheets(guarded(name, expected, || workbook::read(&bytes, name, sheet))?)
    } else {
        let binary = "expected text, XLSX or Parquet, perhaps in gzip, found binary data";
        let (text, encoding) = text::decode(bytes).ok_or_else(|| ImportError::unreadable(name, binary))?;
        Contents::Text(text, encoding)
    };
    Ok((contents, wrappings))
}

/// What a library reads of a container. They panic at some that are cut, and at places and sizes that cannot be.
fn guarded<T>(name: &str, expected: &str, read: impl FnOnce() -> Result<T, ImportError>) -> Result<T, ImportError> {
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(ImportError::unreadable(name, expected)))
}

/// Contents of gzip data.
fn unpacked(bytes: &[u8], name: &str) -> Result<Vec<u8>, ImportError> {
    let mut inner = Vec::new();
    let read = flate2::read::MultiGzDecoder::new(bytes).take(LARGEST_FILE + 1).read_to_end(&mut inner);
    read.map_err(|error| ImportError::unreadable(name, format!("expected gzip data, found {error}")))?;
    if inner.len() as u64 <= LARGEST_FILE {
        return Ok(inner);
    }
    let most = mib(LARGEST_FILE);
    let what =
        format!("expected gzip data of at most {most} MiB when unpacked, found more: unpack it, and take a part of it");
    Err(ImportError::unreadable(name, what))
}
