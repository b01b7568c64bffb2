use std::io;
use std::path::Path;

use ohmstrain::Interface::CommandLine;
use ohmstrain::number::significant;
use ohmstrain::trace::{self, FIRST_LIVE_READINGS, check_unit};
use ohmstrain::{
    Error, Estimate, Filter, FilterBuilder, Known, LaggedFilter, QuietWatch, Reading, Sensor, Stored, ValidityWatch,
};
use ohmstrain_bench_data::{BadContent, DeviceRow, Row, TraceError};

use crate::args::{FilterArgs, Format, RestResistance, WrittenArgs};
use crate::error::CliError;
use crate::estimates::{self, EstimateWriter};
use crate::filter_state;
use crate::messages::Messages;
use crate::output::{Kind, Outputs, RowsOut};
use crate::readings::{late, no_row};
use crate::run::{builder, builder_anew, rest_resistance};
use crate::sensor_file;
use crate::stream::{self, RowSource};
use crate::suits::{self, FIRST_READINGS, Unlike};
use crate::whole_file::is_stdin;

/// Turns readings into strain as they arrive, and returns the number of rows. Memory does not grow with the recording.
pub fn run(args: &FilterArgs, messages: &Messages) -> Result<u64, CliError> {
    let kind = args.estimate.estimator.chosen();
    let WrittenArgs { output, replace, columns, .. } = &args.written;
    let inputs = [&args.trace_file, &args.estimate.sensor];
    // The state that the stream continues from is replaced by the next state alone.
    let state = Outputs::new(replace.force, &args.resume);
    output.as_deref().map_or(Ok(()), |path| state.refuse_input(path))?;
    let mut rows_out = RowsOut::claim(output.as_deref(), columns, replace.force, inputs)?;
    let claim = args.save_state.as_deref().map(|path| rows_out.outputs.claim(path, Kind::State)).transpose()?;
    let mut sensor = sensor_file::read(&args.estimate.sensor, kind)?;
    let stored = args.resume.as_deref().map(filter_state::read).transpose()?;
    // Wrong flags are refused before a stream is waited for.
    FilterRun::new(&sensor, args)?;
    suits::warn_of_start(args.estimate.initial_strain, &sensor, messages);
    let mut rows = stream::open(args)?;
    let header = trace::header(rows.file(), rows.line());
    check_unit(&header, rows.reading_kind(), sensor.params().reading)?;
    if let Some(joint) = trace::joint(&rows.metadata()) {
        sensor = sensor.on_joint(joint)?;
    }
    sensor = suits::sensor_for(sensor, rows.has_temperature(), rows.file(), messages);
    rows.convert_for(&sensor, stored.as_ref().and_then(|stored| stored.temperature_c));
    let mut filter = FilterRun::new(&sensor, args)?;
    if let Some(stored) = &stored {
        filter = FilterRun::resumed(&sensor, args, stored)?;
        filter_state::go_on(&mut rows, stored)?;
    }
    let (columns, format) = (estimates::columns(&sensor, columns)?, args.written.format());
    let live = is_stdin(&args.trace_file) || !args.trace_file.is_file();
    // A Parquet file is complete only with its last row.
    let grows = live && format == Format::Csv;
    let writer = EstimateWriter::new(rows_out.open(grows)?, format, columns)?;
    let (watch, quiet) = (ValidityWatch::new(&sensor, None), QuietWatch::new(&sensor, None, &args.estimate.known));
    let file = rows.file().into();
    let sink = Sink {
        messages,
        writer,
        watch,
        quiet,
        sensor,
        rest: None,
        file,
        header,
        live,
        early: vec![],
        unlike: Unlike::default(),
    };
    let skipped = Skipped::default();
    let stream = Stream { args, filter, sink, stored, times: None, restarted: false, skipped };
    let (written, state) = stream.run(rows)?;
    claim.into_iter().zip(state).for_each(|(claim, state)| rows_out.outputs.put(claim, state));
    rows_out.outputs.publish()?;
    Ok(written)
}

/// A filter with or without a lag; without one, also its last row.
struct FilterRun {
    filter: Lag,
    row: Option<Estimate>,
}

enum Lag {
    None(Filter),
    Some(LaggedFilter),
}

impl FilterRun {
    fn new(sensor: &Sensor, args: &FilterArgs) -> Result<Self, Error> {
        Self::built(builder(sensor, &args.estimate), args)
    }

