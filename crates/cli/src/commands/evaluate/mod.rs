mod evaluation;
mod known_strains;
mod scores;
mod sensors;
mod settled;
mod summary;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

pub use evaluation::Evaluation;
use known_strains::KnownStrains;
use ohmstrain::trace::TraceFile;
use ohmstrain_calib::{Baselines, PublishedLaw, Samples, reference_lag, screen};
use ohmstrain_sensor::EstimatorKind;
use rayon::prelude::*;
pub use scores::RecordingScores;
use sensors::{JudgedSensor, Rivals, phases};

use crate::args::{EvaluateArgs, Split};
use crate::commands::hand;
use crate::commands::hand::scores::{self as joint_scores, JointScores};
use crate::commands::reporting::{Wanted, drawn};
use crate::error::CliError;
use crate::input;
use crate::messages::Messages;
use crate::output::{Outputs, print};
use crate::progress::Progress;
use crate::run::rest_resistance;
use crate::sensor_file;
use crate::suits;
use ohmstrain_report::{Drawn, Reporting, Sample, Scored};

/// Smallest coverage of the 95 % interval that `--check` accepts.
const LEAST_COVERAGE: f64 = 0.8;

/// Compares estimates with the reference of each recording.
pub fn run(args: &EvaluateArgs, messages: &Messages) -> Result<(), CliError> {
    if let Some(hand) = args.calibration.sensor.as_ref().filter(|path| sensor_file::is_of_a_hand(path)) {
        let mut scored: Vec<(String, Vec<JointScores>)> = Vec::new();
        let judged = hand::evaluate::run(args, hand, |name, scores| {
            scored.push((name.to_owned(), scores));
            Ok(())
        });
        if !scored.is_empty() {
            print(|out| joint_scores::write_all(out, &scored, args.json))?;
        }
        return judged;
    }
    evaluate(args, messages, &mut Evaluation::default(), |evaluation| print(|out| evaluation.write(out, args.json)))
}

/// Evaluates into `evaluation`, which is shown once everything possible has been scored.
pub fn evaluate(
    args: &EvaluateArgs,
    messages: &Messages,
    evaluation: &mut Evaluation,
    show: impl FnOnce(&Evaluation) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let source = &args.calibration;
    let inputs = args.traces.iter().chain(&args.test).chain(&source.train).chain(&source.sensor);
    let mut outputs = Outputs::new(args.replace.force, inputs);
    let wanted = Wanted::claim(&args.report, &mut outputs)?;
    let judged = match &source.sensor {
        Some(sensor) => with_sensor_file(args, sensor, evaluation, messages),
        None if !source.split.is_empty() => with_splits(args, evaluation, messages),
        None if source.leave_one_out => with_each_left_out(args, evaluation, messages),
        None => with_training(args, evaluation, messages),
    };
    // Calibrations take long: scores from before an error remain valid.
    if judged.is_ok() || !evaluation.is_empty() {
        show(evaluation)?;
    }
    judged?;
    if let Some((wanted, drawn)) = wanted.zip(evaluation.drawn.take()) {
        wanted.put(drawn, &mut outputs)?;
    }
    outputs.publish()?;
    if args.check { check(evaluation) } else { Ok(()) }
}

/// Evaluates every recording with the parameters of a file.
fn with_sensor_file(
    args: &EvaluateArgs,
    path: &Path,
    evaluation: &mut Evaluation,
    messages: &Messages,
) -> Result<(), CliError> {
    let sensors = JudgedSensor::from_file(path, args.estimator, args.with_correction())?;
    let rivals = Rivals { static_cubic: sensors[0].sensor.params().static_cubic, learned: None, published: None };
    let judged = |path: &PathBuf| judge(args, &read(args, path)?, Scored::since(args.from), &sensors, &rivals);
    add_until_error(evaluation, args.traces.par_iter().map(judged).collect(), messages)
}

/// Evaluates every recording with parameters from some of its rows, split by split.
fn with_splits(args: &EvaluateArgs, evaluation: &mut Evaluation, messages: &Messages) -> Result<(), CliError> {
    let progress = Progress::new("calibrating", messages);
    for path in &args.traces {
        let recording = read(args, path)?;
        for &split in &args.calibration.split {
            add_until_error(evaluation, vec![with_split(args, &recording, split, &progress)], messages)?;
        }
    }
    Ok(())
}

