use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::args::BatchCommand;

/// What `evaluate` found of the first estimator, or `calibrate` on the parts that it left out: errors in %FS, coverage as
/// a share.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Figures {
    /// Rows that were scored.
    pub rows: Option<u64>,
    /// Of the filter.
    pub filter_percent_fs: Option<f64>,
    /// Of the smoother.
    pub smoother_percent_fs: Option<f64>,
    /// Of strain as a cubic polynomial of the reading.
    pub static_cubic_percent_fs: Option<f64>,
    /// Of the filter's 95 % interval.
    pub coverage_95: Option<f64>,
    /// Its mean width.
    pub width_95_percent_fs: Option<f64>,
}

impl Figures {
    /// What a command's JSON says; nothing where it does not.
    pub fn of_json(text: &[u8], command: BatchCommand) -> Self {
        let json: Value = serde_json::from_slice(text).unwrap_or_default();
        let (filter, rest, cubic) = if command == BatchCommand::Evaluate {
            let first = &json["recordings"][0];
            (first, first, &first["baselines"]["static_cubic"])
        } else {
            let left_out = &json["left_out"];
            (&left_out["filter"], left_out, &left_out["static_cubic"])
        };
        Self {
            rows: filter["n"].as_u64(),
            filter_percent_fs: filter["rmse_percent_fs"].as_f64(),
            smoother_percent_fs: rest["smoother"]["rmse_percent_fs"].as_f64(),
            static_cubic_percent_fs: cubic["rmse_percent_fs"].as_f64(),
            coverage_95: filter["coverage_95"].as_f64(),
            width_95_percent_fs: filter["width_95_percent_fs"].as_f64(),
        }
    }
}
