//! State of the view: the filter, and the lines so far.

use std::collections::VecDeque;
use std::time::Instant;

use ohmstrain::Interface::CommandLine;
use ohmstrain::number::significant;
use ohmstrain::trace::{self, check_unit};
use ohmstrain::{Error, Estimate, Filter, QuietWatch, Sensor, Thermometer, ValidityWatch};
use ohmstrain_bench_data::{Line, LineParser, Row, counted};

use super::recorder::Recorder;
use crate::args::{LiveArgs, RestResistance};
use crate::error::CliError;
use crate::port::{Due, Headed, Taker};
use crate::run::{builder, builder_anew, median, of_first};
use crate::suits::FIRST_LIVE_READINGS;

/// Largest number of rows kept for the plot.
const MOST_POINTS: usize = 1 << 16;
/// Ratio of a step to the usual step above which it is a gap.
const GAP: f64 = 5.0;
/// Shortest pause that is reported, s.
const SILENCE_S: f64 = 2.0;
/// Weight of a new step in the running mean of steps.
const NEW_STEP: f64 = 0.1;
/// Duration, s, over which the reading of the rested sensor is determined, and the smallest number of readings for that.
const REST_S: f64 = 1.0;
const LEAST_AT_REST: usize = 5;

/// A row of the plot.
#[derive(Clone, Copy)]
pub struct Point {
    pub time_s: f64,
    /// The reading; NaN where it is missing.
    pub reading: f64,
    /// Strain, and half its 95 % interval.
    pub strain: f64,
    pub half_width: f64,
}

/// Counts of rows, gaps, bad lines and the like.
#[derive(Clone, Copy, Default)]
pub struct Counts {
    pub rows: u64,
    pub missing: u64,
    pub gaps: u64,
    pub bad_lines: u64,
    pub restarts: u64,
    pub marks: u32,
}

/// A filter on a stream of lines.
pub struct Session<'a> {
    args: &'a LiveArgs,
    /// The sensor, on the joint of the last header that named one.
    calibrated: Sensor,
    /// The same for the stream's columns.
    sensor: Sensor,
    /// Conversion of the readings to its reference temperature.
    thermometer: Thermometer,
    lines: LineParser,
    filter: Filter,
    watch: ValidityWatch,
    quiet: QuietWatch,
    /// Reading of the rested sensor, if it differs from that in calibration.
    rest: Option<f64>,
    /// The first known readings.
    early: Vec<f64>,
    headed: Headed,
    usual_step_s: Option<f64>,
    new_mark: Option<u32>,
    pub points: VecDeque<Point>,
    /// Times of the marks, s.
    pub marks: VecDeque<f64>,
    pub last: Option<Estimate>,
    /// Arrival of the last row.
    taken: Option<Instant>,
    pub counts: Counts,
    pub recorder: Option<Recorder>,
    /// Last message.
    pub message: String,
}

impl<'a> Session<'a> {
    /// Creates a session that waits for a header, unless the flags contain it.
    ///
    /// # Errors
    /// If the flags contradict each other or the sensor.
    pub fn new(args: &'a LiveArgs, sensor: Sensor) -> Result<Self, CliError> {
        let rest = match args.estimate.rest_resistance {
            Some(RestResistance::Value(value)) => {
                sensor.check_rest_resistance(value)?;
                Some(value)
            }
            Some(RestResistance::Calibrated) => Some(sensor.params().rested()),
            _ => None,
        };
        let name = args.port.source();
        let lines = LineParser::new(&name, args.setup.metadata(&args.estimate.units));
        let (filter, watch) = (builder(&sensor, &args.estimate).build()?, ValidityWatch::new(&sensor, rest));
        let quiet = QuietWatch::new(&sensor, rest, &args.estimate.known);
        let mut session = Self {
            args,
            calibrated: sensor.clone(),
            thermometer: Thermometer::new(&sensor),
            sensor,
            lines,
            filter,
            watch,
            quiet,
            rest,
            early: vec![],
            headed: Headed::new(args.port.header.as_deref()),
            usual_step_s: None,
            new_mark: None,
            points: VecDeque::new(),
            marks: VecDeque::new(),
            last: None,
            taken: None,
            counts: Counts::default(),
            recorder: None,
            message: String::new(),
        };
        session.begin()?;
        if let Some(header) = session.headed.header().map(str::to_owned) {
            match session.lines.take(header.as_bytes()) {
                Ok(Line::Header) => session.headed()?,
                Ok(_) => return Err(CliError::Arguments("--header: expected names of columns".into())),
                Err(fault) => return Err(CliError::Arguments(format!("--header: expected {}", fault.expected))),
            }
        }
        Ok(session)
    }

