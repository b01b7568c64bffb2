use std::collections::{HashMap, VecDeque};

use ohmstrain_ekf::{
    Advanced, Belief, Estimate, Estimator, Gaussian, Guard, Guarded, Innovation, PastStep, Reading, ReadingVerdict,
    State, StepError, StrainSensor, Streak, smooth_back_through,
};
use ohmstrain_model::StrainRange;

use crate::filter::{Filter, Output};

/// An estimator with its state and the steps it has prepared.
pub(crate) struct Running<E: Estimator<f64, N, L>, S, const M: usize, const B: usize, const N: usize, const L: usize> {
    estimator: E,
    model: S,
    interval: Interval,
    guard: Guard<f64>,
    now: Moment<E::State>,
    prepared: HashMap<u64, E::Prepared>,
    pending: VecDeque<Pending<E::State, E::Prepared>>,
}

/// How strain is reported: within limits, its standard deviation times a calibrated factor.
#[derive(Clone, Copy)]
pub(crate) struct Interval {
    pub limits: StrainRange<f64>,
    pub filtered_scale: f64,
    pub smoothed_scale: f64,
}

/// Where a filter is.
#[derive(Clone)]
struct Moment<S> {
    time_s: Option<f64>,
    state: S,
    streak: Streak,
    seen: Seen,
}

/// What a row's reading said.
#[derive(Clone, Copy)]
struct Seen {
    innovation: Option<Innovation<f64>>,
    verdict: ReadingVerdict,
}

/// A row whose estimate waits for later readings.
struct Pending<S, P> {
    time_s: f64,
    seen: Seen,
    /// The step that leads to the next row, once there is one.
    onward: Option<PastStep<S, P, f64>>,
}

/// Recordings repeat a few hundred step lengths; a stream whose steps never repeat must not fill the memory.
const MOST_PREPARED: usize = 4096;
/// Rows of a recording whose states are in memory at once while it is smoothed; the others are computed again.
const SMOOTHED_AT_ONCE: usize = 4096;

