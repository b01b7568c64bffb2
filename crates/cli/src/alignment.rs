//! References that are early or late.

use ohmstrain::{Interface, LagAnswer};
use ohmstrain_calib::aligned;

use crate::error::CliError;
use crate::input::TraceFile;
use crate::messages::Messages;

/// Reports the lag of a recording's reference. It moves the reference if `align`, refuses one that certainly lags too much to be used
/// otherwise, and warns of one that probably does; with `explain` it reports a harmless lag, too. Returns the lag by which the
/// reference was moved, s.
pub fn check(recording: &mut TraceFile, align: bool, explain: bool, messages: &Messages) -> Result<f64, CliError> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
    let name = recording.name.clone();
    let Some(doubt) = known.lag_doubt() else { return Ok(0.0) };
    match doubt.answer(align, Interface::CommandLine) {
        LagAnswer::Move(lag, text) => {
            messages.warning(&format!("{name}: {text}"));
            shift(recording, lag.lag_s)?;
            return Ok(lag.lag_s);
        }
        LagAnswer::Refuse(text) => return Err(CliError::Input(format!("{name}: {text}"))),
        LagAnswer::Warn(text) => messages.warning(&format!("{name}: {text}")),
        LagAnswer::Remark(text) if explain => messages.remark(&format!("{name}: {text}")),
        LagAnswer::Remark(text) => messages.detail(&format!("{name}: {text}")),
    }
    Ok(0.0)
}

/// Moves a reference that is late by `lag_s`.
pub fn shift(recording: &mut TraceFile, lag_s: f64) -> Result<(), CliError> {
    let moved = aligned(&recording.samples()?, lag_s);
    if let Some(reference) = &mut recording.trace.reference {
        reference.values = moved;
    }
    Ok(())
}
