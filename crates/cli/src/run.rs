use ohmstrain::number::median;
use ohmstrain::{Error, FilterBuilder, Sensor};

use crate::args::{EstimateArgs, RestResistance, Without};
use crate::error::CliError;

/// Returns the builder of a sensor's filter with the settings of the flags.
pub fn builder<'a>(sensor: &'a Sensor, args: &'a EstimateArgs) -> FilterBuilder<'a> {
    let builder = builder_anew(sensor, args).known(&args.known);
    args.initial_strain.map_or(builder, |strain| builder.initial_strain(strain))
}

/// Returns the builder for a device that has restarted: the known first row, and known strains on the first clock, do not apply
/// to it.
pub fn builder_anew<'a>(sensor: &'a Sensor, args: &'a EstimateArgs) -> FilterBuilder<'a> {
    let mut builder = sensor.filter();
    if let Some(kind) = args.estimator.chosen() {
        builder = builder.estimator(kind);
    }
    if args.is_without(Without::Correction) {
        builder = builder.without_correction();
    }
    if let Some(nis) = args.gate {
        builder = builder.gate(nis);
    }
    if args.is_without(Without::Plausibility) {
        builder = builder.without_plausibility();
    }
    if args.is_without(Without::SecondLook) {
        builder = builder.without_second_look();
    }
    if args.is_without(Without::Doubts) {
        builder = builder.without_doubts();
    }
    if let Some(influence) = args.influence {
        builder = builder.influence(influence);
    }
    builder
}

/// Returns the reading of the rested sensor for a recording whose first readings are `first`; `None` if it was not given, so
/// that the filter adapts R₀.
pub fn rest_resistance(
    wanted: Option<RestResistance>,
    sensor: &Sensor,
    first: impl Iterator<Item = f64>,
    file: &str,
) -> Result<Option<f64>, CliError> {
    match wanted {
        None => Ok(None),
        Some(RestResistance::Value(value)) => {
            sensor.check_rest_resistance(value)?;
            Ok(Some(value))
        }
        Some(RestResistance::Calibrated) => Ok(Some(sensor.params().rested())),
        Some(RestResistance::First(count)) => {
            let found = median_of_first(count, first, file)?;
            sensor.check_rest_resistance(found).map_err(|refused| of_first(&refused, count, file))?;
            Ok(Some(found))
        }
    }
}

/// Creates the error of an R₀ that was computed from a recording's first readings and refused.
pub fn of_first(refused: &Error, count: usize, file: &str) -> CliError {
    CliError::Input(format!("{file}: --rest-resistance first:{count}: {refused}"))
}

/// Returns the median of the first `count` known readings.
pub fn median_of_first(count: usize, first: impl Iterator<Item = f64>, file: &str) -> Result<f64, CliError> {
    let none = || CliError::Input(format!("{file}: expected a reading among the first rows, found none"));
    median(first.filter(|value| value.is_finite()).take(count).collect()).ok_or_else(none)
}
