use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use calamine::{Data, DataRef, Ods, Range, Reader, Xls, Xlsb, Xlsx, XlsxError, open_workbook_from_rs};
use chrono::{Duration, NaiveDate};

use crate::import::error::ImportError;
use crate::import::grid::Grid;
use crate::import::header::Header;
use crate::import::number::DecimalMark;
use crate::import::questions::quoted;
use crate::import::recipe::ReadOptions;
use crate::import::sheet::{Budget, Sheet};
use crate::import::table::{Layout, Table};
use crate::import::zipped::{self, Kind};
use crate::import::{ods_size, xls_size};

/// What XLS begins with.
pub(crate) const XLS: [u8; 4] = [0xd0, 0xcf, 0x11, 0xe0];

/// Reads a sheet of a workbook: XLSX, XLSM, XLSB, XLS or ODS.
pub(crate) fn read(bytes: &[u8], name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    // calamine panics at some records that are cut, and at places in a sheet that cannot be.
    catch_unwind(AssertUnwindSafe(|| read_sheet(bytes, name, options))).unwrap_or_else(|_| {
        let what = "cannot be read as a workbook: expected records and places in a sheet, found others: save the sheet with \
                    the recording as CSV";
        Err(ImportError::unreadable(name, what))
    })
}

fn read_sheet(bytes: &[u8], name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let broken = |error: String| ImportError::unreadable(name, format!("cannot be read as a workbook: {error}"));
    let mut workbook = Workbook::open(bytes).map_err(broken)?;
    let mut found: Vec<(String, Table)> = Vec::new();
    let mut last_error = None;
    let (sheets, mut budget) = (workbook.sheet_names(), Budget::default());
    for sheet in sheets.iter().filter(|sheet| options.sheet.as_ref().is_none_or(|wanted| wanted == *sheet)) {
        let of_sheet = |error: String| broken(format!("sheet `{sheet}`: {error}"));
        let cells = workbook.sheet(sheet, &mut budget).map_err(of_sheet)?;
        let grid = Grid::Sheet(cells.rows(&mut budget).map_err(of_sheet)?);
        let decimal = options.decimal.unwrap_or(DecimalMark::Point);
        let layout = Layout { format: format!("workbook, sheet `{sheet}`"), decimal, ..Layout::default() };
        let table = Header::find(name, &grid, decimal, options.skip.unwrap_or(0))
            .and_then(|header| Table::of_grid(name, &grid, header, layout));
        match table {
            Ok(table) => found.push((sheet.clone(), table)),
            Err(error) => last_error = Some(error),
        }
    }
    match (found.len(), last_error) {
        (1, _) => Ok(found.remove(0).1),
        (0, Some(error)) => Err(error),
        (0, None) => {
            let all: Vec<String> = sheets.iter().map(|sheet| format!("`{sheet}`")).collect();
            Err(ImportError::unreadable(name, format!("expected a sheet that is there, found {}", all.join(", "))))
        }
        _ => {
            let answers = found.iter().map(|(sheet, _)| format!("--sheet {}", quoted(sheet)));
            Err(ImportError::question(name, "several sheets have rows of numbers", answers))
        }
    }
}

/// A workbook of which nothing is read before its size is known.
enum Workbook<'a> {
    Xls(Xls<Cursor<&'a [u8]>>),
    Xlsx(Xlsx<Cursor<&'a [u8]>>),
    Xlsb(Xlsb<Cursor<&'a [u8]>>),
    Ods(Ods<Cursor<&'a [u8]>>),
}

impl<'a> Workbook<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let source = Cursor::new(bytes);
        if bytes.starts_with(&XLS) {
            xls_size::check(bytes)?;
            return open_workbook_from_rs(source).map(Self::Xls).map_err(words);
        }
        match zipped::kind(bytes)? {
            Kind::Xlsx => open_workbook_from_rs(source).map(Self::Xlsx).map_err(words),
            Kind::Xlsb => open_workbook_from_rs(source).map(Self::Xlsb).map_err(words),
            Kind::Ods => {
                ods_size::check(bytes)?;
                open_workbook_from_rs(source).map(Self::Ods).map_err(words)
            }
        }
    }

    fn sheet_names(&self) -> Vec<String> {
        match self {
            Self::Xls(book) => book.sheet_names(),
            Self::Xlsx(book) => book.sheet_names(),
            Self::Xlsb(book) => book.sheet_names(),
            Self::Ods(book) => book.sheet_names(),
        }
    }

    /// The cells of a sheet. A sheet of another kind, such as a chart, has none.
    fn sheet(&mut self, name: &str, budget: &mut Budget) -> Result<Sheet, String> {
        let mut sheet = Sheet::default();
        match self {
            Self::Xls(book) => fill(&mut sheet, &book.worksheet_range(name).map_err(words)?, budget)?,
            Self::Ods(book) => fill(&mut sheet, &book.worksheet_range(name).map_err(words)?, budget)?,
            Self::Xlsx(book) => {
                let mut cells = match book.worksheet_cells_reader(name) {
                    Err(XlsxError::NotAWorksheet(_)) => return Ok(sheet),
                    cells => cells.map_err(words)?,
                };
                while let Some(cell) = cells.next_cell().map_err(words)? {
                    push(&mut sheet, cell.get_position(), cell.get_value(), budget)?;
                }
            }
            Self::Xlsb(book) => {
                let mut cells = book.worksheet_cells_reader(name).map_err(words)?;
                while let Some(cell) = cells.next_cell().map_err(words)? {
                    push(&mut sheet, cell.get_position(), cell.get_value(), budget)?;
                }
            }
        }
        Ok(sheet)
    }
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn push(sheet: &mut Sheet, place: (u32, u32), value: &DataRef, budget: &mut Budget) -> Result<(), String> {
    match value {
        DataRef::Empty => Ok(()),
        value => sheet.push(place, cell(&value.clone().into()), budget),
    }
}

fn fill(sheet: &mut Sheet, range: &Range<Data>, budget: &mut Budget) -> Result<(), String> {
    let (top, left) = range.start().unwrap_or_default();
    range
        .used_cells()
        .try_for_each(|(row, column, value)| sheet.push((top + row as u32, left + column as u32), cell(value), budget))
}

/// A cell as text that reads back as the same number.
fn cell(data: &Data) -> String {
    match data {
        Data::Int(value) => value.to_string(),
        Data::Float(value) => value.to_string(),
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => text.trim().to_owned(),
        Data::Bool(value) => u8::from(*value).to_string(),
        Data::DateTime(stamp) => moment(stamp.as_f64()),
        Data::Error(error) => error.to_string(),
        Data::Empty => String::new(),
    }
}

/// Days since the end of 1899 as a date with a time of day, or as a time of day if they are less than one. To the
/// microsecond: a 64-bit number of days tells no more.
fn moment(days: f64) -> String {
    let microseconds = (days * 86_400e6).round() as i64;
    // The day that spreadsheets count too many, 29 February 1900, lies before everything that is recorded.
    let epoch = NaiveDate::from_ymd_opt(1899, 12, 30).and_then(|date| date.and_hms_opt(0, 0, 0));
    match epoch.and_then(|epoch| epoch.checked_add_signed(Duration::microseconds(microseconds))) {
        Some(moment) if days >= 1.0 => moment.format("%Y-%m-%d %H:%M:%S%.6f").to_string(),
        Some(moment) => moment.format("%H:%M:%S%.6f").to_string(),
        None => days.to_string(),
    }
}
