use comfy_table::Table;
use ohmstrain_sensor::Scores;

use crate::output::table;

/// Meaning of the columns, printed below the tables; no line is wider than a terminal.
pub const KEY: &str = "\
RMSE, MAE and bias (mean error) are in the unit of the reference; %FS is the RMSE in percent of the
reference's range in the rows scored. 50/90/95 %: percent of the rows in which the interval of that
level holds the reference. width: mean width of the 95 % interval, CRPS: ranked probability score,
both %FS, less is better. log: mean log density, more is better. wrong: percent of the time on the
wrong branch, more than 20 %FS off for 2 s or longer.";

/// Returns an empty table for [`add_scores`].
pub fn score_table() -> Table {
    table(["estimate", "%FS", "RMSE", "MAE", "bias", "50/90/95 %", "width", "CRPS", "log", "wrong"])
}

/// Adds one row of scores.
pub fn add_scores(table: &mut Table, estimate: &str, scores: &Scores) {
    table.add_row([
        estimate.to_string(),
        format!("{:.2}", scores.rmse_percent_fs),
        format!("{:.4}", scores.rmse),
        format!("{:.4}", scores.mae),
        format!("{:+.4}", scores.bias),
        covered([scores.coverage_50, scores.coverage_90, scores.coverage_95]),
        scores.width_95_percent_fs.map_or_else(String::new, |width| format!("{width:.1}")),
        format!("{:.2}", scores.crps_percent_fs),
        scores.log_score.map_or_else(String::new, |score| format!("{score:.2}")),
        format!("{:.1}", 100.0 * scores.wrong_branch),
    ]);
}

/// Formats coverages in whole percent; empty if there are none.
pub fn covered(shares: [Option<f64>; 3]) -> String {
    let known: Vec<String> = shares.into_iter().flatten().map(|share| format!("{:.0}", 100.0 * share)).collect();
    known.join("/")
}
