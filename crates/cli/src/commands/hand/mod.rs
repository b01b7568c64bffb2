//! Several joints at once: one column of readings per channel in, all angles out.

pub mod calibrate;
pub mod description;
pub mod evaluate;
pub mod export;
pub mod joint;
pub mod lines;
pub mod scores;
pub mod smooth;

use std::io::Write;
use std::path::Path;

use ohmstrain::trace::{self, HandDescription};
use ohmstrain::{Error, Reading};
use ohmstrain_bench_data::{Row, RowWriter, counted};

use crate::args::{EstimateArgs, HandArgs};
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::RowsOut;
use joint::{Joint, JointRow};
use lines::{HandLines, HandParser, channels};

/// Advice for a clock that has restarted.
const LATE: &str = "; if the clock has started again there, --skip-bad goes on with other filters";

/// Turns readings of all joints into angles, row by row as they arrive; returns the number of rows.
pub fn run(args: &HandArgs, messages: &Messages) -> Result<u64, CliError> {
    let description = description::read(&args.hand)?;
    let mut lines = HandLines::open(&args.trace_file, HandParser::new(args.skip_bad, LATE))?;
    let mut joints = joints(&description, &args.hand, &lines.file)?;
    let inputs = std::iter::once(args.trace_file.clone()).chain(description.files(&args.hand));
    let columns = columns(&joints);
    let mut rows_out =
        RowsOut::claim(args.output.as_deref(), &columns, args.replace.force, &inputs.collect::<Vec<_>>())?;
    let mut out = RowWriter::new(rows_out.open(lines.is_live)?);
    let streamed = stream(args, &mut lines, &mut joints, &columns, &mut out, messages);
    out.flush()?;
    let written = streamed?;
    rows_out.outputs.publish()?;
    Ok(written)
}

/// Reads the sensors of all joints for a recording with this name.
pub fn joints<'d>(description: &'d HandDescription, hand: &Path, file: &str) -> Result<Vec<Joint<'d>>, CliError> {
    let folder = hand.parent().unwrap_or(Path::new(""));
    description.joints.iter().map(|joint| Joint::new(joint, folder, file)).collect()
}

/// Reason to refuse a flag.
pub const OF_ONE_SENSOR: &str = "is for one sensor, not for a hand.toml";

/// Refuses flags that are set, for a reason.
pub fn refuse_flags<'f>(flags: impl IntoIterator<Item = (&'f str, bool)>, why: &str) -> Result<(), CliError> {
    match flags.into_iter().find(|(_, is_set)| *is_set) {
        Some((flag, _)) => Err(CliError::Arguments(format!("{flag} {why}"))),
        None => Ok(()),
    }
}

/// Refuses flags of an estimate that are for one sensor.
pub fn refuse_estimate(args: &EstimateArgs) -> Result<(), CliError> {
    refuse_flags(
        [
            ("--estimator", args.estimator.chosen().is_some()),
            ("--initial-strain", args.initial_strain.is_some()),
            ("--known", !args.known.is_empty()),
            ("--rest-resistance", args.rest_resistance.is_some()),
            ("--gate", args.gate.is_some()),
            ("--influence", args.influence.is_some()),
            ("--without", !args.without.is_empty()),
            ("--unit", !args.units.units.is_empty()),
        ],
        OF_ONE_SENSOR,
    )
}

/// Returns the columns of the output.
fn columns(joints: &[Joint]) -> Vec<String> {
    let of_joint = |joint: &Joint| joint.endings().map(|ending| format!("{}{ending}", joint.name));
    let angles = joints.iter().flat_map(of_joint);
    std::iter::once("time_s".to_owned()).chain(angles).chain(["flags".to_owned()]).collect()
}

fn stream<W: Write>(
    args: &HandArgs,
    lines: &mut HandLines,
    joints: &mut [Joint],
    columns: &[String],
    out: &mut RowWriter<W>,
    messages: &Messages,
) -> Result<u64, CliError> {
    let (mut skipped, mut written) = (0_u64, 0_u64);
    while let Some(taken) = lines.next(joints)? {
        if taken.restarted {
            joints.iter_mut().try_for_each(Joint::restart)?;
            messages.warning(&format!("{}: the clock has started again, and so has the filter", lines.place()));
        }
        if taken.is_first {
            header(columns, out)?;
        }
        if let Some(refused) = taken.refused {
            if taken.is_first || !args.skip_bad {
                return Err(CliError::Input(refused));
            }
            skipped += 1;
        } else if !taken.rows.is_empty() {
            for (channel, row) in channels(joints).zip(&taken.rows) {
                doubt(channel.doubt(row.reading.value), lines, messages)?;
            }
            let time_s = taken.rows[0].time_s;
            let at = |error| CliError::Input(format!("{}: {error}", lines.place()));
            let estimates = step(joints, &taken.rows).map_err(at)?;
            write(time_s, &estimates.iter().collect::<Vec<_>>(), out)?;
            written += 1;
            if lines.is_live {
                out.flush()?;
            }
        }
    }
    channels(joints).try_for_each(|channel| doubt(channel.last_doubt(), lines, messages))?;
    if skipped > 0 {
        let were = if skipped == 1 { "was" } else { "were" };
        messages.warning(&format!("{} {were} skipped", counted(skipped, "line")));
    }
    if written == 0 { Err(lines.no_row()) } else { Ok(written) }
}

/// Warns of a doubt if a reader waits for the rows; otherwise refuses the recording.
fn doubt(doubt: Option<String>, lines: &HandLines, messages: &Messages) -> Result<(), CliError> {
    let file = &lines.file;
    match doubt {
        Some(doubt) if lines.is_live => messages.warning(&format!("{file}: {doubt}")),
        Some(doubt) => return Err(CliError::Input(format!("{file}: {doubt}"))),
        None => {}
    }
    Ok(())
}

/// Passes a row of each channel to the joints, and returns their estimates.
pub fn step(joints: &mut [Joint], rows: &[Row]) -> Result<Vec<JointRow>, Error> {
    let time_s = rows.first().map_or(f64::NAN, |row| row.time_s);
    let mut rest = rows;
    let of_joint = |joint: &mut Joint| {
        let (own, others) = rest.split_at(joint.channels.len());
        rest = others;
        let readings: Vec<Reading> = own.iter().map(|row| trace::reading(&row.reading)).collect();
        joint.step(time_s, &readings)
    };
    joints.iter_mut().map(of_joint).collect()
}

/// Writes the header.
fn header<W: Write>(columns: &[String], out: &mut RowWriter<W>) -> Result<(), CliError> {
    columns.iter().for_each(|name| out.text(name));
    Ok(out.end()?)
}

/// Writes all angles of a row.
fn write<W: Write>(time_s: f64, joints: &[&JointRow], out: &mut RowWriter<W>) -> Result<(), CliError> {
    out.number(time_s);
    joints.iter().flat_map(|row| [row.value, row.sd]).for_each(|value| out.number(value));
    out.words(joints.iter().flat_map(|row| &row.flags).map(String::as_str));
    Ok(out.end()?)
}
