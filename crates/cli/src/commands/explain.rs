use comfy_table::Table;
use ohmstrain::trace::{TraceFile, distrusted_rows};
use ohmstrain_calib::{
    CalibrationError, Samples, StructureScore, bootstrap_law, compare_structures, identifiability, screen,
};
use ohmstrain_sensor::LawParams;

use crate::args::CalibrateArgs;
use crate::error::CliError;
use crate::output;

const NOT_IDENTIFIED: &str =
    "parameters without the ridge: not told; without it the equations of the law are singular on these recordings\n";

/// Returns the text that `calibrate --explain` and `--bootstrap` print.
pub fn text(args: &CalibrateArgs, recordings: &[TraceFile], law: &LawParams) -> Result<String, CliError> {
    let mut text = String::new();
    let samples: Vec<Samples> = recordings.iter().map(TraceFile::samples).collect::<Result<_, _>>()?;
    let names: Vec<&str> = recordings.iter().map(|recording| recording.name.as_str()).collect();
    let failed = |error| CliError::calibration(&names, error);
    let screened = screen(&samples).map_err(failed)?;
    let samples = screened.samples();
    if args.explain {
        for row in distrusted_rows(&screened.distrusted, recordings) {
            text += &(row + "\n");
        }
        let found = match identifiability(&samples, law) {
            Ok(found) => found.to_string(),
            // A law that is determined by its ridge penalty alone is a valid answer.
            Err(CalibrationError::Singular) => NOT_IDENTIFIED.to_owned(),
            Err(error) => return Err(failed(error)),
        };
        let structures = structures(&compare_structures(&samples).map_err(failed)?);
        text += &format!("{}\n{structures}\n", output::wrapped(&found));
    }
    if let Some(replicates) = args.bootstrap {
        let found = bootstrap_law(&samples, law, replicates as usize, args.seed).map_err(failed)?;
        let mut table = output::wrapped_table(["parameter", "without ridge", "2.5 %", "97.5 %"]);
        for (i, name) in found.names.iter().enumerate() {
            let cells = [found.values[i], found.lower[i], found.upper[i]].map(|x| format!("{x:.4e}"));
            table.add_row([name.clone()].into_iter().chain(cells));
        }
        text += &format!("{table}\n");
    }
    Ok(text)
}

/// Returns a table with one row per structure; criteria are differences from the best.
fn structures(scores: &[StructureScore]) -> Table {
    let least = |of: fn(&StructureScore) -> f64| scores.iter().map(of).fold(f64::INFINITY, f64::min);
    let (aic, bic) = (least(|score| score.aic), least(|score| score.bic));
    let mut table =
        output::wrapped_table(["gauge", "branches", "parameters", "error, % of R0", "left out, %", "AIC", "BIC"]);
    for score in scores {
        table.add_row([
            score.options.gauge.name().to_string(),
            score.options.branches.to_string(),
            score.parameters.to_string(),
            format!("{:.3}", 100.0 * score.error),
            format!("{:.3}", 100.0 * score.cross_validated_error),
            format!("{:+.1}", score.aic - aic),
            format!("{:+.1}", score.bic - bic),
        ]);
    }
    table
}
