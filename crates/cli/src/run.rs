use ohmstrain_bench_data::{Reading as TraceReading, Trace};
use ohmstrain_calib::{EstimatorKind, Filter, Output, SensorParams, Start, build_filter};
use ohmstrain_ekf::{Guard, Reading, StepError};
use ohmstrain_model::ParameterError;

use crate::args::{EstimateArgs, RestResistance};
use crate::error::CliError;
use crate::input::Recording;
use crate::suits;

/// A reading relative to R₀, with what the electronics add to its variance.
pub fn relative(value: f64, sd_ohm: Option<f64>, rest_reading: f64) -> Option<Reading<f64>> {
    if !value.is_finite() {
        return None;
    }
    let sd = sd_ohm.filter(|sd| sd.is_finite()).unwrap_or(0.0) / rest_reading;
    Some(Reading { value: value / rest_reading - 1.0, extra_variance: sd * sd })
}

/// One streamed row relative to R₀.
pub fn relative_row(reading: &TraceReading, rest_reading: f64) -> Option<Reading<f64>> {
    relative(reading.value, reading.sd_ohm, rest_reading)
}

/// All readings of a trace relative to R₀.
pub fn relative_trace(trace: &Trace, rest_reading: f64) -> Vec<Option<Reading<f64>>> {
    let converter = trace.readings.converter.as_ref();
    let sd = |k: usize| converter.and_then(|converter| converter.sd_ohm.get(k).copied());
    trace.readings.values.iter().enumerate().map(|(k, &value)| relative(value, sd(k), rest_reading)).collect()
}

/// How many readings in a row a gate turns down before it is the state that is doubted.
const PATIENCE: u32 = 10;

/// What protects the filter from outliers.
fn guard(args: &EstimateArgs) -> Result<Guard<f64>, ParameterError> {
    let mut guard = Guard::none();
    if let Some(nis) = args.gate {
        guard = guard.with_gate(nis, PATIENCE)?;
    }
    if let Some(influence) = args.influence {
        guard = guard.with_influence(influence.0)?;
    }
    Ok(guard)
}

/// The filter of an estimator, as the flags want it.
pub fn filter(params: &SensorParams, kind: EstimatorKind, args: &EstimateArgs) -> Result<Box<dyn Filter>, CliError> {
    suits::check_start(args, params)?;
    let start = args.initial_strain.map_or(Start::Unknown, Start::Strain);
    let mut filter = build_filter(params, Some(kind), start).map_err(|error| CliError::Input(error.to_string()))?;
    filter.guard(guard(args).map_err(|error| CliError::Arguments(error.to_string()))?);
    Ok(filter)
}

/// R₀ of the law for a recording whose first readings are `first`.
pub fn rest_reading(
    wanted: Option<RestResistance>,
    params: &SensorParams,
    first: impl Iterator<Item = f64>,
    file: &str,
) -> Result<f64, CliError> {
    match wanted {
        None => Ok(params.rest_reading),
        Some(RestResistance::Value(value)) => Ok(params.rest_reading_of(value)),
        Some(RestResistance::First(count)) => Ok(params.rest_reading_of(median_of_first(count, first, file)?)),
    }
}

/// Median of the first `count` known readings.
pub fn median_of_first(count: usize, first: impl Iterator<Item = f64>, file: &str) -> Result<f64, CliError> {
    let mut known: Vec<f64> = first.filter(|value| value.is_finite()).take(count).collect();
    known.sort_by(f64::total_cmp);
    match known.len() {
        0 => Err(CliError::Input(format!("{file}: expected a reading among the first rows, found none"))),
        n if n % 2 == 1 => Ok(known[n / 2]),
        n => Ok(0.5 * (known[n / 2 - 1] + known[n / 2])),
    }
}

/// Both passes over a recording.
pub struct Estimated {
    /// The filter's outputs, row by row.
    pub filtered: Vec<Output>,
    /// The smoother's.
    pub smoothed: Vec<Output>,
}

/// Filters and smooths a recording with the R₀ `rest_reading`.
pub fn estimate(
    recording: &Recording,
    params: &SensorParams,
    rest_reading: f64,
    kind: Option<EstimatorKind>,
) -> Result<Estimated, CliError> {
    let trace = &recording.trace;
    let readings = relative_trace(trace, rest_reading);
    let build = |kind| build_filter(params, Some(kind), Start::Unknown).map_err(|e| CliError::Input(e.to_string()));
    let kind = kind.unwrap_or(params.default_estimator);
    let mut filter = build(kind)?;
    let mut filtered = Vec::with_capacity(trace.time_s.len());
    for (k, (&time_s, &reading)) in trace.time_s.iter().zip(&readings).enumerate() {
        filter.step(time_s, reading).map_err(|error| step_error(&recording.name, k, error))?;
        filtered.push(filter.output());
    }
    let smoothed = smooth(recording, build(kind.smoother())?, &readings)?;
    Ok(Estimated { filtered, smoothed })
}

/// Smooths a recording.
pub fn smooth(
    recording: &Recording,
    mut filter: Box<dyn Filter>,
    readings: &[Option<Reading<f64>>],
) -> Result<Vec<Output>, CliError> {
    let smoothed =
        filter.smooth(&recording.trace.time_s, readings).map_err(|(k, error)| step_error(&recording.name, k, error))?;
    smoothed.ok_or_else(no_smoother)
}

/// The estimator has no smoother.
pub fn no_smoother() -> CliError {
    CliError::Arguments("--estimator: this one has no smoother".into())
}

/// A filter's refusal as an error about a line of the input.
pub fn step_error_at(file: &str, line: u64) -> impl Fn(StepError) -> CliError {
    move |error| CliError::Input(format!("{file}:{line}: {error}"))
}

/// A filter's refusal as an error about the input.
pub fn step_error(file: &str, row: usize, error: StepError) -> CliError {
    CliError::Input(format!("{file}: data row {}: {error}", row + 1))
}