    /// The sensor.
    pub const fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Begins another stream after a header.
    fn headed(&mut self) -> Result<(), CliError> {
        let kind = self.lines.reading_kind();
        let header = self.args.port.source();
        kind.map_or(Ok(()), |kind| check_unit(&header, kind, self.sensor.params().reading))?;
        if let Some(joint) = trace::joint(&self.lines.metadata()) {
            self.calibrated = self.calibrated.clone().on_joint(joint)?;
        }
        // Messages about the lines above it no longer apply.
        self.message.clear();
        self.sensor = self.calibrated.clone();
        if self.sensor.params().temperature.is_some() && !self.lines.has_temperature() {
            self.message = "no column temperature_c: intervals are wider".into();
            self.sensor = self.calibrated.clone().without_temperature();
        }
        self.thermometer = Thermometer::new(&self.sensor);
        if self.counts.rows > 0 { self.restart() } else { Ok(self.begin()?) }
    }

    /// Starts a new filter.
    fn begin(&mut self) -> Result<(), Error> {
        let anew = self.counts.restarts > 0;
        let wanted = if anew { builder_anew } else { builder }(&self.sensor, &self.args.estimate);
        let known = if anew { &[] } else { self.args.estimate.known.as_slice() };
        self.filter = self.rest.map_or(wanted, |measured| wanted.rest_resistance(measured)).build()?;
        self.watch = ValidityWatch::new(&self.sensor, self.rest);
        self.quiet = QuietWatch::new(&self.sensor, self.rest, known);
        self.usual_step_s = None;
        Ok(())
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), CliError> {
        self.counts.restarts += 1;
        self.begin()?;
        self.points.clear();
        self.marks.clear();
        self.message = "the clock has started again, and so has the filter".into();
        if self.recorder.is_some() {
            self.toggle_record();
            self.toggle_record();
        }
        Ok(())
    }

    fn count(&mut self, row: &Row) {
        self.counts.rows += 1;
        self.counts.missing += u64::from(!row.reading.value.is_finite());
        let Some(step_s) = self.points.back().map(|last| row.time_s - last.time_s) else { return };
        let usual_s = self.usual_step_s.get_or_insert(step_s);
        if step_s > GAP * *usual_s {
            self.counts.gaps += 1;
        } else {
            *usual_s += NEW_STEP * (step_s - *usual_s);
        }
    }

    /// Returns the usual rate of rows per second.
    pub fn rate_hz(&self) -> Option<f64> {
        self.usual_step_s.filter(|step_s| *step_s > 0.0).map(f64::recip)
    }

    /// Returns the time since the last row, s, if it is longer than usual.
    pub fn silent_s(&self) -> Option<f64> {
        let longest_s = SILENCE_S.max(GAP * self.usual_step_s.unwrap_or(0.0));
        self.taken.map(|taken| taken.elapsed().as_secs_f64()).filter(|silent_s| *silent_s > longest_s)
    }

    /// Checks the unit of the readings, and computes R₀ from the first ones if requested.
    fn doubt_early(&mut self, reading: f64) -> Result<(), CliError> {
        let wanted = match self.args.estimate.rest_resistance {
            Some(RestResistance::First(count)) => count,
            _ => 0,
        };
        if !reading.is_finite() || self.early.len() >= wanted.max(FIRST_LIVE_READINGS) {
            return Ok(());
        }
        self.early.push(reading);
        if self.early.len() == wanted {
            self.rest = median(self.early.clone());
            let outcome = self.rest.map_or(Ok(()), |measured| self.filter.rest_resistance(measured));
            outcome.map_err(|refused| of_first(&refused, wanted, &self.args.port.source()))?;
            self.watch = ValidityWatch::new(&self.sensor, self.rest);
        }
        if self.early.len() == wanted.max(FIRST_LIVE_READINGS)
            && let Err(doubt) = self.sensor.check_unit(self.early.iter().copied(), self.rest)
        {
            self.message = doubt.text(CommandLine);
        }
        Ok(())
    }