    /// Creates a filter that resumes from a stored state.
    fn resumed(sensor: &Sensor, args: &FilterArgs, stored: &Stored) -> Result<Self, CliError> {
        if let Some(RestResistance::First(count)) = args.estimate.rest_resistance {
            let message = format!(
                "--rest-resistance first:{count}: R0 is in the state of --resume; leave it out, or give it in ohms"
            );
            return Err(CliError::Arguments(message));
        }
        let builder = builder(sensor, &args.estimate);
        let filter = match args.lag_s {
            None => builder.resume(stored).map(Lag::None),
            Some(lag_s) => builder.resume_lagged(lag_s, stored).map(Lag::Some),
        };
        let path = args.resume.as_deref().unwrap_or(Path::new("")).display();
        let filter = filter.map_err(|error| CliError::Input(format!("{path}: {error}")))?;
        Ok(Self { filter, row: None })
    }

    fn store(&self) -> Result<Stored, Error> {
        match &self.filter {
            Lag::None(filter) => filter.store(),
            Lag::Some(filter) => filter.store(),
        }
    }

    /// Starts a new filter after the device has restarted.
    fn anew(sensor: &Sensor, args: &FilterArgs) -> Result<Self, Error> {
        Self::built(builder_anew(sensor, &args.estimate), args)
    }

    fn built(builder: FilterBuilder, args: &FilterArgs) -> Result<Self, Error> {
        let filter = match args.lag_s {
            None => Lag::None(builder.build()?),
            Some(lag_s) => Lag::Some(builder.build_lagged(lag_s)?),
        };
        Ok(Self { filter, row: None })
    }

    /// Takes a row, and returns the rows that are due.
    fn step(&mut self, time_s: f64, reading: Reading) -> Result<&[Estimate], Error> {
        match &mut self.filter {
            Lag::None(filter) => Ok(std::slice::from_ref(self.row.insert(filter.step(time_s, reading)?))),
            Lag::Some(filter) => filter.step(time_s, reading),
        }
    }

    /// Returns the rows that are still pending.
    fn finish(&mut self) -> Result<&[Estimate], Error> {
        match &mut self.filter {
            Lag::None(_) => Ok(&[]),
            Lag::Some(filter) => filter.finish(),
        }
    }

    fn rest_resistance(&mut self, measured: f64) -> Result<(), Error> {
        match &mut self.filter {
            Lag::None(filter) => filter.rest_resistance(measured),
            Lag::Some(filter) => filter.rest_resistance(measured),
        }
    }
}

/// Rows on their way through a filter.
struct Stream<'a, W: io::Write + Send> {
    args: &'a FilterArgs,
    filter: FilterRun,
    sink: Sink<'a, W>,
    /// State from which the filter resumes.
    stored: Option<Stored>,
    /// First and last time, s, since the start or the last restart of the clock.
    times: Option<(f64, f64)>,
    restarted: bool,
    skipped: Skipped,
}

impl<'a, W: io::Write + Send> Stream<'a, W> {
    /// Filters row by row; returns the number of rows written, and the state if it is to be saved.
    fn run(mut self, mut rows: RowSource) -> Result<(u64, Option<String>), CliError> {
        let wanted = self.args.estimate.rest_resistance;
        // The rows that R₀ is computed from, at least one, are estimated too, once R₀ is known.
        let count = if let Some(RestResistance::First(count)) = wanted { count } else { 0 };
        let enough = if self.sink.live { count } else { count.max(FIRST_READINGS) };
        let first = first_rows(&mut rows, self.args.skip_bad, count, enough)?;
        if first.iter().all(Result::is_err) {
            // All lines may have been skipped; a fault in lines above the header is not to blame for that.
            let above = |error: &TraceError| matches!(error, TraceError::Content(fault) if fault.is_foreign);
            let fault = first.into_iter().filter_map(Result::err).find(|error| !above(error));
            return Err(fault.map_or_else(|| no_row(rows.file(), rows.line()), CliError::from));
        }
        let known = || first.iter().flatten().map(|row| row.row.reading.value);
        let rest = rest_resistance(wanted, &self.sink.sensor, known(), &self.sink.file)?;
        self.sink.rest = rest;
        self.begin(&self.args.estimate.known)?;
        let rest = self.sink.rest;
        if !self.sink.live {
            suits::check_readings(&self.sink.header, &self.sink.sensor, rest, known())?;
            let times = first.iter().flatten().map(|row| row.row.time_s);
            suits::warn_of_clock(&self.sink.header, &self.sink.sensor, times, self.sink.messages);
        }
        let mut first = first.into_iter();
        let streamed = loop {
            let Some(row) = first.next().or_else(|| rows.next()) else { break Ok(()) };
            if let Err(error) = self.take(row, &rows) {
                break Err(error);
            }
        };
        self.skipped.say(self.sink.messages);
        suits::warn_of_temperatures(rows.implausible_temperatures(), &self.sink.file, self.sink.messages);
        if let (Ok(()), Some(times)) = (&streamed, self.times) {
            suits::warn_of_unused(&self.args.estimate.known, times, &self.sink.file, self.sink.messages);
            self.sink.unlike.warn(&self.sink.file, self.sink.messages);
        }
        // The estimates may have lost their reader. The clock is then that of the last filtered row, if none was read ahead.
        let is_closed = matches!(streamed, Err(CliError::ClosedPipe)) && first.len() == 0;
        let saves = self.args.save_state.is_some() && (streamed.is_ok() || is_closed);
        // Pending rows get their estimates whatever stopped the stream, and finished estimates remain valid.
        let finished = if saves { Ok(()) } else { self.finish() };
        let state = saves.then(|| self.state(&rows)).transpose()?;
        let written = match self.sink.writer.finish() {
            Err(CliError::ClosedPipe) if saves => return Ok((0, state)),
            written => written?,
        };
        let ended = if saves { Ok(()) } else { streamed.and(finished) };
        ended.map(|()| (written, state))
    }

