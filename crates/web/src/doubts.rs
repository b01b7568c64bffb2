//! Doubts of the library in the words of the command line: which flag answers them. Refusals are errors, the rest warnings.

use ohmstrain::{CalibrationDoubt, Distrusted, LagDoubt, UnitDoubt, UnitGuess};
use ohmstrain_calib::aligned;

use crate::recording::Recording;

/// Rows named one by one.
const NAMED_ROWS: usize = 5;

/// Warnings of doubts about a calibration; the first one that has to be answered is an error.
pub fn heed(recordings: &[Recording], doubts: &[CalibrationDoubt], warnings: &mut Vec<String>) -> Result<(), String> {
    for doubt in doubts {
        let text = text(recordings, doubt);
        if doubt.is_refusal() {
            return Err(text);
        }
        warnings.push(text);
    }
    Ok(())
}

/// A doubt with the names of its recordings and what answers it.
fn text(recordings: &[Recording], doubt: &CalibrationDoubt) -> String {
    let places = doubt.recordings();
    let names = match places[..] {
        [] => String::new(),
        [one] => format!("{}: ", recordings[one].header),
        _ => places.iter().map(|place| recordings[*place].name.as_str()).collect::<Vec<_>>().join(" and ") + ": ",
    };
    format!("{names}{doubt}{}", answer(doubt))
}

fn answer(doubt: &CalibrationDoubt) -> &'static str {
    match doubt {
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
    }
}

/// Names the rows that took no part in a calibration, the first ones.
pub fn warn_of_distrusted(recordings: &[Recording], rows: &[Distrusted], warnings: &mut Vec<String>) {
    let line = |one: &Distrusted| {
        let recording = &recordings[one.recording];
        let row = recording.first_row + one.row + 1;
        format!("{}: data row {row} ({} s): {}; left out of the calibration", recording.name, one.time_s, one.doubt)
    };
    warnings.extend(rows.iter().take(NAMED_ROWS).map(line));
    if rows.len() > NAMED_ROWS {
        warnings.push(format!("{} more rows are left out; --explain names all", rows.len() - NAMED_ROWS));
    }
}

/// Says how late a reference is, and moves it if that is wanted; by how much, s. One that is certainly too late is an error.
pub fn on_one_clock(recording: &mut Recording, align: bool, warnings: &mut Vec<String>) -> Result<f64, String> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain());
    let doubt = known.map_err(|error| error.to_string())?.lag_doubt();
    let name = recording.name.clone();
    if let Some(lag) = doubt.as_ref().and_then(LagDoubt::lag).filter(|_| align) {
        warnings.push(format!("{name}: the reference is {lag}; it was moved by that"));
        let lag_s = lag.lag_s;
        shift(recording, lag_s)?;
        return Ok(lag_s);
    }
    match doubt {
        None | Some(LagDoubt::Little(_)) => {}
        Some(unknown @ (LagDoubt::OutOfReach { .. } | LagDoubt::Repeats { .. })) => {
            warnings.push(format!("{name}: {unknown}"));
        }
        Some(certain @ LagDoubt::Certain(_)) => {
            return Err(format!("{name}: {certain}; --align moves it to where the readings say it belongs"));
        }
        Some(late) => warnings.push(format!("{name}: {late} --align moves it")),
    }
    Ok(0.0)
}

/// Moves a reference that is late by `lag_s`.
pub fn shift(recording: &mut Recording, lag_s: f64) -> Result<(), String> {
    let moved = aligned(&recording.samples()?, lag_s);
    if let Some(reference) = &mut recording.trace.reference {
        reference.values = moved;
    }
    Ok(())
}

/// A doubt about the unit of readings, with what resolves it.
pub fn answerable(doubt: &UnitDoubt) -> String {
    let answer = match doubt.guess {
        UnitGuess::KiloOhm => {
            "Then say so with `--unit resistance=kohm` or a line `# resistance_unit = kohm` above the header"
        }
        UnitGuess::CalibrationInKiloOhm => "Then calibrate again with `--unit resistance=kohm`",
        UnitGuess::Percent => "The column is a ratio: 110 % is 1.1",
        UnitGuess::Ohm => "Divide them by what the rested sensor reads",
        UnitGuess::Ratio => "The sensor was calibrated in ohms",
        _ => "The column is in ohms",
    };
    format!("{doubt} {answer}")
}
