use ohmstrain::SensorParams;
use ohmstrain_export::{Budget, ExportError, ExportTarget, Firmware, Prefix, usual_step_s};
use pyo3::PyResult;

use crate::error::{Place, raise};

/// Paths and contents of an export's files; the table of its promise and cost; the description of the filter.
pub type Exported = (Vec<(String, String)>, Vec<String>, String);

/// Exports as `ohmstrain export` does.
pub fn exported(
    params: &SensorParams,
    target: &str,
    dt_s: Option<f64>,
    budget: Option<&str>,
    prefix: &str,
) -> PyResult<Exported> {
    let wrong = |argument: &str, message: &str| raise(&Place::default(), &format!("{argument}: {message}"));
    let target: ExportTarget = target.parse().map_err(|error: String| wrong("target", &error))?;
    let budget: Option<Budget> = budget.map(str::parse).transpose().map_err(|error: String| wrong("budget", &error))?;
    let prefix: Prefix = prefix.parse().map_err(|error: String| wrong("prefix", &error))?;
    let dt_s = dt_s.or_else(|| usual_step_s(params)).ok_or_else(|| {
        wrong("dt_s", "expected the usual time between two readings, s; the sensor knows no recording")
    })?;
    let Firmware { files, promise } =
        Firmware::new(params, target, dt_s, budget.as_ref(), &prefix).map_err(|error| match error {
            ExportError::Interval(_) => wrong("dt_s", &error.to_string()),
            ExportError::Budget { .. } => wrong("budget", &error.to_string()),
            _ => raise(&Place::default(), &error.to_string()),
        })?;
    let files = files.into_iter().map(|file| (file.path, file.content)).collect();
    Ok((files, promise.lines, promise.words))
}
