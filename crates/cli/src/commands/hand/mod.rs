//! Several joints at once: a column of readings each, all angles out.
//!
//! Each joint has a filter of its own, and its own view of a line: the line parsed under a header in which its column is the
//! resistance. A line that one of them cannot read is an error, or skipped for all of them.

mod description;

use std::io::{self, BufRead, BufReader, Write};
use std::path::Path;

use ohmstrain::{Estimate, Filter, Quantity, Sensor};
use ohmstrain_bench_data::{Line, LineParser, Metadata, Row, RowWriter};

use crate::args::HandArgs;
use crate::error::CliError;
use crate::input::{self, is_stdin, reading_column};
use crate::output::RowsOut;
use crate::sensor_file;
use description::{Description, Joint};

/// Turns readings of all joints into angles, row by row as they arrive.
pub fn run(args: &HandArgs) -> Result<(), CliError> {
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
    let mut rows_out = RowsOut::claim(args.output.as_deref(), args.replace.force, inputs)?;
    let live = is_stdin(&args.trace_file) || !args.trace_file.is_file();
    let mut out = RowWriter::new(rows_out.open(live)?);
    header(&channels, &mut out)?;
    let streamed = stream(args, &name, source, &mut channels, &mut out, live);
    out.flush()?;
    streamed?;
    rows_out.publish()
}

/// A joint with its filter.
struct Channel<'a> {
    joint: &'a Joint,
    sensor: Sensor,
    filter: Filter,
    lines: LineParser,
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
        let wanted = sensor.filter();
        let filter = joint.rest_resistance.map_or(wanted, |measured| wanted.rest_resistance(measured)).build()?;
        let lines = LineParser::new(file, Metadata { front_end: joint.front_end, ..Metadata::default() });
        Ok(Self { joint, sensor, filter, lines })
    }

    /// The header as this joint sees it: its column is the reading, those of others are passed over.
    fn header(&self, header: &str) -> Result<String, CliError> {
        let has = header.split(',').any(|name| name.trim() == self.joint.column);
        if !has {
            return Err(CliError::Input(format!(
                "joint `{}`: expected a column `{}`, found `{header}`",
                self.joint.name, self.joint.column
            )));
        }
        let own = match (self.joint.front_end, self.sensor.params().reading) {
            (Some(_), _) => "adc",
            (None, unit) => reading_column(unit),
        };
        let cell = |name: &str| match name.trim() {
            name if name == self.joint.column => own.to_owned(),
            name @ ("time_s" | "time_us") => name.to_owned(),
            _ => "_".to_owned(),
        };
        Ok(header.split(',').map(cell).collect::<Vec<_>>().join(","))
    }
}

fn header<W: Write>(channels: &[Channel], out: &mut RowWriter<W>) -> Result<(), CliError> {
    out.text("time_s");
    for channel in channels {
        out.text(&format!("{}_deg", channel.joint.name));
        out.text(&format!("{}_sd_deg", channel.joint.name));
    }
    out.text("flags");
    Ok(out.end()?)
}

fn stream<W: Write>(
    args: &HandArgs,
    file: &str,
    source: Box<dyn io::Read>,
    channels: &mut [Channel],
    out: &mut RowWriter<W>,
    live: bool,
) -> Result<(), CliError> {
    let (mut has_header, mut skipped, mut line) = (false, 0_u64, Vec::new());
    let mut source = BufReader::new(source);
    loop {
        line.clear();
        let unreadable = |error| CliError::file("read", &args.trace_file, &error);
        if source.read_until(b'\n', &mut line).map_err(unreadable)? == 0 {
            break;
        }
        let text = String::from_utf8_lossy(&line);
        let is_header = !has_header && !text.starts_with('#') && !text.trim().is_empty();
        let mut rows = Vec::new();
        let mut refused = None;
        for channel in channels.iter_mut() {
            let taken = if is_header {
                let own = channel.header(text.trim())?;
                channel.lines.take(own.as_bytes())
            } else {
                channel.lines.take(&line)
            };
            match taken {
                Ok(Line::Row(row)) => rows.push(row),
                Ok(Line::Restarted(_)) => refused = Some(format!("{file}: the clock has started again")),
                Ok(_) => {}
                Err(fault) => refused = Some(format!("joint `{}`: {fault}", channel.joint.name)),
            }
        }
        has_header |= is_header;
        if let Some(refused) = refused {
            if is_header || !args.skip_bad {
                return Err(CliError::Input(refused));
            }
            skipped += 1;
        } else if rows.len() == channels.len() && !rows.is_empty() {
            write(channels, &rows, out)?;
            if live {
                out.flush()?;
            }
        }
    }
    if skipped > 0 {
        CliError::warning(&format!("{skipped} lines were skipped"));
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
