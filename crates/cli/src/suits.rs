//! Doubts about a sensor's input: some are refused, others warned of.

use ohmstrain::Interface::CommandLine;
use ohmstrain::number::significant;
use ohmstrain::trace::TraceFile;
use ohmstrain::{Known, ReferenceDoubt, Sensor, UnitDoubt, unused_known};

use crate::error::CliError;
use crate::messages::Messages;

/// Number of readings at the start of a file that are checked before it is filtered.
pub const FIRST_READINGS: usize = 100;

/// Refuses readings in another unit than the sensor's; `header` names the recording's header in messages.
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

/// Returns the sensor for readings with or without temperatures; warns where intervals are wider without.
pub fn sensor_for(sensor: Sensor, has_temperature: bool, file: &str, messages: &Messages) -> Sensor {
    let Some(effect) = sensor.params().temperature.filter(|_| !has_temperature) else { return sensor };
    let (lower, upper) = (significant(effect.lower_c, 3), significant(effect.upper_c, 3));
    messages.warning(&format!(
        "{file}: no column `temperature_c`: intervals are wider by what {lower} to {upper} °C do to the strain, as in the calibration"
    ));
    sensor.without_temperature()
}

/// Warns of an initial strain that the sensor never reports.
pub fn warn_of_start(start: Option<f64>, sensor: &Sensor, messages: &Messages) {
    if let Some(Err(doubt)) = start.map(|start| sensor.check_start(start)) {
        messages.warning(&doubt.text(CommandLine));
    }
}

/// Warns of known strains without a row, in a recording whose first and last time, s, are `times`.
pub fn warn_of_unused(known: &[Known], times: (f64, f64), file: &str, messages: &Messages) {
    for doubt in unused_known(known, times) {
        messages.warning(&format!("{file}: {}", doubt.text(CommandLine)));
    }
}
