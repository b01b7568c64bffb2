use std::collections::VecDeque;
use std::io::{self, Read};

use ohmstrain_bench_data::{Row, TraceError, TraceReader};
use ohmstrain_calib::{EstimatorKind, Filter, Output, SensorParams};

use crate::args::{FilterArgs, RestResistance};
use crate::error::CliError;
use crate::estimates::{EstimateRow, EstimateWriter};
use crate::input::{self, check_unit, is_stdin};
use crate::readings::no_row;
use crate::run::{filter, no_smoother, relative_row, rest_reading, step_error_at};
use crate::sensor_file;
use crate::suits::{self, FIRST_LIVE_READINGS, FIRST_READINGS, doubt_readings};
use crate::validity::ValidityWatch;

/// Bytes handed to standard output at once, unless somebody waits for them.
const WRITTEN_AT_ONCE: usize = 1 << 16;

/// Turns readings into strain as they arrive. Memory does not grow with the recording.
pub fn run(args: &FilterArgs) -> Result<(), CliError> {
    let kind = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let looks_back = |kind: EstimatorKind| args.lag_s.is_none() || kind.smoother() == kind;
    if !kind.is_none_or(looks_back) {
        return Err(no_smoother());
    }
    let mut params = sensor_file::read(&args.estimate.sensor, kind)?;
    let kind = args.estimate.kind(&params);
    if !looks_back(kind) {
        return Err(no_smoother());
    }
    let filter = filter(&params, kind, &args.estimate)?;
    let rows = input::open(&args.trace_file, &args.estimate.trace.metadata())?;
    let header = input::header(&rows);
    check_unit(&header, rows.reading_kind(), params.reading)?;
    input::take_joint(&mut params, rows.metadata());
    let out = io::BufWriter::with_capacity(WRITTEN_AT_ONCE, io::stdout().lock());
    let mut writer = EstimateWriter::new(out, &params, &args.estimate.columns)?;
    let live = is_stdin(&args.trace_file) || !args.trace_file.is_file();
    let (waiting, outputs) = (VecDeque::new(), Vec::new());
    let stream =
        Stream { params: &params, args, header, filter, live, waiting, outputs, early: Vec::new(), watch: None };
    let streamed = stream.run(rows, &mut writer);
    // What was estimated before an error is still good.
    writer.flush().and(streamed)
}

struct Stream<'a> {
    params: &'a SensorParams,
    args: &'a FilterArgs,
    /// What messages call the recording's header.
    header: String,
    filter: Box<dyn Filter>,
    /// Not a file but standard input or a pipe: somebody waits for each row.
    live: bool,
    /// Rows whose estimates wait for later readings.
    waiting: VecDeque<Row>,
    /// Estimates that have just become due.
    outputs: Vec<Output>,
    /// The first known readings of a live stream.
    early: Vec<f64>,
    /// Says when the calibration does not reach; there once R₀ is known.
    watch: Option<ValidityWatch>,
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
        let first = first_rows(&mut rows, count, if self.live { count } else { count.max(FIRST_READINGS) })?;
        if first.is_empty() {
            return Err(no_row(&rows));
        }
        let known = || first.iter().flatten().map(|row| row.reading.value);
        let rest_reading = rest_reading(wanted, self.params, known(), &file)?;
        if !self.live {
            suits::check_readings(&self.header, self.params, rest_reading, known())?;
        }
        self.watch = Some(ValidityWatch::new(&file, self.params, rest_reading));
        let mut streamed = Ok(());
        for row in first.into_iter().chain(rows) {
            streamed = row.map_err(CliError::from).and_then(|row| self.step(row, rest_reading, &file, writer));
            if streamed.is_err() {
                break;
            }
        }
        // The rows that still wait get their estimates, whatever stopped the stream.
        let flushed = self.filter.flush_lagged(&mut |output| self.outputs.push(output));
        self.write_waiting(rest_reading, writer)?;
        streamed.and(flushed.map_err(|error| CliError::Input(format!("{file}: {error}"))))
    }

    fn step<W: io::Write>(
        &mut self,
        row: Row,
        rest_reading: f64,
        file: &str,
        writer: &mut EstimateWriter<W>,
    ) -> Result<(), CliError> {
        let (time_s, reading) = (row.time_s, relative_row(&row.reading, rest_reading));
        let refused = step_error_at(file, row.line);
        match self.args.lag_s {
            None => {
                self.filter.step(time_s, reading).map_err(refused)?;
                self.write(&row, rest_reading, self.filter.output(), writer)?;
            }
            Some(lag_s) => {
                let outputs = &mut self.outputs;
                let taken = self.filter.step_lagged(time_s, reading, lag_s, &mut |output| outputs.push(output));
                if taken.is_ok() {
                    self.waiting.push_back(row);
                }
                self.write_waiting(rest_reading, writer)?;
                taken.map_err(refused)?;
            }
        }
        if self.live { writer.flush() } else { Ok(()) }
    }

    /// Writes the rows that have waited longest, with the estimates that have become due.
    fn write_waiting<W: io::Write>(
        &mut self,
        rest_reading: f64,
        writer: &mut EstimateWriter<W>,
    ) -> Result<(), CliError> {
        for k in 0..self.outputs.len() {
            if let Some(row) = self.waiting.pop_front() {
                self.write(&row, rest_reading, self.outputs[k], writer)?;
            }
        }
        self.outputs.clear();
        Ok(())
    }

    fn write<W: io::Write>(
        &mut self,
        row: &Row,
        rest_reading: f64,
        output: Output,
        writer: &mut EstimateWriter<W>,
    ) -> Result<(), CliError> {
        if self.live && row.reading.value.is_finite() && self.early.len() < FIRST_LIVE_READINGS {
            self.early.push(row.reading.value);
            if self.early.len() == FIRST_LIVE_READINGS {
                let doubt = doubt_readings(self.params, rest_reading, self.early.iter().copied());
                doubt.iter().for_each(|doubt| CliError::warning(&format!("{}: {doubt}", self.header)));
            }
        }
        if let Some(watch) = &mut self.watch {
            let rate = output.estimate.rate.mean;
            watch.see(row.time_s, row.reading.value, rate, f64::NAN, &mut |warning| CliError::warning(&warning));
        }
        writer.write(&estimate_row(row, rest_reading, output))
    }
}

/// Rows without a reading among which a reading is looked for, where it is not needed.
const MOST_FIRST_ROWS: usize = 10 * FIRST_READINGS;

/// The first rows: until `wanted` readings are known, or `enough` of them and many rows. An error ends them; it is returned
/// if fewer readings than that are known.
fn first_rows<R: Read>(
    rows: &mut TraceReader<R>,
    enough: usize,
    wanted: usize,
) -> Result<Vec<Result<Row, TraceError>>, CliError> {
    let (mut first, mut known) = (Vec::new(), 0);
    for row in rows {
        let row = if known < enough { Ok(row?) } else { row };
        known += usize::from(row.as_ref().is_ok_and(|row| row.reading.value.is_finite()));
        let failed = row.is_err();
        first.push(row);
        if failed || known >= wanted || (known >= enough && first.len() >= MOST_FIRST_ROWS) {
            break;
        }
    }
    Ok(first)
}

fn estimate_row(row: &Row, rest_reading: f64, output: Output) -> EstimateRow {
    let (time_s, reading, saturated) = (row.time_s, row.reading.value, row.reading.saturated);
    EstimateRow { time_s, reading, saturated, rest_reading, output }
}
