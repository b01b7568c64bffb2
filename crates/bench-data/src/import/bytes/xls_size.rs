//! Counts the cells of an XLS workbook, whose reader allocates memory for all cells between the first and the last one.

use crate::import::bytes::compound;
use crate::import::bytes::sheet::{Budget, TooMuch, check_size};

/// Types of records: start of a sheet, begin and end of a part, and the extent of a sheet.
const SHEET: u16 = 0x0085;
const BEGIN: u16 = 0x0809;
const END: u16 = 0x000a;
const EXTENT: u16 = 0x0200;
/// Types of records with a cell, which begin with its row and column; the last one holds several cells.
const CELLS: [u16; 8] = [0x0006, 0x0203, 0x0204, 0x0205, 0x00d6, 0x00fd, 0x027e, SEVERAL];
const SEVERAL: u16 = 0x00bd;
/// Largest number of rows and columns in a sheet of this kind.
const ROWS: u32 = 1 << 16;
const COLUMNS: u32 = 1 << 8;

/// Refuses a workbook whose sheets are, or claim to be, too large.
pub(crate) fn check(bytes: &[u8]) -> Result<(), TooMuch> {
    let Some(stream) = compound::stream(bytes, &["Workbook", "Book"])? else {
        return Err(
            "expected a workbook in the compound file, found none; if it is protected, take the password off".into()
        );
    };
    let mut budget = Budget::default();
    let starts = Record::all(&stream).take_while(|record| record.kind != END).filter(|record| record.kind == SHEET);
    for start in starts.filter_map(|record| record.long(0)) {
        let sheet =
            stream.get(start as usize..).ok_or("expected a sheet in the workbook, found its place beyond the end")?;
        check_sheet(sheet, &mut budget)?;
    }
    Ok(())
}

fn check_sheet(sheet: &[u8], budget: &mut Budget) -> Result<(), TooMuch> {
    let (mut depth, mut first, mut last) = (0_usize, (u32::MAX, u32::MAX), (0, 0));
    let mut far = (0, 0);
    for record in Record::all(sheet) {
        match record.kind {
            BEGIN => depth += 1,
            END if depth <= 1 => break,
            END => depth -= 1,
            // Charts within a sheet have their own cells.
            _ if depth > 1 => {}
            EXTENT => check_extent(&record)?,
            kind if CELLS.contains(&kind) => {
                let Some((row, column)) = record.short(0).zip(record.short(2)) else { continue };
                let end = record.data.len().checked_sub(2).and_then(|at| record.short(at));
                let end = end.filter(|_| kind == SEVERAL).unwrap_or(column).max(column);
                if end > last.1 {
                    far = (row, end);
                }
                first = (row.min(first.0), column.min(first.1));
                last = (row.max(last.0), end.max(last.1));
            }
            _ => {}
        }
    }
    if first.0 > last.0 {
        return Ok(());
    }
    let (height, width) = ((last.0 - first.0 + 1) as usize, (last.1 - first.1 + 1) as usize);
    check_size(far, height, width)?;
    budget.take(height * width, 0)
}

/// Checks the stated extent of a sheet, for which memory is allocated before any cell is read.
fn check_extent(record: &Record) -> Result<(), TooMuch> {
    let long = (record.long(0), record.long(4), record.short(8), record.short(10));
    let short = (record.short(0), record.short(2), record.short(4), record.short(6));
    let (rows, columns) = match (long, short) {
        ((Some(top), Some(bottom), Some(left), Some(right)), _) if record.data.len() >= 14 => {
            (top..bottom, left..right)
        }
        (_, (Some(top), Some(bottom), Some(left), Some(right))) => (top..bottom, left..right),
        _ => return Ok(()),
    };
    // An empty sheet ends before its first row.
    let fits = |range: &std::ops::Range<u32>, most| range.end == 0 || (range.start..=most).contains(&range.end);
    if fits(&rows, ROWS) && fits(&columns, COLUMNS) {
        return Ok(());
    }
    Err(format!(
        "expected a sheet of at most {ROWS} rows and {COLUMNS} columns, found rows {rows:?} and columns {columns:?}"
    ))
}

/// A record: a type, a length, and that many bytes.
struct Record<'a> {
    kind: u16,
    data: &'a [u8],
}

impl<'a> Record<'a> {
    /// Returns the records of a stream, up to its end or to a truncated one.
    fn all(stream: &'a [u8]) -> impl Iterator<Item = Self> {
        let mut rest = stream;
        std::iter::from_fn(move || {
            let ([a, b, c, d], behind) = rest.split_first_chunk()?;
            let (data, next) = behind.split_at_checked(usize::from(u16::from_le_bytes([*c, *d])))?;
            rest = next;
            Some(Self { kind: u16::from_le_bytes([*a, *b]), data })
        })
    }

    fn short(&self, at: usize) -> Option<u32> {
        self.data.get(at..)?.first_chunk().map(|bytes| u32::from(u16::from_le_bytes(*bytes)))
    }

    fn long(&self, at: usize) -> Option<u32> {
        self.data.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
    }
}