impl<E, S, const M: usize, const B: usize, const N: usize, const L: usize> Running<E, S, M, B, N, L>
where
    E: Estimator<f64, N, L>,
    S: StrainSensor<f64, M, B, N>,
{
    pub(crate) fn new(estimator: E, state: E::State, model: S, interval: Interval) -> Self {
        let seen = Seen { innovation: None, verdict: ReadingVerdict::Missing };
        let now = Moment { time_s: None, state, streak: Streak::default(), seen };
        let (guard, prepared, pending) = (Guard::none(), HashMap::new(), VecDeque::new());
        Self { estimator, model, interval, guard, now, prepared, pending }
    }

    /// One step; the filter changes only if it succeeds.
    fn advance(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<PastStep<E::State, E::Prepared, f64>, StepError> {
        let prepared = self.prepare_until(time_s)?;
        let Moment { state, streak, .. } = &self.now;
        let Guarded { advanced, from, used, verdict, streak } =
            self.guard.advance(&self.estimator, state, *streak, &prepared, reading)?;
        let Advanced { state, innovation } = advanced;
        self.now = Moment { time_s: Some(time_s), state, streak, seen: Seen { innovation, verdict } };
        Ok(PastStep { from, prepared, reading: used })
    }

    /// The prepared step to a time, remembered by its length in nanoseconds: differences of decimal times repeat to
    /// rounding only.
    fn prepare_until(&mut self, time_s: f64) -> Result<E::Prepared, StepError> {
        let dt_s = time_s - self.now.time_s.unwrap_or(time_s);
        if !dt_s.is_finite() {
            return Err(StepError::NonFiniteTimeStep);
        }
        if dt_s < 0.0 {
            return Err(StepError::NegativeTimeStep);
        }
        let nanoseconds = (dt_s * 1e9).round();
        if self.prepared.len() >= MOST_PREPARED {
            self.prepared.clear();
        }
        let estimator = &self.estimator;
        let remembered = self.prepared.entry(nanoseconds as u64);
        Ok(*remembered.or_insert_with(|| estimator.prepare(nanoseconds * 1e-9)))
    }

    fn output(&self, state: &E::State, seen: Seen, sd_scale: f64) -> Output {
        Output {
            estimate: Estimate::new(&self.model, state, &self.interval.limits, sd_scale),
            nis: seen.innovation.map(|innovation| innovation.nis()),
            verdict: seen.verdict,
            phases: state.phases(),
        }
    }

    /// Goes through rows forward from `start` and hands each step, and what was seen at its end, to `visit`.
    fn replay(
        &mut self,
        start: &Moment<E::State>,
        rows: impl Iterator<Item = (usize, (f64, Option<Reading<f64>>))>,
        mut visit: impl FnMut(&Self, PastStep<E::State, E::Prepared, f64>),
    ) -> Result<(), (usize, StepError)> {
        self.now = start.clone();
        for (row, (time_s, reading)) in rows {
            let step = self.advance(time_s, reading).map_err(|error| (row, error))?;
            visit(self, step);
        }
        Ok(())
    }

    /// Hands out the first `count` of the rows that wait, given everything up to now.
    fn emit(&mut self, count: usize, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        if count == 0 {
            return Ok(());
        }
        let scale = self.interval.filtered_scale.max(self.interval.smoothed_scale);
        let mut earlier = Vec::new();
        let waiting = self.pending.len();
        let mut row = waiting - 1;
        let steps = self.pending.iter().rev().filter_map(|pending| pending.onward.as_ref());
        smooth_back_through(&self.estimator, &self.now.state, steps, |state| {
            row -= 1;
            if row < count {
                earlier.push(self.output(state, self.pending[row].seen, scale));
            }
            row > 0
        })?;
        for output in earlier.into_iter().rev() {
            out(output);
        }
        if count == waiting {
            out(self.output(&self.now.state, self.now.seen, scale));
        }
        self.pending.drain(..count);
        Ok(())
    }
}

impl<E, S, const M: usize, const B: usize, const N: usize, const L: usize> Filter for Running<E, S, M, B, N, L>
where
    E: Estimator<f64, N, L>,
    S: StrainSensor<f64, M, B, N>,
{
    fn guard(&mut self, guard: Guard<f64>) {
        self.guard = guard;
    }

    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        if !self.guard.is_none() {
            return self.advance(time_s, reading).map(|_| ());
        }
        // Nothing is turned down and nobody goes back: no state needs to be kept.
        let prepared = self.prepare_until(time_s)?;
        let Advanced { state, innovation } = self.estimator.advance(&self.now.state, &prepared, reading)?;
        let verdict = if innovation.is_some() { ReadingVerdict::Accepted } else { ReadingVerdict::Missing };
        self.now.time_s = Some(time_s);
        self.now.state = state;
        self.now.seen = Seen { innovation, verdict };
        Ok(())
    }

    fn strain(&self) -> Gaussian<f64> {
        let belief: Belief<f64, N, L> = self.now.state.moments();
        let variance = belief.covariance[(0, 0)] * self.interval.filtered_scale.powi(2);
        Gaussian { mean: belief.mean[0], variance }.clamped(&self.interval.limits)
    }

    fn output(&self) -> Output {
        self.output(&self.now.state, self.now.seen, self.interval.filtered_scale)
    }

    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        lag_s: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError> {
        // Rows that fall due before this reading was taken do not get to see it.
        let overdue = self.pending.partition_point(|row| row.time_s + lag_s < time_s);
        self.emit(overdue, out)?;
        let step = self.advance(time_s, reading)?;
        if let Some(before) = self.pending.back_mut() {
            before.onward = Some(step);
        }
        self.pending.push_back(Pending { time_s, seen: self.now.seen, onward: None });
        let due = self.pending.partition_point(|row| row.time_s + lag_s <= time_s);
        self.emit(due, out)
    }

    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        self.emit(self.pending.len(), out)
    }

    fn smooth(
        &mut self,
        time_s: &[f64],
        readings: &[Option<Reading<f64>>],
    ) -> Result<Option<Vec<Output>>, (usize, StepError)> {
        let rows = || time_s.iter().copied().zip(readings.iter().copied()).enumerate();
        let mut checkpoints = vec![self.now.clone()];
        let mut seen = Vec::with_capacity(time_s.len());
        self.replay(&self.now.clone(), rows(), |running, _| {
            seen.push(running.now.seen);
            if seen.len() % SMOOTHED_AT_ONCE == 0 {
                checkpoints.push(running.now.clone());
            }
        })?;
        let end = self.now.clone();
        let mut smoothed = end.state.clone();
        let mut outputs = Vec::with_capacity(time_s.len());
        for (chunk, start) in checkpoints.iter().enumerate().rev() {
            let first = chunk * SMOOTHED_AT_ONCE;
            let mut steps = Vec::new();
            let of_chunk = rows().skip(first).take(SMOOTHED_AT_ONCE);
            self.replay(start, of_chunk, |_, step| steps.push(step))?;
            for (k, step) in steps.iter().enumerate().rev() {
                let row = first + k;
                outputs.push(self.output(&smoothed, seen[row], self.interval.smoothed_scale));
                let back = self.estimator.smooth_back(&step.from, &step.prepared, step.reading, &smoothed);
                let Some(earlier) = back.map_err(|error| (row, error))? else { return Ok(None) };
                smoothed = earlier;
            }
        }
        self.now = end;
        outputs.reverse();
        Ok(Some(outputs))
    }
}
