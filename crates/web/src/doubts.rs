//! Doubts of the library in the words of the command line: which flag answers them. Refusals are errors, the rest warnings.

use ohmstrain::{CalibrationDoubt, Distrusted, Interface, LagAnswer};
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

/// A doubt with the names of its recordings.
fn text(recordings: &[Recording], doubt: &CalibrationDoubt) -> String {
    let places = doubt.recordings();
    let names = match places[..] {
        [] => String::new(),
        [one] => format!("{}: ", recordings[one].header),
        _ => places.iter().map(|place| recordings[*place].name.as_str()).collect::<Vec<_>>().join(" and ") + ": ",
    };
    names + &doubt.text(Interface::CommandLine)
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

/// Reports the lag of a reference, and moves it if `align`; returns the lag by which it was moved, s. A lag that is certainly too large is an error.
pub fn on_one_clock(recording: &mut Recording, align: bool, warnings: &mut Vec<String>) -> Result<f64, String> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain());
    let name = recording.name.clone();
    let Some(doubt) = known.map_err(|error| error.to_string())?.lag_doubt() else { return Ok(0.0) };
    match doubt.answer(align, Interface::CommandLine) {
        LagAnswer::Move(lag, text) => {
            warnings.push(format!("{name}: {text}"));
            shift(recording, lag.lag_s)?;
            return Ok(lag.lag_s);
        }
        LagAnswer::Refuse(text) => return Err(format!("{name}: {text}")),
        LagAnswer::Warn(text) => warnings.push(format!("{name}: {text}")),
        LagAnswer::Remark(_) => {}
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
