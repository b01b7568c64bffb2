//! Whether what a sensor is given can be meant for it: readings, a reference and a strain to start at, against what its
//! calibration has seen. What cannot be is a question with an answer; what is merely unusual is a warning, see
//! [`ValidityWatch`](crate::validity::ValidityWatch).

use ohmstrain_calib::{Quantity, ReadingUnit, SensorParams};

use crate::args::EstimateArgs;
use crate::error::CliError;
use crate::input::{Recording, reading_column};

/// Readings at the start of a file that are looked at before it is filtered.
pub const FIRST_READINGS: usize = 100;
/// The same where somebody waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;

/// Readings may go this far beyond those of the calibration, and in another unit they would not: sensors of one kind differ
/// by less, units by more.
const READINGS_BEYOND: f64 = 2.0;
/// References whose 95th percentile is this many times the largest strain of the calibration are a hundred times too large.
const PERCENT: std::ops::RangeInclusive<f64> = 30.0..=300.0;
/// No sensor that is glued or cast is stretched this much: a calibration with such strains was one in percent.
const LARGEST_STRAIN: f64 = 3.0;
/// How far beyond the limits a strain may start, in spans.
const START_BEYOND: f64 = 0.1;

/// Doubts about the unit of readings, by their median: `None` if they are near those of the calibration, moved to the R₀ in
/// use, or far from them in a way that no unit explains.
pub fn doubt_readings(params: &SensorParams, rest_reading: f64, readings: impl Iterator<Item = f64>) -> Option<String> {
    let median = quantile(readings, 0.5)?;
    let moved = rest_reading / params.rest_reading;
    let (low, high) = (moved * params.validity.reading_lower, moved * params.validity.reading_upper);
    let suits = |reading: f64| (low / READINGS_BEYOND..=high * READINGS_BEYOND).contains(&reading);
    let units: &[(f64, &str)] = match params.reading {
        ReadingUnit::Ohm => &[
            (
                1e3,
                "a thousandth of that: are they in kilo-ohms? Then say so with `--resistance-unit kohm` or a line `# resistance_unit \
                  = kohm` above the header",
            ),
            (1e6, "a millionth of that: are they in mega-ohms? The column is in ohms"),
            (1e-3, "a thousand times that: is R0, or the calibration, in kilo-ohms? Bring them to ohms"),
        ],
        ReadingUnit::Ratio => &[(1e-2, "a hundred times that: are they in percent? The column is a ratio")],
    };
    let (_, question) = units.iter().find(|(factor, _)| !suits(median) && suits(factor * median))?;
    let with = if moved == 1.0 { String::new() } else { format!(" with R0 = {rest_reading:.5}") };
    let column = reading_column(params.reading);
    Some(format!(
        "column `{column}`: expected readings of {low:.5} to {high:.5}, as in the calibration{with}, found {median:.5} at \
         the median, {question}; if another sensor, or another day, is to explain it, give its R0 with --rest-resistance"
    ))
}

/// Refuses readings in another unit than the sensor's; `header` is what messages call the recording's header.
pub fn check_readings(
    header: &str,
    params: &SensorParams,
    rest_reading: f64,
    readings: impl Iterator<Item = f64>,
) -> Result<(), CliError> {
    let doubt = doubt_readings(params, rest_reading, readings);
    doubt.map_or(Ok(()), |doubt| Err(CliError::Input(format!("{header}: {doubt}"))))
}

/// Refuses a reference in percent for a sensor calibrated with fractions, and the reverse.
pub fn check_reference(recording: &Recording, params: &SensorParams) -> Result<(), CliError> {
    if params.quantity != Quantity::Strain {
        return Ok(());
    }
    let size = |row: usize| recording.truth(row).abs();
    let Some(large) = quantile((0..recording.trace.len()).map(size), 0.95) else { return Ok(()) };
    let seen = params.validity.lower.abs().max(params.validity.upper.abs());
    let header = &recording.header;
    if PERCENT.contains(&(large / seen)) {
        return Err(CliError::Input(format!(
            "{header}: column `strain`: expected strains of up to {seen:.4}, as in the calibration, found {large:.4}: are they \
             in percent? Then say so with `--strain-unit percent` or a line `# strain_unit = percent` above the header"
        )));
    }
    if seen > LARGEST_STRAIN && PERCENT.contains(&(seen / large)) {
        return Err(CliError::Input(format!(
            "{header}: column `strain`: expected strains of up to {seen:.4}, as in the calibration, found {large:.4}: was the \
             calibration in percent? 10 % is 0.1; calibrate again"
        )));
    }
    Ok(())
}

/// Refuses a strain to start at that the sensor never reports.
pub fn check_start(args: &EstimateArgs, params: &SensorParams) -> Result<(), CliError> {
    let (Some(start), limits) = (args.initial_strain, params.limits) else { return Ok(()) };
    let beyond = (limits.lower - start).max(start - limits.upper);
    let (lower, upper, quantity) = (limits.lower, limits.upper, params.quantity.name());
    if beyond > START_BEYOND * limits.span() {
        let percent = if params.quantity == Quantity::Strain { "; 10 % is 0.1" } else { "" };
        return Err(CliError::Arguments(format!(
            "--initial-strain: expected {lower:.4} to {upper:.4}, the limits of the sensor's {quantity}, found {start}{percent}"
        )));
    }
    if beyond > 0.0 {
        CliError::warning(&format!(
            "--initial-strain: {start} is outside of the sensor's limits, {lower:.4} to {upper:.4}; what is reported stops there"
        ));
    }
    Ok(())
}

/// The value that a share of the known ones is below; `None` if none is known.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut known: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let rank = (share * known.len().checked_sub(1)? as f64) as usize;
    Some(*known.select_nth_unstable_by(rank, f64::total_cmp).1)
}
