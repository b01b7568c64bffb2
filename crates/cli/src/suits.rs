//! Doubts about what a sensor is given, refused or warned of.

use ohmstrain::Interface::CommandLine;
use ohmstrain::trace::TraceFile;
use ohmstrain::{Known, ReferenceDoubt, Sensor, UnitDoubt, unused_known};

use crate::error::CliError;
use crate::messages::Messages;

/// Readings at the start of a file that are looked at before it is filtered.
pub const FIRST_READINGS: usize = 100;
/// Number of first readings if a reader waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;

/// Refuses readings in another unit than the sensor's; `header` is what messages call the recording's header.
pub fn check_readings(
    header: &str,
    sensor: &Sensor,
    rest_resistance: Option<f64>,
    readings: impl Iterator<Item = f64>,
) -> Result<(), CliError> {
    let refused = |doubt: UnitDoubt| CliError::Input(format!("{header}: {}", doubt.text(CommandLine)));
    sensor.check_unit(readings, rest_resistance).map_err(refused)
}

/// Refuses a reference in percent for a sensor calibrated with fractions, and the reverse.
pub fn check_reference(recording: &TraceFile, sensor: &Sensor) -> Result<(), CliError> {
    let truth = (0..recording.trace.len()).map(|row| recording.truth(row));
    let refused = |doubt: ReferenceDoubt| CliError::Input(format!("{}: {}", recording.header, doubt.text(CommandLine)));
    sensor.check_reference(truth).map_err(refused)
}

/// Warns of a strain to start at that the sensor never reports.
pub fn warn_of_start(start: Option<f64>, sensor: &Sensor, messages: &Messages) {
    if let Some(Err(doubt)) = start.map(|start| sensor.check_start(start)) {
        messages.warning(&doubt.text(CommandLine));
    }
}

/// Warns of known strains that no row came for in a recording from the first to the last time, s.
pub fn warn_of_unused(known: &[Known], times: (f64, f64), file: &str, messages: &Messages) {
    for doubt in unused_known(known, times) {
        messages.warning(&format!("{file}: {}", doubt.text(CommandLine)));
    }
}
