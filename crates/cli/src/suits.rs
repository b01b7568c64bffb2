//! What the command line says to doubts about what a sensor is given: which flag, or which line of a file, answers them.

use ohmstrain::{Known, Quiet, Sensor, UnitDoubt, UnitGuess, unused_known};

use crate::error::CliError;
use crate::input::TraceFile;
use crate::messages::Messages;

/// Readings at the start of a file that are looked at before it is filtered.
pub const FIRST_READINGS: usize = 100;
/// The same where somebody waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;

/// A doubt about the unit of readings, with what resolves it.
pub fn answerable(doubt: &UnitDoubt) -> String {
    let answer = match doubt.guess {
        UnitGuess::KiloOhm => {
            "Then say so with `--unit resistance=kohm` or a line `# resistance_unit = kohm` above the header"
        }
        UnitGuess::CalibrationInKiloOhm => "Then calibrate again with `--unit resistance=kohm`",
        UnitGuess::Percent => "The column is a ratio: 110 % is 1.1",
        UnitGuess::Ohm => "Divide them by what the rested sensor reads",
        UnitGuess::Ratio => "The sensor was calibrated in ohms",
        _ => "The column is in ohms",
    };
    format!("{doubt} {answer}")
}

/// Refuses readings in another unit than the sensor's; `header` is what messages call the recording's header.
pub fn check_readings(
    header: &str,
    sensor: &Sensor,
    rest_resistance: Option<f64>,
    readings: impl Iterator<Item = f64>,
) -> Result<(), CliError> {
    let refused = |doubt| CliError::Input(format!("{header}: {}", answerable(&doubt)));
    sensor.check_unit(readings, rest_resistance).map_err(refused)
}

/// Refuses a reference in percent for a sensor calibrated with fractions, and the reverse.
pub fn check_reference(recording: &TraceFile, sensor: &Sensor) -> Result<(), CliError> {
    let truth = (0..recording.trace.len()).map(|row| recording.truth(row));
    sensor.check_reference(truth).map_err(|doubt| {
        let answer = if doubt.is_of_calibration {
            "10 % is 0.1; calibrate again"
        } else {
            "Then say so with `--unit strain=percent` or a line `# strain_unit = percent` above the header"
        };
        CliError::Input(format!("{}: {doubt} {answer}", recording.header))
    })
}

/// Warns of a strain to start at that the sensor never reports.
pub fn warn_of_start(start: Option<f64>, sensor: &Sensor, messages: &Messages) {
    if let Some(Err(doubt)) = start.map(|start| sensor.check_start(start)) {
        messages.warning(&format!("--initial-strain: {doubt}"));
    }
}

/// Warns of known strains that no row came for in a recording from the first to the last time, s.
pub fn warn_of_unused(known: &[Known], times: (f64, f64), file: &str, messages: &Messages) {
    for doubt in unused_known(known, times) {
        let Known { time_s, strain, .. } = doubt.known;
        messages.warning(&format!("{file}: --known {time_s}:{strain} {doubt}"));
    }
}

/// Asks whether a long hold was a rest, and says how to tell.
pub fn of_rest(quiet: &Quiet) -> String {
    format!("{quiet}, --known {}:0 tells it", quiet.now_s)
}
