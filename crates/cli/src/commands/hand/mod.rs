//! Several joints at once: a column of readings each, all angles out.
//!
//! Each joint has a filter of its own, and its own view of a line: the line parsed under a header in which its column is the
//! resistance. A line that one of them cannot read is an error, or skipped for all of them.

mod description;

use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;

use ohmstrain::{Error, Estimate, Filter, Quantity, ReadingUnit, Sensor, UnitGuess};
use ohmstrain_bench_data::{Line, LineParser, Metadata, Row, RowWriter, counted};

use crate::args::HandArgs;
use crate::error::CliError;
use crate::input::{self, reading_column};
use crate::messages::Messages;
use crate::output::RowsOut;
use crate::sensor_file;
use crate::suits::FIRST_LIVE_READINGS;
use crate::whole_file::is_stdin;
use description::{Description, Joint};

/// Advice for a clock that has restarted.
const LATE: &str = "; if the clock has started again there, --skip-bad goes on with other filters";

/// Longer lines are no rows, however they go on.
const LONGEST_LINE: u64 = 64 * 1024;

/// Turns readings of all joints into angles, row by row as they arrive.
pub fn run(args: &HandArgs, messages: &Messages) -> Result<(), CliError> {
    let description = Description::read(&args.hand)?;
    let folder = args.hand.parent().unwrap_or(Path::new(""));
    let (name, source) = if is_stdin(&args.trace_file) {
        ("stdin".to_owned(), Box::new(io::stdin()) as Box<dyn io::Read>)
    } else {
        let file = std::fs::File::open(&args.trace_file);
        let file = file.map_err(|error| CliError::file("read", &args.trace_file, &error))?;
        (args.trace_file.display().to_string(), Box::new(file) as Box<dyn io::Read>)
    };
    let mut channels = Vec::new();
    for joint in &description.joints {
        channels.push(Channel::new(joint, folder, &name)?);
    }
    let sensors = channels.iter().map(|channel| folder.join(&channel.joint.sensor)).collect::<Vec<_>>();
    let inputs = [&args.trace_file, &args.hand].into_iter().chain(&sensors);
    let columns = description.columns();
    let mut rows_out = RowsOut::claim(args.output.as_deref(), &columns, args.replace.force, inputs)?;
    let mut out = RowWriter::new(rows_out.open(is_live(args))?);
    let streamed = stream(args, &name, source, &mut channels, &columns, &mut out, messages);
    out.flush()?;
    streamed?;
    rows_out.publish()
}

/// True if a reader waits for each row.
fn is_live(args: &HandArgs) -> bool {
    is_stdin(&args.trace_file) || !args.trace_file.is_file()
}

/// A joint with its filter.
struct Channel<'a> {
    joint: &'a Joint,
    sensor: Sensor,
    filter: Filter,
    lines: LineParser,
    /// The first known readings.
    early: Vec<f64>,
}

impl<'a> Channel<'a> {
    fn new(joint: &'a Joint, folder: &Path, file: &str) -> Result<Self, CliError> {
        let mut sensor = sensor_file::read(&folder.join(&joint.sensor), None)?;
        if let Some(spec) = joint.joint {
            let metadata = Metadata { joint: Some(spec), ..Metadata::default() };
            if let Some(joint) = input::joint(&metadata) {
                sensor = sensor.on_joint(joint)?;
            }
        }
        if sensor.params().quantity == Quantity::Strain && sensor.params().joint.is_none() {
            return Err(CliError::Input(format!(
                "joint `{}`: expected a sensor that was calibrated on an angle, or `joint = \"prestrain=… moment_arm_mm=… \
                 gauge_length_mm=…\"`, found neither",
                joint.name
            )));
        }
        if let Some(measured) = joint.rest_resistance {
            let refused = |error| CliError::Input(format!("joint `{}`: rest_resistance: {error}", joint.name));
            sensor.check_rest_resistance(measured).map_err(refused)?;
        }
        let filter = filter_of(joint, &sensor)?;
        let lines = LineParser::new(file, Metadata { front_end: joint.front_end, ..Metadata::default() });
        Ok(Self { joint, sensor, filter, lines, early: vec![] })
    }