/// Calibrates on some rows of a recording, and scores the others.
fn with_split(
    args: &EvaluateArgs,
    recording: &TraceFile,
    split: Split,
    progress: &Progress,
) -> Result<Judged, CliError> {
    let rows = recording.trace.len();
    let training = [recording.rows(split.training(rows))];
    let (sensors, rivals) = calibrated(&training, args, progress)?;
    progress.doing("scoring");
    let lag_s = reference_lag(&recording.samples()?).ok().map(|lag| lag.lag_s);
    let (scored, time_at) = (split.scored(rows), |row: usize| recording.trace.time_s.get(row).copied());
    let part = Scored { from_s: time_at(scored.start), until_s: time_at(scored.end) };
    let mut judged = judge(args, recording, part, &sensors, &rivals)?;
    for scores in &mut judged.scores {
        (scores.lag_s, scores.split) = (Some(lag_s), Some(split.to_string()));
    }
    Ok(judged)
}

/// Evaluates some recordings with parameters from others.
fn with_training(args: &EvaluateArgs, evaluation: &mut Evaluation, messages: &Messages) -> Result<(), CliError> {
    let progress = Progress::new("calibrating", messages);
    let read = |path| read(args, path);
    let training: Vec<TraceFile> = args.calibration.train.iter().map(|path| read(path)).collect::<Result<_, _>>()?;
    // All recordings are read before any calibration, so that a wrong name costs no time.
    let tests: Vec<TraceFile> = args.test.iter().map(|path| read(path)).collect::<Result<_, _>>()?;
    let (sensors, rivals) = calibrated(&training, args, &progress)?;
    progress.doing("scoring");
    let judged = |recording: &TraceFile| judge(args, recording, Scored::since(args.from), &sensors, &rivals);
    add_until_error(evaluation, tests.par_iter().map(judged).collect(), messages)
}

/// Evaluates every recording with parameters from all others.
fn with_each_left_out(args: &EvaluateArgs, evaluation: &mut Evaluation, messages: &Messages) -> Result<(), CliError> {
    let mut recordings: Vec<TraceFile> = args.traces.iter().map(|path| read(args, path)).collect::<Result<_, _>>()?;
    if recordings.len() < 2 {
        return Err(CliError::Arguments("--leave-one-out: expected two recordings or more, found one".into()));
    }
    let progress = Progress::new("calibrating", messages);
    for place in 0..recordings.len() {
        let left_out = recordings.remove(place);
        progress.doing("calibrating");
        let (sensors, rivals) = calibrated(&recordings, args, &progress)?;
        progress.doing("scoring");
        let mut judged = judge(args, &left_out, Scored::since(args.from), &sensors, &rivals)?;
        judged.scores.iter_mut().for_each(|scores| scores.split = Some("left out".to_owned()));
        add_until_error(evaluation, vec![Ok(judged)], messages)?;
        recordings.insert(place, left_out);
    }
    Ok(())
}

/// Adds scores in the order of the recordings, whichever finished first, and stops at the first recording without any. Warnings
/// wait, so that they come in the same order.
fn add_until_error(
    evaluation: &mut Evaluation,
    judged: Vec<Result<Judged, CliError>>,
    messages: &Messages,
) -> Result<(), CliError> {
    for judged in judged {
        let Judged { scores, warnings, drawn } = judged?;
        warnings.iter().for_each(|warning| messages.warning(warning));
        evaluation.add(scores);
        evaluation.drawn = evaluation.drawn.take().or(drawn);
    }
    Ok(())
}

fn read(args: &EvaluateArgs, path: &Path) -> Result<TraceFile, CliError> {
    input::read(path, &args.units.metadata())
}

/// Calibrates one sensor per estimator, and the baselines, on the same rows.
fn calibrated(
    training: &[TraceFile],
    args: &EvaluateArgs,
    progress: &Progress,
) -> Result<(Vec<JudgedSensor>, Rivals), CliError> {
    let sensors = JudgedSensor::calibrated(training, args.estimator, args.with_correction(), progress)?;
    // All sensors have the same effect of temperature; baselines do without it, too.
    let training: Vec<_> = match sensors.first() {
        Some(first) => training.iter().map(|one| one.at_reference_temperature(&first.sensor)).collect(),
        None => training.iter().map(Cow::Borrowed).collect(),
    };
    let samples: Vec<Samples> = training.iter().map(|one| one.samples()).collect::<Result<_, _>>()?;
    let names: Vec<&str> = training.iter().map(|recording| recording.name.as_str()).collect();
    let failed = |error| CliError::calibration(&names, error);
    let baselines = Baselines::fit(&screen(&samples).map_err(failed)?.samples()).map_err(failed)?;
    let phases: Vec<_> = samples.iter().map(|samples| phases(samples.time_s(), samples.strain())).collect();
    let published = PublishedLaw::fit(&samples, &phases).ok();
    Ok((sensors, Rivals { static_cubic: baselines.static_cubic, learned: Some(baselines), published }))
}

