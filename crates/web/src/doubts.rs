//! Late references in the words of the command line, with the flags that answer them.

use ohmstrain::trace::TraceFile;
use ohmstrain::{Interface, LagAnswer};

/// Reports the lag of a reference, and moves it if `align`; returns the lag by which it was moved, s. A lag that is certainly too large is an error.
pub fn on_one_clock(recording: &mut TraceFile, align: bool, warnings: &mut Vec<String>) -> Result<f64, String> {
    let samples = recording.samples().map_err(|error| error.to_string())?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain());
    let name = recording.name.clone();
    let Some(doubt) = known.map_err(|error| error.to_string())?.lag_doubt() else { return Ok(0.0) };
    match doubt.answer(align, Interface::CommandLine) {
        LagAnswer::Move(lag, text) => {
            warnings.push(format!("{name}: {text}"));
            recording.move_reference(lag.lag_s).map_err(|error| error.to_string())?;
            return Ok(lag.lag_s);
        }
        LagAnswer::Refuse(text) => return Err(format!("{name}: {text}")),
        LagAnswer::Warn(text) => warnings.push(format!("{name}: {text}")),
        LagAnswer::Remark(_) => {}
    }
    Ok(0.0)
}