    /// The header as this joint sees it: its column is the reading, those of others are passed over.
    fn header(&self, header: &str) -> Result<String, String> {
        let has = |column: &str| header.split(',').any(|name| name.trim() == column);
        if !has("time_s") && !has("time_us") {
            return Err(format!("expected a header with the column `time_s` or `time_us`, found {}", quoted(header)));
        }
        if !has(&self.joint.column) {
            let Joint { name, column, .. } = self.joint;
            return Err(format!("joint `{name}`: expected a column `{column}`, found {}", quoted(header)));
        }
        let expected = self.sensor.params().reading;
        if let Some(found) = self.said_unit().filter(|found| *found != expected) {
            return Err(format!(
                "column `{}`: joint `{}`: expected `{}` as in the sensor's calibration, found `{}`",
                self.joint.column,
                self.joint.name,
                reading_column(expected),
                reading_column(found)
            ));
        }
        let own = if self.joint.front_end.is_some() { "adc" } else { reading_column(expected) };
        let cell = |name: &str| match name.trim() {
            name if name == self.joint.column => own.to_owned(),
            name @ ("time_s" | "time_us") => name.to_owned(),
            _ => "_".to_owned(),
        };
        Ok(header.split(',').map(cell).collect::<Vec<_>>().join(","))
    }

    /// The clock has started again, and so does the filter.
    fn restart(&mut self) -> Result<(), CliError> {
        self.filter = filter_of(self.joint, &self.sensor)?;
        self.early.clear();
        Ok(())
    }

    /// Returns the unit of the readings by the electronics, the lines above the header or the end of the column's name.
    fn said_unit(&self) -> Option<ReadingUnit> {
        if self.joint.front_end.is_some() || self.lines.metadata().resistance_unit.is_some() {
            return Some(ReadingUnit::Ohm);
        }
        match self.joint.column.to_lowercase().rsplit('_').next()? {
            "ohm" | "ohms" | "kohm" => Some(ReadingUnit::Ohm),
            "ratio" => Some(ReadingUnit::Ratio),
            _ => None,
        }
    }

    /// Doubts the unit of the readings once there are enough of them.
    fn doubt(&mut self, reading: f64) -> Option<String> {
        if !reading.is_finite() || self.early.len() >= FIRST_LIVE_READINGS {
            return None;
        }
        self.early.push(reading);
        if self.early.len() < FIRST_LIVE_READINGS { None } else { self.unit_doubt() }
    }

    /// Doubts it where the recording has ended before.
    fn last_doubt(&self) -> Option<String> {
        if self.early.len() < FIRST_LIVE_READINGS { self.unit_doubt() } else { None }
    }

    fn unit_doubt(&self) -> Option<String> {
        let doubt = self.sensor.check_unit(self.early.iter().copied(), self.joint.rest_resistance).err()?;
        let answer = match doubt.guess {
            UnitGuess::KiloOhm => "Then say so with a line `# resistance_unit = kohm` above the header",
            UnitGuess::CalibrationInKiloOhm => "Then calibrate again with `--unit resistance=kohm`",
            _ => "Bring them to the sensor's unit",
        };
        Some(format!("joint `{}`: {doubt} {answer}", self.joint.name))
    }
}

fn filter_of(joint: &Joint, sensor: &Sensor) -> Result<Filter, Error> {
    let wanted = sensor.filter();
    joint.rest_resistance.map_or(wanted, |measured| wanted.rest_resistance(measured)).build()
}

/// A header that fits a message.
fn quoted(header: &str) -> String {
    const LONGEST: usize = 80;
    let shown: String = header.chars().take(LONGEST).collect();
    if shown.len() < header.len() { format!("`{shown}…`") } else { format!("`{shown}`") }
}

