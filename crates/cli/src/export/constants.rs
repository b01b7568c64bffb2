//! What the templates show: the model in `f32`, prepared for steps of one length as `SparseEkf` prepares it.

use ohmstrain_calib::{EstimatorKind, MotionParams, Quantity, ReadingUnit, SensorParams};
use ohmstrain_ekf::{Belief, Compact, Switch};
use ohmstrain_model::{
    Branch, Gauge, LEAST_LEFT, ModelNoise, Motion, ParameterError, SensorLaw, StrainRange, SwitchedModel, UNEXPLAINED,
};
use serde::Serialize;

use super::ExportError;
use super::literal::{Literal, literals};
use super::vectors::Vectors;

/// A sensor as the templates have it.
#[derive(Debug, Serialize)]
pub struct Exported {
    made_by: String,
    version: &'static str,
    quantity: &'static str,
    quantity_unit: &'static str,
    reading_name: &'static str,
    reading_unit: &'static str,
    joint: bool,
    dt_s: Literal,
    dt_us: u64,
    dt_ms: f64,
    rest_reading: Literal,
    lower: Literal,
    upper: Literal,
    strain_sd_scale: Literal,
    states: usize,
    start_mean: Vec<Literal>,
    start_variance: Vec<Literal>,
    motion: [[Literal; 2]; 2],
    motion_input: [Literal; 2],
    motion_noise: [Literal; 3],
    /// What the rate's new variance takes from the old ones of strain, of both, of rate.
    rate_squares: [Literal; 3],
    averaging: Literal,
    /// How what an uncertain direction leaves open is computed.
    ninth: Literal,
    unexplained: Literal,
    least_left: Literal,
    rate_change: [Literal; 2],
    /// Below, within and above the law's range.
    gain_regions: [Vec<GainConstants>; 3],
    branches: Vec<BranchConstants>,
    baseline_decay: Literal,
    /// Times the branches' decays, and times itself.
    baseline_decays: Vec<Literal>,
    baseline_square: Literal,
    baseline_variance: Literal,
    reading_variance: Literal,
    range_lower: Literal,
    range_upper: Literal,
    viscosity_s: [Literal; 2],
    gauge: GaugeConstants,
    /// Whether nothing but correctly rounded operations is used.
    exact: bool,
    noise: NoiseConstants,
    prior: PriorConstants,
    vectors: Vectors,
}

/// A branch over one step.
#[derive(Debug, Serialize)]
struct BranchConstants {
    tau_s: Literal,
    decay: Literal,
    /// Times the decays of all branches.
    decays: Vec<Literal>,
    drive: [Literal; 2],
    drive_input: Literal,
    reach_s: Literal,
    per_reach: Literal,
    clear: Literal,
    cross_noise: [Literal; 2],
    branch_noise: Vec<Literal>,
    variance: Literal,
    /// Gain and its growth with strain, as they were calibrated.
    extend: [Literal; 2],
    retract: [Literal; 2],
}

/// The gains of a branch: at zero, and their growth with the sum of old and new strain.
#[derive(Debug, Serialize)]
struct GainConstants {
    extend: [Literal; 2],
    retract: [Literal; 2],
}

/// The gauge curve by family.
#[derive(Debug, Serialize)]
#[serde(tag = "family", rename_all = "kebab-case")]
enum GaugeConstants {
    Polynomial { coefficients: [Literal; 3] },
    DecayingExponential { slope: Literal, decay_strain: Literal },
    Tunnelling { gap: Literal, barrier: Literal, path_loss: Literal },
}

/// The noise as it was calibrated.
#[derive(Debug, Serialize)]
struct NoiseConstants {
    reading_sd: Literal,
    branch_sd: Literal,
    baseline_sd: Literal,
    baseline_time_s: Literal,
}

/// The motion as it was calibrated.
#[derive(Clone, Copy, Debug, Serialize)]
struct PriorConstants {
    rate_time_s: Literal,
    rate_sd_per_s: Literal,
    strain_mean: Literal,
    strain_sd: Literal,
}

