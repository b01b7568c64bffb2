//! `refine`: noise and motion parameters of the extended Kalman filter from readings alone.

mod rows;
mod table;

use ohmstrain::trace::{TraceFile, reading_column};
use ohmstrain_calib::CalibrationError;
use ohmstrain_calib::likelihood::{LikelihoodProblem, NoiseParameter, NoiseStart, ProfileInterval, ReadingSeries};
use ohmstrain_sensor::{EstimatorKind, LawParams, SensorError, SensorParams};

use crate::args::RefineArgs;
use crate::error::CliError;
use crate::input;
use crate::messages::Messages;
use crate::output::{Kind, Outputs, print};
use crate::progress::Progress;
use crate::run::rest_resistance;
use crate::sensor_file;
use crate::suits;
use rows::RelativeRows;
use table::Refinement;

/// Warning for every user.
const TRUST: &str = "the likelihood of readings trusts the law: where the law is wrong, intervals of strain are too \
                     narrow; where a reference exists, use calibrate";

/// Refines a sensor's noise on a recording and writes its parameters.
pub fn run(args: &RefineArgs, messages: &Messages) -> Result<(), CliError> {
    if let Some(other) = args.estimator.chosen().filter(|kind| *kind != EstimatorKind::Ekf) {
        let name = other.name();
        return Err(CliError::Arguments(format!("--estimator: expected ekf, the only one to refine, found {name}")));
    }
    let mut outputs = Outputs::new(args.replace.force, [&args.trace_file, &args.sensor]);
    let output = outputs.claim(&args.output, Kind::Sensor)?;
    let sensor = sensor_file::read(&args.sensor, Some(EstimatorKind::Ekf))?;
    let recording = input::read(&args.trace_file, &args.units.metadata())?;
    recording.check_unit(sensor.params().reading)?;
    let recording = recording.at_reference_temperature(&sensor);
    let readings = || recording.trace.readings.values.iter().copied();
    let rest = rest_resistance(args.rest_resistance, &sensor, readings(), &recording.name)?;
    suits::check_readings(&recording.header, &sensor, rest, readings())?;
    let rows = RelativeRows::new(&recording, args.from, args.until, sensor.rest_reading(rest))?;
    let mut params = sensor.into_params();
    let (start, free) = start(args, &params, &rows.time_s)?;
    let refinement = refine(&params.law, start, free, &rows, messages).map_err(|error| named(args, error))?;
    remark_on_input(&recording, &rows, &params, messages);
    replace(&mut params, &refinement);
    outputs.put(output, sensor_file::text(&sensor_file::checked(params)?)?);
    outputs.publish()?;
    print(|out| table::write(out, &refinement))?;
    for warning in &refinement.found.warnings {
        messages.warning(&format!("{}: {warning}", recording.name));
    }
    messages.warning(TRUST);
    Ok(())
}

/// Adds the file that an error is about: the law and the start of the search come from the sensor's file.
fn named(args: &RefineArgs, error: CalibrationError) -> CliError {
    let of_sensor = matches!(
        error,
        CalibrationError::Unsupported(_) | CalibrationError::Sensor(_) | CalibrationError::Parameter(_)
    );
    let culprit = if of_sensor { &args.sensor } else { &args.trace_file };
    CliError::calibration(&[&culprit.display().to_string()], error)
}

/// Maximises the likelihood and looks at its shape around the maximum.
fn refine(
    law: &LawParams,
    start: NoiseStart,
    free: Vec<NoiseParameter>,
    rows: &RelativeRows,
    messages: &Messages,
) -> Result<Refinement, CalibrationError> {
    let recordings = [ReadingSeries { time_s: &rows.time_s, value: &rows.value, extra_sd: &rows.extra_sd }];
    let problem = LikelihoodProblem { recordings: &recordings, law, start: &start, free: &free };
    let progress = Progress::new("maximising the likelihood", messages);
    let before = problem.log_likelihood()?;
    let found = problem.fit()?;
    progress.doing("profile intervals");
    let profiles: Vec<ProfileInterval> =
        (0..free.len()).map(|index| problem.profile_interval(&found.fit, index)).collect::<Result<_, _>>()?;
    Ok(Refinement { start, free, before, found, profiles })
}

/// Returns the start of the search, and the parameters that it moves.
fn start(
    args: &RefineArgs,
    params: &SensorParams,
    time_s: &[f64],
) -> Result<(NoiseStart, Vec<NoiseParameter>), CliError> {
    let ekf = params.estimator(EstimatorKind::Ekf).map_err(|error| named(args, SensorError::from(error).into()))?;
    let start = NoiseStart::new(ekf, time_s);
    let movable = movable(&params.law, &start);
    let wanted: Vec<NoiseParameter> = args.parameters.iter().map(|moved| moved.0).collect();
    if let Some(parameter) = wanted.iter().find(|parameter| !movable.contains(parameter)) {
        let (name, file) = (parameter.name(), args.sensor.display());
        return Err(CliError::Arguments(format!(
            "--parameters: {name} is without effect in {file} and cannot be moved"
        )));
    }
    let is_wanted = |parameter: &NoiseParameter| wanted.is_empty() || wanted.contains(parameter);
    Ok((start, movable.into_iter().filter(is_wanted).collect()))
}

/// Returns the parameters that can move. A parameter that is zero in the sensor file was left out by its author, and the wander
/// of absent branches has no effect.
fn movable(law: &LawParams, start: &NoiseStart) -> Vec<NoiseParameter> {
    let value = |parameter: NoiseParameter| parameter.get(&start.noise, &start.motion);
    let is_movable = |parameter: &NoiseParameter| match parameter {
        NoiseParameter::BranchSd => !law.branches.is_empty() && value(NoiseParameter::BranchSd) > 0.0,
        NoiseParameter::BaselineTime => value(NoiseParameter::BaselineSd) > 0.0,
        other => value(*other) > 0.0,
    };
    NoiseParameter::ALL.into_iter().filter(is_movable).collect()
}

/// Reports the parts of the recording that were not used.
fn remark_on_input(recording: &TraceFile, rows: &RelativeRows, params: &SensorParams, messages: &Messages) {
    if let Some(quantity) = recording.quantity() {
        let (header, name) = (&recording.header, quantity.name());
        messages.remark(&format!("{header}: the reference in `{name}` is not used; calibrate would use it"));
    }
    if rows.stride > 1 {
        let (name, all, used) = (&recording.name, rows.all, rows.time_s.len());
        let column = reading_column(params.reading);
        messages.remark(&format!("{name}: column `{column}`: {used} of {all} rows are used, one in {}", rows.stride));
    }
}

/// Replaces the extended Kalman filter's noise and motion by the result.
fn replace(params: &mut SensorParams, refinement: &Refinement) {
    if let Some(ekf) = params.estimators.get_mut(&EstimatorKind::Ekf) {
        (ekf.noise, ekf.motion) = (refinement.found.noise, refinement.found.motion);
    }
    params.default_estimator = EstimatorKind::Ekf;
}
