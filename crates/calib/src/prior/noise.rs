use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::median;
use super::population::Population;
use ohmstrain_sensor::{EstimatorParams, MotionParams};

/// Noise and motion of one more sensor of the make under one estimator: logarithms, normal and independent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorPrior {
    /// Mean logarithms of: baseline_sd, baseline_time_s, reading_sd, branch_sd; rate_sd_per_s, rate_time_s, strain_sd; for
    /// filters of phases hold_time_s, move_time_s, speed_per_s, tempering.
    pub ln_mean: Vec<f64>,
    /// Their standard deviations.
    pub ln_sd: Vec<f64>,
    /// Correlation time of the readings' errors, s.
    pub reading_time_s: f64,
    /// Mean strain.
    pub strain_mean: f64,
    /// Probability that a movement turns around without a hold.
    pub reversal: f64,
    /// Factor on the standard deviation of strain.
    pub strain_sd_scale: f64,
}

/// Smallest standard deviation of a logarithm: end points of searches scatter by about as much.
const LEAST_SD: f64 = 0.1;
/// Replaces a speed of zero in filters without a preferred speed.
const NO_SPEED: f64 = 1e-12;

impl EstimatorPrior {
    /// Learns the prior from several sensors' parameters of the estimator; `None` if there are none, or if only some have phases.
    pub(super) fn learn(sensors: &[&EstimatorParams]) -> Option<Self> {
        let points: Vec<DVector<f64>> = sensors.iter().map(|params| point(params)).collect();
        let size = points.first()?.len();
        if points.iter().any(|point| point.len() != size) {
            return None;
        }
        let Population { mean, covariance } = Population::new(&points, None);
        Some(Self {
            ln_mean: mean.iter().copied().collect(),
            ln_sd: covariance.diagonal().iter().map(|variance| variance.sqrt().max(LEAST_SD)).collect(),
            reading_time_s: median(sensors.iter().map(|params| params.noise.reading_time_s)),
            strain_mean: median(sensors.iter().map(|params| params.motion.strain_mean)),
            reversal: median(sensors.iter().filter_map(|params| params.phases.map(|phases| phases.reversal))),
            strain_sd_scale: median(sensors.iter().map(|params| params.strain_sd_scale)),
        })
    }

    /// Returns the penalty on the mean score per row for a distance from the mean: the negative log density of the prior over the number of
    /// independent errors in `duration_s`.
    pub(crate) fn pull(&self, point: &[f64], duration_s: f64) -> f64 {
        let lasts_s = self.ln_mean.get(1).map_or(1.0, |ln| ln.exp());
        let independent = (0.5 * duration_s / lasts_s).max(1.0);
        let squares = point.iter().zip(&self.ln_mean).zip(&self.ln_sd).map(|((x, mean), sd)| ((x - mean) / sd).powi(2));
        0.5 * squares.sum::<f64>() / independent
    }
}

/// Returns the parameters in the order of calibration's search.
fn point(params: &EstimatorParams) -> DVector<f64> {
    let MotionParams { rate_time_s, rate_sd_per_s, strain_sd, .. } = params.motion;
    let noise = params.noise;
    let mut values = vec![noise.baseline_sd, noise.baseline_time_s, noise.reading_sd, noise.branch_sd];
    values.extend([rate_sd_per_s, rate_time_s, strain_sd]);
    if let Some(phases) = params.phases {
        values.extend([phases.hold_time_s, phases.move_time_s, phases.speed_per_s.max(NO_SPEED), phases.tempering]);
    }
    let ln: Vec<f64> = values.iter().map(|value| value.max(NO_SPEED).ln()).collect();
    DVector::from_vec(ln)
}
