//! What `calibrate --json` prints.

use ohmstrain::{Closing, Findings, MADE_BY, Tested};
use ohmstrain_calib::{ErrorShares, Limit};
use serde::Serialize;

/// Version of what `--json` prints. Names are added without another version; one that goes or changes its meaning brings
/// the next.
const SCHEMA: u32 = 1;
/// What `--json` prints.
#[derive(Serialize)]
struct Json<'a> {
    schema: u32,
    made_by: &'static str,
    sensor: &'a str,
    estimator: &'static str,
    branches: usize,
    quantity: &'static str,
    calibration_s: f64,
    /// Scores of parts that were left out in turn, what limits them, and what the recordings contain.
    left_out: Option<&'a Findings>,
    /// Scores of the rows that `--from` and `--until` kept from it.
    tested: Option<&'a Tested>,
    limited_by: Option<Limit>,
    /// Of the squared error, 0 to 1.
    error_shares: Option<ErrorShares>,
    verdict: Option<String>,
}

/// As JSON, with an end of line.
pub fn json(closing: &Closing, file: &str) -> serde_json::Result<Vec<u8>> {
    let (params, findings) = (closing.params, closing.findings);
    let json = Json {
        schema: SCHEMA,
        made_by: MADE_BY,
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
    let mut bytes = serde_json::to_vec_pretty(&json)?;
    bytes.push(b'\n');
    Ok(bytes)
}
