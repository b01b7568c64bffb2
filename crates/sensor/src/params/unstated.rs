use serde::{Deserialize, Serialize};

/// Errors beyond those that the estimators state: standard deviations of the strain that widen their intervals, so that 95 %
/// intervals cover 95 % of the rows to which the calibration was not fitted; errors of few strokes count for more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unstated {
    /// Standard deviation for filters.
    pub filter_sd: f64,
    /// Standard deviation for smoothers.
    pub smoother_sd: f64,
}

impl Unstated {
    /// True if estimators state all of their error.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}
