use std::sync::Arc;

#[cfg(feature = "particles")]
use ohmstrain_ekf::Particles;
use ohmstrain_ekf::live::Sieve;
use ohmstrain_ekf::{
    AnyCurve, Belief, Compact, Dwell, Evidence, Hypotheses, Imm, Mixture, PhaseMixture, Settling, SigmaPoints,
    SignSplit, SparseEkf,
};
use ohmstrain_model::{Phase, SwitchedModel};

use crate::filter::corrected::Corrected;
use crate::filter::learned::Learned;
use crate::filter::running::{Interval, Running};
use crate::filter::{Filter, Start};
use crate::params::estimator::{EstimatorKind, EstimatorParams, NoParameters, SettlingParams};
use crate::params::law::LawParams;
use crate::params::{RangeParams, SensorParams};
use crate::{CalibrationError, with_sizes};

/// Share of the limits' span to which a given initial strain is believed.
pub(crate) const START_SD: f64 = 1e-3;

/// Builds a filter for a sensor.
///
/// # Errors
/// If a number is out of its range, the sensor has no parameters for the estimator, or it has a number of branches that no
/// filter is built for.
pub fn build_filter(
    params: &SensorParams,
    kind: Option<EstimatorKind>,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    build_filter_with(params, Learned::of(params).as_ref(), kind, start)
}

/// The same with what the sensor's correction has learned already, or learns now: [`Learned::of`] these parameters.
///
/// # Errors
/// As [`build_filter`].
pub fn build_filter_with(
    params: &SensorParams,
    learned: Option<&Arc<Learned>>,
    kind: Option<EstimatorKind>,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    params.validate()?;
    let kind = kind.unwrap_or(params.default_estimator);
    let setting = Setting { limits: params.limits, start, sieve: params.sieve() };
    let of = params.filter_of(kind);
    let filter = filter_from_parts(of, &params.law, params.estimator(of)?, setting)?;
    if kind != EstimatorKind::Corrected {
        return Ok(filter);
    }
    let learned = learned.ok_or(NoParameters { kind })?;
    Ok(Box::new(Corrected::new(filter, learned)?))
}

/// What a filter needs besides law, noise and motion.
#[derive(Clone, Copy)]
pub(crate) struct Setting {
    pub limits: RangeParams,
    pub start: Start,
    pub sieve: Sieve<f64>,
}

pub(crate) fn filter_from_parts(
    kind: EstimatorKind,
    law: &LawParams,
    estimator: &EstimatorParams,
    setting: Setting,
) -> Result<Box<dyn Filter>, CalibrationError> {
    let branches = law.branches.len();
    with_sizes!(branches, B, N, L => of_size::<B, N, L>(kind, law, estimator, setting))
        .unwrap_or_else(|| Err(CalibrationError::branches(branches)))
}

/// The model of a law.
fn switched<const B: usize, const N: usize>(
    law: &LawParams,
    estimator: &EstimatorParams,
) -> Result<SwitchedModel<f64, B, N>, CalibrationError> {
    let law = law.to_model().ok_or_else(|| CalibrationError::Unsupported("number of branches".into()))?;
    let mut motion = estimator.motion.to_model()?;
    if let Some(phases) = estimator.phases {
        motion = motion.with_phase_rate(phases.speed_per_s)?;
    }
    Ok(SwitchedModel::new(law, motion, estimator.noise.to_model())?)
}

