//! What a filter is made of as plain numbers: for programs that write it in another language.

use ohmstrain_ekf::correction::{FEATURES, FeatureScale, INDUCING, InputScale, OUTPUTS};

use crate::CalibrationError;
use crate::build_filter::{HISTORIES, HYPOTHESES, START_SD};
use crate::corrected::learned_for_filter;
use crate::corrector::Corrector;
use crate::estimator_params::{EstimatorKind, EstimatorParams};
use crate::params::SensorParams;
use crate::sieve::{MOST_REPEATS, Sieve};

/// A sensor's filter, with what stands around it.
#[derive(Clone, Debug)]
pub struct PortableFilter {
    /// Which filter moves the state: never [`EstimatorKind::Corrected`].
    pub kind: EstimatorKind,
    /// How many hypotheses it keeps: 1 if it keeps none.
    pub hypotheses: usize,
    /// Its noise, motion and phases.
    pub estimator: EstimatorParams,
    /// What a reading must be for it to see it.
    pub readings: PortableSieve,
    /// What corrects its strain.
    pub correction: Option<PortableCorrection>,
    /// Deviation of a strain that is known when it starts.
    pub known_sd: f64,
}

/// What a reading must be for a filter to see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortableSieve {
    /// Least and largest `R/R₀ - 1` that can be a reading.
    pub plausible: (f64, f64),
    /// Longest time, s, for which a working sensor repeats one number; infinite if that is not known.
    pub longest_repeat_s: f64,
    /// How often a number must have come again to be stuck.
    pub most_repeats: u32,
    /// Time, s, over which errors of the readings are alike.
    pub error_time_s: f64,
}

/// The learned correction of a filter's strain, as [`ohmstrain_ekf::correction::Correction`] has it.
#[derive(Clone, Debug, PartialEq)]
pub struct PortableCorrection {
    /// The scale of the features.
    pub features: FeatureScale<f64>,
    /// Standardised inputs of the training rows; the first [`INDUCING`] at most are the inducing rows.
    pub rows: Vec<[f64; OUTPUTS + FEATURES]>,
    /// Scales of the inputs.
    pub scales: [InputScale<f64>; OUTPUTS + FEATURES],
    /// Strain from the features.
    pub direct: PortableProcess,
    /// What the filter's strain lacks, from all inputs.
    pub residual: PortableProcess,
    /// Variance of the strain over the training rows.
    pub strain_variance: f64,
    /// Factor on the mixture's variance.
    pub variance_factor: f64,
}

/// A Gaussian process, as [`ohmstrain_ekf::correction::Process`] has it.
#[derive(Clone, Debug, PartialEq)]
pub struct PortableProcess {
    /// Length scale, in standard deviations of the inputs.
    pub length: f64,
    /// Mean of the targets.
    pub mean: f64,
    /// Weight of each training row.
    pub weights: Vec<f64>,
    /// The upper triangle of what the inducing rows explain, row by row.
    pub explained: Vec<f64>,
    /// Prior variance.
    pub variance: f64,
    /// Variance of the noise.
    pub noise: f64,
    /// Factor on the variance.
    pub widening: f64,
    /// Least variance where nothing is known.
    pub least_variance: f64,
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
        let learned = params.correction.as_ref().filter(|_| asked == EstimatorKind::Corrected);
        let correction = learned.map(|correction| {
            let corrector = learned_for_filter(correction, params.limits)?;
            Ok::<_, CalibrationError>(PortableCorrection::new(correction.readings.past(), &corrector))
        });
        let hypotheses = match kind {
            EstimatorKind::SignSplit => HYPOTHESES,
            EstimatorKind::Hypotheses => HISTORIES,
            EstimatorKind::Imm => 3,
            _ => 1,
        };
        let sieve = Sieve::new(params);
        let readings = PortableSieve {
            plausible: sieve.plausible,
            longest_repeat_s: sieve.longest_repeat_s,
            most_repeats: MOST_REPEATS,
            error_time_s: estimator.noise.reading_time_s,
        };
        let known_sd = START_SD * params.limits.span();
        Ok(Self { kind, hypotheses, estimator, readings, correction: correction.transpose()?, known_sd })
    }
}

impl PortableCorrection {
    fn new(features: FeatureScale<f64>, corrector: &Corrector<{ OUTPUTS + FEATURES }>) -> Self {
        let correction = corrector.correction();
        debug_assert!(corrector.direct.explained.len() <= INDUCING * (INDUCING + 1) / 2);
        Self {
            features,
            rows: correction.rows.to_vec(),
            scales: *correction.scales,
            direct: corrector.direct.clone(),
            residual: corrector.residual.clone(),
            strain_variance: correction.strain_variance,
            variance_factor: correction.variance_factor,
        }
    }
}
