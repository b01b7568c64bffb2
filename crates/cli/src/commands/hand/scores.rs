use std::io::Write;

use ohmstrain::Scores;
use serde::Serialize;

use crate::commands::score_table::{KEY, add_scores, score_table};
use crate::error::CliError;
use crate::output;

/// Scores of a joint and of each of its channels alone.
#[derive(Serialize)]
pub struct JointScores {
    /// Name of the joint.
    pub joint: String,
    /// Scores of the joint's estimate as `hand` reports it.
    pub fused: Option<Scores>,
    /// Scores of the smoothed estimate; `None` without a smoother.
    pub smoothed: Option<Scores>,
    pub channels: Vec<ChannelScores>,
}

/// Scores of a channel by itself.
#[derive(Serialize)]
pub struct ChannelScores {
    /// Column of its readings.
    pub column: String,
    pub alone: Option<Scores>,
    /// Scores of its smoother; `None` without one, or on the parts left out of a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothed: Option<Scores>,
}

/// Version of the fields of the JSON.
const SCHEMA: u32 = 1;

/// Prints scores below a heading, as JSON or as a table.
pub fn write(out: &mut dyn Write, heading: &str, joints: &[JointScores], is_json: bool) -> Result<(), CliError> {
    if is_json {
        return output::json(out, SCHEMA, &serde_json::json!({ "scored": heading, "joints": joints }));
    }
    let mut table = score_table();
    for JointScores { joint, fused, smoothed, channels } in joints {
        fused.iter().for_each(|scores| add_scores(&mut table, joint, scores));
        smoothed.iter().for_each(|scores| add_scores(&mut table, &format!("{joint}, smoothed"), scores));
        let alone = channels.iter().filter(|_| channels.len() > 1);
        for ChannelScores { column, alone, smoothed } in alone {
            alone.iter().for_each(|scores| add_scores(&mut table, &format!("  {column} alone"), scores));
            smoothed.iter().for_each(|scores| add_scores(&mut table, &format!("  {column} alone, smoothed"), scores));
        }
    }
    Ok(writeln!(out, "{heading}\n\n{table}\n\n{KEY}")?)
}
