//! Smoothed angles of all joints of a recording.

use ohmstrain::{Reading, trace};
use ohmstrain_bench_data::RowWriter;

use super::description;
use super::joint::JointRow;
use super::lines::{HandLines, HandParser, channels};
use super::{OF_ONE_SENSOR, columns, doubt, header, joints, refuse_estimate, refuse_flags, write};
use crate::args::{Format, SmoothArgs};
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::RowsOut;

/// Advice for a clock that has restarted.
const LATE: &str = "; if the clock has started again there, give each part a file of its own";

/// Smooths the readings of all joints, writes all angles or none, and returns the number of rows. The whole recording is in memory.
pub fn run(args: &SmoothArgs, messages: &Messages) -> Result<u64, CliError> {
    let (hand, written) = (&args.estimate.sensor, &args.written);
    refuse_estimate(&args.estimate)?;
    let parquet = written.format() == Format::Parquet;
    refuse_flags([("--columns", !written.columns.is_empty()), ("--format parquet", parquet)], OF_ONE_SENSOR)?;
    let description = description::read(hand)?;
    let mut lines = HandLines::open(&args.trace_file, HandParser::new(false, LATE))?;
    let mut joints = joints(&description, hand, &lines.file)?;
    let inputs = std::iter::once(args.trace_file.clone()).chain(description.files(hand));
    let columns = columns(&joints);
    let output = written.output.as_deref();
    let mut rows_out = RowsOut::claim(output, &columns, written.replace.force, &inputs.collect::<Vec<_>>())?;
    let (mut time_s, mut readings) = (Vec::new(), vec![Vec::new(); channels(&mut joints).count()]);
    while let Some(taken) = lines.next(&mut joints)? {
        if let Some(refused) = taken.refused {
            return Err(CliError::Input(refused));
        }
        for ((channel, row), readings) in channels(&mut joints).zip(&taken.rows).zip(&mut readings) {
            doubt(channel.doubt(row.reading.value), &lines, messages)?;
            readings.push(trace::reading(&row.reading));
        }
        time_s.extend(taken.rows.first().map(|row| row.time_s));
    }
    channels(&mut joints).try_for_each(|channel| doubt(channel.last_doubt(), &lines, messages))?;
    if time_s.is_empty() {
        return Err(lines.no_row());
    }
    let mut smoothed: Vec<Vec<JointRow>> = Vec::new();
    let mut rest = readings.as_slice();
    for joint in &joints {
        let (own, others) = rest.split_at(joint.channels.len());
        rest = others;
        let own: Vec<&[Reading]> = own.iter().map(Vec::as_slice).collect();
        let named = |error| CliError::Input(format!("{}: joint `{}`: {error}", lines.file, joint.name));
        smoothed.push(joint.smooth(&time_s, &own).map_err(named)?);
    }
    let mut out = RowWriter::new(rows_out.open(false)?);
    header(&columns, &mut out)?;
    for (row, time_s) in time_s.iter().enumerate() {
        let estimates: Vec<&JointRow> = smoothed.iter().map(|rows| &rows[row]).collect();
        write(*time_s, &estimates, &mut out)?;
    }
    out.flush()?;
    drop(out);
    rows_out.outputs.publish()?;
    Ok(time_s.len() as u64)
}
