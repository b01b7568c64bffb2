use std::io;
use std::path::PathBuf;

use serde_json::{Map, Value, json};

use super::journal::Entry;
use crate::args::SummaryForm;
use crate::error::CliError;
use crate::parquet_table::ParquetTable;

/// Separator of several values in one cell.
const BETWEEN: &str = "; ";

/// A cell of the summary.
enum Cell {
    Number(Option<f64>),
    Text(Option<String>),
}

/// Returns the columns of an entry, in order.
fn cells(entry: &Entry) -> Vec<(&'static str, Cell)> {
    let paths =
        |paths: &[PathBuf]| paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(BETWEEN);
    let some = |text: String| Cell::Text(Some(text).filter(|text| !text.is_empty()));
    let figures = &entry.figures;
    vec![
        ("file", some(paths(&entry.files))),
        ("state", some(entry.state.name().to_owned())),
        ("message", some(entry.message.clone())),
        ("warnings", some(entry.warnings.join(BETWEEN))),
        ("exit_code", Cell::Number(entry.exit_code.map(f64::from))),
        ("output", some(paths(std::slice::from_ref(&entry.output)))),
        ("rows", Cell::Number(entry.rows.map(|rows| rows as f64))),
        ("seconds", Cell::Number(Some(entry.seconds))),
        ("filter_percent_fs", Cell::Number(figures.filter_percent_fs)),
        ("smoother_percent_fs", Cell::Number(figures.smoother_percent_fs)),
        ("static_cubic_percent_fs", Cell::Number(figures.static_cubic_percent_fs)),
        ("coverage_95", Cell::Number(figures.coverage_95)),
        ("width_95_percent_fs", Cell::Number(figures.width_95_percent_fs)),
        ("sha256", some(entry.sha256.join(BETWEEN))),
        ("sensor", some(entry.sensor.as_ref().map(|sensor| sensor.display().to_string()).unwrap_or_default())),
        ("sensor_sha256", Cell::Text(entry.sensor_sha256.clone())),
        ("prior_sha256", Cell::Text(entry.prior_sha256.clone())),
        ("output_sha256", Cell::Text(entry.output_sha256.clone())),
        ("command", some(entry.command.clone())),
        ("flags", some(entry.flags.join(" "))),
        ("made_by", some(entry.made_by.clone())),
    ]
}

/// Beginning of the summary's file name.
pub const SUMMARY: &str = "summary";

/// Returns the names of its columns.
pub fn columns() -> Vec<String> {
    cells(&Entry::default()).into_iter().map(|(name, _)| name.to_owned()).collect()
}

/// Returns the summary as text, one row per job.
pub fn text(entries: &[Entry], form: SummaryForm) -> Result<Vec<u8>, CliError> {
    let rows: Vec<_> = entries.iter().map(cells).collect();
    let mut text = Vec::new();
    match form {
        SummaryForm::Csv => csv_of(&mut text, &rows),
        SummaryForm::Json => json_of(&mut text, &rows),
        SummaryForm::Parquet => parquet_of(&mut text, &rows),
    }?;
    Ok(text)
}

type Rows = [Vec<(&'static str, Cell)>];

fn csv_of(out: &mut Vec<u8>, rows: &Rows) -> io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    out.write_record(columns())?;
    for row in rows {
        out.write_record(row.iter().map(|(_, cell)| match cell {
            Cell::Number(number) => number.map(|number| number.to_string()).unwrap_or_default(),
            Cell::Text(text) => text.clone().unwrap_or_default(),
        }))?;
    }
    out.flush()
}

fn json_of(out: &mut Vec<u8>, rows: &Rows) -> io::Result<()> {
    let value = |cell: &Cell| match cell {
        // Counts are integers.
        Cell::Number(Some(number)) if number.fract() == 0.0 => json!(*number as i64),
        Cell::Number(number) => json!(number),
        Cell::Text(text) => json!(text),
    };
    let object = |row: &Vec<(&'static str, Cell)>| {
        row.iter().map(|(name, cell)| ((*name).to_owned(), value(cell))).collect::<Map<String, Value>>()
    };
    Ok(serde_json::to_writer_pretty(out, &rows.iter().map(object).collect::<Vec<_>>())?)
}

fn parquet_of(out: &mut Vec<u8>, rows: &Rows) -> io::Result<()> {
    let cells = cells(&Entry::default());
    let names = cells.iter().map(|(name, cell)| (*name, matches!(cell, Cell::Number(_))));
    let mut out = ParquetTable::new(out, names)?;
    for row in rows {
        for (_, cell) in row {
            match cell {
                Cell::Number(number) => out.number(number.unwrap_or(f64::NAN)),
                Cell::Text(text) => out.text(text.as_deref()),
            }
        }
        out.end()?;
    }
    out.finish().map(drop)
}
