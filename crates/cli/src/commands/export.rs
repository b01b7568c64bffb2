use ohmstrain_calib::EstimatorKind;

use crate::args::ExportArgs;
use crate::error::CliError;
use crate::export;
use crate::output::{Kind, Outputs};
use crate::sensor_file;

/// Writes a sensor's filter as source code.
pub fn run(args: &ExportArgs) -> Result<(), CliError> {
    if let Some(other) = args.estimator.chosen().map(|estimator| estimator.0).filter(|kind| *kind != EstimatorKind::Ekf)
    {
        let name = other.name();
        return Err(CliError::Arguments(format!("--estimator: expected ekf, the only one to export, found {name}")));
    }
    let params = sensor_file::read(&args.sensor, Some(EstimatorKind::Ekf))?.into_params();
    let files = export::files(&params, args.target, args.dt_s)
        .map_err(|error| error.into_cli(&args.sensor.display().to_string()))?;
    if params.default_estimator != EstimatorKind::Ekf && args.estimator.chosen().is_none() {
        let name = params.default_estimator.name();
        CliError::remark(&format!("exported is the ekf: the file's default estimator, {name}, has no such form"));
    }
    let mut outputs = Outputs::new(args.force, [&args.sensor]);
    for file in files {
        let path = args.output.join(file.path);
        if let Some(folder) = path.parent() {
            outputs.folder(folder)?;
        }
        let output = outputs.claim(&path, Kind::Source)?;
        outputs.put(output, file.content);
    }
    outputs.publish()
}
