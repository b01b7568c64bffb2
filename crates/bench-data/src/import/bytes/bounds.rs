//! Bounds on the memory that a file may take up: above what a recording needs, below what a computer has.

use crate::import::error::ImportError;

/// Largest size of a file, and of its unpacked contents, bytes: 1 GiB are thirty million rows.
pub const LARGEST_FILE: u64 = 1 << 30;
/// Largest unpacked size of a workbook, bytes: a full sheet of a million rows and a dozen columns.
pub(crate) const LARGEST_WORKBOOK: u64 = 1 << 29;
/// Longest line of text, bytes: ten thousand columns.
pub(crate) const LONGEST_LINE: usize = 1 << 18;
/// Largest number of cells in a table: as many rows as a recording may have, with four columns.
pub(crate) const MOST_CELLS: usize = 1 << 27;
/// Largest number of cells in a workbook, empty ones in between included: a full sheet of a million rows and sixteen
/// columns.
pub(crate) const MOST_SHEET_CELLS: usize = 1 << 24;
/// Largest number of columns in a sheet, of 16384 possible ones: instruments have fewer, and anything beyond is a stray
/// cell.
pub(crate) const MOST_SHEET_COLUMNS: usize = 1 << 12;
/// Largest number of nested compressions: `trace.csv.gz.gz` has two.
pub(crate) const MOST_WRAPPINGS: usize = 3;

/// Refuses a table with too many cells.
pub(crate) fn check_cells(file: &str, rows: usize, columns: usize) -> Result<(), ImportError> {
    if rows.saturating_mul(columns) <= MOST_CELLS {
        return Ok(());
    }
    let what = format!(
        "expected a table of at most {MOST_CELLS} cells, found {rows} rows of {columns} columns: take a part of it, or \
         fewer columns"
    );
    Err(ImportError::unreadable(file, what))
}

/// Converts bytes to MiB, for messages.
pub(crate) const fn mib(bytes: u64) -> u64 {
    bytes >> 20
}
