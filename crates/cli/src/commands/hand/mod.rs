//! Several joints at once: one column of readings per channel in, all angles out.
//!
//! Each channel parses every line under a header in which its own column is the resistance. A line that one channel cannot read
//! is an error, or is skipped for all of them.

pub mod calibrate;
mod description;
pub mod evaluate;
mod joint;
mod scores;

use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use ohmstrain::Reading;
use ohmstrain::trace;
use ohmstrain_bench_data::{Line, Row, RowWriter, counted};

use crate::args::HandArgs;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::RowsOut;
use crate::whole_file::is_stdin;
use description::Description;
use joint::{Channel, Joint};

/// Advice for a clock that has restarted.
const LATE: &str = "; if the clock has started again there, --skip-bad goes on with other filters";

/// Longest line, bytes; anything longer is not a row.
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
    let mut joints = Vec::new();
    for joint in &description.joints {
        joints.push(Joint::new(joint, folder, &name)?);
    }
    let files = description.joints.iter().flat_map(|joint| {
        joint.channels.iter().map(|channel| &channel.sensor).chain(&joint.fusion).map(|path| folder.join(path))
    });
    let files: Vec<PathBuf> = files.collect();
    let inputs = [&args.trace_file, &args.hand].into_iter().chain(&files);
    let columns = columns(&joints);
    let mut rows_out = RowsOut::claim(args.output.as_deref(), &columns, args.replace.force, inputs)?;
    let mut out = RowWriter::new(rows_out.open(is_live(args))?);
    let streamed = stream(args, &name, source, &mut joints, &columns, &mut out, messages);
    out.flush()?;
    streamed?;
    rows_out.publish()
}

/// Returns the columns of the output.
fn columns(joints: &[Joint]) -> Vec<String> {
    let of_joint = |joint: &Joint| joint.endings().map(|ending| format!("{}{ending}", joint.name));
    let angles = joints.iter().flat_map(of_joint);
    std::iter::once("time_s".to_owned()).chain(angles).chain(["flags".to_owned()]).collect()
}

/// Returns the channels of all joints.
fn channels<'j, 'a: 'j>(joints: &'j mut [Joint<'a>]) -> impl Iterator<Item = &'j mut Channel<'a>> {
    joints.iter_mut().flat_map(|joint| &mut joint.channels)
}

/// True if a reader waits for each row.
fn is_live(args: &HandArgs) -> bool {
    is_stdin(&args.trace_file) || !args.trace_file.is_file()
}

fn stream<W: Write>(
    args: &HandArgs,
    file: &str,
    source: Box<dyn io::Read>,
    joints: &mut [Joint],
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
        for channel in channels(joints) {
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
                    rows.push(row);
                    restarted = true;
                }
                Ok(_) => {}
                Err(fault) => {
                    let hint = if fault.is_late { LATE } else { "" };
                    refused = Some(format!("joint `{}`: {fault}{hint}", channel.joint));
                }
            }
        }
        if restarted {
            joints.iter_mut().try_for_each(Joint::restart)?;
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
        } else if rows.len() == channels(joints).count() && !rows.is_empty() {
            is_empty = false;
            for (channel, row) in channels(joints).zip(&rows) {
                say(channel.doubt(row.reading.value), file, live, messages)?;
            }
            write(joints, &rows, out)?;
            if live {
                out.flush()?;
            }
        }
    }
    channels(joints).try_for_each(|channel| say(channel.last_doubt(), file, live, messages))?;
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

/// Warns of a doubt if a reader waits for the rows; otherwise refuses the recording.
fn say(doubt: Option<String>, file: &str, live: bool, messages: &Messages) -> Result<(), CliError> {
    match doubt {
        Some(doubt) if live => messages.warning(&format!("{file}: {doubt}")),
        Some(doubt) => return Err(CliError::Input(format!("{file}: {doubt}"))),
        None => {}
    }
    Ok(())
}

/// Writes all angles of a row.
fn write<W: Write>(joints: &mut [Joint], rows: &[Row], out: &mut RowWriter<W>) -> Result<(), CliError> {
    let time_s = rows.first().map_or(f64::NAN, |row| row.time_s);
    let (mut flags, mut values, mut rest) = (Vec::new(), Vec::new(), rows);
    for joint in joints {
        let (own, others) = rest.split_at(joint.channels.len());
        let readings: Vec<Reading> = own.iter().map(|row| trace::reading(&row.reading)).collect();
        let row = joint.step(time_s, &readings)?;
        flags.extend(row.flags);
        values.extend([row.value, row.sd]);
        rest = others;
    }
    out.number(time_s);
    values.iter().for_each(|value| out.number(*value));
    out.words(flags.iter().map(String::as_str));
    Ok(out.end()?)
}
