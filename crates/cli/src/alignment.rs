//! References that are early or late.

use ohmstrain_calib::aligned;

use crate::error::CliError;
use crate::input::Recording;

/// Says how late the reference of a recording is; moves it if that is wanted, and refuses one that is too late to be used
/// otherwise.
pub fn check(recording: &mut Recording, align: bool) -> Result<(), CliError> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
    let Some(lag) = known.reference_lag() else { return Ok(()) };
    let name = recording.name.clone();
    let late = format!("{:.2} s {}", lag.lag_s.abs(), if lag.lag_s < 0.0 { "early" } else { "late" });
    if align {
        let moved = aligned(&samples, lag.lag_s);
        CliError::warning(&format!("{name}: the reference is {late}; it was moved by that"));
        if let Some(reference) = &mut recording.trace.reference {
            reference.values = moved;
        }
        return Ok(());
    }
    if !lag.is_too_late() {
        return Ok(());
    }
    Err(CliError::Input(format!(
        "{name}: expected a reference on the clock of the readings, found one that seems to be {late}, where a movement takes \
         {:.1} s; --align moves it to where the readings say it belongs",
        lag.movement_s
    )))
}