/// What the numbers of states in a filter's type are made for.
pub struct FixedRate<const B: usize, const N: usize> {
    /// The model in double precision, for simulation and to see what rounding does.
    pub reference: SwitchedModel<f64, 2, B, N>,
    /// The model in single precision.
    pub model: SwitchedModel<f32, 2, B, N>,
    /// Time between readings, s.
    pub dt_s: f32,
    /// R₀.
    pub rest_reading: f32,
    /// Factor on the standard deviation of strain.
    pub strain_sd_scale: f32,
    /// Limits of the output.
    pub limits: StrainRange<f32>,
}

impl<const B: usize, const N: usize> FixedRate<B, N> {
    /// A sensor with R₀ = 1, whose deviations are taken as they are. `motion`: correlation time of the rate, its deviation,
    /// mean and deviation of strain.
    ///
    /// # Errors
    /// Names the parameter that no model can have.
    pub fn new(
        law: SensorLaw<f64, B>,
        motion: [f64; 4],
        noise: ModelNoise<f64>,
        dt_s: f32,
        limits: StrainRange<f32>,
    ) -> Result<Self, ExportError> {
        let wrong = |error: ParameterError| ExportError::Parameter(error.to_string());
        let [time, rate_sd, mean, sd] = motion;
        let reference = Motion::ornstein_uhlenbeck(time, rate_sd, mean, sd)
            .and_then(|motion| SwitchedModel::new(law, motion, noise))
            .map_err(wrong)?;
        let [time, rate_sd, mean, sd] = motion.map(|x| x as f32);
        let model = Motion::ornstein_uhlenbeck(time, rate_sd, mean, sd)
            .and_then(|motion| SwitchedModel::new(narrow_law(&law), motion, narrow_noise(noise)))
            .map_err(wrong)?;
        Ok(Self { reference, model, dt_s, rest_reading: 1.0, strain_sd_scale: 1.0, limits })
    }

    /// Whether the filter uses nothing but operations that are rounded correctly everywhere.
    pub fn is_exact(&self) -> bool {
        matches!(self.model.law().gauge, Gauge::Polynomial { .. })
    }
}

impl Exported {
    /// Checks that the sensor has an exported form and computes all of it.
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn new(params: &SensorParams, made_by: &str, dt_s: f64) -> Result<Self, ExportError> {
        if dt_s * 1e6 < 1.0 || dt_s > params.validity.duration_s {
            return Err(ExportError::Interval(format!(
                "expected between a microsecond and the longest recording, {} s, found {dt_s}",
                params.validity.duration_s
            )));
        }
        match params.law.branches.len() {
            0 => Self::of::<0, 3, 6>(params, made_by, dt_s),
            1 => Self::of::<1, 4, 10>(params, made_by, dt_s),
            2 => Self::of::<2, 5, 15>(params, made_by, dt_s),
            3 => Self::of::<3, 6, 21>(params, made_by, dt_s),
            4 => Self::of::<4, 7, 28>(params, made_by, dt_s),
            _ => Err(ExportError::Unsupported {
                what: "the law has more than four branches",
                instead: "calibrate with `--branches 4` or fewer",
            }),
        }
    }

