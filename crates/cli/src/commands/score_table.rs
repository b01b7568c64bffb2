use comfy_table::{Table, presets};
use ohmstrain_calib::Scores;

/// An empty table for [`add_scores`], with more columns at its end.
pub fn score_table(quantity: &str, more: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let (rmse, mae) = (format!("RMSE, {quantity}"), format!("MAE, {quantity}"));
    let columns = [
        "recording",
        "estimate",
        &rmse,
        &mae,
        "%FS",
        "bias",
        "50 % covers",
        "90 % covers",
        "95 % covers",
        "95 % width, %FS",
        "CRPS, %FS",
        "log score",
        "wrong branch",
    ];
    table.set_header(columns.iter().chain(more));
    table
}

/// One row of scores; `more` are the cells of the columns at the end.
pub fn add_scores(table: &mut Table, recording: &str, estimate: &str, scores: &Scores, more: &[String]) {
    let percent = |share: Option<f64>| share.map_or_else(String::new, |share| format!("{:.1} %", 100.0 * share));
    let mut cells = vec![
        recording.to_string(),
        estimate.to_string(),
        format!("{:.4}", scores.rmse),
        format!("{:.4}", scores.mae),
        format!("{:.2}", scores.rmse_percent_fs),
        format!("{:+.4}", scores.bias),
        percent(scores.coverage_50),
        percent(scores.coverage_90),
        percent(scores.coverage_95),
        scores.width_95_percent_fs.map_or_else(String::new, |width| format!("{width:.1}")),
        format!("{:.2}", scores.crps_percent_fs),
        scores.log_score.map_or_else(String::new, |score| format!("{score:.2}")),
        percent(Some(scores.wrong_branch)),
    ];
    cells.extend_from_slice(more);
    table.add_row(cells);
}
