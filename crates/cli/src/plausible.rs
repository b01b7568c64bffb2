//! Doubts about the recordings of a calibration, refused or warned of.

use ohmstrain::{CalibrationDoubt, Interface};
use ohmstrain_calib::Distrusted;

use crate::error::CliError;
use crate::input::TraceFile;
use crate::messages::Messages;

/// Rows named one by one.
const NAMED_ROWS: usize = 5;

/// Refuses what has to be answered, warns of the rest.
pub fn heed(recordings: &[TraceFile], doubts: &[CalibrationDoubt], messages: &Messages) -> Result<(), CliError> {
    for doubt in doubts {
        let text = text(recordings, doubt);
        if doubt.is_refusal() {
            return Err(CliError::Input(text));
        }
        messages.warning(&text);
    }
    Ok(())
}

/// A doubt with the names of its recordings.
fn text(recordings: &[TraceFile], doubt: &CalibrationDoubt) -> String {
    let places = doubt.recordings();
    let names = match places[..] {
        [] => String::new(),
        [one] => format!("{}: ", recordings[one].header),
        _ => places.iter().map(|place| recordings[*place].name.as_str()).collect::<Vec<_>>().join(" and ") + ": ",
    };
    names + &doubt.text(Interface::CommandLine)
}

/// Lists the rows that took no part in a calibration; the first ones, or all of them.
pub fn distrusted(recordings: &[TraceFile], distrusted: &[Distrusted]) -> Vec<String> {
    let line = |one: &Distrusted| {
        let recording = &recordings[one.recording];
        let row = recording.first_row + one.row + 1;
        format!("{}: data row {row} ({} s): {}; left out of the calibration", recording.name, one.time_s, one.doubt)
    };
    distrusted.iter().map(line).collect()
}

/// Prints the first of them on stderr.
pub fn warn_of_distrusted(recordings: &[TraceFile], rows: &[Distrusted], messages: &Messages) {
    let lines = distrusted(recordings, rows);
    lines.iter().take(NAMED_ROWS).for_each(|line| messages.warning(line));
    if lines.len() > NAMED_ROWS {
        messages.warning(&format!("{} more rows are left out; --explain names all", lines.len() - NAMED_ROWS));
    }
}
