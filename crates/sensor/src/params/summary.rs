use serde::{Deserialize, Serialize};

/// Scores of a calibration in a few numbers, kept with the sensor: see [`Findings`](crate::Findings). Nothing computes with them.
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
    /// Largest contribution to the error.
    pub limited_by: Limit,
}

/// Scores of a sensor on rows that its calibration never saw, percent. Nothing computes with them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestedSummary {
    /// Root mean squared error of the default estimator's filter, percent of full scale.
    pub filter_percent_fs: f64,
    /// The static cubic's.
    pub static_cubic_percent_fs: f64,
    /// Share of the rows that the filter's 95 % interval holds.
    pub coverage_95_percent: f64,
}

/// Contribution that limits a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// The form of the law.
    Law,
    /// Wrong direction of the body's motion.
    Direction,
    /// Slow changes that strain does not explain.
    Drift,
    /// Noise of the readings.
    Noise,
}

impl Limit {
    /// Returns its name, in a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Law => "law",
            Self::Direction => "direction",
            Self::Drift => "drift",
            Self::Noise => "noise",
        }
    }
}
