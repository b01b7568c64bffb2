//! Scores of a hand's estimates against the references of a recording of all its channels.

use ohmstrain_report::Scored;
use std::path::Path;

use ohmstrain::trace::TraceFile;
use ohmstrain::{Reading, ScoredRow, score};
use ohmstrain_bench_data::Metadata;

use super::description::Description;
use super::joint::Joint;
use super::scores::{self, ChannelScores, JointScores};
use crate::args::{Estimators, EvaluateArgs};
use crate::channels::{Channel, Table};
use crate::error::CliError;
use crate::output::print;

/// Scores every recording with the joints of a description.
pub fn run(args: &EvaluateArgs, hand: &Path) -> Result<(), CliError> {
    refuse_flags(args)?;
    let description = Description::read(hand)?;
    let folder = hand.parent().unwrap_or(Path::new(""));
    for path in &args.traces {
        let Some(table) = Table::read(path)? else {
            let what = "expected a recording with two or more columns of readings, NAME_ohm or NAME_ratio, as hand.toml names them";
            return Err(CliError::Input(format!("{}: {what}", path.display())));
        };
        let name = path.display().to_string();
        let mut joints = Vec::new();
        for joint in &description.joints {
            let joint = Joint::new(joint, folder, &name)?;
            joints.push(scored(joint, &table, &args.units.metadata(), Scored::since(args.from))?);
        }
        print(|out| scores::write(out, &name, &joints, args.json))?;
    }
    Ok(())
}

/// Refuses flags that apply to one sensor only.
fn refuse_flags(args: &EvaluateArgs) -> Result<(), CliError> {
    let flags = [
        ("--estimator", !matches!(args.estimator, Estimators::Auto)),
        ("--without", args.without.is_some()),
        ("--report", args.report.report.is_some()),
        ("--figures", args.report.figures.is_some()),
        ("--rest-resistance", args.rest_resistance.is_some()),
        ("--known-every", args.known_every.is_some()),
        ("--check", args.check),
    ];
    match flags.iter().find(|(_, is_set)| *is_set) {
        Some((flag, _)) => Err(CliError::Arguments(format!("{flag} is for one sensor, not for a hand.toml"))),
        None => Ok(()),
    }
}

/// Scores a joint on the rows of `part`; its filter starts at the first row.
pub fn scored(mut joint: Joint, table: &Table, overrides: &Metadata, part: Scored) -> Result<JointScores, CliError> {
    let known = table.channels()?;
    let trace = |column: &str| -> Result<TraceFile, CliError> {
        let found: Option<&Channel> = known.iter().find(|channel| channel.column == column);
        let missing = || {
            let (header, name) = (table.header_name(), joint.name);
            CliError::Input(format!("{header}: joint `{name}`: expected a column `{column}`, found none"))
        };
        let trace = table.trace(found.ok_or_else(missing)?, overrides)?;
        trace.check_quantity(joint.quantity())?;
        Ok(trace)
    };
    let traces: Vec<TraceFile> =
        joint.channels.iter().map(|channel| trace(&channel.entry.column)).collect::<Result<_, _>>()?;
    let (mut fused, mut alone) = (Vec::new(), vec![Vec::new(); traces.len()]);
    for row in 0..traces.first().map_or(0, |trace| trace.trace.len()) {
        let time_s = traces[0].trace.time_s[row];
        let readings: Vec<Reading> = traces.iter().map(|trace| trace.reading(row).1).collect();
        let estimate = joint.step(time_s, &readings)?;
        let truth = traces[0].truth(row);
        if !part.holds(time_s) {
            continue;
        }
        fused.push(ScoredRow { time_s, truth, strain: estimate.strain, sd: Some(estimate.strain_sd) });
        for (alone, channel) in alone.iter_mut().zip(&estimate.channels) {
            alone.push(ScoredRow { time_s, truth, strain: channel.strain, sd: Some(channel.strain_sd) });
        }
    }
    let columns = joint.channels.iter().map(|channel| channel.entry.column.clone());
    let channels = columns.zip(&alone).map(|(column, rows)| ChannelScores { column, alone: score(rows) }).collect();
    Ok(JointScores { joint: joint.name.into(), fused: score(&fused), channels })
}