fn stream<W: Write>(
    args: &HandArgs,
    file: &str,
    source: Box<dyn io::Read>,
    channels: &mut [Channel],
    columns: &[String],
    out: &mut RowWriter<W>,
    messages: &Messages,
) -> Result<(), CliError> {
    let live = is_live(args);
    let (mut known_header, mut skipped, mut number, mut line) = (None, 0_u64, 0_u64, Vec::new());
    let mut is_empty = true;
    let mut source = BufReader::new(source);
    loop {
        let unreadable = |error| CliError::file("read", &args.trace_file, &error);
        if line.len() as u64 == LONGEST_LINE && !line.ends_with(b"\n") {
            source.skip_until(b'\n').map_err(unreadable)?;
        }
        line.clear();
        if (&mut source).take(LONGEST_LINE).read_until(b'\n', &mut line).map_err(unreadable)? == 0 {
            break;
        }
        number += 1;
        let text = String::from_utf8_lossy(&line);
        let is_first = known_header.is_none() && !text.starts_with('#') && !text.trim().is_empty();
        let is_header = is_first || (args.skip_bad && known_header.as_deref() == Some(text.trim()));
        let (mut rows, mut refused, mut restarted) = (Vec::new(), None, is_header && !is_first);
        for channel in channels.iter_mut() {
            let taken = if is_header {
                let own = channel.header(text.trim());
                let own = own.map_err(|what| CliError::Input(format!("{file}:{number}: {what}")))?;
                channel.lines.take(own.as_bytes())
            } else {
                channel.lines.take(&line)
            };
            match taken {
                Ok(Line::Row(row)) => rows.push(row),
                Ok(Line::Restarted(row)) => {
                    channel.restart()?;
                    rows.push(row);
                    restarted = true;
                }
                Ok(Line::Header) if !is_first => channel.restart()?,
                Ok(_) => {}
                Err(fault) => {
                    let hint = if fault.is_late { LATE } else { "" };
                    refused = Some(format!("joint `{}`: {fault}{hint}", channel.joint.name));
                }
            }
        }
        if restarted {
            messages.warning(&format!("{file}:{number}: the clock has started again, and so has the filter"));
        }
        if is_first {
            columns.iter().for_each(|name| out.text(name));
            out.end()?;
            known_header = Some(text.trim().to_owned());
        }
        if let Some(refused) = refused {
            if is_first || !args.skip_bad {
                return Err(CliError::Input(refused));
            }
            skipped += 1;
        } else if rows.len() == channels.len() && !rows.is_empty() {
            is_empty = false;
            for (channel, row) in channels.iter_mut().zip(&rows) {
                say(channel.doubt(row.reading.value), file, live, messages)?;
            }
            write(channels, &rows, out)?;
            if live {
                out.flush()?;
            }
        }
    }
    channels.iter().try_for_each(|channel| say(channel.last_doubt(), file, live, messages))?;
    if skipped > 0 {
        let were = if skipped == 1 { "was" } else { "were" };
        messages.warning(&format!("{} {were} skipped", counted(skipped, "line")));
    }
    if is_empty {
        let none = "expected at least one row of data, found the end of the file";
        return Err(CliError::Input(format!("{file}:{}: {none}", number + 1)));
    }
    Ok(())
}

/// Warns of a doubt if a reader waits for the rows, and refuses the recording otherwise.
fn say(doubt: Option<String>, file: &str, live: bool, messages: &Messages) -> Result<(), CliError> {
    match doubt {
        Some(doubt) if live => messages.warning(&format!("{file}: {doubt}")),
        Some(doubt) => return Err(CliError::Input(format!("{file}: {doubt}"))),
        None => {}
    }
    Ok(())
}

/// All angles of a row.
fn write<W: Write>(channels: &mut [Channel], rows: &[Row], out: &mut RowWriter<W>) -> Result<(), CliError> {
    let mut flags: Vec<String> = Vec::new();
    let mut angles = Vec::new();
    for (channel, row) in channels.iter_mut().zip(rows) {
        let estimate = channel.filter.step(row.time_s, input::reading(&row.reading))?;
        flags.extend(estimate.flags.names().map(|flag| format!("{}:{flag}", channel.joint.name)));
        angles.push(angle(&estimate));
    }
    out.number(rows.first().map_or(f64::NAN, |row| row.time_s));
    for (angle, sd) in angles {
        out.number(angle);
        out.number(sd);
    }
    out.words(flags.iter().map(String::as_str));
    Ok(out.end()?)
}

/// Angle and standard deviation, degrees: by the joint, or what the sensor was calibrated on.
fn angle(estimate: &Estimate) -> (f64, f64) {
    match (estimate.angle_deg, estimate.angle_sd) {
        (Some(angle), Some(sd)) => (angle, sd),
        _ => (estimate.strain, estimate.strain_sd),
    }
}
