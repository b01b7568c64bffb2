use ohmstrain_ekf::{
    Belief, Dwell, Ekf, Estimate, Evidence, Gaussian, Guard, Hypotheses, Imm, Mixture, Particles, Reading,
    ReadingVerdict, SignSplit, StepError, Ukf, Unscented,
};
use ohmstrain_model::{Motion, Phase, SwitchedModel};

use crate::CalibrationError;
use crate::ensemble::Ensemble;
use crate::estimator_params::{AnyMotion, EstimatorKind, EstimatorParams};
use crate::law_params::LawParams;
use crate::params::{RangeParams, SensorParams};
use crate::running::{Interval, Running};

/// A filter for a sensor whose number of branches and kind of motion are known at run time only.
pub trait Filter {
    /// Takes the reading `R/R₀ - 1` at `time_s`; `None` if it is missing. The first call is an update without a
    /// prediction.
    ///
    /// # Errors
    /// See [`StepError`]. The filter stays as it was: the next good row goes on from the last good one.
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError>;

    /// Strain within the limits.
    fn strain(&self) -> Gaussian<f64>;

    /// Everything that is reported.
    fn output(&self) -> Output;

    /// Protects the filter from outliers from now on.
    fn guard(&mut self, guard: Guard<f64>);

    /// Like [`Self::step`], but every row is estimated from the readings up to `lag_s` seconds after it; `out` gets the
    /// rows that have become due, in order. The cost of a step grows with the rows within the lag, not with time.
    ///
    /// # Errors
    /// See [`StepError`]. The filter stays as it was.
    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        lag_s: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError>;

    /// The rows that still wait, from all readings there are.
    ///
    /// # Errors
    /// See [`StepError`].
    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError>;

    /// Smooths a whole recording, from the state the filter is in; `None` if the estimator has no smoother.
    ///
    /// # Errors
    /// The row at which a step failed, and why.
    fn smooth(
        &mut self,
        time_s: &[f64],
        readings: &[Option<Reading<f64>>],
    ) -> Result<Option<Vec<Output>>, (usize, StepError)>;
}

/// What a filter or smoother says at one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// The estimate.
    pub estimate: Estimate<f64>,
    /// Normalised innovation squared of the row's reading; `None` if it was missing.
    pub nis: Option<f64>,
    /// What became of the reading.
    pub verdict: ReadingVerdict,
    /// Probabilities of extend, hold and retract; `None` if the estimator has no phases.
    pub phases: Option<[f64; 3]>,
}

/// Where a filter starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// The long-run distribution of the calibration.
    Unknown,
    /// A strain that is known to the limits' resolution, at rest.
    Strain(f64),
}

/// Share of the limits' span to which a given initial strain is believed.
const START_SD: f64 = 1e-3;

/// Builds the filter for a sensor.
///
/// # Errors
/// If the sensor has no parameters for the estimator, or more branches than four.
pub fn build_filter(
    params: &SensorParams,
    kind: Option<EstimatorKind>,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    let kind = kind.unwrap_or(params.default_estimator);
    let single = |kind| filter_from_parts(kind, &params.law, params.estimator(kind)?, params.limits, start);
    if kind != EstimatorKind::Ensemble {
        return single(kind);
    }
    let ensemble = params.ensemble.as_ref().ok_or_else(|| CalibrationError::no_parameters(kind))?;
    let members = ensemble.weights.iter().map(|(kind, weight)| Ok((single(*kind)?, *weight)));
    let members = members.collect::<Result<_, CalibrationError>>()?;
    let smoothed_scale = ensemble.smoothed_sd_scale.unwrap_or(1.0);
    Ok(Box::new(Ensemble::new(members, ensemble.strain_sd_scale, smoothed_scale)))
}

