use std::collections::HashMap;

use ohmstrain_ekf::{
    Belief, Dwell, Ekf, Estimate, Gaussian, Hypotheses, Imm, Mixture, Reading, SignSplit, Step, StepError, rts_smooth_vec,
};
use ohmstrain_model::{Motion, Phase, StrainRange, SwitchedModel, SwitchedStep};

use crate::CalibrationError;
use crate::params::{AnyMotion, EstimatorKind, EstimatorParams, LawParams, RangeParams, SensorParams};

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
    let estimator = params.estimator(kind)?;
    filter_from_parts(kind.unwrap_or(params.default_estimator), &params.law, estimator, params.limits, start)
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
    let belief = initial_belief(&model, limits, start);
    let limits = limits.to_model();
    if kind == EstimatorKind::Ekf {
        return Ok(Box::new(Running::new(Ekf::new(model), belief, model, limits)));
    }
    let phases = estimator.phases.ok_or_else(|| {
        CalibrationError::Unsupported(format!("`{}` needs `phases` in its parameters", kind.name()))
    })?;
    let dwell = Dwell::new(phases.hold_time_s, phases.move_time_s, phases.reversal)?;
    let tempering = phases.tempering;
    Ok(match kind {
        EstimatorKind::Ekf => Box::new(Running::new(Ekf::new(model), belief, model, limits)),
        EstimatorKind::Imm => {
            let start = Mixture::single(belief, Phase::Hold);
            Box::new(Running::new(Imm::new(model, dwell, limits, tempering), start, model, limits))
        }
        EstimatorKind::SignSplit => {
            let start = Mixture::<f64, N, L, HYPOTHESES>::single(belief, Phase::Extend);
            let hold = (phases.hold_time_s > 0.0 && phases.reversal < 1.0).then_some(dwell);
            Box::new(Running::new(SignSplit::new(model, hold, limits, tempering), start, model, limits))
        }
        EstimatorKind::Hypotheses => {
            let start = Mixture::<f64, N, L, HISTORIES>::single(belief, Phase::Hold);
            Box::new(Running::new(Hypotheses::new(model, dwell, limits, tempering), start, model, limits))
        }
    })
}

/// Capacity of the sign-split filter.
const HYPOTHESES: usize = 8;
/// Capacity of the filter of phase histories.
const HISTORIES: usize = 16;

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

/// What the estimators have in common: a state that a prepared step turns into another one.
trait Estimator<const M: usize, const B: usize, const N: usize, const L: usize> {
    /// What is carried from step to step.
    type State: Clone;
    /// What a smoother keeps of a step.
    type Kept;

    fn advance(
        &self,
        state: &Self::State,
        prepared: &SwitchedStep<f64, M, B>,
        reading: Option<Reading<f64>>,
    ) -> Result<(Self::State, Option<f64>, Self::Kept), StepError>;

    fn belief(state: &Self::State) -> Belief<f64, N, L>;

    fn phases(_: &Self::State) -> Option<[f64; 3]> {
        None
    }

    /// Beliefs given all readings; `None` if the estimator has no smoother.
    fn smoothed(_: &[Self::Kept]) -> Option<Vec<Belief<f64, N, L>>> {
        None
    }
}

impl<const M: usize, const B: usize, const N: usize, const L: usize> Estimator<M, B, N, L>
    for Ekf<SwitchedModel<f64, M, B, N>>
{
    type State = Belief<f64, N, L>;
    type Kept = Step<f64, N, L>;

    fn advance(
        &self,
        state: &Self::State,
        prepared: &SwitchedStep<f64, M, B>,
        reading: Option<Reading<f64>>,
    ) -> Result<(Self::State, Option<f64>, Self::Kept), StepError> {
        let step = self.step_prepared(state, prepared, reading)?;
        Ok((step.posterior, step.update.map(|update| update.nis), step))
    }

    fn belief(state: &Self::State) -> Belief<f64, N, L> {
        *state
    }

    fn smoothed(kept: &[Self::Kept]) -> Option<Vec<Belief<f64, N, L>>> {
        Some(rts_smooth_vec(kept))
    }
}

