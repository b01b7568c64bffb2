//! What a filter is made of as plain numbers: for programs that write it in another language.

use std::sync::Arc;

use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale};
use ohmstrain_ekf::live::LiveParts;

use crate::CalibrationError;
use crate::correction::owned::OwnedCorrection;
use crate::filter::build::{HISTORIES, HYPOTHESES};
use crate::filter::learned::Learned;
use crate::params::SensorParams;
use crate::params::estimator::{EstimatorKind, EstimatorParams};

/// A sensor's filter, with what stands around it.
#[derive(Clone, Debug)]
pub struct PortableFilter {
    /// Which filter moves the state: never [`EstimatorKind::Corrected`].
    pub kind: EstimatorKind,
    /// How many hypotheses it keeps: 1 if it keeps none.
    pub hypotheses: usize,
    /// Its noise, motion and phases.
    pub estimator: EstimatorParams,
    /// Its surroundings.
    pub parts: LiveParts<f64, ()>,
    /// What corrects its strain.
    pub correction: Option<PortableCorrection>,
}

/// The learned correction of a filter's strain.
#[derive(Clone, Debug, PartialEq)]
pub struct PortableCorrection {
    /// The scale of the features.
    pub features: FeatureScale<f64>,
    /// As it runs.
    pub learned: OwnedCorrection<f64, FILTER_INPUTS>,
}

impl PortableFilter {
    /// Of the sensor's default estimator, or of another one.
    ///
    /// # Errors
    /// If the sensor has no parameters for it, or nothing can be learned from its correction's rows.
    pub fn new(params: &SensorParams, kind: Option<EstimatorKind>) -> Result<Self, CalibrationError> {
        params.validate()?;
        let asked = kind.unwrap_or(params.default_estimator);
        let kind = params.filter_of(asked);
        let estimator = *params.estimator(kind)?;
        let learned = Learned::of(params).filter(|_| asked == EstimatorKind::Corrected);
        let correction = learned.map(|learned| {
            let (features, learned) = (learned.params.readings.past(), Arc::unwrap_or_clone(learned.for_filter()?));
            Ok::<_, CalibrationError>(PortableCorrection { features, learned })
        });
        let hypotheses = match kind {
            EstimatorKind::SignSplit => HYPOTHESES,
            EstimatorKind::Hypotheses => HISTORIES,
            EstimatorKind::Imm => 3,
            _ => 1,
        };
        let parts = params.live_parts(&estimator);
        Ok(Self { kind, hypotheses, estimator, parts, correction: correction.transpose()? })
    }
}
