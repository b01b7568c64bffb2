use comfy_table::{Table, presets};
use ohmstrain_calib::{EstimatorKind, Scores, SensorParams};
use serde::Serialize;

use super::scoring;
use crate::args::EvaluateArgs;
use crate::error::CliError;
use crate::input::{self, check_unit};
use crate::output::write_to;
use crate::run::estimate;
use crate::sensor_file;

/// What `--json` prints.
#[derive(Serialize)]
struct Evaluation {
    recordings: Vec<RecordingScores>,
}

/// One recording: the filter's scores, and those it is compared with.
#[derive(Serialize)]
struct RecordingScores {
    file: String,
    estimator: &'static str,
    #[serde(flatten)]
    filter: Scores,
    /// For the table; the JSON is about one estimator.
    #[serde(skip)]
    smoother: Scores,
    baselines: Baselines,
}

#[derive(Serialize)]
struct Baselines {
    static_cubic: Scores,
}

/// Smallest coverage of the 95 % interval that `--check` accepts.
const LEAST_COVERAGE: f64 = 0.8;

/// Compares estimates with the reference of each recording.
pub fn run(args: &EvaluateArgs) -> Result<(), CliError> {
    let kind = args.estimator.chosen().map(|estimator| estimator.0);
    let params = sensor_file::read(&args.sensor, kind)?;
    let overrides = args.trace.metadata();
    let mut recordings = Vec::new();
    for path in &args.traces {
        let recording = input::read(path, &overrides)?;
        check_unit(&recording.header, recording.trace.readings.kind, params.reading)?;
        recording.samples()?;
        recording.check_quantity(params.quantity)?;
        recordings.push(score(&recording, &params, kind, args.from)?);
    }
    let evaluation = Evaluation { recordings };
    write_to(None, |out| {
        if args.json {
            serde_json::to_writer_pretty(&mut *out, &evaluation).map_err(std::io::Error::from)?;
            Ok(writeln!(out)?)
        } else {
            Ok(writeln!(out, "{}", table(&evaluation, params.quantity.name()))?)
        }
    })?;
    if args.check { check(&evaluation) } else { Ok(()) }
}

fn score(
    recording: &input::Recording,
    params: &SensorParams,
    kind: Option<EstimatorKind>,
    from: Option<f64>,
) -> Result<RecordingScores, CliError> {
    let wanted = kind.unwrap_or(params.default_estimator);
    let estimated = estimate(recording, params, kind)?;
    let nothing = || {
        let rows = from.map_or_else(|| "any row".into(), |from| format!("time_s >= {from}"));
        CliError::Input(format!("{}: expected a reference at {rows}, found none", recording.name))
    };
    Ok(RecordingScores {
        file: recording.name.clone(),
        estimator: wanted.name(),
        filter: scoring::of_outputs(recording, &estimated.filtered, from).ok_or_else(nothing)?,
        smoother: scoring::of_outputs(recording, &estimated.smoothed, from).ok_or_else(nothing)?,
        baselines: Baselines {
            static_cubic: scoring::of_static_cubic(recording, &params.static_cubic, from).ok_or_else(nothing)?,
        },
    })
}

fn table(evaluation: &Evaluation, quantity: &str) -> Table {
    let mut table = score_table(quantity);
    for recording in &evaluation.recordings {
        add_scores(&mut table, &recording.file, recording.estimator, &recording.filter);
        add_scores(&mut table, "", "smoother", &recording.smoother);
        add_scores(&mut table, "", "static cubic", &recording.baselines.static_cubic);
    }
    table
}

/// An empty table for [`add_scores`].
pub fn score_table(quantity: &str) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header([
        "recording",
        "estimate",
        &format!("RMSE, {quantity}"),
        "%FS",
        "bias",
        "95 % covers",
        "log score",
    ]);
    table
}

/// One row of scores.
pub fn add_scores(table: &mut Table, recording: &str, estimate: &str, scores: &Scores) {
    let percent = |share: Option<f64>| share.map_or_else(String::new, |share| format!("{:.1} %", 100.0 * share));
    table.add_row([
        recording.to_string(),
        estimate.to_string(),
        format!("{:.4}", scores.rmse),
        format!("{:.2}", scores.rmse_percent_fs),
        format!("{:+.4}", scores.bias),
        percent(scores.coverage_95),
        scores.log_score.map_or_else(String::new, |score| format!("{score:.2}")),
    ]);
}

fn check(evaluation: &Evaluation) -> Result<(), CliError> {
    for recording in &evaluation.recordings {
        let baseline = recording.baselines.static_cubic.rmse;
        if recording.filter.rmse >= baseline {
            return Err(CliError::Check(format!(
                "{}: RMSE {:.4} is not below the static cubic's {baseline:.4}",
                recording.file, recording.filter.rmse
            )));
        }
        let coverage = recording.filter.coverage_95.unwrap_or(0.0);
        if coverage < LEAST_COVERAGE {
            return Err(CliError::Check(format!(
                "{}: the 95 % interval covers {:.1} %, less than {:.0} %",
                recording.file,
                100.0 * coverage,
                100.0 * LEAST_COVERAGE
            )));
        }
    }
    Ok(())
}
