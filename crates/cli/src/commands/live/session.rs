//! State of the view: the filter, and the lines so far.

use std::io;

use ohmstrain::trace::{self, WatchedFilter, check_unit};
use ohmstrain::{Error, Estimate, FilterBuilder, Sensor};
use ohmstrain_bench_data::{Headed, Line, LineParser, Row};

use super::Shown;
use super::recorder::Recorder;
use super::track::{Timed, Track};
use crate::args::{LiveArgs, RestResistance};
use crate::error::CliError;
use crate::port::{Due, Taker};
use crate::run::{builder, builder_anew, of_first, rest_resistance};

/// A row of the plot.
#[derive(Clone, Copy)]
pub struct Point {
    pub time_s: f64,
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
    pub sensor: Sensor,
    lines: LineParser,
    filter: WatchedFilter,
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
        let (rest, rest_of_first) = match args.estimate.rest_resistance {
            Some(RestResistance::First(count)) => (None, count),
            given => (rest_resistance(given, &sensor, std::iter::empty(), "")?, 0),
        };
        let wanted = builder(&sensor, &args.estimate);
        let wanted = rest.map_or(wanted, |measured| wanted.rest_resistance(measured));
        let filter = WatchedFilter::new(wanted, rest_of_first)?;
        let name = args.port.source();
        let lines = LineParser::new(&name, args.setup.metadata(&args.estimate.units));
        let mut session = Self {
            args,
            sensor,
            lines,
            filter,
            headed: Headed::new(args.port.header.as_deref()),
            track: Track::new(),
            last: None,
        };
        if let Some(header) = session.headed.header().map(str::to_owned) {
            match session.lines.take(header.as_bytes()) {
                Ok(Line::Header) => session.headed()?,
                Ok(_) => return Err(CliError::Arguments("--header: expected names of columns".into())),
                Err(fault) => return Err(CliError::Arguments(format!("--header: expected {}", fault.expected))),
            }
        }
        Ok(session)
    }

    /// Begins another stream after a header.
    fn headed(&mut self) -> Result<(), CliError> {
        let kind = self.lines.reading_kind();
        let header = self.args.port.source();
        kind.map_or(Ok(()), |kind| check_unit(&header, kind, self.sensor.params().reading))?;
        if let Some(joint) = trace::joint(&self.lines.metadata()) {
            self.sensor = self.sensor.clone().on_joint(joint)?;
        }
        // Messages about the lines above it no longer apply.
        self.track.message.clear();
        if self.track.pulse.counts.rows > 0 {
            return self.restart();
        }
        self.begin()?.into_iter().for_each(|remark| self.track.message = remark.into());
        Ok(())
    }

    /// Starts a new filter; returns a remark on its columns.
    fn begin(&mut self) -> Result<Option<&'static str>, Error> {
        let wanted = wanted(self.args, &self.sensor, &self.track);
        let remark = self.filter.begin(wanted, self.lines.has_temperature())?;
        self.track.pulse.restart();
        Ok(remark)
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), CliError> {
        self.track.pulse.counts.restarts += 1;
        let remark = self.begin()?;
        self.restarted(&trace::restarted(remark));
        Ok(())
    }
}

/// Returns the builder of the filter on the present clock.
fn wanted<'b>(args: &'b LiveArgs, sensor: &'b Sensor, track: &Track<Point>) -> FilterBuilder<'b> {
    if track.pulse.counts.restarts > 0 { builder_anew(sensor, &args.estimate) } else { builder(sensor, &args.estimate) }
}

impl Taker for Session<'_> {
    type Row = Row;

    fn parse(&mut self, line: &[u8], arrived_s: f64) -> Result<Option<Due<Row>>, CliError> {
        let due = |row: Row, restarted: bool| Due { time_s: row.time_s, row, restarted };
        match self.lines.take(&self.headed.line(line, arrived_s)) {
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
        let row = due.row;
        let estimate = match self.filter.step(&row) {
            Ok(estimate) => estimate,
            Err(error) => {
                self.track.skip(error.to_string());
                return Ok(());
            }
        };
        self.track.pulse.count(row.time_s, u64::from(!row.reading.value.is_finite()));
        let half_width = 1.96 * estimate.strain_sd;
        let point = Point { time_s: row.time_s, strain: estimate.strain, half_width };
        self.track.push(point, self.args.window_s);
        let remark =
            self.filter.remark(&estimate, "z").map_err(|refused| match self.args.estimate.rest_resistance {
                Some(RestResistance::First(count)) => of_first(&refused, count, &self.args.port.source()),
                _ => refused.into(),
            })?;
        remark.into_iter().for_each(|remark| self.track.message = remark);
        self.last = Some(estimate);
        self.track.record(row.time_s, self.lines.recorded(&row));
        Ok(())
    }
}

impl Shown for Session<'_> {
    type Point = Point;

    fn track(&mut self) -> &mut Track<Point> {
        &mut self.track
    }

    /// Begins a recording of the reading as it comes, as a code if it is one, of the reference and of the temperature.
    fn new_recorder(&self) -> io::Result<Recorder> {
        Recorder::begin(&self.args.record, self.lines.metadata(), self.lines.recorded_columns())
    }

    /// Makes the reading R₀, and the strain zero.
    fn zero(&mut self) -> Result<(), CliError> {
        self.track.message = self.filter.zero(wanted(self.args, &self.sensor, &self.track));
        Ok(())
    }
}
