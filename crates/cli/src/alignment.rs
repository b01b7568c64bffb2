//! References that are early or late.

use ohmstrain_calib::aligned;

use crate::error::CliError;
use crate::input::Recording;

/// Says how late the reference of a recording is; moves it if that is wanted, and refuses one that is too late to be used
/// otherwise. By how much it was moved, s.
pub fn check(recording: &mut Recording, align: bool) -> Result<f64, CliError> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
    let Some(lag) = known.reference_lag() else { return Ok(0.0) };
    let name = recording.name.clone();
    let late = format!("{:.2} s {}", lag.lag_s.abs(), if lag.lag_s < 0.0 { "early" } else { "late" });
    if align {
        CliError::warning(&format!("{name}: the reference is {late}; it was moved by that"));
        shift(recording, lag.lag_s)?;
        return Ok(lag.lag_s);
    }
    if !lag.is_too_late() {
        return Ok(0.0);
    }
    Err(CliError::Input(format!(
        "{name}: expected a reference on the clock of the readings, found one that seems to be {late}, where a movement takes \
         {:.1} s; --align moves it to where the readings say it belongs",
        lag.movement_s
    )))
}

/// Moves a reference that is late by `lag_s`.
pub fn shift(recording: &mut Recording, lag_s: f64) -> Result<(), CliError> {
    let moved = aligned(&recording.samples()?, lag_s);
    if let Some(reference) = &mut recording.trace.reference {
        reference.values = moved;
    }
    Ok(())
}