/// Any filter of a model of known size.
fn of_size<const B: usize, const N: usize, const L: usize>(
    kind: EstimatorKind,
    law: &LawParams,
    estimator: &EstimatorParams,
    setting: Setting,
) -> Result<Box<dyn Filter>, CalibrationError> {
    let model = switched::<B, N>(law, estimator)?;
    let beliefs: [Belief<f64, N, L>; 2] = [initial_belief(&model, setting), Belief::initial(&model)];
    let interval = interval(estimator, setting, B);
    match kind {
        EstimatorKind::Ekf => {
            let filter = SparseEkf::<_, Compact, B, N>::at_a_moment(model).map_err(CalibrationError::NoFilter)?;
            return Ok(Box::new(Running::new(filter, beliefs, model, interval)));
        }
        EstimatorKind::Ukf => {
            let filter = SparseEkf::<_, Compact, B, N, SigmaPoints<AnyCurve<f64>>>::at_a_moment(model);
            return Ok(Box::new(Running::new(filter.map_err(CalibrationError::NoFilter)?, beliefs, model, interval)));
        }
        EstimatorKind::Corrected => return Err(NoParameters { kind }.into()),
        _ => {}
    }
    let PhaseFilter { dwell, hold, evidence } = PhaseFilter::new(kind, estimator, setting.limits)?;
    Ok(match kind {
        EstimatorKind::Imm => {
            let start = beliefs.map(|belief| PhaseMixture::single(belief, Phase::Hold));
            let filter = Imm::<_, B, N>::new(model, NO_STEP_S, dwell, evidence).map_err(CalibrationError::NoFilter)?;
            Box::new(Running::new(filter, start, model, interval))
        }
        EstimatorKind::SignSplit => {
            let start = beliefs.map(|belief| Mixture::single(belief, Phase::Extend));
            let filter = SignSplit::<_, B, N, HYPOTHESES>::new(model, NO_STEP_S, hold, evidence)
                .map_err(CalibrationError::NoFilter)?;
            Box::new(Running::new(filter, start, model, interval))
        }
        #[cfg(not(feature = "particles"))]
        EstimatorKind::Particles => {
            return Err(CalibrationError::Unsupported("`particles` without the feature of that name".into()));
        }
        #[cfg(feature = "particles")]
        EstimatorKind::Particles => {
            let filter = Particles::new(model, hold, evidence, PARTICLES, PARTICLE_SEED);
            let start = beliefs.map(|belief| filter.start(&belief, Phase::Extend));
            Box::new(Running::new(filter, start, model, interval))
        }
        _ => {
            let start = beliefs.map(|belief| Mixture::single(belief, Phase::Hold));
            let filter = Hypotheses::<_, B, N, HISTORIES>::new(model, NO_STEP_S, dwell, evidence)
                .map_err(CalibrationError::NoFilter)?;
            Box::new(Running::new(filter, start, model, interval))
        }
    })
}

/// What filters of phases need besides a model.
struct PhaseFilter {
    dwell: Dwell<f64>,
    /// The same for a body that rests at times.
    hold: Option<Dwell<f64>>,
    evidence: Evidence<f64>,
}

impl PhaseFilter {
    fn new(kind: EstimatorKind, estimator: &EstimatorParams, limits: RangeParams) -> Result<Self, CalibrationError> {
        let phases = estimator.phases.ok_or_else(|| {
            CalibrationError::Unsupported(format!("`{}` needs `phases` in its parameters", kind.name()))
        })?;
        let dwell = phases.dwell()?;
        let hold = phases.rests().then_some(dwell);
        Ok(Self { dwell, hold, evidence: Evidence::new(limits.to_model(), phases.tempering)? })
    }
}

fn interval(estimator: &EstimatorParams, setting: Setting, branches: usize) -> Interval {
    let unseen = || Settling::unseen(&estimator.noise.to_model(), branches);
    Interval {
        settling: estimator.settling.map_or_else(unseen, SettlingParams::to_model),
        limits: setting.limits.to_model(),
        filtered_scale: estimator.strain_sd_scale,
        smoothed_scale: estimator.smoothed_sd_scale.unwrap_or(1.0),
        sieve: setting.sieve.with_error_time(estimator.noise.reading_time_s),
        starts_known: matches!(setting.start, Start::Strain(_)),
    }
}

/// What filters are made for before they know the length of a step.
const NO_STEP_S: f64 = 0.0;

/// Capacity of the sign-split filter.
pub const HYPOTHESES: usize = 8;
/// Capacity of the filter of phase histories.
pub const HISTORIES: usize = 8;
/// Particles.
#[cfg(feature = "particles")]
const PARTICLES: usize = 4000;
/// Seed of the particles' paths: the same readings give the same estimates.
pub const PARTICLE_SEED: u64 = 1;

fn initial_belief<const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<f64, B, N>,
    setting: Setting,
) -> Belief<f64, N, L> {
    let Start::Strain(strain) = setting.start else { return Belief::initial(model) };
    let (mut mean, mut variance) = model.initial_distribution();
    (mean[0], variance[0]) = (strain, (START_SD * setting.limits.span()).powi(2));
    Belief::independent(mean, &variance)
}
