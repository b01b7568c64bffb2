//! Doubts about a sensor's input: some are refused, others warned of.

use ohmstrain::Interface::CommandLine;
use ohmstrain::trace::TraceFile;
use ohmstrain::{Estimate, Flag, Known, ReferenceDoubt, Sensor, UnitDoubt, UseDoubt, unused_known};

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

/// Warns of times that may be milliseconds.
pub fn warn_of_clock(header: &str, sensor: &Sensor, times_s: impl Iterator<Item = f64>, messages: &Messages) {
    warn(header, sensor.clock_doubt(times_s), messages);
}

fn warn(file: &str, doubt: Option<UseDoubt>, messages: &Messages) {
    doubt.into_iter().for_each(|doubt| messages.warning(&format!("{file}: {}", doubt.text(CommandLine))));
}

/// Rows that were used beyond the calibration.
#[derive(Default)]
pub struct Unlike {
    rows: usize,
    extrapolated: usize,
    /// True if a warning has already told what is beyond it.
    pub is_warned: bool,
}

impl Unlike {
    /// Counts rows.
    pub fn see(&mut self, rows: &[Estimate]) {
        self.rows += rows.len();
        self.extrapolated += rows.iter().filter(|row| row.flags.has(Flag::Extrapolated)).count();
    }

    /// Warns if they are most of the rows.
    pub fn warn(&self, file: &str, messages: &Messages) {
        if !self.is_warned && self.rows >= FIRST_READINGS && 2 * self.extrapolated > self.rows {
            let percent = 100 * self.extrapolated / self.rows;
            messages.warning(&format!(
                "{file}: {percent} % of the rows are flagged `extrapolated`: sensor or use are unlike those of the calibration"
            ));
        }
    }
}

/// Returns the sensor for readings with or without temperatures; warns where intervals are wider without.
pub fn sensor_for(sensor: Sensor, has_temperature: bool, file: &str, messages: &Messages) -> Sensor {
    if has_temperature {
        return sensor;
    }
    warn(file, sensor.no_temperatures_doubt(), messages);
    sensor.without_temperature()
}

/// Warns of temperatures that counted as not measured.
pub fn warn_of_temperatures(count: usize, file: &str, messages: &Messages) {
    warn(file, (count > 0).then_some(UseDoubt::FarTemperatures { count }), messages);
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
