use std::io::{self, Read};

use ohmstrain::{Error, Estimate, Filter, LaggedFilter, Reading, Sensor, ValidityWatch};
use ohmstrain_bench_data::{BadContent, Row, TraceError, TraceReader};

use crate::args::{FilterArgs, RestResistance, WrittenArgs};
use crate::error::CliError;
use crate::estimates::{self, EstimateWriter};
use crate::input::{self, Beginning, check_unit, is_stdin};
use crate::output::RowsOut;
use crate::quiet::QuietWatch;
use crate::readings::no_row;
use crate::run::{builder, rest_resistance};
use crate::sensor_file;
use crate::suits::{self, FIRST_LIVE_READINGS, FIRST_READINGS};

/// Turns readings into strain as they arrive. Memory does not grow with the recording.
pub fn run(args: &FilterArgs) -> Result<(), CliError> {
    let kind = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    if args.lag_s.is_some() && kind.is_some_and(|kind| kind.smoother() != kind) {
        return Err(Error::NoSmoother.into());
    }
    let WrittenArgs { output, replace, columns, .. } = &args.written;
    let mut rows_out = RowsOut::claim(output.as_deref(), replace.force, [&args.trace_file, &args.estimate.sensor])?;
    let mut sensor = sensor_file::read(&args.estimate.sensor, kind)?;
    let mut filter = FilterRun::new(&sensor, args)?;
    suits::warn_of_start(args.estimate.initial_strain, &sensor);
    let beginning = match &args.header {
        Some(columns) => Beginning::Row(columns),
        None if args.skip_bad => Beginning::Preamble,
        None => Beginning::Header,
    };
    let rows = input::open_at(&args.trace_file, &args.estimate.trace.metadata(), beginning)?;
    let header = input::header(&rows);
    check_unit(&header, rows.reading_kind(), sensor.params().reading)?;
    if let Some(joint) = input::joint(rows.metadata()) {
        sensor = sensor.on_joint(joint)?;
        filter = FilterRun::new(&sensor, args)?;
    }
    let columns = estimates::columns(&sensor, columns)?;
    let live = is_stdin(&args.trace_file) || !args.trace_file.is_file();
    let writer = EstimateWriter::new(rows_out.open(live)?, args.written.format(), columns)?;
    let watch = ValidityWatch::new(&sensor, None);
    let quiet = QuietWatch::new(&sensor, None, &args.estimate.known);
    let sink = Sink {
        writer,
        watch,
        quiet,
        sensor: &sensor,
        rest: None,
        file: rows.file().into(),
        header,
        live,
        early: vec![],
    };
    stream(args, filter, rows, sink)?;
    rows_out.publish()
}

/// A filter with or without a lag, and the last row of one without.
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
        let builder = builder(sensor, &args.estimate);
        let filter = match args.lag_s {
            None => Lag::None(builder.build()?),
            Some(lag_s) => Lag::Some(builder.build_lagged(lag_s)?),
        };
        Ok(Self { filter, row: None })
    }

    /// Takes a row; the rows that are due.
    fn step(&mut self, time_s: f64, reading: Reading) -> Result<&[Estimate], Error> {
        match &mut self.filter {
            Lag::None(filter) => Ok(std::slice::from_ref(self.row.insert(filter.step(time_s, reading)?))),
            Lag::Some(filter) => filter.step(time_s, reading),
        }
    }

    /// The rows that still wait.
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

