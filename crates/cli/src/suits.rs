//! Doubts about a sensor's input: some are refused, others warned of.

use ohmstrain::Interface::CommandLine;
use ohmstrain::number::significant;
use ohmstrain::trace::TraceFile;
use ohmstrain::{Estimate, Flag, Known, ReferenceDoubt, Sensor, UnitDoubt, unused_known};
use ohmstrain_bench_data::counted;

use crate::error::CliError;
use crate::messages::Messages;

/// Number of readings at the start of a file that are checked before it is filtered.
pub const FIRST_READINGS: usize = 100;
/// Least number of rows whose steps are compared with those of the calibration.
const FEWEST_TIMES: usize = 10;
/// Multiple of the calibration's step beyond which times may be in milliseconds; a recording read less often has smaller ones.
const FARTHER: f64 = 200.0;

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

/// Warns of rows so much farther apart than those of the calibration that their times may be milliseconds.
pub fn warn_of_clock(header: &str, sensor: &Sensor, times_s: impl Iterator<Item = f64>, messages: &Messages) {
    let recordings = &sensor.params().recordings;
    let lasted_s: f64 = recordings.iter().map(|one| one.last_s - one.first_s).sum();
    let rows: usize = recordings.iter().map(|one| one.rows).sum();
    let times: Vec<f64> = times_s.take(FIRST_READINGS).collect();
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return };
    let step_s = (last - first) / (times.len() - 1).max(1) as f64;
    let usual_s = lasted_s / rows as f64;
    if times.len() < FEWEST_TIMES || !(step_s > FARTHER * usual_s) {
        return;
    }
    messages.warning(&format!(
        "{header}: rows are {} s apart, {} s in the calibration: if `time_s` is in milliseconds, convert the recording with \
         `ohmstrain import FILE --unit time=ms -o trace.csv`",
        significant(step_s, 3),
        significant(usual_s, 3)
    ));
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
    let Some(effect) = sensor.params().temperature.filter(|_| !has_temperature) else { return sensor };
    let (lower, upper) = (significant(effect.lower_c, 3), significant(effect.upper_c, 3));
    messages.warning(&format!(
        "{file}: no column `temperature_c`: intervals are wider by what {lower} to {upper} °C do to the strain, as in the calibration"
    ));
    sensor.without_temperature()
}

/// Warns of temperatures that counted as not measured.
pub fn warn_of_temperatures(implausible: usize, file: &str, messages: &Messages) {
    if implausible > 0 {
        messages.warning(&format!(
            "{file}: {} far from those of the calibration counted as missing: is the probe connected?",
            counted(implausible, "temperature")
        ));
    }
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
