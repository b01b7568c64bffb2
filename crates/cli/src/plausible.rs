//! Doubts about the recordings of a calibration: some are refused, others warned of.

use ohmstrain::trace::{TraceFile, doubt_text, first_distrusted_rows};
use ohmstrain::{CalibrationDoubt, Distrusted};

use crate::error::CliError;
use crate::messages::Messages;

/// Refuses doubts that need an answer, and warns of the others.
pub fn refuse_or_warn(
    recordings: &[TraceFile],
    doubts: &[CalibrationDoubt],
    messages: &Messages,
) -> Result<(), CliError> {
    for doubt in doubts {
        let text = doubt_text(doubt, recordings);
        if doubt.is_refusal() {
            return Err(CliError::Input(text));
        }
        messages.warning(&text);
    }
    Ok(())
}

/// Names the first rows that are excluded from a calibration.
pub fn warn_of_distrusted(recordings: &[TraceFile], rows: &[Distrusted], messages: &Messages) {
    first_distrusted_rows(rows, recordings).iter().for_each(|line| messages.warning(line));
}
