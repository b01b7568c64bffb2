use std::sync::{Arc, OnceLock};

use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale};

use crate::CalibrationError;
use crate::correction::owned::OwnedCorrection;
use crate::correction::{self, Examples};
use crate::params::correction::{CorrectionParams, SIDES, SMOOTHER_INPUTS, TrainingRow};
use crate::params::{RangeParams, SensorParams};

/// What corrects the strain of a sensor's filters and smoothers. Either is learned when it is first asked for, and then
/// shared by all filters that are built with this.
#[derive(Debug)]
pub struct Learned {
    pub(crate) params: CorrectionParams,
    limits: RangeParams,
    of_filter: OnceLock<Option<Arc<OfFilter>>>,
    of_smoother: OnceLock<Option<Arc<OfSmoother>>>,
}

/// What corrects a filter's strain.
pub(crate) type OfFilter = OwnedCorrection<f64, FILTER_INPUTS>;
/// What corrects a smoother's.
pub(crate) type OfSmoother = OwnedCorrection<f64, SMOOTHER_INPUTS, SIDES>;

impl Learned {
    /// Of a sensor's correction; `None` if it has none.
    #[must_use]
    pub fn of(params: &SensorParams) -> Option<Arc<Self>> {
        params.correction.clone().map(|correction| Self::new(correction, params.limits))
    }

    pub(crate) fn new(params: CorrectionParams, limits: RangeParams) -> Arc<Self> {
        Arc::new(Self { params, limits, of_filter: OnceLock::new(), of_smoother: OnceLock::new() })
    }

    /// Learns now what a smoother needs, and says whether it can be learned.
    ///
    /// # Errors
    /// If nothing can be learned from the rows.
    pub fn check_smoother(&self) -> Result<(), CalibrationError> {
        self.for_smoother().map(|_| ())
    }

    /// The scale of the features that a filter's correction sees.
    pub(crate) fn past_scale(&self) -> FeatureScale<f64> {
        self.params.readings.past()
    }

    pub(crate) fn for_filter(&self) -> Result<Arc<OfFilter>, CalibrationError> {
        let CorrectionParams { filter, simulated, .. } = &self.params;
        let learn = || {
            self.of_examples(TrainingRow::filter_inputs, |rows| {
                correction::learned_with_simulated(filter, rows, simulated)
            })
        };
        self.of_filter.get_or_init(learn).clone().ok_or_else(|| nothing("filter"))
    }

    pub(crate) fn for_smoother(&self) -> Result<Arc<OfSmoother>, CalibrationError> {
        let params = &self.params.smoother;
        let learn = || self.of_examples(TrainingRow::smoother_inputs, |rows| correction::learned(params, rows));
        self.of_smoother.get_or_init(learn).clone().ok_or_else(|| nothing("smoother"))
    }

    fn of_examples<const D: usize, X>(
        &self,
        inputs: impl Fn(&TrainingRow) -> [f64; D],
        learn: impl Fn(Examples<D>) -> Option<X>,
    ) -> Option<Arc<X>> {
        let rows = &self.params.rows;
        let (strain, time_s): (Vec<f64>, Vec<f64>) = rows.iter().map(|row| (row.strain, row.time_s)).unzip();
        let inputs: Vec<_> = rows.iter().map(inputs).collect();
        learn(Examples { inputs: &inputs, strain: &strain, time_s: &time_s, limits: self.limits }).map(Arc::new)
    }
}

fn nothing(of: &str) -> CalibrationError {
    CalibrationError::Unsupported(format!("`correction.{of}`: nothing can be learned from its rows"))
}
