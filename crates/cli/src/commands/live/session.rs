//! State of the view: the filter, and the lines so far.

use std::io;
use std::time::Instant;

use ohmstrain::Interface::CommandLine;
use ohmstrain::number::significant;
use ohmstrain::trace::{self, check_unit};
use ohmstrain::{Error, Estimate, Filter, QuietWatch, Sensor, Thermometer, ValidityWatch};
use ohmstrain_bench_data::{Line, LineParser, ReadingKind, ReferenceQuantity, Row};

use super::Shown;
use super::recorder::Recorder;
use super::track::{LEAST_AT_REST, REST_S, Timed, Track};
use crate::args::{LiveArgs, RestResistance};
use crate::error::CliError;
use crate::port::{Due, Headed, Taker};
use crate::run::{builder, builder_anew, median, of_first};
use crate::suits::FIRST_LIVE_READINGS;

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

impl Timed for Point {
    fn time_s(&self) -> f64 {
        self.time_s
    }
}

/// A filter on a stream of lines.
pub struct Session<'a> {
    pub args: &'a LiveArgs,
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
    pub track: Track<Point>,
    pub last: Option<Estimate>,
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
            track: Track::new(),
            last: None,
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
        self.track.message.clear();
        self.sensor = self.calibrated.clone();
        if self.sensor.params().temperature.is_some() && !self.lines.has_temperature() {
            self.track.message = "no column temperature_c: intervals are wider".into();
            self.sensor = self.calibrated.clone().without_temperature();
        }
        self.thermometer = Thermometer::new(&self.sensor);
        if self.track.pulse.counts.rows > 0 { self.restart() } else { Ok(self.begin()?) }
    }

    /// Starts a new filter.
    fn begin(&mut self) -> Result<(), Error> {
        let anew = self.track.pulse.counts.restarts > 0;
        let wanted = if anew { builder_anew } else { builder }(&self.sensor, &self.args.estimate);
        let known = if anew { &[] } else { self.args.estimate.known.as_slice() };
        self.filter = self.rest.map_or(wanted, |measured| wanted.rest_resistance(measured)).build()?;
        self.watch = ValidityWatch::new(&self.sensor, self.rest);
        self.quiet = QuietWatch::new(&self.sensor, self.rest, known);
        self.track.pulse.restart();
        Ok(())
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), CliError> {
        self.track.pulse.counts.restarts += 1;
        self.begin()?;
        self.restarted("the clock has started again, and so has the filter");
        Ok(())
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
            self.track.message = doubt.text(CommandLine);
        }
        Ok(())
    }

    fn record(&mut self, row: &Row) {
        let reading = recorded(row, self.lines.has_codes());
        let reference = self.lines.reference_quantity().map(|_| row.reference);
        self.track.record(row.time_s, std::iter::once(reading).chain(reference));
    }
}

/// Returns the reading of a row as it is recorded.
pub fn recorded(row: &Row, is_code: bool) -> f64 {
    if is_code { row.reading.code.map_or(f64::NAN, f64::from) } else { row.reading.value }
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
                self.track.skip(format!("skipped {fault}"));
                if self.lines.reading_kind().is_none() {
                    self.track.message += "; a stream without a header needs --header time_s,resistance_ohm";
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
                self.track.skip(error.to_string());
                return Ok(());
            }
        };
        self.track.pulse.count(row.time_s, u64::from(!row.reading.value.is_finite()));
        let (reading, half_width) = (row.reading.value, 1.96 * estimate.strain_sd);
        let point = Point { time_s: row.time_s, reading, strain: estimate.strain, half_width };
        self.track.push(point, self.args.window_s);
        if let Some(warning) = self.watch.see(row.time_s, reading, estimate.strain_rate, f64::NAN).last() {
            self.track.message = warning.to_string();
        }
        if let Some(quiet) = self.quiet.see(&estimate) {
            let quiet_s = significant(quiet.now_s - quiet.from_s, 2);
            self.track.message = format!("{quiet_s} s of quiet that may be a rest: z, if it is one");
        }
        self.last = Some(estimate);
        self.doubt_early(reading)?;
        self.record(row);
        Ok(())
    }
}

impl Shown for Session<'_> {
    type Point = Point;

    fn track(&mut self) -> &mut Track<Point> {
        &mut self.track
    }

    /// Begins a recording of the reading, as a code if it is one, and of the reference.
    fn new_recorder(&self) -> io::Result<Recorder> {
        let reading = match (self.lines.has_codes(), self.lines.reading_kind()) {
            (true, _) => "adc",
            (_, Some(ReadingKind::Ratio)) => "resistance_ratio",
            _ => "resistance_ohm",
        };
        let reference = self.lines.reference_quantity().map(|quantity| match quantity {
            ReferenceQuantity::Strain => "strain",
            ReferenceQuantity::AngleDeg => "angle_deg",
        });
        let columns = std::iter::once(reading).chain(reference);
        Recorder::begin(&self.args.record, self.lines.metadata(), columns)
    }

    /// Makes the reading R₀, and the strain zero.
    fn zero(&mut self) -> Result<(), CliError> {
        let Some(last_s) = self.track.points.back().map(|point| point.time_s) else { return Ok(()) };
        let recent = self.track.points.iter().rev().take_while(|point| point.time_s >= last_s - REST_S);
        let mut readings: Vec<f64> = recent.map(|point| point.reading).filter(|reading| reading.is_finite()).collect();
        if readings.len() < LEAST_AT_REST {
            let known = self.track.points.iter().rev().map(|point| point.reading).filter(|reading| reading.is_finite());
            readings = known.take(LEAST_AT_REST).collect();
        }
        let count = readings.len();
        let Some(rest) = median(readings) else { return Ok(()) };
        if let Err(refused) = self.sensor.check_rest_resistance(rest) {
            self.track.message = format!("R0 stays as it was: {refused}");
            return Ok(());
        }
        self.rest = Some(rest);
        self.begin()?;
        // A sensor whose range excludes zero cannot start there.
        let wanted = builder(&self.sensor, &self.args.estimate).rest_resistance(rest);
        let at_zero = wanted.initial_strain(0.0).build();
        let starts = if at_zero.is_ok() { "; it starts again at zero" } else { "" };
        self.filter = at_zero.unwrap_or(wanted.build()?);
        self.track.message = format!("R0 is {} now, the median of {count} readings{starts}", significant(rest, 5));
        Ok(())
    }
}
