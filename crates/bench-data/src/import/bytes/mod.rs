//! Contents of a file: gzip is unpacked, containers are opened, text is decoded. The meaning of cells is not considered here.

mod archive;
pub(crate) mod bounds;
mod cell;
mod compound;
mod foreign;
mod json;
mod numpy;
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
use crate::metadata::Metadata;
use crate::parquet_text::DAMAGED;

use bounds::{LARGEST_FILE, MOST_WRAPPINGS, mib};
pub use cell::Cells;
pub(crate) use cell::{Cell, Rows};
pub(crate) use json::{Json, values as json_values};
pub(crate) use parquet::RawColumn;
pub(crate) use sheet::NamedSheets;

/// Contents of a file.
pub(crate) enum Contents {
    /// Text and its encoding.
    Text(String, &'static str),
    Sheets(NamedSheets),
    /// Columns, all with the same number of rows, the metadata, and the name of the container.
    Columns(Vec<RawColumn>, Metadata, &'static str),
}

/// Returns the contents of a file of any kind, and a prefix for its packing, such as `gzip, `. `sheet` is the requested sheet of a
/// workbook, or the requested file of an archive.
pub(crate) fn open(mut bytes: Vec<u8>, name: &str, sheet: Option<&str>) -> Result<(Contents, String), ImportError> {
    let mut wrappings = Vec::new();
    loop {
        if wrappings.len() > MOST_WRAPPINGS {
            let what = format!("expected gzip data in at most {MOST_WRAPPINGS} wrappings, found more: unpack it first");
            return Err(ImportError::unreadable(name, what));
        }
        if bytes.starts_with(&[0x1f, 0x8b]) {
            bytes = unpacked(&bytes, name)?;
            wrappings.push("gzip, ");
        } else if bytes.starts_with(PK) && zipped::is_archive(&bytes) {
            let broken = "cannot be read as a zip archive: expected files, found others";
            // The request for a file of an archive is not one for a sheet in that file.
            let wanted = sheet.filter(|_| !wrappings.contains(&ZIP));
            match guarded(name, broken, || archive::read(&bytes, name, wanted))? {
                archive::Packed::File(file) => bytes = file,
                archive::Packed::Arrays(columns) => {
                    return Ok((Contents::Columns(columns, Metadata::default(), "NumPy"), wrappings.concat()));
                }
            }
            wrappings.push(ZIP);
        } else {
            return Ok((contents(bytes, name, sheet)?, wrappings.concat()));
        }
    }
}

/// Format prefix of a file in a zip archive.
const ZIP: &str = "zip, ";
/// First bytes of a zip container.
const PK: &[u8] = b"PK\x03\x04";

const NO_WORKBOOK: &str = "cannot be read as a workbook: expected records and places in a sheet, found others: save the sheet \
                           with the recording as CSV";

/// Returns the contents of a file that is not packed.
fn contents(bytes: Vec<u8>, name: &str, sheet: Option<&str>) -> Result<Contents, ImportError> {
    if ParquetText::is_one(&bytes) {
        let expected = format!("cannot be read {DAMAGED}");
        let (columns, metadata) = guarded(name, &expected, || parquet::read(bytes, name))?;
        return Ok(Contents::Columns(columns, metadata, "Parquet"));
    }
    if bytes.starts_with(PK) || bytes.starts_with(&workbook::XLS) {
        return guarded(name, NO_WORKBOOK, || workbook::read(&bytes, name, sheet)).map(Contents::Sheets);
    }
    if bytes.starts_with(numpy::MAGIC) {
        let columns = numpy::columns(&bytes, "").map_err(|error| ImportError::unreadable(name, error))?;
        return Ok(Contents::Columns(columns, Metadata::default(), "NumPy"));
    }
    if let Some(refusal) = foreign::refusal(&bytes, name) {
        return Err(ImportError::unreadable(name, refusal));
    }
    let binary = "expected text, XLSX or Parquet, perhaps in gzip, found binary data";
    let (text, encoding) = text::decode(bytes).ok_or_else(|| ImportError::unreadable(name, binary))?;
    Ok(Contents::Text(text, encoding))
}

/// Calls a library that reads a container. Libraries panic on some truncated containers, and on impossible places and sizes.
fn guarded<T>(name: &str, expected: &str, read: impl FnOnce() -> Result<T, ImportError>) -> Result<T, ImportError> {
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(ImportError::unreadable(name, expected)))
}

/// Unpacks gzip data.
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
