//! Output of `calibrate --json`.

use std::io::Write;

use ohmstrain::{Closing, Findings, Tested};
use ohmstrain_sensor::{ErrorShares, Limit};
use serde::Serialize;

use crate::error::CliError;
use crate::output;

/// Version of the output of `--json`.
const SCHEMA: u32 = 1;
/// Content of the output of `--json`.
#[derive(Serialize)]
struct Json<'a> {
    sensor: &'a str,
    estimator: &'static str,
    branches: usize,
    quantity: &'static str,
    calibration_s: Option<f64>,
    /// Scores of parts that were left out in turn, what limits them, and what the recordings contain.
    left_out: Option<&'a Findings>,
    /// Scores of the rows that `--from` and `--until` kept out of the calibration.
    tested: Option<&'a Tested>,
    limited_by: Option<Limit>,
    /// Shares of the squared error, 0 to 1.
    error_shares: Option<ErrorShares>,
    verdict: Option<String>,
}

/// Writes the output of `--json`.
pub fn json(out: &mut dyn Write, closing: &Closing, file: &str) -> Result<(), CliError> {
    let (params, findings) = (closing.params, closing.findings);
    let json = Json {
        sensor: file,
        estimator: params.default_estimator.name(),
        branches: params.law.branches.len(),
        quantity: params.quantity.name(),
        calibration_s: closing.calibration_s,
        left_out: findings,
        limited_by: findings.map(|found| found.budget.limit()),
        error_shares: findings.map(|found| found.budget.shares()),
        tested: closing.tested,
        verdict: closing.verdict(),
    };
    output::json(out, SCHEMA, &json)
}
