//! Scores of a hand's estimates against the references of a recording of all its channels.

use ohmstrain_report::{Sample, Scored, scoring};
use std::path::Path;

use ohmstrain::trace::{HandChannel, TraceFile};
use ohmstrain::{Error, Reading};
use ohmstrain_bench_data::Metadata;

use super::description;
use super::joint::{Channel, Joint, JointRow};
use super::scores::{ChannelScores, JointScores};
use super::{OF_ONE_SENSOR, joints, refuse_flags};
use crate::args::{Estimators, EvaluateArgs};
use crate::channels::{self, Table};
use crate::commands::evaluate::check_truth;
use crate::error::CliError;

/// Scores every recording with the joints of a description, and passes its name and the scores to `show`.
pub fn run(
    args: &EvaluateArgs,
    hand: &Path,
    mut show: impl FnMut(&str, Vec<JointScores>) -> Result<(), CliError>,
) -> Result<(), CliError> {
    refuse_flags(
        [
            ("--estimator", !matches!(args.estimator, Estimators::Auto)),
            ("--without", args.without.is_some()),
            ("--report", args.report.report.is_some()),
            ("--figures", args.report.figures.is_some()),
            ("--rest-resistance", args.rest_resistance.is_some()),
            ("--known-every", args.known_every.is_some()),
            ("--check", args.check),
        ],
        OF_ONE_SENSOR,
    )?;
    let description = description::read(hand)?;
    for path in &args.traces {
        let Some(table) = Table::read(path)? else {
            let what = "expected a recording with two or more columns of readings, NAME_ohm, NAME_ratio or NAME_adc, as hand.toml names them";
            return Err(CliError::Input(format!("{}: {what}", path.display())));
        };
        let name = path.display().to_string();
        let mut scores = Vec::new();
        for joint in joints(&description, hand, &name)? {
            scores.push(scored(joint, &table, &args.units.metadata(), Scored::since(args.from))?);
        }
        show(&name, scores)?;
    }
    Ok(())
}

/// Scores a joint on the rows of `part`; its filter starts at the first row.
pub fn scored(mut joint: Joint, table: &Table, overrides: &Metadata, part: Scored) -> Result<JointScores, CliError> {
    let known = table.channels()?;
    let trace = |entry: &HandChannel| -> Result<TraceFile, CliError> {
        let column = &entry.column;
        let found: Option<&channels::Channel> = known.iter().find(|channel| channel.column == *column);
        let missing = || {
            let (header, name) = (table.header_name(), joint.name);
            CliError::Input(format!("{header}: joint `{name}`: expected a column `{column}`, found none"))
        };
        let overrides = Metadata { front_end: entry.front_end, ..overrides.clone() };
        let trace = table.trace(found.ok_or_else(missing)?, &overrides)?;
        trace.check_quantity(joint.quantity())?;
        Ok(trace)
    };
    let traces: Vec<TraceFile> = joint.channels.iter().map(|channel| trace(channel.entry)).collect::<Result<_, _>>()?;
    let Some((first, channel)) = traces.first().zip(joint.channels.first()) else {
        return Err(CliError::Input(format!("joint `{}`: expected a channel, found none", joint.name)));
    };
    check_truth(first, part)?;
    let time_s = first.trace.time_s.clone();
    let sample = Sample::of(&time_s, &first.sha256, channel.sensor.params(), part);
    let readings: Vec<Vec<Reading>> =
        traces.iter().map(|trace| (0..time_s.len()).map(|row| trace.reading(row).1).collect()).collect();
    let step = |row: usize| {
        let of_row: Vec<Reading> = readings.iter().map(|readings| readings[row]).collect();
        joint.step(time_s[row], &of_row)
    };
    let filtered: Vec<JointRow> = (0..time_s.len()).map(step).collect::<Result<_, _>>()?;
    let smoothed = match joint.smooth(&time_s, &readings.iter().map(Vec::as_slice).collect::<Vec<_>>()) {
        Err(Error::NoFusedSmoother) => Vec::new(),
        smoothed => smoothed?,
    };
    let score = |rows: &[JointRow], of: &dyn Fn(&JointRow) -> (f64, f64)| {
        let estimate = |row: usize| {
            let (strain, sd) = of(&rows[row]);
            (strain, Some(sd))
        };
        if rows.is_empty() { None } else { scoring::scores(first, part, estimate) }
    };
    let of_joint = |row: &JointRow| (row.strain, row.strain_sd);
    let of_channel = |(k, channel): (usize, &Channel)| {
        let of_channel = |row: &JointRow| (row.channels[k].strain, row.channels[k].strain_sd);
        let (alone, smoothed) = (score(&filtered, &of_channel), score(&smoothed, &of_channel));
        ChannelScores { column: channel.entry.column.clone(), alone, smoothed }
    };
    let channels = joint.channels.iter().enumerate().map(of_channel).collect();
    let (fused, smoothed) = (score(&filtered, &of_joint), score(&smoothed, &of_joint));
    Ok(JointScores { joint: joint.name.into(), sample, fused, smoothed, channels })
}
