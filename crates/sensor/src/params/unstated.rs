use serde::{Deserialize, Serialize};

/// Errors that the estimators do not state: standard deviations of the strain by which intervals are wider than theirs, so that
/// 95 % intervals hold 95 % of the rows that the calibration was not fitted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unstated {
    /// Deviation for filters.
    pub filter_sd: f64,
    /// Deviation for smoothers.
    pub smoother_sd: f64,
}

impl Unstated {
    /// True if estimators state all of their error.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}
