use std::ops::Range;

use ohmstrain_calib::{CalibrationError, Distrusted, Samples, Stage, screen};
use thiserror::Error;

use super::{TraceFile, TraceFileError, check_alike, known_recordings};
use crate::{
    Calibrated, Calibration, CalibrationDoubt, Error, Interface, Kept, Sensor, Tested, calibration_doubts,
    motion_doubts,
};

/// Number of excluded rows that are named one by one.
const NAMED_ROWS: usize = 5;

/// Reason why recordings do not give a sensor.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A recording does not suit a calibration.
    #[error(transparent)]
    File(#[from] TraceFileError),
    /// A doubt that needs an answer, with the names of its recordings.
    #[error("{0}")]
    Doubt(String),
    /// The calibration failed on the recordings of these names.
    #[error("{0}: {1}")]
    Calibration(String, CalibrationError),
    /// The library refused a recording, an option or the resulting sensor.
    #[error(transparent)]
    Library(#[from] Error),
}

impl Refusal {
    /// Creates the error of a calibration that failed on the contents of `files`.
    #[must_use]
    pub fn calibration(files: &[&str], error: CalibrationError) -> Self {
        let files = match error {
            CalibrationError::TooFewRows { recording, .. } => files[recording].to_owned(),
            _ => files.join(", "),
        };
        Self::Calibration(files, error)
    }
}

/// Calibrates a sensor on recordings: untrustworthy rows are left out first, and doubts are raised. `warn` receives warnings in
/// the words of the command line, `progress` each stage.
///
/// # Errors
/// If a recording is invalid or differs from the first in unit or quantity, if a doubt needs an answer, or as
/// [`Calibration::run`].
pub fn calibrate(
    recordings: &[TraceFile],
    calibration: Calibration,
    mut warn: impl FnMut(String),
    progress: impl FnMut(Stage),
) -> Result<Calibrated, Refusal> {
    let samples: Vec<Samples> = recordings.iter().map(TraceFile::samples).collect::<Result<_, _>>()?;
    check_alike(recordings)?;
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let failed = |error| Refusal::calibration(&names, error);
    let as_read = known_recordings(recordings, &samples)?;
    refuse_or_warn(recordings, &motion_doubts(&as_read), &mut warn)?;
    let screened = screen(&samples).map_err(failed)?;
    let samples = screened.samples();
    let known = known_recordings(recordings, &samples)?;
    refuse_or_warn(recordings, &calibration_doubts(&known), &mut warn)?;
    first_distrusted_rows(&screened.distrusted, recordings).into_iter().for_each(&mut warn);
    let calibrated = calibration.run_with(&known, progress).map_err(|error| match error {
        Error::Calibration(error) => failed(error),
        other => other.into(),
    })?;
    refuse_or_warn(recordings, &calibrated.doubts(), &mut warn)?;
    Ok(calibrated)
}

/// Scores a calibrated sensor on the rows that were kept from its calibration; see [`Sensor::tested_on`]. Each item is a whole
/// recording, its rows in the calibration, and the lag by which their reference was moved, s.
///
/// # Errors
/// If a recording has no reference or an invalid row, or the resulting sensor is invalid.
pub fn tested_on(
    sensor: Sensor,
    recordings: impl Iterator<Item = (TraceFile, Range<usize>, f64)>,
) -> Result<(Sensor, Option<Tested>), Refusal> {
    let mut kept = Vec::new();
    for (mut whole, seen, lag_s) in recordings {
        whole.move_reference(lag_s)?;
        kept.push((whole.at_reference_temperature(&sensor).into_owned(), seen));
    }
    let rows: Vec<_> = kept.iter().map(|(whole, _)| |row| whole.known_row(row)).collect();
    let kept =
        kept.iter().zip(&rows).map(|((whole, seen), row)| Kept { len: whole.trace.len(), row, seen: seen.clone() });
    Ok(sensor.tested_on(&kept.collect::<Vec<_>>())?)
}

/// Refuses the first doubt that needs an answer, and warns of those before it.
fn refuse_or_warn(
    recordings: &[TraceFile],
    doubts: &[CalibrationDoubt],
    mut warn: impl FnMut(String),
) -> Result<(), Refusal> {
    let name = |place: &usize| recordings[*place].name.as_str();
    for doubt in doubts {
        let names = match &doubt.recordings()[..] {
            [] => String::new(),
            [one] if matches!(doubt, CalibrationDoubt::Percent { .. }) => {
                format!("{}: ", recordings[*one].reference_header)
            }
            [one] => format!("{}: ", recordings[*one].header),
            several => several.iter().map(name).collect::<Vec<_>>().join(" and ") + ": ",
        };
        let text = names + &doubt.text(Interface::CommandLine);
        if doubt.is_refusal() {
            return Err(Refusal::Doubt(text));
        }
        warn(text);
    }
    Ok(())
}

/// Lists the rows that are excluded from a calibration.
pub fn distrusted_rows(rows: &[Distrusted], recordings: &[TraceFile]) -> Vec<String> {
    let line = |one: &Distrusted| {
        let file = &recordings[one.recording];
        let row = file.first_row + one.row + 1;
        format!("{}: data row {row} ({} s): {}; left out of the calibration", file.name, one.time_s, one.doubt)
    };
    rows.iter().map(line).collect()
}

/// Lists the first of them, and the number of the others.
fn first_distrusted_rows(rows: &[Distrusted], recordings: &[TraceFile]) -> Vec<String> {
    let (first, more) = rows.split_at(rows.len().min(NAMED_ROWS));
    let rest = (!more.is_empty()).then(|| format!("{} more rows are left out; --explain names all", more.len()));
    distrusted_rows(first, recordings).into_iter().chain(rest).collect()
}
