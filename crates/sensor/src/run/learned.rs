use std::sync::Arc;

use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale};
use ohmstrain_model::StrainRange;

use crate::correction::{OwnedCorrection, OwnedSimulated};
use crate::params::SensorParams;
use crate::params::correction::{CorrectionParams, SIDES, SMOOTHER_INPUTS, TrainingRow};

/// The learned correction of a sensor, shared by its filters and smoothers.
#[derive(Debug)]
pub struct Learned {
    pub(crate) readings: FeatureScale<f64>,
    pub(crate) filter: Arc<OfFilter>,
    pub(crate) smoother: Arc<OfSmoother>,
}

/// The correction of a filter's strain.
pub(crate) type OfFilter = OwnedCorrection<f64, FILTER_INPUTS>;
/// The correction of a smoother's strain.
pub(crate) type OfSmoother = OwnedCorrection<f64, SMOOTHER_INPUTS, SIDES>;

impl Learned {
    /// Prepares a sensor's correction; `None` if it has none.
    #[must_use]
    pub fn of(params: &SensorParams) -> Option<Arc<Self>> {
        params.correction.as_ref().map(|correction| Self::new(correction, params.limits))
    }

    /// Prepares a correction from parameters and the limits of the strain.
    #[must_use]
    pub fn new(params: &CorrectionParams, limits: StrainRange<f64>) -> Arc<Self> {
        let of_filter: Vec<_> = params.rows.iter().map(TrainingRow::filter_inputs).collect();
        let of_smoother: Vec<_> = params.rows.iter().map(TrainingRow::smoother_inputs).collect();
        let mut filter = OfFilter::new(&params.filter, &of_filter, limits);
        filter.simulated = Some(OwnedSimulated::new(&params.simulated, &filter.scales));
        let smoother = OfSmoother::new(&params.smoother, &of_smoother, limits);
        Arc::new(Self { readings: params.readings, filter: Arc::new(filter), smoother: Arc::new(smoother) })
    }
}
