//! Strains known at certain times, in place of a reference: from files of marks, or from the recordings themselves.

use std::path::{Path, PathBuf};

use csv::{Reader, StringRecord};
use ohmstrain::trace::{self, Marked, TraceFile, take_marks};
use ohmstrain::{CalibrationError, Error, Mark};
use ohmstrain_bench_data::{ReferenceQuantity, SpecError, StrainUnit, counted};

use crate::error::CliError;
use crate::messages::Messages;
use crate::whole_file;

/// Columns of a file of marks: strain, and its standard deviation.
const STRAINS: [(&str, &str, ReferenceQuantity); 2] =
    [("strain", "strain_sd", ReferenceQuantity::Strain), ("angle_deg", "angle_sd", ReferenceQuantity::AngleDeg)];

/// Reads the marks of a recording from a CSV file with the columns `time_s`, `strain` (or `angle_deg`) and, optionally,
/// `until_s` and `strain_sd` (`angle_sd`), and converts them. A line `# strain_unit = percent` above the header counts
/// before `unit`, and this before the unit of the recording.
fn read(
    path: &Path,
    (place, recording): (usize, &mut TraceFile),
    unit: Option<StrainUnit>,
) -> Result<Marked, CliError> {
    let name = path.display().to_string();
    let wrong = |error: csv::Error| CliError::Input(format!("{name}: {error}"));
    let whole = whole_file::text(path)?;
    let (above, text) = above(&whole);
    let header_line = above.len() as u64 + 1;
    let own_unit = above.iter().zip(1..).find_map(|(line, number)| {
        let (key, value) = line.trim_start_matches('#').split_once('=')?;
        let wrong = |error: SpecError| CliError::Input(format!("{name}:{number}: {error}"));
        (key.trim() == "strain_unit").then(|| value.trim().parse::<StrainUnit>().map_err(wrong))
    });
    let mut rows = Reader::from_reader(text.as_bytes());
    let header = rows.headers().map_err(wrong)?.clone();
    let columns = Columns::find(&header).ok_or_else(|| {
        let found = header.iter().collect::<Vec<_>>().join(",");
        CliError::Input(format!(
            "{name}:{header_line}: expected the columns `time_s`, `strain` (or `angle_deg`) and, if known, `until_s`, \
             `strain_sd` (or `angle_sd`) and `time_sd_s`, found `{found}`"
        ))
    })?;
    let (mut marks, mut lines) = (Vec::new(), Vec::new());
    for row in rows.records() {
        let row = row.map_err(wrong)?;
        let line = header_line - 1 + whole_file::line(text, &row);
        marks.push(columns.mark(&row).map_err(|text| CliError::Input(format!("{name}:{line}: {text}")))?);
        lines.push(line);
    }
    let header = trace::header(&name, header_line);
    let marked = Marked { recording: place, name, header, quantity: columns.quantity, marks, lines };
    let metadata = &mut recording.trace.metadata;
    let unit = own_unit.transpose()?.or(unit).or(metadata.strain_unit);
    // Marks become the reference, in fractions.
    metadata.strain_unit = unit.map(|_| StrainUnit::Fraction);
    Ok(marked.of_recording(metadata, unit)?)
}

/// Splits a file into the lines `# key = value` and the rest.
fn above(text: &str) -> (Vec<&str>, &str) {
    let above: Vec<&str> = text.split_inclusive('\n').take_while(|line| line.starts_with('#')).collect();
    (above.clone(), text.split_at(above.iter().map(|line| line.len()).sum()).1)
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

/// Returns the marks of recordings: from files, one per recording and with strains in `unit`, or else from the recordings
/// themselves.
pub fn of_recordings(
    recordings: &mut [TraceFile],
    files: &[PathBuf],
    unit: Option<StrainUnit>,
) -> Result<Vec<Marked>, CliError> {
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
    files.iter().zip(recordings.iter_mut().enumerate()).map(|(path, recording)| read(path, recording, unit)).collect()
}

/// Drops the marks of `whole` that are not within the rows of it that are used, and cuts those that reach beyond them.
pub fn within(marked: &mut Marked, used: &TraceFile, whole: &TraceFile, messages: &Messages) {
    let ends = |of: &TraceFile| of.trace.time_s.first().copied().zip(of.trace.time_s.last().copied());
    let (Some((first_s, last_s)), Some((from_s, until_s))) = (ends(used), ends(whole)) else { return };
    let is_dropped = |mark: &Mark| {
        let (start_s, end_s) = (mark.time_s, mark.until_s.unwrap_or(mark.time_s));
        (from_s <= start_s && end_s < first_s) || (last_s < start_s && end_s <= until_s)
    };
    let is_kept: Vec<bool> = marked.marks.iter().map(|mark| !is_dropped(mark)).collect();
    let (mut of_marks, mut of_lines) = (is_kept.iter().copied(), is_kept.iter().copied());
    marked.marks.retain(|_| of_marks.next() == Some(true));
    marked.lines.retain(|_| of_lines.next() == Some(true));
    for mark in &mut marked.marks {
        if mark.until_s.is_some_and(|end_s| end_s <= until_s) {
            mark.until_s = mark.until_s.map(|end_s| end_s.min(last_s));
        }
        if from_s <= mark.time_s && mark.until_s.is_some() {
            mark.time_s = mark.time_s.max(first_s);
        }
    }
    let dropped = is_kept.iter().filter(|is_kept| !**is_kept).count();
    if dropped > 0 {
        let (marks, name) = (counted(dropped, "mark"), &marked.name);
        messages.remark(&format!("{name}: {marks} outside of the rows of the calibration left out"));
    }
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