    fn of<const B: usize, const N: usize, const L: usize>(
        params: &SensorParams,
        made_by: &str,
        dt_s: f64,
    ) -> Result<Self, ExportError> {
        let estimator = params.estimator(EstimatorKind::Ekf).map_err(|e| ExportError::Parameter(e.to_string()))?;
        let prior = prior(&estimator.motion)?;
        let law = params.law.to_model();
        let law = law.ok_or_else(|| ExportError::Parameter("field `law.branches`: another number of them".into()))?;
        let limits = narrow_range(params.limits.to_model());
        let motion = [prior.rate_time_s, prior.rate_sd_per_s, prior.strain_mean, prior.strain_sd];
        let motion = motion.map(|literal| f64::from(literal.0));
        let mut sensor = FixedRate::new(law, motion, estimator.noise.every(dt_s), dt_s as f32, limits)?;
        sensor.rest_reading = params.rest_reading as f32;
        sensor.strain_sd_scale = estimator.strain_sd_scale as f32;
        let model = sensor.model;
        let vectors = Vectors::new::<B, N, L>(&sensor)?;
        let (law, noise) = (model.law(), model.noise());
        let start: Belief<f32, N, L> = Belief::initial(&model);
        let step = model.prepare(sensor.dt_s);
        let response = step.response();
        let push = model.motion().restoring()[0] * model.motion().rest_strain();
        let change = &response.motion_change;
        let motion = [[1.0 + change[0][0], change[0][1]], [change[1][0], 1.0 + change[1][1]]];
        let [_, b] = motion;
        let baseline_decay = 1.0 + step.baseline_change();
        let decays = response.decay_change.map(|change| 1.0 + change);
        let exported = Self {
            made_by: made_by.into(),
            version: env!("CARGO_PKG_VERSION"),
            quantity: if params.quantity == Quantity::AngleDeg { "angle" } else { "strain" },
            quantity_unit: if params.quantity == Quantity::AngleDeg { ", degrees" } else { "" },
            reading_name: if params.reading == ReadingUnit::Ohm { "resistance" } else { "resistance ratio" },
            reading_unit: if params.reading == ReadingUnit::Ohm { "ohm" } else { "a ratio" },
            joint: params.joint.is_some(),
            dt_s: Literal(sensor.dt_s),
            dt_us: (dt_s * 1e6).round() as u64,
            dt_ms: (dt_s * 1e6).round() / 1e3,
            rest_reading: Literal(sensor.rest_reading),
            lower: Literal(sensor.limits.lower),
            upper: Literal(sensor.limits.upper),
            strain_sd_scale: Literal(sensor.strain_sd_scale),
            states: N,
            start_mean: literals(start.mean.iter()),
            start_variance: (0..N).map(|i| Literal(start.covariance[(i, i)])).collect(),
            motion: motion.map(|row| row.map(Literal)),
            motion_input: response.input.map(|answer| Literal(answer * push)),
            motion_noise: [response.motion_noise[0][0], response.motion_noise[1][0], response.motion_noise[1][1]]
                .map(Literal),
            rate_squares: [b[0] * b[0], 2.0 * b[0] * b[1], b[1] * b[1]].map(Literal),
            averaging: Literal(step.averaging()),
            ninth: Literal((1.0_f64 / 9.0) as f32),
            unexplained: Literal(UNEXPLAINED as f32),
            least_left: Literal(LEAST_LEFT as f32),
            rate_change: response.motion_change[1].map(Literal),
            gain_regions: [Some(law.range.lower), None, Some(law.range.upper)].map(|border| gains(law, border)),
            branches: (0..B).map(|i| branch(&sensor, i)).collect(),
            baseline_decay: Literal(baseline_decay),
            baseline_decays: decays.iter().map(|decay| Literal(baseline_decay * decay)).collect(),
            baseline_square: Literal(baseline_decay * baseline_decay),
            baseline_variance: Literal(step.baseline_variance()),
            reading_variance: Literal(noise.reading_sd * noise.reading_sd),
            range_lower: Literal(law.range.lower),
            range_upper: Literal(law.range.upper),
            viscosity_s: [law.extend_viscosity_s, law.retract_viscosity_s].map(Literal),
            gauge: gauge_constants(&law.gauge),
            exact: sensor.is_exact(),
            noise: NoiseConstants {
                reading_sd: Literal(noise.reading_sd),
                branch_sd: Literal(noise.branch_sd),
                baseline_sd: Literal(noise.baseline_sd),
                baseline_time_s: Literal(noise.baseline_time_s),
            },
            prior,
            vectors,
        };
        exported.check_finite()?;
        Ok(exported)
    }

    /// A literal that is no number would not compile, or worse.
    fn check_finite(&self) -> Result<(), ExportError> {
        let scalars = [self.rest_reading, self.lower, self.upper, self.strain_sd_scale, self.reading_variance];
        let all = self.start_mean.iter().chain(&self.start_variance).chain(&scalars);
        match all.copied().find(|literal| !literal.0.is_finite()) {
            Some(literal) => Err(ExportError::Parameter(format!("a parameter is {:?} in single precision", literal.0))),
            None if !(self.rest_reading.0 > 0.0) => {
                Err(ExportError::Parameter("field `rest_reading`: vanishes in single precision".into()))
            }
            None => Ok(()),
        }
    }
}

/// The gains within the range, or at one of its borders and beyond, as `SparseEkf` keeps them.
fn gains<const B: usize>(law: &SensorLaw<f32, B>, border: Option<f32>) -> Vec<GainConstants> {
    let gain = |at_zero: f32, growth: f32| match border {
        None => [Literal(at_zero), Literal(0.5 * growth)],
        Some(border) => [Literal(at_zero + growth * border), Literal(0.0)],
    };
    let gains = |branch: &Branch<f32>| GainConstants {
        extend: gain(branch.extend_gain, branch.extend_gain_slope),
        retract: gain(branch.retract_gain, branch.retract_gain_slope),
    };
    law.branches.iter().map(gains).collect()
}

