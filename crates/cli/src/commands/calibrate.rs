use std::ops::Range;
use std::time::Instant;

use ohmstrain::trace::{TraceFile, check_alike, known_recordings};
use ohmstrain::{
    Calibrated, Calibration, Closing, Error, EstimatorKind, Findings, Kept, Sensor, Tested, calibration_doubts,
    motion_doubts,
};
use ohmstrain_calib::{Samples, screen};

use super::closing;
use super::explain;
use super::fleet;
use super::hand;
use super::reporting::{Reporting, Wanted};
use crate::alignment;
use crate::args::{CalibrateArgs, Coefficients};
use crate::channels::Table;
use crate::error::CliError;
use crate::input;
use crate::marks;
use crate::messages::Messages;
use crate::output::{Kind, Outputs, named, print};
use crate::plausible;
use crate::progress::Progress;
use crate::sensor_file;
use ohmstrain_report::{Sample, Scored};

/// Calibrates a sensor on recordings, writes its parameters, and prints a summary.
pub fn run(args: &CalibrateArgs, messages: &Messages) -> Result<(), CliError> {
    let tables: Option<Vec<Table>> = args.traces.iter().map(|path| Table::read(path)).collect::<Result<_, _>>()?;
    if let Some(tables) = tables {
        return hand::calibrate::run(args, &tables, messages);
    }
    let outcome = calibrate(args, messages)?;
    let file = args.output.display().to_string();
    let closing = outcome.closing(&file);
    print(|out| {
        out.write_all(outcome.explained.as_bytes())?;
        if args.json {
            closing::json(out, &closing, &file)
        } else if messages.is_quiet() {
            Ok(())
        } else {
            Ok(out.write_all(named(&closing.lines()).as_bytes())?)
        }
    })
}

/// Result of a calibration, beside the sensor's file.
pub struct Outcome {
    sensor: Sensor,
    /// Findings on held-out parts.
    pub findings: Option<Findings>,
    tested: Option<Tested>,
    calibration_s: f64,
    /// Text that `--explain` and `--bootstrap` print.
    explained: String,
}

impl Outcome {
    fn closing<'a>(&'a self, file: &'a str) -> Closing<'a> {
        Closing {
            file: Some(file),
            params: self.sensor.params(),
            findings: self.findings.as_ref(),
            tested: self.tested.as_ref(),
            calibration_s: Some(self.calibration_s),
            more: "--explain",
        }
    }
}

