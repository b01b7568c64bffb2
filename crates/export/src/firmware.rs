//! A sensor's filter as source code, chosen and described; used by the page and by notebooks.

use ohmstrain_sensor::SensorParams;

use crate::{Budget, ExportError, ExportTarget, Plan, Prefix, Promise, SourceFile, files, first_fitting};

/// Source code of a filter, and what it promises.
#[derive(Clone, Debug)]
pub struct Firmware {
    /// Its files.
    pub files: Vec<SourceFile>,
    /// Errors and costs.
    pub promise: Promise,
}

impl Firmware {
    /// Exports the filter of a sensor with readings every `dt_s` seconds: the whole filter, or the choice of [`first_fitting`].
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn new(
        params: &SensorParams,
        target: ExportTarget,
        dt_s: f64,
        budget: Option<&Budget>,
        prefix: &Prefix,
    ) -> Result<Self, ExportError> {
        if !(dt_s.is_finite() && dt_s > 0.0) {
            return Err(ExportError::Interval(format!("expected a positive number, found {dt_s}")));
        }
        let plan = match budget {
            None => Plan::default(),
            Some(budget) => first_fitting(params, budget, dt_s)?,
        };
        let promise = Promise::new(params, &plan, dt_s, None, budget)?;
        let files = files(params, &plan, target, dt_s, prefix, &promise.lines)?;
        Ok(Self { files, promise })
    }
}
