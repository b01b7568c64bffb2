//! Which of the filters that a chip has room for is exported.

use ohmstrain_sensor::SensorParams;

use crate::args::ExportArgs;
use crate::commands::export_score::OnRecording;
use crate::error::CliError;
use ohmstrain_export::{self as export, Budget, Plan};

/// The sensor's filter, or what is best of it within a budget: by its score on a recording, else by a table.
pub fn plan(args: &ExportArgs, params: &SensorParams, recording: Option<&OnRecording>) -> Result<Plan, CliError> {
    let asked = args.estimator.chosen().map(|estimator| estimator.0);
    let Some(budget) = &args.budget else { return Ok(Plan { kind: asked, ..Plan::default() }) };
    within(args, params, budget, recording)
}

fn within(
    args: &ExportArgs,
    params: &SensorParams,
    budget: &Budget,
    recording: Option<&OnRecording>,
) -> Result<Plan, CliError> {
    let name = args.sensor.display().to_string();
    let fitting = export::fitting(params, budget, args.dt_s).map_err(|error| CliError::export(&error, &name))?;
    let mut best: Option<(f64, Plan)> = None;
    for plan in &fitting {
        // Without a recording all are alike, and the first is the best by the table.
        let error = recording.map_or(Ok(0.0), |recording| recording.error(params, plan, args))?;
        if best.is_none_or(|(least, _)| error < least) {
            best = Some((error, *plan));
        }
    }
    best.map(|(_, plan)| plan).ok_or_else(|| CliError::Arguments("--budget: nothing fits".into()))
}