    /// Returns the state from which the next row can resume.
    fn state(&self, rows: &RowSource) -> Result<String, CliError> {
        let mut stored = self.filter.store()?;
        stored.rest_resistance = self.sink.rest;
        stored.temperature_c = rows.last_temperature_c();
        stored.clock = rows.last_time().map(filter_state::of_last_time);
        stored.validity = Some(self.sink.watch.seen());
        stored.quiet = Some(self.sink.quiet.seen());
        Ok(stored.to_toml()?)
    }

    /// Takes a row or an error; `rows` is its source.
    fn take(&mut self, row: Result<DeviceRow, TraceError>, rows: &RowSource) -> Result<(), CliError> {
        let DeviceRow { row, restarted } = match row {
            Err(TraceError::Content(fault)) if self.args.skip_bad => {
                self.skipped.count(fault);
                return Ok(());
            }
            row => row.map_err(|error| late(error, SKIPS))?,
        };
        if restarted {
            self.restart(&row, rows)?;
        }
        if !self.restarted {
            self.times = Some((self.times.map_or(row.time_s, |times| times.0), row.time_s));
        }
        let at = |error| CliError::Input(format!("{}:{}: {error}", self.sink.file, row.line));
        self.sink.write(self.filter.step(row.time_s, trace::reading(&row.reading)).map_err(at)?)
    }

    /// Restarts the filter after the clock has restarted. Times stay those of the file.
    fn restart(&mut self, row: &Row, rows: &RowSource) -> Result<(), CliError> {
        let at = format!("{}:{}", self.sink.file, row.line);
        check_unit(&at, rows.reading_kind(), self.sink.sensor.params().reading)?;
        self.finish()?;
        let time_s = significant(row.time_s, 6);
        self.sink.messages.warning(&format!("{at}: the clock has started again, at {time_s} s, and so has the filter"));
        if let Some(joint) = trace::joint(&rows.metadata()) {
            self.sink.sensor = self.sink.sensor.clone().on_joint(joint)?;
        }
        self.filter = FilterRun::anew(&self.sink.sensor, self.args)?;
        self.sink.early.clear();
        self.restarted = true;
        self.begin(&[])
    }

    /// Passes the reading of the rested sensor to the filter, and to the watches.
    fn begin(&mut self, known: &'a [Known]) -> Result<(), CliError> {
        let sink = &mut self.sink;
        sink.rest.map_or(Ok(()), |measured| self.filter.rest_resistance(measured))?;
        let is_given = sink.rest.is_some();
        let stored = self.stored.take();
        // A resumed filter has its R₀ already.
        sink.rest = sink.rest.or(stored.as_ref().and_then(|stored| stored.rest_resistance));
        sink.watch = ValidityWatch::new(&sink.sensor, sink.rest);
        sink.quiet = QuietWatch::new(&sink.sensor, sink.rest, known);
        if let Some(stored) = stored.filter(|_| !is_given) {
            stored.validity.into_iter().for_each(|seen| sink.watch.go_on(seen));
            stored.quiet.into_iter().for_each(|seen| sink.quiet.go_on(seen));
        }
        Ok(())
    }

