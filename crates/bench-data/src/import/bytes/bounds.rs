//! Bounds on what a file may make the program hold: above what a recording needs, below what a computer has.

use crate::import::error::ImportError;

/// Bytes of a file, and of what is packed in it: 1 GiB are thirty million rows.
pub const LARGEST_FILE: u64 = 1 << 30;
/// Unpacked bytes of a workbook: a full sheet of a million rows and a dozen columns.
pub(crate) const LARGEST_WORKBOOK: u64 = 1 << 29;
/// Bytes of a line of text: ten thousand columns.
pub(crate) const LONGEST_LINE: usize = 1 << 18;
/// Cells of a table: as many rows as a recording may have, of four columns.
pub(crate) const MOST_CELLS: usize = 1 << 27;
/// Cells of a workbook, empty ones between others too: a full sheet of a million rows and sixteen columns.
pub(crate) const MOST_SHEET_CELLS: usize = 1 << 24;
/// Columns of a sheet, of the 16384 that there may be: instruments have fewer, and what stands beyond is a stray cell.
pub(crate) const MOST_SHEET_COLUMNS: usize = 1 << 12;
/// Files in a file: `trace.csv.gz.gz` has two.
pub(crate) const MOST_WRAPPINGS: usize = 3;

/// Refuses a table of so many cells.
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

/// Megabytes, for messages.
pub(crate) const fn mib(bytes: u64) -> u64 {
    bytes >> 20
}
