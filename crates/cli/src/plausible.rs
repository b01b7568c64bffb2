//! What the command line says to doubts about the recordings of a calibration: which flag, or which line of a file, answers them.

use ohmstrain::CalibrationDoubt;
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

/// A doubt with the names of its recordings and what answers it.
fn text(recordings: &[TraceFile], doubt: &CalibrationDoubt) -> String {
    let places = doubt.recordings();
    let names = match places[..] {
        [] => String::new(),
        [one] => format!("{}: ", recordings[one].header),
        _ => places.iter().map(|place| recordings[*place].name.as_str()).collect::<Vec<_>>().join(" and ") + ": ",
    };
    let answer = match doubt {
        CalibrationDoubt::Percent { .. } => {
            "; if they are in percent, say so with `--unit strain=percent` or a line `# strain_unit = percent` above the header, \
             if not with `fraction`"
        }
        CalibrationDoubt::KiloOhm { .. } => {
            "; if they are in kilo-ohms, say so with `--unit resistance=kohm` or a line `# resistance_unit = kohm` above the \
             header, if not with `ohm`"
        }
        CalibrationDoubt::ReadingsApart { .. } => " Then put `# resistance_unit = kohm` above its header",
        CalibrationDoubt::ReferencesApart { .. } => " Then put `# strain_unit = percent` above its header",
        CalibrationDoubt::Exchanged { .. } => "; if they are, exchange their names in the header",
        CalibrationDoubt::Frozen { .. } => {
            "; leave that part out with `--from` and `--until`, or empty those cells of the reference"
        }
        CalibrationDoubt::Turned { .. } => {
            "; if it has, change it, if not say so with `--unit strain=fraction` or a line `# strain_unit = fraction` above the header"
        }
        CalibrationDoubt::TurnedApart { .. } => " Change it",
        CalibrationDoubt::Milliseconds { .. } => {
            "; if they are, divide them by 1000, if not say so with a line `# time_unit = s` above the header"
        }
        CalibrationDoubt::Widened { .. } => " (--explain)",
        _ => "",
    };
    format!("{names}{doubt}{answer}")
}

/// Says which rows took no part in a calibration; the first ones, or all of them.
pub fn distrusted(recordings: &[TraceFile], distrusted: &[Distrusted]) -> Vec<String> {
    let line = |one: &Distrusted| {
        let recording = &recordings[one.recording];
        let row = recording.first_row + one.row + 1;
        format!("{}: data row {row} ({} s): {}; left out of the calibration", recording.name, one.time_s, one.doubt)
    };
    distrusted.iter().map(line).collect()
}

/// The same on stderr, the first ones.
pub fn warn_of_distrusted(recordings: &[TraceFile], rows: &[Distrusted], messages: &Messages) {
    let lines = distrusted(recordings, rows);
    lines.iter().take(NAMED_ROWS).for_each(|line| messages.warning(line));
    if lines.len() > NAMED_ROWS {
        messages.warning(&format!("{} more rows are left out; --explain names all", lines.len() - NAMED_ROWS));
    }
}
