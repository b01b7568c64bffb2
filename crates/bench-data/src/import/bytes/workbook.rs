use std::io::Cursor;

use calamine::{Data, Reader, Sheets, XlsxError, open_workbook_from_rs};

use crate::import::bytes::cell::Cell;
use crate::import::bytes::sheet::{Budget, NamedSheets, Sheet};
use crate::import::bytes::xls_size;
use crate::import::bytes::zipped::{self, Kind};
use crate::import::error::ImportError;

/// First bytes of XLS.
pub(crate) const XLS: [u8; 4] = [0xd0, 0xcf, 0x11, 0xe0];

/// Reads all sheets of a workbook, or the requested one: XLSX, XLSM, XLSB, XLS or ODS.
pub(crate) fn read(bytes: &[u8], name: &str, wanted: Option<&str>) -> Result<NamedSheets, ImportError> {
    let broken = |error| ImportError::unreadable(name, format!("cannot be read as a workbook: {error}"));
    let (all, found) = sheets(bytes, wanted).map_err(broken)?;
    if found.is_empty() {
        let all: Vec<String> = all.iter().map(|sheet| format!("`{sheet}`")).collect();
        return Err(ImportError::unreadable(name, format!("expected a sheet that is there, found {}", all.join(", "))));
    }
    Ok(found)
}

/// Returns the names of all sheets, and the rows of the requested ones.
fn sheets(bytes: &[u8], wanted: Option<&str>) -> Result<(Vec<String>, NamedSheets), String> {
    let mut book = open(bytes)?;
    let (all, mut budget, mut found) = (book.sheet_names(), Budget::default(), Vec::new());
    for sheet in all.iter().filter(|sheet| wanted.is_none_or(|wanted| wanted == *sheet)) {
        let rows = read_cells(&mut book, sheet, &mut budget).and_then(|cells| cells.rows(&mut budget));
        found.push((sheet.clone(), rows.map_err(|error| format!("sheet `{sheet}`: {error}"))?));
    }
    Ok((all, found))
}

/// Opens a workbook after checking its size.
fn open(bytes: &[u8]) -> Result<Sheets<Cursor<&[u8]>>, String> {
    let source = Cursor::new(bytes);
    if bytes.starts_with(&XLS) {
        xls_size::check(bytes)?;
        return open_workbook_from_rs(source).map(Sheets::Xls).map_err(words);
    }
    match zipped::kind(bytes)? {
        Kind::Xlsx => open_workbook_from_rs(source).map(Sheets::Xlsx).map_err(words),
        Kind::Xlsb => open_workbook_from_rs(source).map(Sheets::Xlsb).map_err(words),
        Kind::Ods => {
            zipped::check_ods(bytes)?;
            open_workbook_from_rs(source).map(Sheets::Ods).map_err(words)
        }
    }
}

/// Returns the cells of a sheet. A sheet of another kind, such as a chart, has none.
fn read_cells(book: &mut Sheets<Cursor<&[u8]>>, name: &str, budget: &mut Budget) -> Result<Sheet, String> {
    let mut sheet = Sheet::default();
    let range = match book {
        Sheets::Xlsx(book) => {
            let mut cells = match book.worksheet_cells_reader(name) {
                Err(XlsxError::NotAWorksheet(_)) => return Ok(sheet),
                cells => cells.map_err(words)?,
            };
            while let Some(found) = cells.next_cell().map_err(words)? {
                sheet.push(found.get_position(), cell(found.get_value().clone().into()), budget)?;
            }
            return Ok(sheet);
        }
        Sheets::Xlsb(book) => {
            let mut cells = book.worksheet_cells_reader(name).map_err(words)?;
            while let Some(found) = cells.next_cell().map_err(words)? {
                sheet.push(found.get_position(), cell(found.get_value().clone().into()), budget)?;
            }
            return Ok(sheet);
        }
        Sheets::Xls(book) => book.worksheet_range(name).map_err(words)?,
        Sheets::Ods(book) => book.worksheet_range(name).map_err(words)?,
    };
    let (top, left) = range.start().unwrap_or_default();
    for (row, column, value) in range.used_cells() {
        sheet.push((top + row as u32, left + column as u32), cell(value.clone()), budget)?;
    }
    Ok(sheet)
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn cell(data: Data) -> Cell<'static> {
    match data {
        Data::Int(value) => Cell::count(value),
        Data::Float(value) => Cell::Number(value),
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => {
            Cell::Text(text.trim().to_owned().into())
        }
        Data::Bool(value) => Cell::Number(f64::from(u8::from(value))),
        Data::DateTime(time) if time.is_duration() => Cell::Text(elapsed(time.as_f64()).into()),
        Data::DateTime(stamp) => Cell::Date(stamp.as_f64()),
        Data::Error(error) => Cell::Text(error.to_string().into()),
        Data::Empty => Cell::Empty,
    }
}

/// Writes elapsed days as hours, which may be more than 24, minutes and seconds.
fn elapsed(days: f64) -> String {
    let microseconds = (days * 86_400e6).round();
    let (minutes, seconds) = ((microseconds / 60e6).floor(), microseconds.rem_euclid(60e6) / 1e6);
    format!("{}:{:02}:{seconds:09.6}", (minutes / 60.0).floor(), minutes.rem_euclid(60.0))
}
