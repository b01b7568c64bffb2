use std::collections::HashMap;

use ohmstrain_ekf::{
    Belief, Channel, Dynamics, Ekf, Estimate, Gaussian, Hypotheses, Imm, Mixture, Reading, SignSplit, Step, StepError,
    rts_smooth_vec,
};
use ohmstrain_model::{StrainRange, SwitchedModel, SwitchedStep};

use crate::filter::{Filter, HISTORIES, HYPOTHESES, Output};

/// What one step of an estimator leaves behind.
pub(crate) struct Advanced<State, Kept> {
    state: State,
    nis: Option<f64>,
    kept: Kept,
}

/// What the estimators have in common: a state that a prepared step turns into another one.
pub(crate) trait Estimator<const M: usize, const B: usize, const N: usize, const L: usize> {
    /// What is carried from step to step.
    type State: Clone;
    /// What a smoother keeps of a step.
    type Kept;

    fn advance(
        &self,
        state: &Self::State,
        prepared: &SwitchedStep<f64, M, B>,
        reading: Option<Reading<f64>>,
    ) -> Result<Advanced<Self::State, Self::Kept>, StepError>;

    fn belief(state: &Self::State) -> Belief<f64, N, L>;

    fn phases(_: &Self::State) -> Option<[f64; 3]> {
        None
    }

    /// Beliefs given all readings; `None` if the estimator has no smoother.
    fn smoothed(_: &[Self::Kept]) -> Option<Vec<Belief<f64, N, L>>> {
        None
    }
}

impl<Mo, const M: usize, const B: usize, const N: usize, const L: usize> Estimator<M, B, N, L> for Ekf<Mo>
where
    Mo: Dynamics<f64, N, L, Prepared = SwitchedStep<f64, M, B>> + Channel<f64, N, L>,
{
    type State = Belief<f64, N, L>;
    type Kept = Step<f64, N, L>;

    fn advance(
        &self,
        state: &Self::State,
        prepared: &SwitchedStep<f64, M, B>,
        reading: Option<Reading<f64>>,
    ) -> Result<Advanced<Self::State, Self::Kept>, StepError> {
        let step = self.step_prepared(state, prepared, reading)?;
        Ok(Advanced { state: step.posterior, nis: step.update.map(|update| update.nis), kept: step })
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
            ) -> Result<Advanced<Self::State, ()>, StepError> {
                let step = self.step_prepared(state, prepared, prepared.dt_s(), reading)?;
                Ok(Advanced { state: step.posterior, nis: step.nis, kept: () })
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
pub(crate) struct Running<E: Estimator<M, B, N, L>, const M: usize, const B: usize, const N: usize, const L: usize> {
    estimator: E,
    state: E::State,
    model: SwitchedModel<f64, M, B, N>,
    interval: Interval,
    last_time_s: Option<f64>,
    nis: Option<f64>,
    prepared: HashMap<u64, SwitchedStep<f64, M, B>>,
}

/// How strain is reported: within limits, its standard deviation times a calibrated factor.
#[derive(Clone, Copy)]
pub(crate) struct Interval {
    pub limits: StrainRange<f64>,
    pub filtered_scale: f64,
    pub smoothed_scale: f64,
}

/// Recordings repeat a few hundred step lengths; a stream whose steps never repeat must not fill the memory.
const MOST_PREPARED: usize = 4096;

impl<E: Estimator<M, B, N, L>, const M: usize, const B: usize, const N: usize, const L: usize> Running<E, M, B, N, L> {
    pub(crate) fn new(estimator: E, state: E::State, model: SwitchedModel<f64, M, B, N>, interval: Interval) -> Self {
        Self { estimator, state, model, interval, last_time_s: None, nis: None, prepared: HashMap::new() }
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
        let advanced = self.estimator.advance(&self.state, &prepared, reading)?;
        (self.state, self.nis, self.last_time_s) = (advanced.state, advanced.nis, Some(time_s));
        Ok(advanced.kept)
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

    fn estimate(&self, belief: &Belief<f64, N, L>, sd_scale: f64) -> Estimate<f64> {
        let mut estimate = Estimate::new(&self.model, belief, &self.interval.limits);
        estimate.strain.variance *= sd_scale * sd_scale;
        estimate
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
        let variance = belief.covariance[(0, 0)] * self.interval.filtered_scale.powi(2);
        Gaussian { mean: belief.mean[0], variance }.clamped(&self.interval.limits)
    }

    fn output(&self) -> Output {
        let estimate = self.estimate(&E::belief(&self.state), self.interval.filtered_scale);
        Output { estimate, nis: self.nis, phases: E::phases(&self.state) }
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
        let output =
            |(belief, nis)| Output { estimate: self.estimate(belief, self.interval.smoothed_scale), nis, phases: None };
        Ok(Some(smoothed.iter().zip(nis).map(output).collect()))
    }
}
