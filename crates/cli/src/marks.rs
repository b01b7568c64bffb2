//! Files of marks: strains that are known at times, in place of a reference.

use std::path::Path;

use csv::{Position, Reader, StringRecord};
use ohmstrain::trace::TraceFile;
use ohmstrain::{CalibrationError, Error, Mark, MarkedReference, MarksError};
use ohmstrain_bench_data::{Reference, ReferenceQuantity};

use crate::error::CliError;
use crate::whole_file;

/// Columns of a file of marks, with that of the strain's standard deviation.
const STRAINS: [(&str, &str, ReferenceQuantity); 2] =
    [("strain", "strain_sd", ReferenceQuantity::Strain), ("angle_deg", "angle_sd", ReferenceQuantity::AngleDeg)];

/// Marks of one recording, as a file has them.
pub struct MarksFile {
    name: String,
    quantity: ReferenceQuantity,
    marks: Vec<Mark>,
    /// The line of each mark.
    lines: Vec<u64>,
}

impl MarksFile {
    /// Reads a CSV with the columns `time_s`, `strain` (or `angle_deg`) and, if there are any, `until_s` and `strain_sd` (`angle_sd`).
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let name = path.display().to_string();
        let wrong = |error: csv::Error| CliError::Input(format!("{name}: {error}"));
        let text = whole_file::text(path)?;
        let mut rows = Reader::from_reader(text.as_bytes());
        let header = rows.headers().map_err(wrong)?.clone();
        let columns = Columns::find(&header).ok_or_else(|| {
            let found = header.iter().collect::<Vec<_>>().join(",");
            CliError::Input(format!(
                "{name}:1: expected the columns `time_s`, `strain` (or `angle_deg`) and, if known, `until_s` and \
                 `strain_sd` (or `angle_sd`), found `{found}`"
            ))
        })?;
        let mut file = Self { name: name.clone(), quantity: columns.quantity, marks: Vec::new(), lines: Vec::new() };
        for row in rows.records() {
            let row = row.map_err(wrong)?;
            let line = row.position().map_or(0, Position::line);
            file.marks.push(columns.mark(&row).map_err(|text| CliError::Input(format!("{name}:{line}: {text}")))?);
            file.lines.push(line);
        }
        Ok(file)
    }

    /// A fault with the file and the line that it is about.
    fn named(&self, source: &MarksError) -> CliError {
        let line = source.mark().and_then(|mark| self.lines.get(mark)).map_or(String::new(), |line| format!(":{line}"));
        CliError::Input(format!("{}{line}: {source}", self.name))
    }
}

/// Places of the columns.
struct Columns {
    time: usize,
    until: Option<usize>,
    strain: usize,
    strain_name: &'static str,
    sd: Option<usize>,
    sd_name: &'static str,
    quantity: ReferenceQuantity,
}

impl Columns {
    fn find(header: &StringRecord) -> Option<Self> {
        let place = |name: &str| header.iter().position(|column| column.trim() == name);
        let of_quantity = |(strain_name, sd_name, quantity): &(&'static str, &'static str, ReferenceQuantity)| {
            let (strain, sd) = (place(strain_name)?, place(sd_name));
            let (time, until) = (place("time_s")?, place("until_s"));
            Some(Self { time, until, strain, strain_name, sd, sd_name, quantity: *quantity })
        };
        STRAINS.iter().find_map(of_quantity)
    }

    /// A row's mark. An empty cell of an optional column stands for nothing known.
    fn mark(&self, row: &StringRecord) -> Result<Mark, String> {
        let cell = |place: usize| row.get(place).unwrap_or("").trim();
        let number = |place: usize, name: &str| {
            cell(place).parse().map_err(|_| format!("column `{name}`: expected a number, found `{}`", cell(place)))
        };
        let optional = |place: Option<usize>, name: &str| {
            place.filter(|place| !cell(*place).is_empty()).map(|place| number(place, name)).transpose()
        };
        let mark = Mark::new(number(self.time, "time_s")?, number(self.strain, self.strain_name)?);
        Ok(Mark { until_s: optional(self.until, "until_s")?, strain_sd: optional(self.sd, self.sd_name)?, ..mark })
    }
}

/// Gives recordings the references that their marks make; says what those are.
pub fn take(recordings: &mut [TraceFile], files: &[MarksFile]) -> Result<Vec<String>, CliError> {
    if files.len() != recordings.len() {
        return Err(CliError::Arguments(format!(
            "--marks: expected one file for each of {} recordings, in their order, found {}",
            recordings.len(),
            files.len()
        )));
    }
    let known = recordings.iter().map(|recording| {
        let trace = &recording.trace;
        ohmstrain::Recording::new(&trace.time_s, &trace.readings.values, &trace.time_s)
    });
    let known = known.collect::<Result<Vec<_>, _>>()?;
    let marks: Vec<Vec<Mark>> = files.iter().map(|file| file.marks.clone()).collect();
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let found = ohmstrain::marked_references(&known, &marks).map_err(|error| match error {
        Error::Calibration(CalibrationError::Marks { recording, source }) => files[recording].named(&source),
        Error::Calibration(error) => CliError::calibration(&names, &error),
        other => other.into(),
    })?;
    let remarks = found.iter().zip(files).map(|(found, file)| file.remark(found)).collect();
    for ((recording, found), file) in recordings.iter_mut().zip(found).zip(files) {
        recording.trace.reference = Some(Reference { quantity: file.quantity, values: found.strain });
        recording.reference_sd = found.strain_sd;
    }
    Ok(remarks)
}

impl MarksFile {
    /// Sentence on the reference that was found.
    fn remark(&self, found: &MarkedReference) -> String {
        let marks = self.marks.iter().map(|mark| mark.strain);
        let (low, high) = marks.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let known = || found.strain_sd.iter().filter(|sd| sd.is_finite());
        let variance = known().map(|sd| sd * sd).sum::<f64>() / known().count().max(1) as f64;
        format!(
            "{}: {} marks, held at {}; {} of {} moves at a pace of their own; the reference between them is good to {:.1} % of the marks' span",
            self.name,
            self.marks.len(),
            found.holds,
            found.irregular,
            found.moves,
            100.0 * variance.sqrt() / (high - low)
        )
    }
}
