//! What an exported filter is worth on a recording, beside what was promised and what this computer makes of it.

use comfy_table::{Table, presets};
use ohmstrain::Sensor;
use ohmstrain_calib::{Baseline, ScoredRow, Scores};

use crate::args::ExportArgs;
use crate::commands::score_table::covered;
use crate::error::CliError;
use crate::export::{self, ReplayedRow};
use crate::input::Recording;
use crate::output::print;

/// Scores of the rows from `from_s` on, all of them with a reference.
struct Scored {
    program: Scores,
    exported: Scores,
    static_cubic: Scores,
}

/// Prints the table; refuses what is worse than a static cubic, unless it is forced.
pub fn run(args: &ExportArgs, sensor: &Sensor, recording: &Recording) -> Result<(), CliError> {
    let name = &recording.name;
    let Some(scored) = scored(args, sensor, recording)? else {
        return Err(CliError::Input(format!("{name}: expected rows with a reference to score, found none")));
    };
    let Scored { program, exported, static_cubic } = &scored;
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["estimate", "%FS", "50/90/95 %"]);
    if let Some(summary) = &sensor.params().summary {
        let coverage = format!("{:.0}", summary.coverage_95_percent);
        table.add_row(["promised: left out".into(), format!("{:.2}", summary.left_out_percent_fs), coverage]);
    }
    for (estimate, scores) in [("this computer", program), ("exported", exported), ("static cubic", static_cubic)] {
        let coverage = covered([scores.coverage_50, scores.coverage_90, scores.coverage_95]);
        table.add_row([estimate.to_owned(), format!("{:.2}", scores.rmse_percent_fs), coverage]);
    }
    print(|out| Ok(writeln!(out, "{table}")?))?;
    if exported.rmse > static_cubic.rmse && !args.force {
        return Err(CliError::Input(format!(
            "{name}: what would be exported is worse than a static cubic here; --force exports it"
        )));
    }
    Ok(())
}

/// Runs all three over the whole recording, as they would live.
fn scored(args: &ExportArgs, sensor: &Sensor, recording: &Recording) -> Result<Option<Scored>, CliError> {
    let asked = args.estimator.chosen().map(|estimator| estimator.0);
    let params = sensor.params();
    let mut builder = sensor.filter();
    if let Some(kind) = asked {
        builder = builder.estimator(kind);
    }
    let mut filter = builder.build().map_err(|error| CliError::Input(format!("{}: {error}", recording.name)))?;
    let mut cubic = params.static_cubic.start();
    let mut rows = Vec::new();
    let [mut program, mut static_cubic] = [const { Vec::new() }; 2];
    for row in 0..recording.trace.len() {
        let (time_s, reading) = recording.reading(row);
        rows.push(ReplayedRow { time_s, reading: reading.value, reading_sd: reading.sd });
        let estimate = filter.step(time_s, reading).map_err(|e| CliError::Input(format!("{}: {e}", recording.name)))?;
        let truth = recording.truth(row);
        program.push(ScoredRow { time_s, truth, strain: estimate.strain, sd: Some(estimate.strain_sd) });
        static_cubic.push(ScoredRow { time_s, truth, strain: cubic.strain(time_s, reading.value), sd: None });
    }
    let replayed = export::replay(params, asked, args.dt_s, &rows)
        .map_err(|error| error.into_cli(&args.sensor.display().to_string()))?;
    let exported: Vec<ScoredRow> = program
        .iter()
        .zip(&replayed)
        .map(|(row, said)| ScoredRow { strain: said.0.into(), sd: Some(said.1.into()), ..*row })
        .collect();
    let of = |rows: &[ScoredRow]| {
        let counted = |row: &&ScoredRow| row.truth.is_finite() && args.from.is_none_or(|from_s| row.time_s >= from_s);
        Scores::new(&rows.iter().filter(counted).copied().collect::<Vec<_>>())
    };
    let all = (of(&program), of(&exported), of(&static_cubic));
    let (Some(program), Some(exported), Some(static_cubic)) = all else { return Ok(None) };
    Ok(Some(Scored { program, exported, static_cubic }))
}
