//! All joints of a hand as source code.

use std::path::Path;

use ohmstrain::{FusedSensor, SensorParams};
use ohmstrain_bench_data::FrontEndSpec;
use ohmstrain_export::{Divider, ExportTarget, HandChannel, HandFirmware, HandJoint};
use ohmstrain_model::SensorSide;

use super::description;
use super::joint::{Channel, Joint};
use super::{OF_ONE_SENSOR, joints, refuse_flags};
use crate::args::ExportArgs;
use crate::commands::export::put;
use crate::commands::export_choice::usual_step_s;
use crate::error::CliError;
use crate::output::{Outputs, print};

/// Writes a filter for each channel, their fusion, and what calls them.
pub fn run(args: &ExportArgs, hand: &Path) -> Result<(), CliError> {
    refuse_flags(
        [
            ("--target rust", ExportTarget::from(args.target) == ExportTarget::Rust),
            ("--estimator", args.estimator.chosen().is_some()),
            ("--budget", args.budget.is_some()),
            ("--score", args.score.is_some()),
        ],
        OF_ONE_SENSOR,
    )?;
    let description = description::read(hand)?;
    let joints = joints(&description, hand, "")?;
    let refused = |error| CliError::export(&error, &hand.display().to_string());
    let usual = |params: &SensorParams| usual_step_s(args.dt_s, params);
    let steps: Vec<f64> = channels(&joints).map(usual).collect::<Result<_, _>>()?;
    // The slowest channel has the longest step.
    let dt_s = steps.into_iter().fold(0.0, f64::max);
    let exported: Result<Vec<HandJoint>, String> = joints.iter().map(exported).collect();
    let exported = exported.map_err(|what| CliError::Input(format!("{}: {what}", hand.display())))?;
    let firmware = HandFirmware::new(&exported, dt_s, &args.prefix).map_err(refused)?;
    let files = description.files(hand);
    let mut outputs = Outputs::new(args.force, &files);
    put(&mut outputs, &args.output, firmware.files)?;
    outputs.publish()?;
    print(|out| firmware.costs.iter().try_for_each(|line| Ok(writeln!(out, "{line}")?)))
}

fn channels<'j>(joints: &'j [Joint]) -> impl Iterator<Item = &'j SensorParams> {
    joints.iter().flat_map(|joint| &joint.channels).map(|channel| channel.sensor.params())
}

/// Returns a joint in the form that is exported.
fn exported<'j>(joint: &'j Joint) -> Result<HandJoint<'j>, String> {
    let channel = |one: &'j Channel| {
        Ok(HandChannel {
            column: one.entry.column.clone(),
            params: one.sensor.params(),
            rest_resistance: one.rest_resistance,
            divider: one.entry.front_end.map(|spec| divider(&one.entry.column, spec)).transpose()?,
        })
    };
    Ok(HandJoint {
        name: joint.name.into(),
        channels: joint.channels.iter().map(channel).collect::<Result<_, String>>()?,
        fusion: joint.fusion.as_ref().map(FusedSensor::params),
        joint: joint.channels.iter().find_map(|channel| channel.sensor.params().joint),
    })
}

/// Returns the divider of a column, which the sketch measures.
fn divider(column: &str, spec: FrontEndSpec) -> Result<Divider, String> {
    match spec {
        FrontEndSpec::Divider { reference_ohm, side, bits, .. } => {
            Ok(Divider { reference_ohm, is_high: side == SensorSide::High, full: f64::from(bits).exp2() - 1.0 })
        }
        other => Err(format!(
            "column `{column}`: expected a divider, which the exported sketch measures, found `{other}`; without `front_end` the sketch is \
             exported for a divider, whose `ohm_at` is then to be replaced"
        )),
    }
}
