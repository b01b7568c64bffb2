//! References that are early or late.

use ohmstrain_calib::aligned;

use crate::error::CliError;
use crate::input::TraceFile;
use crate::verbosity::Verbosity;

/// Says how late the reference of a recording is; moves it if that is wanted, refuses one that is certainly too late to be used
/// otherwise, and warns of one that probably is; says how late it is where that does not matter if `explain`. By how much it was
/// moved, s.
pub fn check(recording: &mut TraceFile, align: bool, explain: bool) -> Result<f64, CliError> {
    let samples = recording.samples()?;
    let known = ohmstrain::Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
    let name = recording.name.clone();
    let late = |lag_s: f64| format!("{:.2} s {}", lag_s.abs(), if lag_s < 0.0 { "early" } else { "late" });
    let Some(lag) = known.reference_lag() else {
        if let Some(lag_s) = known.lag_out_of_reach() {
            CliError::warning(&format!(
                "{name}: the reference seems to be {} or more, as far as lags are looked for; it was not moved: are both on one clock?",
                late(lag_s)
            ));
        }
        return Ok(0.0);
    };
    let own = if lag.own_s > 0.0 {
        format!(", give or take {:.1} s that the sensor may lag itself", lag.own_s)
    } else {
        String::new()
    };
    let late = late(lag.lag_s) + &own;
    if align {
        CliError::warning(&format!("{name}: the reference is {late}; it was moved by that"));
        shift(recording, lag.lag_s)?;
        return Ok(lag.lag_s);
    }
    if !lag.is_too_late() {
        let text =
            format!("{name}: the reference seems to be {late}, little of the {:.1} s of a movement", lag.movement_s);
        if explain {
            CliError::remark(&text)
        } else {
            Verbosity::detail(&text)
        }
        return Ok(0.0);
    }
    if !lag.is_certain {
        CliError::warning(&format!(
            "{name}: the reference seems to be {late}, where a movement takes {:.1} s; the readings do not tell for certain, and it \
             was not moved: are both on one clock? --align moves it",
            lag.movement_s
        ));
        return Ok(0.0);
    }
    Err(CliError::Input(format!(
        "{name}: expected a reference on the clock of the readings, found one that seems to be {late}, where a movement takes \
         {:.1} s; --align moves it to where the readings say it belongs",
        lag.movement_s
    )))
}

/// Moves a reference that is late by `lag_s`.
pub fn shift(recording: &mut TraceFile, lag_s: f64) -> Result<(), CliError> {
    let moved = aligned(&recording.samples()?, lag_s);
    if let Some(reference) = &mut recording.trace.reference {
        reference.values = moved;
    }
    Ok(())
}