/// The three filters of phase hypotheses differ in their type only.
macro_rules! mixture_estimator {
    ($estimator:ident, $capacity:expr) => {
        impl<const M: usize, const B: usize, const N: usize, const L: usize> Estimator<M, B, N, L>
            for $estimator<f64, SwitchedModel<f64, M, B, N>>
        {
            type State = Mixture<f64, N, L, { $capacity }>;
            type Kept = ();

            fn advance(
                &self,
                state: &Self::State,
                prepared: &SwitchedStep<f64, M, B>,
                reading: Option<Reading<f64>>,
            ) -> Result<(Self::State, Option<f64>, ()), StepError> {
                let step = self.step_prepared(state, prepared, prepared.dt_s(), reading)?;
                Ok((step.posterior, step.nis, ()))
            }

            fn belief(state: &Self::State) -> Belief<f64, N, L> {
                state.moments()
            }

            fn phases(state: &Self::State) -> Option<[f64; 3]> {
                Some(state.phase_probabilities())
            }
        }
    };
}

mixture_estimator!(Imm, 3);
mixture_estimator!(SignSplit, HYPOTHESES);
mixture_estimator!(Hypotheses, HISTORIES);

/// An estimator with its state and the steps it has prepared.
struct Running<E: Estimator<M, B, N, L>, const M: usize, const B: usize, const N: usize, const L: usize> {
    estimator: E,
    state: E::State,
    model: SwitchedModel<f64, M, B, N>,
    limits: StrainRange<f64>,
    last_time_s: Option<f64>,
    nis: Option<f64>,
    prepared: HashMap<u64, SwitchedStep<f64, M, B>>,
}

/// Recordings repeat a few hundred step lengths; a stream whose steps never repeat must not fill the memory.
const MOST_PREPARED: usize = 4096;

impl<E: Estimator<M, B, N, L>, const M: usize, const B: usize, const N: usize, const L: usize> Running<E, M, B, N, L> {
    fn new(estimator: E, state: E::State, model: SwitchedModel<f64, M, B, N>, limits: StrainRange<f64>) -> Self {
        Self { estimator, state, model, limits, last_time_s: None, nis: None, prepared: HashMap::new() }
    }

    /// One step; the filter changes only if it succeeds.
    fn advance(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<E::Kept, StepError> {
        let dt_s = time_s - self.last_time_s.unwrap_or(time_s);
        if !dt_s.is_finite() {
            return Err(StepError::NonFiniteTimeStep);
        }
        if dt_s < 0.0 {
            return Err(StepError::NegativeTimeStep);
        }
        let prepared = self.prepare(dt_s);
        let (state, nis, kept) = self.estimator.advance(&self.state, &prepared, reading)?;
        (self.state, self.nis, self.last_time_s) = (state, nis, Some(time_s));
        Ok(kept)
    }

    /// The prepared step, remembered by its length in nanoseconds: differences of decimal times repeat to rounding only.
    fn prepare(&mut self, dt_s: f64) -> SwitchedStep<f64, M, B> {
        let nanoseconds = (dt_s * 1e9).round();
        if self.prepared.len() >= MOST_PREPARED {
            self.prepared.clear();
        }
        let model = &self.model;
        *self.prepared.entry(nanoseconds as u64).or_insert_with(|| model.prepare(nanoseconds * 1e-9))
    }

    fn output_of(&self, belief: &Belief<f64, N, L>, nis: Option<f64>, phases: Option<[f64; 3]>) -> Output {
        Output { estimate: Estimate::new(&self.model, belief, &self.limits), nis, phases }
    }
}

impl<E: Estimator<M, B, N, L>, const M: usize, const B: usize, const N: usize, const L: usize> Filter
    for Running<E, M, B, N, L>
{
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        self.advance(time_s, reading).map(|_| ())
    }

    fn strain(&self) -> Gaussian<f64> {
        let belief = E::belief(&self.state);
        Gaussian { mean: belief.mean[0], variance: belief.covariance[(0, 0)] }.clamped(&self.limits)
    }

    fn output(&self) -> Output {
        self.output_of(&E::belief(&self.state), self.nis, E::phases(&self.state))
    }

    fn smooth(
        &mut self,
        time_s: &[f64],
        readings: &[Option<Reading<f64>>],
    ) -> Result<Option<Vec<Output>>, (usize, StepError)> {
        let mut kept = Vec::with_capacity(time_s.len());
        let mut nis = Vec::with_capacity(time_s.len());
        for (row, (&time_s, &reading)) in time_s.iter().zip(readings).enumerate() {
            kept.push(self.advance(time_s, reading).map_err(|error| (row, error))?);
            nis.push(self.nis);
        }
        let Some(smoothed) = E::smoothed(&kept) else { return Ok(None) };
        Ok(Some(smoothed.iter().zip(nis).map(|(belief, nis)| self.output_of(belief, nis, None)).collect()))
    }
}
