use serde::{Deserialize, Serialize};

use crate::error_budget::Limit;
use crate::findings::Findings;

/// What a calibration is worth in a few numbers, kept with the sensor: see [`Findings`]. Nothing computes with them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// Root mean squared error of the default estimator's filter on quarters that it was not fitted to, percent of full
    /// scale.
    pub left_out_percent_fs: f64,
    /// Its smoother's; `None` if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smoothed_percent_fs: Option<f64>,
    /// The static cubic's on the same quarters.
    pub static_cubic_percent_fs: f64,
    /// Share of their rows that the filter's 95 % interval holds, percent.
    pub coverage_95_percent: f64,
    /// Mean width of that interval, percent of full scale.
    pub width_95_percent_fs: f64,
    /// What makes most of the error.
    pub limited_by: Limit,
}

impl From<&Findings> for Summary {
    fn from(found: &Findings) -> Self {
        Self {
            left_out_percent_fs: found.filter.rmse_percent_fs,
            smoothed_percent_fs: found.smoother.map(|scores| scores.rmse_percent_fs),
            static_cubic_percent_fs: found.static_cubic.rmse_percent_fs,
            coverage_95_percent: 100.0 * found.filter.coverage_95.unwrap_or(0.0),
            width_95_percent_fs: found.filter.width_95_percent_fs.unwrap_or(0.0),
            limited_by: found.budget.limit(),
        }
    }
}
