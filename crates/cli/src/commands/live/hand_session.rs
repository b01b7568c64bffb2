//! State of the view of several joints: their filters, and the lines so far.

use std::io;

use ohmstrain::number::median;
use ohmstrain::trace::HandDescription;
use ohmstrain_bench_data::{Headed, Metadata, Row};

use super::Shown;
use super::recorder::Recorder;
use super::track::{Timed, Track};
use crate::args::LiveArgs;
use crate::commands::hand::joint::{Channel, Joint, JointRow};
use crate::commands::hand::lines::{HandParser, channels};
use crate::commands::hand::{OF_ONE_SENSOR, joints, refuse_estimate, refuse_flags, step};
use crate::error::CliError;
use crate::port::{Due, Taker};

/// Row of the plot.
pub struct HandPoint {
    pub time_s: f64,
    /// Reading of each channel; NaN where it is missing.
    readings: Vec<f64>,
    /// Value of each joint, degrees or strain.
    pub values: Vec<f64>,
}

impl Timed for HandPoint {
    fn time_s(&self) -> f64 {
        self.time_s
    }
}

/// Filters of all joints on a stream of lines.
pub struct HandSession<'a> {
    pub args: &'a LiveArgs,
    pub joints: Vec<Joint<'a>>,
    parser: HandParser,
    headed: Headed,
    pub track: Track<HandPoint>,
    /// Estimate of each joint in the last row.
    pub last: Vec<JointRow>,
}

impl<'a> HandSession<'a> {
    /// Creates a session that waits for a header, unless the flags contain it.
    ///
    /// # Errors
    /// If a file cannot be read, the header lacks a column, or a flag is for one sensor.
    pub fn new(args: &'a LiveArgs, description: &'a HandDescription) -> Result<Self, CliError> {
        refuse_estimate(&args.estimate)?;
        refuse_flags(
            [
                ("--gauge-length-mm", args.setup.gauge_length_mm.is_some()),
                ("--front-end", args.setup.front_end.is_some()),
                ("--joint", args.setup.joint.is_some()),
            ],
            OF_ONE_SENSOR,
        )?;
        let mut joints = joints(description, &args.estimate.sensor, &args.port.source())?;
        let (mut parser, headed) = (HandParser::new(true, ""), Headed::new(args.port.header.as_deref()));
        if let Some(header) = headed.header() {
            let refused = parser.take(header.as_bytes(), "--header", &mut joints)?.refused;
            refused.map_or(Ok(()), |refused| Err(CliError::Arguments(refused)))?;
        }
        Ok(Self { args, joints, parser, headed, track: Track::new(), last: Vec::new() })
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), CliError> {
        self.track.pulse.counts.restarts += 1;
        self.joints.iter_mut().try_for_each(Joint::restart)?;
        self.restarted("the clock has started again, and so have the filters");
        Ok(())
    }

    fn record(&mut self, rows: &[Row]) {
        let all: Vec<&Channel> = self.joints.iter().flat_map(|joint| &joint.channels).collect();
        let columns: Vec<&str> = all.iter().map(|channel| channel.entry.column.as_str()).collect();
        let readings = own(&columns).flat_map(|place| all[place].lines.recorded(&rows[place]));
        self.track.record(rows[0].time_s, readings);
    }

    /// Returns the median of a channel's readings in the last second, or of the last few; `None` if it is not read now.
    fn rested(&self, channel: usize) -> Option<f64> {
        self.track.points.back().filter(|last| last.readings[channel].is_finite())?;
        median(self.track.at_rest(|point| point.readings[channel]))
    }
}

/// Returns the places of columns that no earlier one repeats: two joints may share a column.
fn own<'c>(columns: &'c [&str]) -> impl Iterator<Item = usize> + 'c {
    (0..columns.len()).filter(|place| !columns[..*place].contains(&columns[*place]))
}

