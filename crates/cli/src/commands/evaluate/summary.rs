use std::io::Write;

use ohmstrain_sensor::Scores;
use serde::Serialize;

use super::scores::RecordingScores;
use crate::commands::score_table::covered;
use crate::error::CliError;
use crate::output::table;

/// Summary of all cases of one estimate. A case is a recording and a split of it.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// The estimate's name.
    estimate: String,
    /// Number of cases.
    cases: usize,
    /// Geometric mean of the ratio of the error to that of the static cubic on the same rows.
    ratio: f64,
    /// Geometric mean of the error, %FS.
    percent_fs: f64,
    /// The largest such ratio.
    worst_ratio: f64,
    /// The case with that ratio.
    worst_case: String,
    /// Mean CRPS, %FS.
    crps_percent_fs: f64,
    /// Mean of the 95 % interval's width, %FS; `None` for estimates without a deviation.
    width_95_percent_fs: Option<f64>,
    /// Mean coverages.
    coverage_50: Option<f64>,
    coverage_90: Option<f64>,
    coverage_95: Option<f64>,
    /// Smallest coverage of the 95 % interval.
    least_coverage_95: Option<f64>,
}

/// One case of one estimate: both names, its scores and those of the static cubic.
struct Case {
    estimate: String,
    name: String,
    scores: Scores,
    cubic_rmse: f64,
}

/// Returns a summary per estimate, in order of first appearance; the recordings' first estimator brings the baselines.
pub fn summaries<'a>(recordings: impl Iterator<Item = &'a [RecordingScores]>) -> Vec<Summary> {
    let mut cases: Vec<Case> = Vec::new();
    for scores in recordings {
        let Some(first) = scores.first() else { continue };
        let cubic_rmse = first.baselines.static_cubic.rmse;
        let name = first.case();
        let mut add = |estimate: String, scores: Scores| {
            cases.push(Case { estimate, name: name.clone(), scores, cubic_rmse });
        };
        for of in scores {
            add(of.name(), of.filter);
            add(format!("{}, smoother", of.name()), of.smoother);
        }
        for (baseline, scores) in first.baselines.named() {
            add(baseline.to_string(), scores);
        }
    }
    let mut names: Vec<String> = Vec::new();
    for case in &cases {
        if !names.contains(&case.estimate) {
            names.push(case.estimate.clone());
        }
    }
    let of = |name: &String| summary(name, cases.iter().filter(|case| case.estimate == *name).collect());
    names.iter().filter_map(of).collect()
}

/// Sums up the cases; `None` without a case.
fn summary(estimate: &str, cases: Vec<&Case>) -> Option<Summary> {
    let count = cases.len() as f64;
    let ratio = |case: &Case| case.scores.rmse / case.cubic_rmse;
    let mean = |of: &dyn Fn(&Scores) -> f64| cases.iter().map(|case| of(&case.scores)).sum::<f64>() / count;
    let mean_known = |of: &dyn Fn(&Scores) -> Option<f64>| {
        let known: Option<Vec<f64>> = cases.iter().map(|case| of(&case.scores)).collect();
        known.map(|known| known.iter().sum::<f64>() / count)
    };
    let worst = cases.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
    let geometric_mean =
        |of: &dyn Fn(&Case) -> f64| (cases.iter().map(|case| of(case).ln()).sum::<f64>() / count).exp();
    Some(Summary {
        estimate: estimate.into(),
        cases: cases.len(),
        ratio: geometric_mean(&ratio),
        percent_fs: geometric_mean(&|case| case.scores.rmse_percent_fs),
        worst_ratio: ratio(worst),
        worst_case: worst.name.clone(),
        crps_percent_fs: mean(&|scores| scores.crps_percent_fs),
        width_95_percent_fs: mean_known(&|scores| scores.width_95_percent_fs),
        coverage_50: mean_known(&|scores| scores.coverage_50),
        coverage_90: mean_known(&|scores| scores.coverage_90),
        coverage_95: mean_known(&|scores| scores.coverage_95),
        least_coverage_95: cases.iter().filter_map(|case| case.scores.coverage_95).reduce(f64::min),
    })
}

/// Writes a table, one estimate per row.
pub fn write(summaries: &[Summary], out: &mut dyn Write) -> Result<(), CliError> {
    let mut table =
        table(["all cases", "cases", "%FS", "/ cubic", "worst", "50/90/95 %", "least 95 %", "width", "CRPS"]);
    for summary in summaries {
        table.add_row([
            summary.estimate.clone(),
            summary.cases.to_string(),
            format!("{:.2}", summary.percent_fs),
            format!("{:.3}", summary.ratio),
            format!("{:.2}", summary.worst_ratio),
            covered([summary.coverage_50, summary.coverage_90, summary.coverage_95]),
            summary.least_coverage_95.map_or_else(String::new, |share| format!("{:.0}", 100.0 * share)),
            summary.width_95_percent_fs.map_or_else(String::new, |width| format!("{width:.1}")),
            format!("{:.2}", summary.crps_percent_fs),
        ]);
    }
    writeln!(out, "{table}")?;
    writeln!(
        out,
        "%FS: geometric mean of the RMSE, / cubic: of its ratio to the static cubic's; worst: the largest, in"
    )?;
    for summary in summaries.iter().filter(|summary| summary.width_95_percent_fs.is_some()) {
        writeln!(out, "  {}: {}", summary.estimate, summary.worst_case)?;
    }
    Ok(writeln!(out)?)
}
