use serde::{Deserialize, Serialize};

/// Main scores of a calibration, stored with the sensor: see [`Findings`](crate::Findings). No computation uses them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// Root mean squared error of the default estimator's filter on held-out quarters, percent of full scale.
    pub left_out_percent_fs: f64,
    /// Root mean squared error of its smoother; `None` if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smoothed_percent_fs: Option<f64>,
    /// Root mean squared error of the static cubic on the same quarters.
    pub static_cubic_percent_fs: f64,
    /// Coverage of the filter's 95 % interval in those quarters, percent.
    pub coverage_95_percent: f64,
    /// Mean width of that interval, percent of full scale.
    pub width_95_percent_fs: f64,
    /// Largest contribution to the error.
    pub limited_by: Limit,
}

/// Scores of a sensor on rows that its calibration did not use, percent. No computation uses them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestedSummary {
    /// Root mean squared error of the default estimator's filter, percent of full scale.
    pub filter_percent_fs: f64,
    /// Root mean squared error of the static cubic, percent of full scale.
    pub static_cubic_percent_fs: f64,
    /// Coverage of the filter's 95 % interval, percent.
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
    /// Returns its one-word name.
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