    /// Takes the sensor as rested now: its reading becomes R₀, and its strain zero.
    ///
    /// # Errors
    /// If no filter can be built.
    pub fn zero(&mut self) -> Result<(), CliError> {
        let Some(last_s) = self.points.back().map(|point| point.time_s) else { return Ok(()) };
        let recent = self.points.iter().rev().take_while(|point| point.time_s >= last_s - REST_S);
        let mut readings: Vec<f64> = recent.map(|point| point.reading).filter(|reading| reading.is_finite()).collect();
        if readings.len() < LEAST_AT_REST {
            let known = self.points.iter().rev().map(|point| point.reading).filter(|reading| reading.is_finite());
            readings = known.take(LEAST_AT_REST).collect();
        }
        let count = readings.len();
        let Some(rest) = median(readings) else { return Ok(()) };
        if let Err(refused) = self.sensor.check_rest_resistance(rest) {
            self.message = format!("R0 stays as it was: {refused}");
            return Ok(());
        }
        self.rest = Some(rest);
        self.begin()?;
        // A sensor whose range excludes zero cannot start there.
        let wanted = builder(&self.sensor, &self.args.estimate).rest_resistance(rest);
        let at_zero = wanted.initial_strain(0.0).build();
        let starts = if at_zero.is_ok() { "; it starts again at zero" } else { "" };
        self.filter = at_zero.unwrap_or(wanted.build()?);
        self.message = format!("R0 is {} now, the median of {count} readings{starts}", significant(rest, 5));
        Ok(())
    }

    /// Puts a mark on the next row.
    pub fn mark(&mut self) {
        let Some(last) = self.points.back() else { return };
        self.counts.marks += 1;
        self.new_mark = Some(self.counts.marks);
        self.marks.push_back(last.time_s);
        self.message = format!("mark {} at {:.2} s", self.counts.marks, last.time_s);
    }

    /// Starts or stops recording.
    pub fn toggle_record(&mut self) {
        self.message = match self.recorder.take() {
            Some(recorder) => {
                let message = format!("recorded {} ({})", recorder.path.display(), counted(recorder.count, "row"));
                message
            }
            None if self.counts.rows == 0 => "there is nothing to record yet".into(),
            None => match Recorder::begin(&self.args.record, &self.lines) {
                Ok(recorder) => {
                    let message = format!("recording to {}", recorder.path.display());
                    self.recorder = Some(recorder);
                    message
                }
                Err(error) => format!("cannot record: {error}"),
            },
        };
    }

    fn record(&mut self, row: &Row) {
        let mark = self.new_mark.take();
        let Some(recorder) = &mut self.recorder else { return };
        if let Err(error) = recorder.write(row, mark) {
            self.message = format!("cannot record: {error}");
            self.recorder = None;
        }
    }
}

impl Taker for Session<'_> {
    type Row = Row;

    fn parse(&mut self, line: &[u8], arrived: Instant) -> Result<Option<Due<Row>>, CliError> {
        let due = |row: Row, restarted: bool| Due { time_s: row.time_s, row, restarted };
        match self.lines.take(&self.headed.line(line, arrived)) {
            Ok(Line::Row(row)) => Ok(Some(due(row, false))),
            Ok(Line::Restarted(row)) => Ok(Some(due(row, true))),
            Ok(Line::Header) => self.headed().map(|()| None),
            Ok(_) => Ok(None),
            Err(fault) => {
                self.counts.bad_lines += 1;
                self.message = format!("skipped {fault}");
                if self.lines.reading_kind().is_none() {
                    self.message += "; a stream without a header needs --header time_s,resistance_ohm";
                }
                Ok(None)
            }
        }
    }

    fn take(&mut self, due: Due<Row>) -> Result<(), CliError> {
        if due.restarted {
            self.restart()?;
        }
        let mut row = due.row;
        row.reading.value = self.thermometer.at_reference(row.reading.value, row.temperature_c);
        let row = &row;
        let estimate = match self.filter.step(row.time_s, trace::reading(&row.reading)) {
            Ok(estimate) => estimate,
            Err(error) => {
                self.counts.bad_lines += 1;
                self.message = error.to_string();
                return Ok(());
            }
        };
        self.count(row);
        self.taken = Some(Instant::now());
        let (reading, half_width) = (row.reading.value, 1.96 * estimate.strain_sd);
        self.points.push_back(Point { time_s: row.time_s, reading, strain: estimate.strain, half_width });
        let oldest_s = row.time_s - self.args.window_s.max(REST_S);
        while self.points.len() > MOST_POINTS || self.points.front().is_some_and(|point| point.time_s < oldest_s) {
            self.points.pop_front();
        }
        while self.marks.front().is_some_and(|mark_s| *mark_s < oldest_s) {
            self.marks.pop_front();
        }
        if let Some(warning) = self.watch.see(row.time_s, reading, estimate.strain_rate, f64::NAN).last() {
            self.message = warning.to_string();
        }
        if let Some(quiet) = self.quiet.see(&estimate) {
            let quiet_s = significant(quiet.now_s - quiet.from_s, 2);
            self.message = format!("{quiet_s} s of quiet that may be a rest: z, if it is one");
        }
        self.last = Some(estimate);
        self.doubt_early(reading)?;
        self.record(row);
        Ok(())
    }
}
