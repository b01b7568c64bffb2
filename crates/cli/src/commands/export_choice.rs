//! Choice of the filter to export among those that fit a chip.

use ohmstrain_sensor::SensorParams;

use crate::args::ExportArgs;
use crate::commands::export_score::OnRecording;
use crate::error::CliError;
use crate::output;
use ohmstrain_export::{self as export, Candidate, Plan};

/// Filter that is exported, and the candidates.
pub struct Choice {
    pub plan: Plan,
    /// A table of all candidates, and the reason why the next better one does not fit; empty without a budget.
    pub lines: Vec<String>,
}

/// Returns the usual interval between two readings, s: the requested one, or else that of the calibration's recordings.
pub fn usual_step_s(asked: Option<f64>, params: &SensorParams) -> Result<f64, CliError> {
    asked.or_else(|| export::usual_step_s(params)).ok_or_else(|| {
        CliError::Arguments(
            "--dt-s: expected the usual time between two readings; the sensor's file names no recording".into(),
        )
    })
}

/// Returns the sensor's filter, or the best one within a budget: by its score on a recording, or else by a table.
pub fn choose(
    args: &ExportArgs,
    params: &SensorParams,
    dt_s: f64,
    recording: Option<&OnRecording>,
) -> Result<Choice, CliError> {
    let Some(budget) = &args.budget else {
        let plan = Plan { kind: args.estimator.chosen(), ..Plan::default() };
        return Ok(Choice { plan, lines: Vec::new() });
    };
    let name = args.sensor.display().to_string();
    let candidates =
        export::candidates(params, budget, dt_s).map_err(|error| CliError::export(&error, &name))?.into_iter();
    let ranked = candidates.enumerate().map(|(place, candidate)| {
        let rank = match recording {
            Some(recording) => recording.exported(params, &candidate.plan, args)?.rmse_percent_fs,
            None => place as f64,
        };
        Ok(Ranked { candidate, rank })
    });
    let ranked = ranked.collect::<Result<Vec<_>, CliError>>()?;
    let fits = |one: &&Ranked| one.candidate.lacks.is_none();
    let best = ranked.iter().filter(fits).min_by(|a, b| a.rank.total_cmp(&b.rank));
    let best = best.ok_or_else(|| CliError::Arguments("--budget: nothing fits".into()))?;
    let better = ranked.iter().filter(|one| !fits(one) && one.rank < best.rank);
    let next = better.max_by(|a, b| a.rank.total_cmp(&b.rank));
    let mut lines = table(&ranked, recording.is_some());
    if let Some(Ranked { candidate: Candidate { words, lacks: Some(lacks), .. }, .. }) = next {
        lines.push(format!("the next better one, {words}, does not fit: {lacks}"));
    }
    lines.push(String::new());
    Ok(Choice { plan: best.candidate.plan, lines })
}

/// A candidate with its error in percent of full scale, or its rank in the table.
struct Ranked {
    candidate: Candidate,
    rank: f64,
}

/// Returns a table of all candidates, the best first.
fn table(ranked: &[Ranked], is_scored: bool) -> Vec<String> {
    let mut table = output::table(["candidate", "%FS", "instructions", "flash, B", "RAM, B", "fits"]);
    for Ranked { candidate: Candidate { words, cost, lacks, .. }, rank } in ranked {
        let error = if is_scored { format!("{rank:.2}") } else { String::new() };
        let fits = if lacks.is_none() { "yes" } else { "no" };
        let costs = [cost.instructions, cost.flash, cost.ram()].map(|number| number.to_string());
        table.add_row([words.clone(), error].into_iter().chain(costs).chain([fits.to_owned()]));
    }
    table.lines().collect()
}
