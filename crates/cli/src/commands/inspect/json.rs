use std::io::Write;

use ohmstrain_bench_data::import::{ChannelSurvey, Role, Survey, Table, candidates};
use serde_json::{Value, json};

use super::{Findings, Proposal};
use crate::error::CliError;
use crate::output;

/// Version of the output of `--json`.
const SCHEMA: u32 = 1;

/// Prints the findings as JSON.
pub fn write(out: &mut dyn Write, findings: &Findings) -> Result<(), CliError> {
    let files: Vec<Value> = (0..findings.tables.len()).map(|index| file(findings, index)).collect();
    let mut all = json!({ "files": files });
    match &findings.plan {
        Ok(proposal) => {
            all["command"] = json!(proposal.command);
            all["columns"] = columns(proposal, &findings.tables);
            all["notes"] = json!(proposal.remarks);
            all["recording"] = survey(&proposal.survey);
        }
        Err(question) => all["question"] = json!(question.to_string()),
    }
    if let Some(each) = &findings.each {
        let channel = |(name, readings, reference): &(String, String, Option<String>)| json!({ "name": name, "readings": readings, "reference": reference });
        let channels: Vec<Value> = each.channels.iter().map(channel).collect();
        all["each"] = json!({ "command": each.command, "channels": channels });
    }
    output::json(out, SCHEMA, &all)
}

fn file(findings: &Findings, index: usize) -> Value {
    let table = &findings.tables[index];
    let layout = &table.layout;
    let found = candidates(&findings.tables);
    let columns: Vec<Value> = table
        .columns
        .iter()
        .enumerate()
        .map(|(place, column)| {
            let roles: Vec<Role> =
                found.iter().filter(|it| (it.table, it.column) == (index, place)).map(|it| it.role).collect();
            json!({
                "number": place + 1,
                "heading": column.heading,
                "unit": column.unit,
                "candidates": roles.iter().map(|role| role.name()).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "file": table.file,
        "kind": layout.format,
        "encoding": layout.encoding,
        "separator": layout.separator,
        "decimal": layout.decimal.to_string(),
        "skipped_lines": layout.skip,
        "header_lines": layout.header_lines,
        "unit_line": layout.unit_line,
        "exchanged": layout.is_exchanged,
        "values_in_turn": layout.values_in_turn,
        "text_lines": layout.text_lines,
        "short_lines": layout.short_lines,
        "rows": table.len(),
        "columns": columns,
    })
}

fn columns(proposal: &Proposal, tables: &[Table]) -> Value {
    let columns = proposal.plan.columns(tables).into_iter();
    columns
        .map(|(role, table, column, _, unit)| {
            json!({ "role": role.name(), "file": tables[table].file, "column": column + 1, "unit": unit })
        })
        .collect()
}

fn survey(survey: &Survey) -> Value {
    let clock = &survey.clock;
    let lag = survey.lag.map(|lag| {
        json!({ "seconds": lag.lag_s, "sd_s": lag.sd_s, "own_sd_s": lag.own_s, "unexplained": lag.unexplained, "is_sure": lag.is_sure() })
    });
    let phases = survey.phases.as_ref().map(|phases| {
        let of = |i: usize| json!({ "count": phases.phases[i].0, "seconds": phases.phases[i].1 });
        json!({ "extend": of(0), "hold": of(1), "retract": of(2) })
    });
    json!({
        "clock": {
            "step_s": clock.step_s,
            "step_5_percent_s": clock.step_range_s.0,
            "step_95_percent_s": clock.step_range_s.1,
            "first_s": clock.span_s.0,
            "last_s": clock.span_s.1,
            "gaps": clock.gaps.0,
            "longest_step_s": clock.gaps.1,
            "duplicates": clock.duplicates,
        },
        "readings": channel(&survey.readings),
        "reference": survey.reference.as_ref().map(channel),
        "phases": phases,
        "drift": survey.drift,
        "polarity_flips": survey.alternation,
        "reference_lag": lag,
        "reference_lag_unknown": survey.lag_unknown,
    })
}

fn channel(channel: &ChannelSurvey) -> Value {
    let allan: Vec<Value> =
        channel.allan.iter().map(|point| json!({ "tau_s": point.tau_s, "deviation": point.deviation })).collect();
    json!({
        "known": channel.counts.0,
        "missing": channel.counts.1,
        "smallest": channel.range.0,
        "largest": channel.range.1,
        "clipped_at_smallest": channel.clipped.0,
        "clipped_at_largest": channel.clipped.1,
        "noise_sd": channel.noise,
        "allan": allan,
    })
}
