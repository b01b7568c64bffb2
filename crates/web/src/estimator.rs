//! Estimators by their names.

use ohmstrain::EstimatorKind;

/// Returns an estimator by its name.
pub fn estimator(name: &str) -> Result<EstimatorKind, String> {
    name.parse().map_err(|expected| format!("estimator: {expected}, found `{name}`"))
}
