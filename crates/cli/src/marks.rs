//! Strains known at certain times, in place of a reference: from files of marks, or from the recordings themselves.

use std::path::{Path, PathBuf};

use csv::{Position, Reader, StringRecord};
use ohmstrain::trace::{Marked, TraceFile, take_marks};
use ohmstrain::{CalibrationError, Error, Mark};
use ohmstrain_bench_data::ReferenceQuantity;

use crate::error::CliError;
use crate::whole_file;

/// Columns of a file of marks: strain, and its standard deviation.
const STRAINS: [(&str, &str, ReferenceQuantity); 2] =
    [("strain", "strain_sd", ReferenceQuantity::Strain), ("angle_deg", "angle_sd", ReferenceQuantity::AngleDeg)];

/// Reads the marks of a recording from a CSV file with the columns `time_s`, `strain` (or `angle_deg`) and, optionally,
/// `until_s` and `strain_sd` (`angle_sd`).
fn read(path: &Path, recording: usize) -> Result<Marked, CliError> {
    let name = path.display().to_string();
    let wrong = |error: csv::Error| CliError::Input(format!("{name}: {error}"));
    let text = whole_file::text(path)?;
    let mut rows = Reader::from_reader(text.as_bytes());
    let header = rows.headers().map_err(wrong)?.clone();
    let columns = Columns::find(&header).ok_or_else(|| {
        let found = header.iter().collect::<Vec<_>>().join(",");
        CliError::Input(format!(
            "{name}:1: expected the columns `time_s`, `strain` (or `angle_deg`) and, if known, `until_s`, \
             `strain_sd` (or `angle_sd`) and `time_sd_s`, found `{found}`"
        ))
    })?;
    let (mut marks, mut lines) = (Vec::new(), Vec::new());
    for row in rows.records() {
        let row = row.map_err(wrong)?;
        let line = row.position().map_or(0, Position::line);
        marks.push(columns.mark(&row).map_err(|text| CliError::Input(format!("{name}:{line}: {text}")))?);
        lines.push(line);
    }
    Ok(Marked { recording, name, quantity: columns.quantity, marks, lines })
}

/// Indices of the columns.
struct Columns {
    time: usize,
    until: Option<usize>,
    strain: usize,
    strain_name: &'static str,
    sd: Option<usize>,
    time_sd: Option<usize>,
    sd_name: &'static str,
    quantity: ReferenceQuantity,
}

impl Columns {
    fn find(header: &StringRecord) -> Option<Self> {
        let place = |name: &str| header.iter().position(|column| column.trim() == name);
        let of_quantity = |(strain_name, sd_name, quantity): &(&'static str, &'static str, ReferenceQuantity)| {
            let (strain, sd) = (place(strain_name)?, place(sd_name));
            let (time, until, time_sd) = (place("time_s")?, place("until_s"), place("time_sd_s"));
            Some(Self { time, until, strain, strain_name, sd, sd_name, time_sd, quantity: *quantity })
        };
        STRAINS.iter().find_map(of_quantity)
    }

    /// Returns the mark of a row. An empty cell of an optional column is an unknown value.
    fn mark(&self, row: &StringRecord) -> Result<Mark, String> {
        let cell = |place: usize| row.get(place).unwrap_or("").trim();
        let number = |place: usize, name: &str| {
            cell(place).parse().map_err(|_| format!("column `{name}`: expected a number, found `{}`", cell(place)))
        };
        let optional = |place: Option<usize>, name: &str| {
            place.filter(|place| !cell(*place).is_empty()).map(|place| number(place, name)).transpose()
        };
        let mark = Mark::new(number(self.time, "time_s")?, number(self.strain, self.strain_name)?);
        Ok(Mark {
            until_s: optional(self.until, "until_s")?,
            strain_sd: optional(self.sd, self.sd_name)?,
            time_sd_s: optional(self.time_sd, "time_sd_s")?,
            ..mark
        })
    }
}

/// Returns the marks of recordings: from files, one per recording, or else from the recordings themselves.
pub fn of_recordings(recordings: &[TraceFile], files: &[PathBuf]) -> Result<Vec<Marked>, CliError> {
    if files.is_empty() {
        let own = recordings.iter().enumerate().filter_map(|(place, recording)| Marked::of_trace(place, recording));
        return Ok(own.collect());
    }
    if files.len() != recordings.len() {
        return Err(CliError::Arguments(format!(
            "--marks: expected one file for each of {} recordings, in their order, found {}",
            recordings.len(),
            files.len()
        )));
    }
    files.iter().enumerate().map(|(place, path)| read(path, place)).collect()
}

/// Turns the marks of recordings into references, and describes these.
pub fn take(recordings: &mut [TraceFile], marked: &[Marked]) -> Result<Vec<String>, CliError> {
    let names: Vec<String> = marked.iter().map(|one| recordings[one.recording].name.clone()).collect();
    let found = take_marks(recordings, marked).map_err(|error| match error {
        Error::Calibration(CalibrationError::Marks { recording, source }) => {
            CliError::Input(marked[recording].fault(&source))
        }
        Error::Calibration(error) => {
            CliError::calibration(&names.iter().map(String::as_str).collect::<Vec<_>>(), error)
        }
        other => other.into(),
    })?;
    Ok(marked.iter().zip(found).map(|(one, found)| one.remark(&found)).collect())
}