/// Result for a recording.
#[derive(Default)]
struct Judged {
    scores: Vec<RecordingScores>,
    warnings: Vec<String>,
    /// Report on the first recording.
    drawn: Option<Drawn>,
}

/// Scores every sensor on some rows of a recording.
fn judge(
    args: &EvaluateArgs,
    recording: &TraceFile,
    part: Scored,
    sensors: &[JudgedSensor],
    rivals: &Rivals,
) -> Result<Judged, CliError> {
    let mut judged = Judged::default();
    let Some(JudgedSensor { sensor: first, kind, .. }) = sensors.first() else { return Ok(judged) };
    let recording = &recording.at_reference_temperature(first);
    recording.check_unit(first.params().reading)?;
    recording.samples()?;
    recording.check_quantity(first.params().quantity)?;
    let readings = || recording.trace.readings.values.iter().copied();
    let rest = rest_resistance(args.rest_resistance, first, readings(), &recording.name)?;
    suits::check_readings(&recording.header, first, rest, readings())?;
    suits::check_reference(recording, first)?;
    check_truth(recording, part)?;
    let nothing = || no_truth(recording, part);
    let moved = first.params().rest_reading / first.rest_reading(rest);
    let baselines = rivals.scores(recording, part, moved).ok_or_else(nothing)?;
    let has_split = !args.calibration.split.is_empty();
    let sample = if has_split {
        Sample::Out
    } else {
        Sample::of(&recording.trace.time_s, &recording.sha256, first.params(), part)
    };
    for sensor in sensors {
        let of_whole = args.known_every.filter(|_| !sensor.is_part);
        for given in KnownStrains::cases(recording, part, sensor.sensor.params().limits, of_whole) {
            let scores = sensor.judge(recording, part, rest, &given, baselines, &mut judged.warnings)?;
            judged.scores.push(RecordingScores { sample, ..scores.ok_or_else(nothing)? });
        }
    }
    if args.draws(&recording.name) {
        let (kind, tested, facts) = (Some(*kind), None, &[]);
        let reporting =
            Reporting { recording, sensor: first, kind, rest_resistance: rest, part, sample, tested, facts };
        judged.drawn = Some(drawn(&reporting)?);
    }
    Ok(judged)
}

/// Refuses a recording without rows in `part`, or whose reference is unknown or constant in them.
pub fn check_truth(recording: &TraceFile, part: Scored) -> Result<(), CliError> {
    let last_s = recording.trace.time_s.last().copied();
    if part.until_s.is_none() && part.from_s.zip(last_s).is_some_and(|(from_s, last_s)| from_s > last_s) {
        return Err(recording.no_rows(part.from_s, None).into());
    }
    let rows = recording.trace.time_s.iter().enumerate().filter(|(_, time_s)| part.holds(**time_s));
    let mut known = rows.map(|(row, _)| recording.truth(row)).filter(|truth| truth.is_finite());
    let first = known.next().ok_or_else(|| no_truth(recording, part))?;
    if known.all(|truth| truth == first) {
        let name = &recording.name;
        let text = format!("{name}: expected a reference that changes, found {first} in every row that is scored");
        return Err(CliError::Input(text));
    }
    Ok(())
}

fn no_truth(recording: &TraceFile, part: Scored) -> CliError {
    let rows = part.from_s.map_or_else(|| "any row".into(), |from| format!("time_s >= {from}"));
    CliError::Input(format!("{}: expected a reference at {rows}, found none", recording.name))
}

fn check(evaluation: &Evaluation) -> Result<(), CliError> {
    let split = |of: &RecordingScores| of.split.as_ref().map_or_else(String::new, |split| format!("split {split}: "));
    for recording in evaluation.recordings().filter(|scores| !scores.is_part) {
        let baseline = recording.baselines.static_cubic.rmse;
        if recording.estimator != EstimatorKind::StaticCubic.name() && recording.filter.rmse >= baseline {
            return Err(CliError::Check(format!(
                "{}: {}RMSE {:.4} is not below the static cubic's {baseline:.4}",
                recording.file,
                split(recording),
                recording.filter.rmse
            )));
        }
        let coverage = recording.filter.coverage_95.unwrap_or(0.0);
        if coverage < LEAST_COVERAGE {
            return Err(CliError::Check(format!(
                "{}: {}the 95 % interval covers {:.1} %, less than {:.0} %",
                recording.file,
                split(recording),
                100.0 * coverage,
                100.0 * LEAST_COVERAGE
            )));
        }
    }
    Ok(())
}
