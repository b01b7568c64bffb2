use std::io::{self, Read};

use ohmstrain_bench_data::{Row, TraceReader};
use ohmstrain_calib::{Filter, SensorParams, build_filter};

use crate::args::{FilterArgs, RestResistance};
use crate::error::CliError;
use crate::estimates::{EstimateRow, EstimateWriter};
use crate::input::{self, check_unit, is_stdin};
use crate::run::{relative_row, rest_reading, start};
use crate::sensor_file;

/// Turns readings into strain as they arrive. Memory does not grow with the recording.
pub fn run(args: &FilterArgs) -> Result<(), CliError> {
    let kind = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let mut params = sensor_file::read(&args.estimate.sensor, kind)?;
    let filter =
        build_filter(&params, kind, start(&args.estimate)).map_err(|error| CliError::Input(error.to_string()))?;
    let rows = input::open(&args.trace_file, &args.estimate.trace.metadata())?;
    check_unit(&input::header(&rows), rows.reading_kind(), params.reading)?;
    input::take_joint(&mut params, rows.metadata());
    let out = io::BufWriter::new(io::stdout().lock());
    let mut writer = EstimateWriter::new(out, &params, &args.estimate.columns)?;
    let streamed =
        Stream { params: &params, args, filter, live: is_stdin(&args.trace_file) || !args.trace_file.is_file() }
            .run(rows, &mut writer);
    // What was estimated before an error is still good.
    writer.flush().and(streamed)
}

struct Stream<'a> {
    params: &'a SensorParams,
    args: &'a FilterArgs,
    filter: Box<dyn Filter>,
    /// Not a file but standard input or a pipe: somebody waits for each row.
    live: bool,
}

impl Stream<'_> {
    fn run<W: io::Write>(
        mut self,
        mut rows: TraceReader<Box<dyn Read>>,
        writer: &mut EstimateWriter<W>,
    ) -> Result<(), CliError> {
        let file = rows.file().to_string();
        let wanted = self.args.estimate.rest_resistance;
        // The rows that R₀ is taken from, at least one, are estimated too, once it is known.
        let count = if let Some(RestResistance::First(count)) = wanted { count } else { 0 };
        let mut first = Vec::new();
        for row in rows.by_ref() {
            first.push(row?);
            if first.iter().filter(|row| row.reading.value.is_finite()).count() >= count {
                break;
            }
        }
        if first.is_empty() {
            let line = rows.line() + 1;
            let none = "expected at least one row of data, found the end of the file";
            return Err(CliError::Input(format!("{file}:{line}: {none}")));
        }
        let rest_reading = rest_reading(wanted, self.params, first.iter().map(|row| row.reading.value), &file)?;
        for row in first.into_iter().map(Ok).chain(rows) {
            self.step(&row?, rest_reading, &file, writer)?;
        }
        Ok(())
    }

    fn step<W: io::Write>(
        &mut self,
        row: &Row,
        rest_reading: f64,
        file: &str,
        writer: &mut EstimateWriter<W>,
    ) -> Result<(), CliError> {
        self.filter
            .step(row.time_s, relative_row(&row.reading, rest_reading))
            .map_err(|error| CliError::Input(format!("{file}:{}: {error}", row.line)))?;
        writer.write(&EstimateRow {
            time_s: row.time_s,
            reading: row.reading.value,
            saturated: row.reading.saturated,
            rest_reading,
            output: self.filter.output(),
        })?;
        if self.live { writer.flush() } else { Ok(()) }
    }
}
