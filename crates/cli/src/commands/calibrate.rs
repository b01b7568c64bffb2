use std::ops::Range;
use std::time::Instant;

use ohmstrain::trace::{self, TraceFile};
use ohmstrain::{Calibrated, Calibration, Closing, Findings, Sensor, Tested};

use super::closing;
use super::explain;
use super::fleet;
use super::reporting::{Wanted, drawn};
use crate::alignment;
use crate::args::{CalibrateArgs, Coefficients};
use crate::error::CliError;
use crate::input;
use crate::marks;
use crate::messages::Messages;
use crate::output::{Kind, Outputs, named, print};
use crate::progress::Progress;
use crate::sensor_file;
use ohmstrain_report::{Reporting, Sample, Scored};

/// Calibrates a sensor on recordings, writes its parameters, and prints a summary.
pub fn run(args: &CalibrateArgs, messages: &Messages) -> Result<(), CliError> {
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
    let mut marked = marks::of_recordings(&mut recordings, &args.marks, overrides.strain_unit)?;
    if !args.marks.is_empty() {
        // Marks stand in place of a reference: nothing is known of the other rows.
        for (place, whole, _) in kept.drain(..) {
            marks::within(&mut marked[place], &recordings[place], &whole, messages);
        }
    }
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
    let kept = kept.into_iter().map(|(place, whole, seen)| (whole, seen, lags_s[place]));
    let (sensor, tested) = trace::tested_on(sensor, kept)?;
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
        wanted.put(drawn(&reporting)?, &mut outputs)?;
    }
    if let Some(warning) = closing.warning(args.estimator.chosen()) {
        messages.warning(&warning);
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
    let warn = |warning: String| progress.messages().warning(&warning);
    Ok(trace::calibrate(recordings, calibration, warn, |stage| progress.calibrating(stage))?)
}
