//! Law, noise and motion from the calibration, in single precision.

use ohmstrain_model::{Branch, Gauge, ModelNoise, SensorLaw};
use ohmstrain_sensor::{MotionParams, PhaseParams};
use serde::Serialize;

use super::literal::Literal;

/// The calibrated law.
#[derive(Debug, Serialize)]
pub struct LawConstants {
    gauge: GaugeConstants,
    viscosity_s: [Literal; 2],
    branches: Vec<BranchConstants>,
    range_lower: Literal,
    range_upper: Literal,
}

/// A calibrated branch; gains and their growth with strain.
#[derive(Debug, Serialize)]
pub struct BranchConstants {
    tau_s: Literal,
    extend: [Literal; 2],
    retract: [Literal; 2],
}

/// The gauge curve by family.
#[derive(Debug, Serialize)]
#[serde(tag = "family", rename_all = "kebab-case")]
pub enum GaugeConstants {
    Polynomial { coefficients: [Literal; 3] },
    DecayingExponential { slope: Literal, decay_strain: Literal },
    Tunnelling { gap: Literal, barrier: Literal, path_loss: Literal },
}

/// The calibrated noise.
#[derive(Debug, Serialize)]
pub struct NoiseConstants {
    reading_sd: Literal,
    branch_sd: Literal,
    baseline_sd: Literal,
    baseline_time_s: Literal,
}

/// The calibrated motion.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PriorConstants {
    rate_time_s: Literal,
    rate_sd_per_s: Literal,
    strain_mean: Literal,
    strain_sd: Literal,
}

/// The calibrated phases.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PhaseConstants {
    hold_time_s: Literal,
    move_time_s: Literal,
    reversal: Literal,
    tempering: Literal,
    speed_per_s: Literal,
}

impl LawConstants {
    /// Converts the constants of a law.
    pub fn new<const B: usize>(law: &SensorLaw<f32, B>) -> Self {
        let branch = |branch: &Branch<f32>| BranchConstants {
            tau_s: Literal(branch.tau_s),
            extend: [branch.extend_gain, branch.extend_gain_slope].map(Literal),
            retract: [branch.retract_gain, branch.retract_gain_slope].map(Literal),
        };
        Self {
            gauge: gauge_constants(&law.gauge),
            viscosity_s: [law.extend_viscosity_s, law.retract_viscosity_s].map(Literal),
            branches: law.branches.iter().map(branch).collect(),
            range_lower: Literal(law.range.lower),
            range_upper: Literal(law.range.upper),
        }
    }
}

impl NoiseConstants {
    /// Converts the constants of a noise.
    pub const fn new(noise: &ModelNoise<f32>) -> Self {
        Self {
            reading_sd: Literal(noise.reading_sd),
            branch_sd: Literal(noise.branch_sd),
            baseline_sd: Literal(noise.baseline_sd),
            baseline_time_s: Literal(noise.baseline_time_s),
        }
    }
}

impl PhaseConstants {
    /// Converts the constants of phases.
    pub const fn new(phases: &PhaseParams) -> Self {
        Self {
            hold_time_s: Literal(phases.hold_time_s as f32),
            move_time_s: Literal(phases.move_time_s as f32),
            reversal: Literal(phases.reversal as f32),
            tempering: Literal(phases.tempering as f32),
            speed_per_s: Literal(phases.speed_per_s as f32),
        }
    }
}

impl PriorConstants {
    /// Converts the constants of a motion.
    pub const fn new(motion: &MotionParams) -> Self {
        Self {
            rate_time_s: Literal(motion.rate_time_s as f32),
            rate_sd_per_s: Literal(motion.rate_sd_per_s as f32),
            strain_mean: Literal(motion.strain_mean as f32),
            strain_sd: Literal(motion.strain_sd as f32),
        }
    }

    /// Returns the correlation time of the rate, its deviation, and mean and deviation of strain.
    pub fn numbers(&self) -> [f32; 4] {
        [self.rate_time_s, self.rate_sd_per_s, self.strain_mean, self.strain_sd].map(|literal| literal.0)
    }
}

pub fn narrow_noise(noise: ModelNoise<f64>) -> ModelNoise<f32> {
    ModelNoise {
        reading_sd: noise.reading_sd as f32,
        branch_sd: noise.branch_sd as f32,
        baseline_sd: noise.baseline_sd as f32,
        baseline_time_s: noise.baseline_time_s as f32,
    }
}

fn gauge_constants(gauge: &Gauge<f32>) -> GaugeConstants {
    match *gauge {
        Gauge::Polynomial { coefficients } => GaugeConstants::Polynomial { coefficients: coefficients.map(Literal) },
        Gauge::DecayingExponential { slope, decay_strain } => {
            GaugeConstants::DecayingExponential { slope: Literal(slope), decay_strain: Literal(decay_strain) }
        }
        Gauge::Tunnelling { gap, barrier, path_loss } => {
            GaugeConstants::Tunnelling { gap: Literal(gap), barrier: Literal(barrier), path_loss: Literal(path_loss) }
        }
    }
}
