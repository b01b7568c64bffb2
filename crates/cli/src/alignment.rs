//! References that are early or late.

use ohmstrain::trace::TraceFile;
use ohmstrain::{Interface, LagAnswer};

use crate::error::CliError;
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
            recording.move_reference(lag.lag_s)?;
            return Ok(lag.lag_s);
        }
        LagAnswer::Refuse(text) => return Err(CliError::Input(format!("{name}: {text}"))),
        LagAnswer::Warn(text) => messages.warning(&format!("{name}: {text}")),
        LagAnswer::Remark(text) if explain => messages.remark(&format!("{name}: {text}")),
        LagAnswer::Remark(text) => messages.detail(&format!("{name}: {text}")),
    }
    Ok(0.0)
}
