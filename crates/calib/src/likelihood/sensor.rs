use super::{LikelihoodFit, NoiseParameter};
use crate::samples::usual_step_s;
use ohmstrain_sensor::{EstimatorParams, MotionParams, NoiseParams};

/// Initial noise and motion; parameters that are not free keep these values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseStart {
    /// Noise.
    pub noise: NoiseParams,
    /// Motion.
    pub motion: MotionParams,
}

impl NoiseStart {
    /// Takes the start from an estimator. The likelihood assumes white errors of readings; it starts with their standard deviation at the
    /// usual time step of the rows.
    #[must_use]
    pub fn new(estimator: &EstimatorParams, time_s: &[f64]) -> Self {
        let step_s = usual_step_s([time_s].into_iter());
        let reading_sd = estimator.noise.every(step_s).reading_sd;
        Self { noise: NoiseParams { reading_sd, reading_time_s: 0.0, ..estimator.noise }, motion: estimator.motion }
    }
}

/// Noise and motion that make the readings most likely.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseFit {
    /// The noise found.
    pub noise: NoiseParams,
    /// The motion found.
    pub motion: MotionParams,
    /// Uncertainty of the parameters.
    pub fit: LikelihoodFit,
    /// Warnings in words; empty if all went well.
    pub warnings: Vec<String>,
}

/// Largest standard error of a logarithm without a warning. Beyond it the readings carry next to no information on the parameter: its 95 %
/// interval is from a fiftieth to fifty times the value.
const LEAST_SURE: f64 = 2.0;

pub(super) fn found(start: &NoiseStart, free: &[NoiseParameter], fit: &LikelihoodFit) -> (NoiseParams, MotionParams) {
    let value = |parameter: NoiseParameter| {
        let mut moved = free.iter().zip(&fit.parameters).filter(|(free, _)| **free == parameter);
        moved.next().map_or_else(|| parameter.get(&start.noise, &start.motion), |(_, fitted)| fitted.value)
    };
    let noise = NoiseParams {
        reading_sd: value(NoiseParameter::ReadingSd),
        reading_time_s: 0.0,
        branch_sd: value(NoiseParameter::BranchSd),
        baseline_sd: value(NoiseParameter::BaselineSd),
        baseline_time_s: value(NoiseParameter::BaselineTime),
    };
    let motion = MotionParams {
        rate_sd_per_s: value(NoiseParameter::RateSd),
        rate_time_s: value(NoiseParameter::RateTime),
        ..start.motion
    };
    (noise, motion)
}

pub(super) fn warnings(fit: &LikelihoodFit) -> Vec<String> {
    let mut out = Vec::new();
    if !fit.converged {
        let (steps, norm) = (fit.iterations, fit.gradient_norm);
        out.push(format!("no maximum after {steps} steps, gradient {norm:.1e}: the likelihood jumps or rises forever"));
    }
    for parameter in &fit.parameters {
        let name = parameter.name;
        if let Some(bound) = parameter.bound {
            out.push(format!(
                "{name} ends on its {} bound {:.3e}: the readings do not determine it",
                bound.name(),
                parameter.value
            ));
        } else if fit.converged && parameter.ln_standard_error.is_none_or(|error| error > LEAST_SURE) {
            out.push(format!("{name} is hardly determined by the readings"));
        }
    }
    out
}
