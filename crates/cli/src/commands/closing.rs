//! What `calibrate --json` prints.

use ohmstrain::verdict::verdict;
use ohmstrain::{Closing, Findings, MADE_BY};
use ohmstrain_calib::Limit;
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
    limited_by: Option<&'static str>,
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
        limited_by: findings.map(|found| limit_name(found.budget.limit())),
        verdict: findings.map(|found| verdict(&found.filter, Some(&found.static_cubic))),
    };
    let mut bytes = serde_json::to_vec_pretty(&json)?;
    bytes.push(b'\n');
    Ok(bytes)
}

const fn limit_name(limit: Limit) -> &'static str {
    match limit {
        Limit::Law => "law",
        Limit::Direction => "direction",
        Limit::Drift => "drift",
        Limit::Noise => "noise",
    }
}
