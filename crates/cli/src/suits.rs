//! What the command line says to doubts about what a sensor is given: which flag, or which line of a file, answers them.

use ohmstrain::number::{plain, significant};
use ohmstrain::{Known, Sensor, UnitDoubt, UnitGuess};

use crate::error::CliError;
use crate::input::TraceFile;
use crate::quiet::Quiet;

/// Readings at the start of a file that are looked at before it is filtered.
pub const FIRST_READINGS: usize = 100;
/// The same where somebody waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;

/// A doubt about the unit of readings, with what resolves it.
pub fn answerable(doubt: &UnitDoubt) -> String {
    let answer = match doubt.guess {
        UnitGuess::KiloOhm => {
            "Then say so with `--resistance-unit kohm` or a line `# resistance_unit = kohm` above the header"
        }
        UnitGuess::RestInKiloOhm => "Bring them to ohms",
        UnitGuess::Percent => "The column is a ratio",
        _ => "The column is in ohms",
    };
    format!("{doubt} {answer}; if another sensor, or another day, is to explain it, give its R0 with --rest-resistance")
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
            "Then say so with `--strain-unit percent` or a line `# strain_unit = percent` above the header"
        };
        CliError::Input(format!("{}: {doubt} {answer}", recording.header))
    })
}

/// Warns of a strain to start at that the sensor never reports.
pub fn warn_of_start(start: Option<f64>, sensor: &Sensor) {
    let (Some(start), limits) = (start, sensor.params().limits) else { return };
    let (lower, upper) = (limits.lower, limits.upper);
    if !(lower..=upper).contains(&start) {
        CliError::warning(&format!(
            "--initial-strain: {start} is outside of the sensor's limits, {} to {}; what is reported stops there",
            plain(lower),
            plain(upper)
        ));
    }
}

/// Warns of known strains that no row came for in a recording from the first to the last time, s.
pub fn warn_of_unused(known: &[Known], (first_s, last_s): (f64, f64), file: &str) {
    let (first, last) = (significant(first_s, 6), significant(last_s, 6));
    for Known { time_s, strain, .. } in known.iter().filter(|known| known.time_s > last_s) {
        CliError::warning(&format!(
            "{file}: --known {time_s}:{strain} was not used: the recording goes from {first} to {last} s"
        ));
    }
}

/// Asks whether a long hold was a rest, and says how to tell.
pub fn of_rest(quiet: &Quiet) -> String {
    let Quiet { from_s, now_s, strain } = *quiet;
    format!(
        "{} s of quiet from t = {} s that may be a rest, where the strain is said to be {}: if the body was at rest there, \
         --known {now_s}:0 tells it",
        significant(now_s - from_s, 2),
        significant(from_s, 6),
        significant(strain, 2),
    )
}
