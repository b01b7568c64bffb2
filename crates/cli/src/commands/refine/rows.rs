use ohmstrain::trace::TraceFile;

use crate::error::CliError;

/// Largest number of rows, with which a maximum and its intervals take seconds. More rows are thinned, since the model is
/// continuous in time.
const MOST_ROWS: usize = 3000;
/// Smallest number of readings, ten for each parameter, as for a calibration.
const FEWEST_READINGS: usize = 60;

/// The rows of a recording that are used, with readings relative to R₀.
pub struct RelativeRows {
    /// Times, s.
    pub time_s: Vec<f64>,
    /// R/R₀ − 1; NaN where missing.
    pub value: Vec<f64>,
    /// Standard deviation of the electronics' noise in each reading, relative to R₀.
    pub extra_sd: Vec<f64>,
    /// Number of rows before thinning.
    pub all: usize,
    /// Stride: one row in `stride` is used.
    pub stride: usize,
}

impl RelativeRows {
    /// The rows of `recording` with `from <= time_s < until`, thinned if there are many.
    pub fn new(
        recording: &TraceFile,
        from: Option<f64>,
        until: Option<f64>,
        rest_reading: f64,
    ) -> Result<Self, CliError> {
        let rows = recording.rows(recording.between(from, until));
        if rows.trace.is_empty() {
            return Err(recording.no_rows(from, until).into());
        }
        let stride = rows.trace.len().div_ceil(MOST_ROWS).max(1);
        let relative = |row: usize| rows.reading(row).1.relative(rest_reading);
        let readings: Vec<_> = (0..rows.trace.len()).step_by(stride).map(relative).collect();
        let known = readings.iter().flatten().count();
        if known < FEWEST_READINGS {
            let name = &recording.name;
            let found = if known == 0 { "none".into() } else { known.to_string() };
            return Err(CliError::Input(format!(
                "{name}: expected at least {FEWEST_READINGS} readings, found {found}"
            )));
        }
        Ok(Self {
            time_s: rows.trace.time_s.iter().copied().step_by(stride).collect(),
            value: readings.iter().map(|reading| reading.map_or(f64::NAN, |reading| reading.value)).collect(),
            extra_sd: readings.iter().map(|reading| reading.map_or(f64::NAN, |r| r.extra_variance.sqrt())).collect(),
            all: rows.trace.len(),
            stride,
        })
    }
}
