use std::io;

use ohmstrain_calib::{Output, SensorParams};

use crate::args::SmoothArgs;
use crate::error::CliError;
use crate::estimates::{EstimateRow, EstimateWriter};
use crate::input::{self, Recording, check_unit};
use crate::run::{filter, relative_trace, rest_reading, smooth};
use crate::sensor_file;

/// Smooths a recording and writes its estimates.
pub fn run(args: &SmoothArgs) -> Result<(), CliError> {
    let wanted = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let mut params = sensor_file::read(&args.estimate.sensor, wanted)?;
    let kind = wanted.unwrap_or(params.default_estimator);
    let recording = input::read(&args.trace_file, &args.estimate.trace.metadata())?;
    check_unit(&recording.header, recording.trace.readings.kind, params.reading)?;
    input::take_joint(&mut params, &recording.trace.metadata);
    let values = recording.trace.readings.values.iter().copied();
    let rest_reading = rest_reading(args.estimate.rest_resistance, &params, values, &recording.name)?;
    let readings = relative_trace(&recording.trace, rest_reading);
    let outputs = smooth(&recording, filter(&params, kind.smoother(), &args.estimate)?, &readings)?;
    let out = io::BufWriter::new(io::stdout().lock());
    write_estimates(out, &recording, &params, rest_reading, &outputs, &args.estimate.columns)
}

/// Writes a whole recording's estimates.
pub fn write_estimates(
    out: impl io::Write,
    recording: &Recording,
    params: &SensorParams,
    rest_reading: f64,
    outputs: &[Output],
    columns: &[String],
) -> Result<(), CliError> {
    let trace = &recording.trace;
    let saturated = trace.readings.converter.as_ref().map(|converter| converter.saturated.as_slice());
    let mut writer = EstimateWriter::new(out, params, columns)?;
    for (k, output) in outputs.iter().enumerate() {
        writer.write(&EstimateRow {
            time_s: trace.time_s[k],
            reading: trace.readings.values[k],
            saturated: saturated.and_then(|saturated| saturated.get(k).copied()).unwrap_or(false),
            rest_reading,
            output: *output,
        })?;
    }
    writer.flush()
}