/// Calibrates a sensor on recordings and writes its parameters.
pub fn calibrate(args: &CalibrateArgs, messages: &Messages) -> Result<Outcome, CliError> {
    let mut outputs = Outputs::new(args.replace.force, args.traces.iter().chain(&args.prior).chain(&args.marks));
    let sensor_output = outputs.claim(&args.output, Kind::Sensor)?;
    let wanted = Wanted::claim(&args.report, &mut outputs)?;
    let overrides = args.units.metadata();
    let (mut recordings, mut kept) = (Vec::new(), Vec::new());
    for path in &args.traces {
        let recording = input::read(path, &overrides)?;
        let rows = rows_in(args, &recording)?;
        recordings.push(recording.rows(rows.clone()));
        if rows.len() < recording.trace.len() {
            kept.push((recordings.len() - 1, recording, rows));
        }
    }
    let marked = marks::of_recordings(&recordings, &args.marks)?;
    let mut lags_s = vec![0.0; recordings.len()];
    for (place, recording) in recordings.iter_mut().enumerate() {
        if marked.iter().all(|one| one.recording != place) {
            lags_s[place] = alignment::check(recording, args.align, args.explain, messages)?;
        }
    }
    for remark in marks::take(&mut recordings, &marked)? {
        messages.remark(&remark);
    }
    let prior = args.prior.as_deref().map(fleet::read).transpose()?;
    let wished = calibration(args);
    let wished = prior.as_ref().map_or(wished, |prior| wished.prior(prior));
    let start = Instant::now();
    let progress = Progress::new("calibrating", messages);
    let Calibrated { sensor, findings, .. } = calibrate_recordings(&recordings, wished, &progress)?;
    drop(progress);
    let calibration_s = start.elapsed().as_secs_f64();
    for (recording, whole, _) in &mut kept {
        whole.move_reference(lags_s[*recording])?;
    }
    for (_, whole, _) in &mut kept {
        *whole = whole.at_reference_temperature(&sensor).into_owned();
    }
    let rows: Vec<_> = kept.iter().map(|(_, whole, _)| |row| whole.known_row(row)).collect();
    let kept =
        kept.iter().zip(&rows).map(|((_, whole, seen), row)| Kept { len: whole.trace.len(), row, seen: seen.clone() });
    let (sensor, tested) = sensor.tested_on(&kept.collect::<Vec<_>>())?;
    outputs.put(sensor_output, sensor_file::text(&sensor)?);
    let mut outcome = Outcome { sensor, findings, tested, calibration_s, explained: String::new() };
    let file = args.output.display().to_string();
    let closing = outcome.closing(&file);
    if let Some(wanted) = wanted {
        let reporting = Reporting {
            recording: &recordings[0].at_reference_temperature(&outcome.sensor),
            sensor: &outcome.sensor,
            kind: None,
            rest_resistance: None,
            part: Scored::default(),
            sample: Sample::In,
            tested: outcome.tested.as_ref(),
            facts: &closing.facts(),
        };
        wanted.put(reporting.drawn()?, &mut outputs)?;
    }
    if let Some(chosen) = args.estimator.chosen().filter(|chosen| *chosen != EstimatorKind::Corrected)
        && closing.is_better() == Some(false)
    {
        messages.warning(&format!(
            "{file}: {} is no better than a static curve; without --estimator, calibrate tries others and a correction",
            chosen.name()
        ));
    }
    outcome.explained = explain::text(args, &recordings, &outcome.sensor.params().law)?;
    outputs.publish()?;
    Ok(outcome)
}

/// Returns the rows of a recording between --from and --until.
pub fn rows_in(args: &CalibrateArgs, recording: &TraceFile) -> Result<Range<usize>, CliError> {
    let rows = recording.between(args.from, args.until);
    if rows.is_empty() && !recording.trace.is_empty() {
        return Err(recording.no_rows(args.from, args.until).into());
    }
    Ok(rows)
}

/// Returns the calibration that the flags ask for.
pub fn calibration(args: &CalibrateArgs) -> Calibration<'static> {
    let mut calibration = Calibration::new();
    if let Some(kind) = args.estimator.chosen() {
        calibration = calibration.estimator(kind);
    }
    if let Some(family) = args.gauge.chosen() {
        calibration = calibration.gauge(family);
    }
    if let Some(Coefficients(coefficients)) = args.temperature {
        calibration = calibration.temperature(coefficients);
    }
    args.branches.chosen().map_or(calibration, |branches| calibration.branches(branches.0))
}

/// Returns the sensor behind `recordings`.
pub fn calibrate_recordings(
    recordings: &[TraceFile],
    calibration: Calibration,
    progress: &Progress,
) -> Result<Calibrated, CliError> {
    let samples: Vec<Samples> = recordings.iter().map(TraceFile::samples).collect::<Result<_, _>>()?;
    check_alike(recordings)?;
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let as_read = known_recordings(recordings, &samples)?;
    plausible::refuse_or_warn(recordings, &motion_doubts(&as_read), progress.messages())?;
    let screened = screen(&samples).map_err(|error| CliError::calibration(&names, &error))?;
    let samples = screened.samples();
    let known = known_recordings(recordings, &samples)?;
    plausible::refuse_or_warn(recordings, &calibration_doubts(&known), progress.messages())?;
    plausible::warn_of_distrusted(recordings, &screened.distrusted, progress.messages());
    let calibrated =
        calibration.run_with(&known, |stage| progress.calibrating(stage)).map_err(|error| match error {
            Error::Calibration(error) => CliError::calibration(&names, &error),
            other => other.into(),
        })?;
    plausible::refuse_or_warn(recordings, &calibrated.doubts(), progress.messages())?;
    Ok(calibrated)
}
