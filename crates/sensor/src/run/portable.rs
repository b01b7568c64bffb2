//! A filter as plain numbers, for programs that generate it in another language.

use ohmstrain_ekf::correction::{FILTER_INPUTS, FeatureScale};
use ohmstrain_ekf::live::{LiveParts, StaticCurve};

use crate::SensorError;
use crate::correction::OwnedCorrection;
use crate::params::SensorParams;
use crate::params::estimator::{EstimatorKind, EstimatorParams};
use crate::run::build::{HISTORIES, HYPOTHESES};
use crate::run::learned::Learned;

/// A sensor's filter, with the components around it.
#[derive(Clone, Debug)]
pub struct PortableFilter {
    /// Filter that propagates the state: never [`EstimatorKind::Corrected`] or [`EstimatorKind::StaticCubic`].
    pub kind: EstimatorKind,
    /// Maximum number of hypotheses; 1 for a single Gaussian.
    pub hypotheses: usize,
    /// Its noise, motion and phases.
    pub estimator: EstimatorParams,
    /// Components around it.
    pub parts: LiveParts<f64, ()>,
    /// Correction of its strain.
    pub correction: Option<PortableCorrection>,
    /// Curve that gives the strain in place of the filter.
    pub curve: Option<StaticCurve<f64>>,
}

/// The learned correction of a filter's strain.
#[derive(Clone, Debug, PartialEq)]
pub struct PortableCorrection {
    /// The scale of the features.
    pub features: FeatureScale<f64>,
    /// Correction in running form.
    pub learned: OwnedCorrection<f64, FILTER_INPUTS>,
}

impl PortableFilter {
    /// Collects the filter of the sensor's default estimator, or of another one.
    ///
    /// # Errors
    /// If a number is out of its range, or the sensor has no parameters for the estimator.
    pub fn new(params: &SensorParams, kind: Option<EstimatorKind>) -> Result<Self, SensorError> {
        params.validate()?;
        let asked = kind.unwrap_or(params.default_estimator);
        let curve = params.curve_of(asked)?;
        let kind = params.filter_of(asked);
        let estimator = *params.estimator(kind)?;
        let learned = Learned::of(params).filter(|_| asked == EstimatorKind::Corrected);
        let correction = learned.map(|learned| {
            let (features, learned) = (learned.readings, learned.filter.as_ref().clone());
            PortableCorrection { features, learned }
        });
        let hypotheses = match kind {
            EstimatorKind::SignSplit => HYPOTHESES,
            EstimatorKind::Hypotheses => HISTORIES,
            EstimatorKind::Imm => 3,
            _ => 1,
        };
        let parts = params.live_parts(&estimator);
        Ok(Self { kind, hypotheses, estimator, parts, correction, curve })
    }
}