/// Deviations from which on a rate has one direction.
const CLEAR: f32 = <Compact as Switch<f32>>::CLEAR as f32;

/// As `SparseEkf` prepares it.
fn branch<const B: usize, const N: usize>(sensor: &FixedRate<B, N>, i: usize) -> BranchConstants {
    let step = sensor.model.prepare(sensor.dt_s);
    let (response, law) = (step.response(), &sensor.model.law().branches[i]);
    let push = sensor.model.motion().restoring()[0] * sensor.model.motion().rest_strain();
    let reach_s = -response.decay_change[i] * law.tau_s;
    BranchConstants {
        tau_s: Literal(law.tau_s),
        decay: Literal(1.0 + response.decay_change[i]),
        decays: response.decay_change.map(|other| Literal((1.0 + response.decay_change[i]) * (1.0 + other))).into(),
        drive: response.drive[i].map(Literal),
        drive_input: Literal(response.drive_input[i] * push),
        reach_s: Literal(reach_s),
        per_reach: Literal(1.0 / reach_s),
        clear: Literal(CLEAR * CLEAR * reach_s * reach_s),
        cross_noise: response.cross_noise[i].map(Literal),
        branch_noise: literals(&response.branch_noise[i]),
        variance: Literal(step.branch_variance()[i]),
        extend: [law.extend_gain, law.extend_gain_slope].map(Literal),
        retract: [law.retract_gain, law.retract_gain_slope].map(Literal),
    }
}

fn prior(motion: &MotionParams) -> Result<PriorConstants, ExportError> {
    match *motion {
        MotionParams::OrnsteinUhlenbeck { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } => Ok(PriorConstants {
            rate_time_s: Literal(rate_time_s as f32),
            rate_sd_per_s: Literal(rate_sd_per_s as f32),
            strain_mean: Literal(strain_mean as f32),
            strain_sd: Literal(strain_sd as f32),
        }),
        MotionParams::Smooth { .. } => Err(ExportError::Unsupported {
            what: "the ekf's motion has an acceleration, which the exported filter has not",
            instead: "calibrate with `--estimator ekf`, which gives it Ornstein-Uhlenbeck motion",
        }),
    }
}

fn narrow_noise(noise: ModelNoise<f64>) -> ModelNoise<f32> {
    ModelNoise {
        reading_sd: noise.reading_sd as f32,
        branch_sd: noise.branch_sd as f32,
        baseline_sd: noise.baseline_sd as f32,
        baseline_time_s: noise.baseline_time_s as f32,
    }
}

fn narrow_law<const B: usize>(law: &SensorLaw<f64, B>) -> SensorLaw<f32, B> {
    let gauge = match law.gauge {
        Gauge::Polynomial { coefficients } => Gauge::Polynomial { coefficients: coefficients.map(|a| a as f32) },
        Gauge::DecayingExponential { slope, decay_strain } => {
            Gauge::DecayingExponential { slope: slope as f32, decay_strain: decay_strain as f32 }
        }
        Gauge::Tunnelling { gap, barrier, path_loss } => {
            Gauge::Tunnelling { gap: gap as f32, barrier: barrier as f32, path_loss: path_loss as f32 }
        }
    };
    let branch = |branch: &Branch<f64>| Branch {
        tau_s: branch.tau_s as f32,
        extend_gain: branch.extend_gain as f32,
        retract_gain: branch.retract_gain as f32,
        extend_gain_slope: branch.extend_gain_slope as f32,
        retract_gain_slope: branch.retract_gain_slope as f32,
    };
    SensorLaw {
        gauge,
        extend_viscosity_s: law.extend_viscosity_s as f32,
        retract_viscosity_s: law.retract_viscosity_s as f32,
        branches: law.branches.each_ref().map(branch),
        range: narrow_range(law.range),
    }
}

fn narrow_range(range: StrainRange<f64>) -> StrainRange<f32> {
    StrainRange { lower: range.lower as f32, upper: range.upper as f32 }
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
