//! References that are early or late.

use ohmstrain_calib::{Lag, aligned, reference_lag, screen};

use crate::error::CliError;
use crate::input::Recording;

/// A lag of more than this share of a movement is refused: it turns stretching into releasing for that share of the time.
const LARGEST_SHARE: f64 = 0.1;
/// Says how late the reference of a recording is; moves it if that is wanted, and refuses one that is too late to be used
/// otherwise.
pub fn check(recording: &mut Recording, align: bool) -> Result<(), CliError> {
    let samples = recording.samples()?;
    // What cannot be screened is for the calibration to refuse.
    let Ok(screened) = screen(&[samples]) else { return Ok(()) };
    let lag = screened.samples().first().and_then(reference_lag);
    let Some(lag) = lag.filter(Lag::is_sure) else { return Ok(()) };
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
    if lag.lag_s.abs() <= LARGEST_SHARE * lag.movement_s {
        return Ok(());
    }
    Err(CliError::Input(format!(
        "{name}: expected a reference on the clock of the readings, found one that seems to be {late}, where a movement takes \
         {:.1} s; --align moves it to where the readings say it belongs",
        lag.movement_s
    )))
}
