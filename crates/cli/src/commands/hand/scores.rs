use std::io::Write;

use ohmstrain::Scores;
use ohmstrain_report::Sample;
use serde::Serialize;

use crate::commands::score_table::{KEY, add_scores, score_table};
use crate::error::CliError;
use crate::output;

/// Scores of a joint and of each of its channels alone.
#[derive(Serialize)]
pub struct JointScores {
    /// Name of the joint.
    pub joint: String,
    /// Overlap of the scored rows with the calibration of the first channel.
    #[serde(skip)]
    pub sample: Sample,
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
    let seen = joints.iter().map(|joint| joint.sample).find(|sample| *sample != Sample::Out);
    let sample = seen.map_or_else(String::new, |sample| format!(": {}", sample.name()));
    let mut table = score_table();
    for JointScores { joint, fused, smoothed, channels, .. } in joints {
        fused.iter().for_each(|scores| add_scores(&mut table, joint, scores));
        smoothed.iter().for_each(|scores| add_scores(&mut table, &format!("{joint}, smoothed"), scores));
        let alone = channels.iter().filter(|_| channels.len() > 1);
        for ChannelScores { column, alone, smoothed } in alone {
            alone.iter().for_each(|scores| add_scores(&mut table, &format!("  {column} alone"), scores));
            smoothed.iter().for_each(|scores| add_scores(&mut table, &format!("  {column} alone, smoothed"), scores));
        }
    }
    Ok(writeln!(out, "{heading}{sample}\n\n{table}\n\n{KEY}")?)
}

/// Prints the scores of recordings with their names: as one JSON document, or as a table each.
pub fn write_all(out: &mut dyn Write, scored: &[(String, Vec<JointScores>)], is_json: bool) -> Result<(), CliError> {
    if is_json && scored.len() > 1 {
        let of_one =
            |(name, joints): &(String, Vec<JointScores>)| serde_json::json!({ "scored": name, "joints": joints });
        let recordings: Vec<_> = scored.iter().map(of_one).collect();
        return output::json(out, SCHEMA, &serde_json::json!({ "recordings": recordings }));
    }
    scored.iter().try_for_each(|(name, joints)| write(out, name, joints, is_json))
}
