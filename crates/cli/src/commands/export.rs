use std::path::Path;

use ohmstrain_bench_data::Metadata;
use ohmstrain_sensor::EstimatorKind;

use crate::args::ExportArgs;
use crate::commands::export_choice::{self, Choice};
use crate::commands::export_score::{OnRecording, print_promise};
use crate::error::CliError;
use crate::input;
use crate::output::{Kind, Outputs};
use crate::sensor_file;
use ohmstrain_export::{self as export, Compared, ExportError, Promise, SourceFile};

/// Writes a sensor's filter as source code.
pub fn run(args: &ExportArgs) -> Result<(), CliError> {
    let asked = args.estimator.chosen();
    if let Some(other) = asked.filter(|kind| !export::FILTERS.contains(kind)) {
        let message = "--estimator: expected corrected, sign-split, hypotheses, ekf or static-cubic, found";
        return Err(CliError::Arguments(format!("{message} {}", other.name())));
    }
    let sensor = sensor_file::read(&args.sensor, asked)?;
    let params = sensor.params();
    let dt_s = export_choice::usual_step_s(args.dt_s, params)?;
    let recording = match &args.score {
        Some(_) if params.joint.is_some() => {
            return Err(CliError::Arguments("--score: expected a sensor of strain, found one across a joint".into()));
        }
        Some(trace) => Some(OnRecording::new(args, dt_s, &sensor, &input::read(trace, &Metadata::default())?)?),
        None => None,
    };
    let Choice { plan, lines } = export_choice::choose(args, params, dt_s, recording.as_ref())?;
    let refused = |error: ExportError| CliError::export(&error, &args.sensor.display().to_string());
    let compared = recording.as_ref().map(|recording| recording.compared(params, &plan, args)).transpose()?;
    let promise = Promise::new(params, &plan, dt_s, compared.as_ref(), args.budget.as_ref()).map_err(refused)?;
    // The static cubic is what a worse one is compared with.
    let is_filter = plan.kind.unwrap_or(params.default_estimator) != EstimatorKind::StaticCubic;
    let worse = |compared: &&Compared| is_filter && compared.exported.rmse > compared.static_cubic.rmse;
    let worse_on = compared.as_ref().filter(worse).and(recording.as_ref()).map(|recording| recording.name.as_str());
    let files =
        export::files(params, &plan, args.target.into(), dt_s, &args.prefix, &promise.lines).map_err(refused)?;
    let mut outputs = Outputs::new(args.force, std::iter::once(&args.sensor).chain(&args.score));
    put(&mut outputs, &args.output, files)?;
    // Printed after the outputs are claimed and before anything is written to them: it may refuse.
    match print_promise(args, &lines, &promise, worse_on) {
        // The files are written even if nobody reads what is printed.
        Ok(()) | Err(CliError::ClosedPipe) => outputs.publish(),
        refused => refused,
    }
}

/// Puts files of source code below a folder.
pub fn put(outputs: &mut Outputs, folder: &Path, files: Vec<SourceFile>) -> Result<(), CliError> {
    for file in files {
        let path = folder.join(&file.path);
        if let Some(folder) = path.parent() {
            outputs.folder(folder)?;
        }
        let output = outputs.claim(&path, Kind::Source)?;
        outputs.put(output, file.content);
    }
    Ok(())
}
