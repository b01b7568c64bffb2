use std::io::Cursor;

use calamine::{Data, Reader, open_workbook_auto_from_rs};
use chrono::{Duration, NaiveDate};

use crate::import::error::ImportError;
use crate::import::grid::Grid;
use crate::import::header::Header;
use crate::import::number::DecimalMark;
use crate::import::questions::quoted;
use crate::import::recipe::ReadOptions;
use crate::import::table::{Layout, Table};

/// Reads a sheet of a workbook: XLSX, XLSM, XLSB, XLS or ODS.
pub(crate) fn read(bytes: Vec<u8>, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let broken =
        |error: &dyn std::fmt::Display| ImportError::unreadable(name, format!("cannot be read as a workbook: {error}"));
    let mut workbook = open_workbook_auto_from_rs(Cursor::new(bytes)).map_err(|error| broken(&error))?;
    let mut found: Vec<(String, Table)> = Vec::new();
    let mut last_error = None;
    let sheets = workbook.sheet_names();
    for sheet in sheets.iter().filter(|sheet| options.sheet.as_ref().is_none_or(|wanted| wanted == *sheet)) {
        let range = workbook.worksheet_range(sheet).map_err(|error| broken(&error))?;
        let first = range.start().map_or(0, |(row, _)| u64::from(row)) + 1;
        let rows = range.rows().zip(first..).map(|(row, number)| (number, row.iter().map(cell).collect::<Vec<_>>()));
        let grid = Grid::Sheet(rows.filter(|(_, row)| row.iter().any(|cell| !cell.is_empty())).collect());
        let decimal = options.decimal.unwrap_or(DecimalMark::Point);
        let layout = Layout { format: format!("workbook, sheet `{sheet}`"), decimal, ..Layout::default() };
        match Header::find(name, &grid, decimal, options.skip.unwrap_or(0)) {
            Ok(header) => found.push((sheet.clone(), Table::of_grid(name, &grid, header, layout))),
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