/// Filters row by row.
fn stream<'a, W: io::Write + Send>(
    args: &'a FilterArgs,
    mut filter: FilterRun,
    rows: TraceReader<Box<dyn Read>>,
    mut sink: Sink<'a, W>,
) -> Result<(), CliError> {
    let wanted = args.estimate.rest_resistance;
    // The rows that R₀ is taken from, at least one, are estimated too, once it is known.
    let count = if let Some(RestResistance::First(count)) = wanted { count } else { 0 };
    let mut rows = if args.skip_bad { rows.past_bad_lines() } else { rows };
    let first = first_rows(&mut rows, args.skip_bad, count, if sink.live { count } else { count.max(FIRST_READINGS) })?;
    if first.iter().all(Result::is_err) {
        // What was skipped may be all there was; what stood above the header is not to blame for it.
        let above = |error: &TraceError| matches!(error, TraceError::Content(fault) if fault.is_foreign);
        let fault = first.into_iter().filter_map(Result::err).find(|error| !above(error));
        return Err(fault.map_or_else(|| no_row(&rows), CliError::from));
    }
    let known = || first.iter().flatten().map(|row| row.reading.value);
    let rest = rest_resistance(wanted, sink.sensor, known(), &sink.file)?;
    rest.map_or(Ok(()), |measured| filter.rest_resistance(measured))?;
    (sink.rest, sink.watch) = (rest, ValidityWatch::new(sink.sensor, rest));
    sink.quiet = QuietWatch::new(sink.sensor, rest, &args.estimate.known);
    if !sink.live {
        suits::check_readings(&sink.header, sink.sensor, rest, known())?;
    }
    let mut times: Option<(f64, f64)> = None;
    let mut take = |row: Row| -> Result<(), CliError> {
        times = Some((times.map_or(row.time_s, |times| times.0), row.time_s));
        let at = |error| CliError::Input(format!("{}:{}: {error}", sink.file, row.line));
        sink.write(filter.step(row.time_s, input::reading(&row.reading)).map_err(at)?)
    };
    let mut skipped = Skipped::default();
    let streamed = first.into_iter().chain(rows).try_for_each(|row| match row {
        Err(TraceError::Content(fault)) if args.skip_bad => {
            skipped.count(fault);
            Ok(())
        }
        row => take(row?),
    });
    skipped.say();
    if let (Ok(()), Some(times)) = (&streamed, times) {
        suits::warn_of_unused(&args.estimate.known, times, &sink.file);
    }
    // The rows that still wait get their estimates, whatever stopped the stream, and what was estimated is still good.
    let finished = match filter.finish() {
        Ok(estimates) => sink.write(estimates),
        Err(error) => Err(CliError::Input(format!("{}: {error}", sink.file))),
    };
    sink.writer.finish().and(streamed).and(finished)
}

/// Where estimates go.
struct Sink<'a, W: io::Write + Send> {
    writer: EstimateWriter<W>,
    /// Says when the calibration does not reach.
    watch: ValidityWatch,
    quiet: QuietWatch<'a>,
    sensor: &'a Sensor,
    /// What the rested sensor reads, if not what it read in calibration.
    rest: Option<f64>,
    file: String,
    /// What messages call the recording's header.
    header: String,
    /// Not a file but standard input or a pipe: somebody waits for each row.
    live: bool,
    /// The first known readings of a live stream.
    early: Vec<f64>,
}

impl<W: io::Write + Send> Sink<'_, W> {
    fn write(&mut self, estimates: &[Estimate]) -> Result<(), CliError> {
        for row in estimates {
            let reading = row.resistance.unwrap_or(f64::NAN);
            if self.live && reading.is_finite() && self.early.len() < FIRST_LIVE_READINGS {
                self.early.push(reading);
                self.doubt_early();
            }
            for warning in self.watch.see(row.time_s, reading, row.strain_rate, f64::NAN) {
                CliError::warning(&format!("{}: {warning}", self.file));
            }
            if let Some(quiet) = self.quiet.see(row) {
                CliError::warning(&format!("{}: {}", self.file, suits::of_rest(&quiet)));
            }
            self.writer.write(row)?;
        }
        if self.live { self.writer.flush() } else { Ok(()) }
    }

    /// Asks about the unit of a live stream's readings, once there are enough.
    fn doubt_early(&self) {
        if self.early.len() == FIRST_LIVE_READINGS
            && let Err(doubt) = self.sensor.check_unit(self.early.iter().copied(), self.rest)
        {
            CliError::warning(&format!("{}: {}", self.header, suits::answerable(&doubt)));
        }
    }
}

/// Lines that were none of a trace.
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

    fn say(&self) {
        let Some(first) = &self.first else { return };
        let lines = if self.count == 1 { "1 line was skipped" } else { &format!("{} lines were skipped", self.count) };
        CliError::warning(&format!("{lines}; the first one: {first}"));
    }
}

/// Rows without a reading among which a reading is looked for, where it is not needed.
const MOST_FIRST_ROWS: usize = 10 * FIRST_READINGS;

/// The first rows: until `wanted` readings are known, or `enough` of them and many rows. An error ends them; it is returned
/// if fewer readings than that are known.
fn first_rows<R: Read>(
    rows: &mut TraceReader<R>,
    skips_bad: bool,
    enough: usize,
    wanted: usize,
) -> Result<Vec<Result<Row, TraceError>>, CliError> {
    let (mut first, mut known) = (Vec::new(), 0);
    for row in rows {
        let passed_over = skips_bad && matches!(row, Err(TraceError::Content(_)));
        let row = if known < enough && !passed_over { Ok(row?) } else { row };
        known += usize::from(row.as_ref().is_ok_and(|row| row.reading.value.is_finite()));
        let failed = row.is_err() && !passed_over;
        first.push(row);
        let is_enough = !passed_over && known >= wanted;
        if failed || is_enough || (known >= enough && first.len() >= MOST_FIRST_ROWS) {
            break;
        }
    }
    Ok(first)
}