impl Taker for HandSession<'_> {
    type Row = Vec<Row>;

    fn parse(&mut self, line: &[u8], arrived_s: f64) -> Result<Option<Due<Vec<Row>>>, CliError> {
        let line = self.headed.line(line, arrived_s);
        let taken = self.parser.take(&line, &self.args.port.source(), &mut self.joints)?;
        if let Some(refused) = taken.refused {
            self.track.skip(format!("skipped {refused}"));
        }
        let Some(first) = taken.rows.first() else {
            // A header that comes again is a device that has restarted.
            if taken.restarted && self.track.pulse.counts.rows > 0 {
                self.restart()?;
            }
            return Ok(None);
        };
        Ok(Some(Due { time_s: first.time_s, restarted: taken.restarted, row: taken.rows }))
    }

    fn take(&mut self, due: Due<Vec<Row>>) -> Result<(), CliError> {
        if due.restarted {
            self.restart()?;
        }
        let rows = due.row;
        self.last = match step(&mut self.joints, &rows) {
            Ok(estimates) => estimates,
            Err(error) => {
                self.track.skip(error.to_string());
                return Ok(());
            }
        };
        let missing = rows.iter().filter(|row| !row.reading.value.is_finite()).count();
        self.track.pulse.count(due.time_s, missing as u64);
        let readings: Vec<f64> = rows.iter().map(|row| row.reading.value).collect();
        for (channel, reading) in channels(&mut self.joints).zip(&readings) {
            channel.doubt(*reading).into_iter().for_each(|doubt| self.track.message = doubt);
        }
        let values = self.last.iter().map(|row| row.value).collect();
        self.track.push(HandPoint { time_s: due.time_s, readings, values }, self.args.window_s);
        self.record(&rows);
        Ok(())
    }
}

impl Shown for HandSession<'_> {
    type Point = HandPoint;

    fn track(&mut self) -> &mut Track<HandPoint> {
        &mut self.track
    }

    /// Begins a recording of all channels' readings, as codes where they are.
    fn new_recorder(&self) -> io::Result<Recorder> {
        let all = || self.joints.iter().flat_map(|joint| &joint.channels);
        let metadata = all().next().map_or_else(Metadata::default, |channel| channel.lines.metadata());
        // Electronics that differ are in hand.toml alone.
        let spec = metadata.front_end.filter(|spec| all().all(|channel| channel.entry.front_end == Some(*spec)));
        let metadata = Metadata { front_end: spec, ..metadata };
        let columns: Vec<&str> = all().map(|channel| channel.entry.column.as_str()).collect();
        Recorder::begin(&self.args.record, metadata, own(&columns).map(|place| columns[place]))
    }

    /// Makes the readings R₀ of each channel, and the strains of their joints zero; a joint with a channel that is not read, or whose reading
    /// cannot be its R₀, stays as it was.
    fn zero(&mut self) -> Result<(), CliError> {
        if self.track.points.is_empty() {
            return Ok(());
        }
        let count = channels(&mut self.joints).count();
        let mut rested = (0..count).map(|channel| self.rested(channel)).collect::<Vec<_>>().into_iter();
        let mut refused = Vec::new();
        for joint in &mut self.joints {
            let own: Vec<Option<f64>> = rested.by_ref().take(joint.channels.len()).collect();
            let check = |(channel, rested): (&Channel, &Option<f64>)| match rested {
                Some(rested) => channel.sensor.check_rest_resistance(*rested).err().map(|error| error.to_string()),
                None => Some(format!("{}: no reading", channel.entry.column)),
            };
            if let Some(why) = joint.channels.iter().zip(&own).find_map(check) {
                refused.push(format!("{} stays as it was: {why}", joint.name));
                continue;
            }
            joint.channels.iter_mut().zip(own).for_each(|(channel, rested)| channel.rest_resistance = rested);
            joint.start_at_zero()?;
        }
        let all = "R0 of each channel is its median of the last second";
        self.track.message = if refused.is_empty() { all.into() } else { refused.join("; ") };
        Ok(())
    }
}
