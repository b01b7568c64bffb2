//! Plan of an exported filter: the sensor's whole filter, or a part of it for a small chip.

use ohmstrain_sensor::{EstimatorKind, HYPOTHESES, PortableFilter, SensorParams};

use super::quadratic::OwnedQuadratic;
use super::reduced::{RowBudget, reduced};
use super::{ExportError, FILTERS, parameter};

/// Parts of a filter that are exported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The estimator; the sensor's default if `None`.
    pub kind: Option<EstimatorKind>,
    /// Number of hypotheses to keep; as many as on a computer if `None`.
    pub hypotheses: Option<usize>,
    /// Part of the correction to keep; all of it if `None`.
    pub rows: Option<RowBudget>,
}

/// A filter in the form that is put onto a chip.
pub struct ChipFilter {
    /// The filter, with the remaining hypotheses and rows.
    pub filter: PortableFilter,
    /// Stand-in for the other rows, of the direct and of the residual process.
    pub quadratics: Option<[OwnedQuadratic; 2]>,
}

impl ChipFilter {
    /// Creates the filter of a sensor, restricted to the plan.
    ///
    /// # Errors
    /// If the sensor has no parameters for it, it has no exported form, or its correction cannot be reduced.
    pub fn new(params: &SensorParams, plan: &Plan) -> Result<Self, ExportError> {
        let mut filter = PortableFilter::new(params, plan.kind).map_err(parameter)?;
        if !FILTERS.contains(&filter.kind) {
            let what = format!("the estimator {} has no exported form", filter.kind.name());
            return Err(ExportError::Unsupported { what, instead: "export another one with --estimator ekf" });
        }
        if filter.kind != EstimatorKind::Ekf {
            filter.hypotheses = plan.hypotheses.map_or(filter.hypotheses, |most| most.min(filter.hypotheses));
        }
        let mut quadratics = None;
        if let (Some(rows), Some(correction)) = (plan.rows, &mut filter.correction) {
            let singular = || parameter("`correction`: its rows cannot be projected onto fewer");
            let (fewer, both) = reduced(&correction.learned, rows).ok_or_else(singular)?;
            (correction.learned, quadratics) = (fewer, Some(both));
        }
        Ok(Self { filter, quadratics })
    }

    /// True if it is reduced against the filter on a computer.
    pub fn is_smaller(&self) -> bool {
        let has_fewer = self.filter.kind != EstimatorKind::Ekf && self.filter.hypotheses < HYPOTHESES;
        has_fewer || self.quadratics.is_some()
    }

    /// Describes the plan.
    pub fn words(&self) -> String {
        let name = self.filter.kind.name();
        if self.filter.curve.is_some() {
            return format!("static cubic, beside {name}");
        }
        let filter = match self.filter.hypotheses {
            _ if self.filter.kind == EstimatorKind::Ekf => name.to_owned(),
            1 => format!("{name}, one hypothesis"),
            several => format!("{name}, {several} hypotheses"),
        };
        match (&self.filter.correction, &self.quadratics) {
            (None, _) => format!("{filter}, no correction"),
            (Some(all), None) => format!("{filter}, correction of {} rows", all.learned.rows.len()),
            (Some(few), Some(_)) => {
                format!("{filter}, correction of {} rows and a quadratic function", few.learned.rows.len())
            }
        }
    }
}
