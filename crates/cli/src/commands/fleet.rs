use std::path::{Path, PathBuf};

use ohmstrain::{Prior, Sensor};
use ohmstrain_bench_data::counted;

use crate::args::{FleetArgs, FleetCommand};
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::{Kind, Outputs, print};
use crate::sensor_file;
use crate::whole_file;

/// Learns a prior from sensors of one make.
pub fn run(args: &FleetArgs, messages: &Messages) -> Result<(), CliError> {
    let FleetCommand::Fit(args) = &args.command;
    let mut outputs = Outputs::new(args.replace.force, &args.sensors);
    let output = outputs.claim(&args.output, Kind::Prior)?;
    let sensors = args.sensors.iter().map(|path| sensor_file::read(path, None));
    let sensors: Vec<Sensor> = sensors.collect::<Result<_, _>>()?;
    refuse_other_quantities(&args.sensors, &sensors)?;
    let prior = Prior::learn(&sensors)?;
    outputs.put(output, prior.to_toml()?.into_bytes());
    outputs.publish()?;
    if !messages.is_quiet() {
        print(|out| Ok(writeln!(out, "{}", summary(&prior, &args.output))?))?;
    }
    Ok(())
}

fn refuse_other_quantities(files: &[PathBuf], sensors: &[Sensor]) -> Result<(), CliError> {
    let mut of_files = files.iter().zip(sensors.iter().map(|sensor| sensor.params().quantity));
    let Some((first, expected)) = of_files.next() else { return Ok(()) };
    match of_files.find(|(_, found)| *found != expected) {
        None => Ok(()),
        Some((file, found)) => Err(CliError::Input(format!(
            "{}: expected a sensor of `{}`, as {} is one, found one of `{}`",
            file.display(),
            expected.name(),
            first.display(),
            found.name()
        ))),
    }
}

/// Summarises the prior in a few words.
fn summary(prior: &Prior, output: &Path) -> String {
    let params = prior.params();
    let branches = params.law.tau_s.iter().map(|tau_s| format!("{tau_s:.1}")).collect::<Vec<_>>().join(", ");
    let correction = params.correction.as_ref().map_or_else(
        || "no correction".to_owned(),
        |correction| {
            format!("{} for the correction of {}", counted(correction.rows.len(), "row"), correction.corrects.name())
        },
    );
    format!(
        "{}: {} sensors; branches of {branches} s; {}; {correction}",
        output.display(),
        params.sensors,
        counted(params.estimators.len(), "estimator")
    )
}

/// Reads the prior of a fleet.
pub fn read(path: &Path) -> Result<Prior, CliError> {
    let text = whole_file::text(path)?;
    Prior::from_toml(&text).map_err(|error| CliError::Input(error.in_file(&path.display().to_string())))
}