    /// Writes the rows that are still pending.
    fn finish(&mut self) -> Result<(), CliError> {
        let named = |error| CliError::Input(format!("{}: {error}", self.sink.file));
        let waiting = self.filter.finish().map_err(named)?;
        self.sink.write(waiting)
    }
}

/// Advice for a clock that has restarted.
const SKIPS: &str = "--skip-bad goes on with another filter";

/// Destination of the estimates.
struct Sink<'a, W: io::Write + Send> {
    messages: &'a Messages,
    writer: EstimateWriter<W>,
    /// Watch for use outside the calibrated range.
    watch: ValidityWatch,
    quiet: QuietWatch,
    sensor: Sensor,
    /// Reading of the rested sensor, if it differs from that in calibration.
    rest: Option<f64>,
    file: String,
    /// Name of the recording's header in messages.
    header: String,
    /// True for standard input or a pipe, where a reader waits for each row.
    live: bool,
    /// First known readings of a live stream.
    early: Vec<f64>,
    unlike: Unlike,
}

impl<W: io::Write + Send> Sink<'_, W> {
    fn write(&mut self, estimates: &[Estimate]) -> Result<(), CliError> {
        self.unlike.see(estimates);
        for row in estimates {
            let reading = row.resistance.unwrap_or(f64::NAN);
            if self.live && reading.is_finite() && self.early.len() < FIRST_LIVE_READINGS {
                self.early.push(reading);
                self.doubt_early();
            }
            for warning in self.watch.see(row.time_s, reading, row.strain_rate, f64::NAN) {
                self.messages.warning(&format!("{}: {warning}", self.file));
                self.unlike.is_warned = true;
            }
            if let Some(quiet) = self.quiet.see(row) {
                self.messages.warning(&format!("{}: {}", self.file, quiet.text(CommandLine)));
            }
            self.writer.write(row)?;
        }
        if self.live { self.writer.flush() } else { Ok(()) }
    }

    /// Checks the unit of a live stream's readings, once enough have arrived.
    fn doubt_early(&self) {
        if self.early.len() == FIRST_LIVE_READINGS
            && let Err(doubt) = self.sensor.check_unit(self.early.iter().copied(), self.rest)
        {
            self.messages.warning(&format!("{}: {}", self.header, doubt.text(CommandLine)));
        }
    }
}

/// Lines that were not part of a trace.
#[derive(Default)]
struct Skipped {
    first: Option<BadContent>,
    count: usize,
}

impl Skipped {
    fn count(&mut self, fault: BadContent) {
        self.first.get_or_insert(fault);
        self.count += 1;
    }

    fn say(&self, messages: &Messages) {
        let Some(first) = &self.first else { return };
        let lines = if self.count == 1 { "1 line was skipped" } else { &format!("{} lines were skipped", self.count) };
        messages.warning(&format!("{lines}; the first one: {first}"));
    }
}

/// Rows that are searched for a first reading, if it is not required.
const MOST_FIRST_ROWS: usize = 10 * FIRST_READINGS;

/// Rows that are searched for required readings. It bounds memory, and lasts for days at 10 Hz.
const MOST_WAITING_ROWS: usize = 1 << 20;

/// Returns the first rows: until `wanted` readings are known, or at least `enough` of them in many rows. An error ends the
/// search; it is returned if fewer than `enough` readings are known.
fn first_rows(
    rows: &mut RowSource,
    skips_bad: bool,
    enough: usize,
    wanted: usize,
) -> Result<Vec<Result<DeviceRow, TraceError>>, CliError> {
    let (mut first, mut known) = (Vec::new(), 0);
    while let Some(row) = rows.next() {
        let passed_over = skips_bad && matches!(row, Err(TraceError::Content(_)));
        let row = if known < enough && !passed_over { Ok(row.map_err(|error| late(error, SKIPS))?) } else { row };
        known += usize::from(row.as_ref().is_ok_and(|row| row.row.reading.value.is_finite()));
        let failed = row.is_err() && !passed_over;
        first.push(row);
        let is_enough = !passed_over && known >= wanted;
        if failed || is_enough || (known >= enough && first.len() >= MOST_FIRST_ROWS) {
            break;
        }
        if first.len() == MOST_WAITING_ROWS {
            return Err(CliError::Input(format!(
                "{}:{}: --rest-resistance: expected {enough} readings among the first {MOST_WAITING_ROWS} lines, found {known}",
                rows.file(),
                rows.line()
            )));
        }
    }
    Ok(first)
}
