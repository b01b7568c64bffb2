//! References that are early or late.

use ohmstrain::LagDoubt;
use ohmstrain_calib::aligned;

use crate::error::CliError;
use crate::input::TraceFile;
use crate::messages::Messages;

/// Says how late the reference of a recording is; moves it if that is wanted, refuses one that is certainly too late to be used
/// otherwise, and warns of one that probably is; says how late it is where that does not matter if `explain`. By how much it was
/// moved, s.
pub fn check(recording: &mut TraceFile, align: bool, explain: bool, messages: &Messages) -> Result<f64, CliError> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
    let name = recording.name.clone();
    let doubt = known.lag_doubt();
    if let Some(lag) = doubt.as_ref().and_then(LagDoubt::lag).filter(|_| align) {
        messages.warning(&format!("{name}: the reference is {lag}; it was moved by that"));
        shift(recording, lag.lag_s)?;
        return Ok(lag.lag_s);
    }
    match doubt {
        None => {}
        Some(little @ LagDoubt::Little(_)) if explain => messages.remark(&format!("{name}: {little}")),
        Some(little @ LagDoubt::Little(_)) => messages.detail(&format!("{name}: {little}")),
        Some(unknown @ (LagDoubt::OutOfReach { .. } | LagDoubt::Repeats { .. })) => {
            messages.warning(&format!("{name}: {unknown}"))
        }
        Some(certain @ LagDoubt::Certain(_)) => {
            let answer = "--align moves it to where the readings say it belongs";
            return Err(CliError::Input(format!("{name}: {certain}; {answer}")));
        }
        Some(late) => messages.warning(&format!("{name}: {late} --align moves it")),
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
