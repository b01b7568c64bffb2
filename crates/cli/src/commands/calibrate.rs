use std::io;
use std::path::Path;
use std::time::Instant;

use ohmstrain::Sensor;
use ohmstrain_calib::{
    EstimatorKind, Findings, LawOptions, Quantity, RECIPE, ReadingUnit, RecordingInfo, Samples, SensorParams,
    calibrate, screen,
};

use super::closing::Closing;
use super::explain;
use super::reporting::{Reporting, Wanted};
use super::scoring::Part;
use crate::alignment;
use crate::args::CalibrateArgs;
use crate::error::CliError;
use crate::input::{self, Recording, unit};
use crate::output::{Kind, Outputs, print};
use crate::plausible;
use crate::progress::Progress;
use crate::report::Sample;
use crate::sensor_file::{self, MADE_BY};
use crate::verbosity::Verbosity;

/// Calibrates a sensor on recordings and writes its parameters.
pub fn run(args: &CalibrateArgs) -> Result<(), CliError> {
    let mut outputs = Outputs::new(args.force, &args.traces);
    let sensor_output = outputs.claim(&args.output, Kind::Sensor)?;
    let wanted = Wanted::claim(&args.report, &mut outputs)?;
    let overrides = args.trace.metadata();
    let mut recordings = Vec::new();
    for path in &args.traces {
        let recording = input::read(path, &overrides)?;
        let row_at = |time_s: f64| recording.trace.time_s.partition_point(|earlier_s| *earlier_s < time_s);
        let end = args.until.map_or(recording.trace.len(), row_at);
        let rows = args.from.map_or(0, row_at).min(end)..end;
        if rows.is_empty() && !recording.trace.is_empty() {
            return Err(recording.no_rows(args.from, args.until));
        }
        recordings.push(recording.rows(rows));
    }
    for recording in &mut recordings {
        alignment::check(recording, args.align)?;
    }
    let estimator = args.estimator.chosen().map_or(RECIPE.estimator, |estimator| estimator.0);
    let structures = structures(args, estimator);
    let start = Instant::now();
    let progress = Progress::new("calibrating");
    let Calibrated { sensor, findings } = calibrate_recordings(&recordings, &structures, estimator, &progress)?;
    drop(progress);
    let calibration_s = start.elapsed().as_secs_f64();
    let params = sensor.params();
    outputs.put(sensor_output, sensor_file::text(&sensor)?);
    let file = args.output.display().to_string();
    let closing = Closing { file: &file, params, findings: findings.as_ref(), calibration_s };
    if let Some(wanted) = wanted {
        let (facts, rest_resistance) = (closing.facts(), None);
        let (recording, part, sample) = (&recordings[0], Part::default(), Sample::In);
        let reporting =
            Reporting { recording, sensor: &sensor, kind: None, rest_resistance, part, sample, facts: &facts };
        wanted.put(reporting.drawn()?, &mut outputs)?;
    }
    let explained = explain::text(args, &recordings, &params.law)?;
    outputs.publish()?;
    let said = if Verbosity::chosen() == Verbosity::Quiet && !args.json {
        vec![]
    } else if args.json {
        closing.json().map_err(io::Error::from)?
    } else {
        closing.text().into_bytes()
    };
    print(|out| {
        out.write_all(explained.as_bytes())?;
        Ok(out.write_all(&said)?)
    })
}

/// What comes of a calibration.
pub struct Calibrated {
    /// The sensor.
    pub sensor: Sensor,
    /// What it is worth; `None` if that could not be told.
    pub findings: Option<Findings>,
}

/// What the flags leave to choose from.
fn structures(args: &CalibrateArgs, estimator: EstimatorKind) -> Vec<LawOptions> {
    let mut structures = LawOptions::candidates(estimator).to_vec();
    for structure in &mut structures {
        if let Some(gauge) = args.gauge.chosen() {
            structure.gauge = gauge.into();
        }
    }
    match args.branches.chosen() {
        Some(branches) => vec![LawOptions { branches: branches.0, ..structures[0] }],
        None => structures,
    }
}

/// The parameters of the sensor behind `recordings`, with `estimator` as the default.
pub fn calibrate_recordings(
    recordings: &[Recording],
    structures: &[LawOptions],
    estimator: EstimatorKind,
    progress: &Progress,
) -> Result<Calibrated, CliError> {
    let samples: Vec<Samples> = recordings.iter().map(Recording::samples).collect::<Result<_, _>>()?;
    let (quantity, reading) = common_units(recordings)?;
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let screened = screen(&samples).map_err(|error| CliError::calibration(&names, &error))?;
    plausible::warn_of_copies(recordings);
    plausible::check(recordings, &screened)?;
    plausible::warn_of_distrusted(recordings, &screened.distrusted);
    let mut calibration = calibrate(&screened.samples(), structures, &[estimator], |stage| progress.calibrating(stage))
        .map_err(|error| CliError::calibration(&names, &error))?;
    let info = |(recording, rest_reading): (&Recording, &f64)| RecordingInfo {
        file: file_name(&recording.name),
        sha256: recording.sha256.clone(),
        rows: recording.trace.len(),
        rest_reading: *rest_reading,
    };
    let infos = recordings.iter().zip(&calibration.rest_readings).map(info).collect();
    let findings = calibration.findings.take();
    let sensor = calibration.into_sensor(MADE_BY, quantity, reading);
    let sensor = SensorParams { joint: recordings.iter().find_map(Recording::joint), recordings: infos, ..sensor };
    plausible::warn_of_rests(recordings, &sensor);
    plausible::warn_of_intervals(&sensor);
    Ok(Calibrated { sensor: sensor_file::checked(sensor)?, findings })
}

/// Paths are the machine's own business; the name says which recording it was.
fn file_name(path: &str) -> String {
    Path::new(path).file_name().map_or_else(|| path.to_string(), |name| name.to_string_lossy().into_owned())
}

/// Quantity and unit that all recordings share.
fn common_units(recordings: &[Recording]) -> Result<(Quantity, ReadingUnit), CliError> {
    let first = &recordings[0];
    let (quantity, reading) = (first.quantity().unwrap_or(Quantity::Strain), unit(first.trace.readings.kind));
    for recording in recordings {
        input::check_unit(&recording.header, recording.trace.readings.kind, reading)?;
        recording.check_quantity(quantity)?;
    }
    Ok((quantity, reading))
}