pub(crate) fn filter_from_parts(
    kind: EstimatorKind,
    law: &LawParams,
    estimator: &EstimatorParams,
    limits: RangeParams,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    /// One instance per number of motion states and branches; N = M + B + 1, L = N (N + 1) / 2.
    macro_rules! build {
        ($motion:expr, $m:literal, $([$b:literal, $n:literal, $l:literal]),+) => {
            match law.branches.len() {
                $($b => build_sized::<$m, $b, $n, $l>(kind, $motion, law, estimator, limits, start),)+
                many => Err(CalibrationError::Unsupported(format!("a law with {many} branches; at most 4 are supported"))),
            }
        };
    }
    match estimator.motion.to_model()? {
        AnyMotion::Two(mut motion) => {
            if let Some(phases) = estimator.phases {
                motion = motion.with_phase_rate(phases.speed_per_s);
            }
            build!(motion, 2, [0, 3, 6], [1, 4, 10], [2, 5, 15], [3, 6, 21], [4, 7, 28])
        }
        AnyMotion::Three(motion) => {
            build!(motion, 3, [0, 4, 10], [1, 5, 15], [2, 6, 21], [3, 7, 28], [4, 8, 36])
        }
    }
}

/// The model of a law, and the filter around it.
fn build_sized<const M: usize, const B: usize, const N: usize, const L: usize>(
    kind: EstimatorKind,
    motion: Motion<f64, M>,
    law: &LawParams,
    estimator: &EstimatorParams,
    limits: RangeParams,
    start: Start,
) -> Result<Box<dyn Filter>, CalibrationError> {
    let law = law.to_model().ok_or_else(|| CalibrationError::Unsupported("number of branches".into()))?;
    let model = SwitchedModel::<f64, M, B, N>::new(law, motion, estimator.noise.to_model())?;
    let belief: Belief<f64, N, L> = initial_belief(&model, limits, start);
    let limits = limits.to_model();
    let interval = Interval {
        limits,
        filtered_scale: estimator.strain_sd_scale,
        smoothed_scale: estimator.smoothed_sd_scale.unwrap_or(1.0),
    };
    match kind {
        EstimatorKind::Ekf => return Ok(Box::new(Running::new(Ekf::new(model), belief, model, interval))),
        EstimatorKind::Ukf => {
            return Ok(Box::new(Running::new(Ukf::new(Unscented::new(model)), belief, model, interval)));
        }
        EstimatorKind::Ensemble => return Err(CalibrationError::no_parameters(kind)),
        _ => {}
    }
    let phases = estimator
        .phases
        .ok_or_else(|| CalibrationError::Unsupported(format!("`{}` needs `phases` in its parameters", kind.name())))?;
    let dwell = Dwell::new(phases.hold_time_s, phases.move_time_s, phases.reversal)?;
    let evidence = Evidence { limits, tempering: phases.tempering };
    Ok(match kind {
        EstimatorKind::Imm => {
            let start = Mixture::single(belief, Phase::Hold);
            Box::new(Running::new(Imm::new(model, dwell, evidence), start, model, interval))
        }
        EstimatorKind::SignSplit => {
            let start = Mixture::single(belief, Phase::Extend);
            let hold = (phases.hold_time_s > 0.0 && phases.reversal < 1.0).then_some(dwell);
            let filter = SignSplit::<_, _, HYPOTHESES>::new(model, hold, evidence);
            Box::new(Running::new(filter, start, model, interval))
        }
        EstimatorKind::Particles => {
            let hold = (phases.hold_time_s > 0.0 && phases.reversal < 1.0).then_some(dwell);
            let filter = Particles::new(model, hold, evidence, PARTICLES, PARTICLE_SEED);
            let start = filter.start(&belief, Phase::Extend);
            Box::new(Running::new(filter, start, model, interval))
        }
        _ => {
            let start = Mixture::single(belief, Phase::Hold);
            let filter = Hypotheses::<_, _, HISTORIES>::new(model, dwell, evidence);
            Box::new(Running::new(filter, start, model, interval))
        }
    })
}

/// Capacity of the sign-split filter.
pub(crate) const HYPOTHESES: usize = 8;
/// Capacity of the filter of phase histories.
pub(crate) const HISTORIES: usize = 16;
/// Particles, and the seed of their paths: the same readings give the same estimates.
const PARTICLES: usize = 4000;
const PARTICLE_SEED: u64 = 1;

fn initial_belief<const M: usize, const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<f64, M, B, N>,
    limits: RangeParams,
    start: Start,
) -> Belief<f64, N, L> {
    let Start::Strain(strain) = start else { return Belief::initial(model) };
    let (mut mean, mut variance) = model.initial_distribution();
    (mean[0], variance[0]) = (strain, (START_SD * limits.span()).powi(2));
    Belief::independent(mean, &variance)
}
