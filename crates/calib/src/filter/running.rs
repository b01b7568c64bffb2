use std::collections::VecDeque;
use std::mem;

use ohmstrain_ekf::live::{BESIDE_SHARE, Sieve};
use ohmstrain_ekf::{
    Estimate, Estimator, Gaussian, Guard, PastStep, Reading, Repeated, Settling, State, StepError, smooth_back_through,
};
use ohmstrain_model::{StrainRange, SwitchedModel};

use crate::filter::stepper::{Moment, Seen, Stepper};
use crate::filter::way_back::Segments;
use crate::filter::{Filter, Output, Rows, WayBack};

/// An estimator with its state.
pub(crate) struct Running<E: Estimator<f64, N, L>, const B: usize, const N: usize, const L: usize> {
    pub stepper: Stepper<E, N, L>,
    model: SwitchedModel<f64, B, N>,
    interval: Interval,
    pub now: Moment<E::State>,
    /// Before any reading, where nothing is known.
    unknown: E::State,
    pending: VecDeque<Pending<E::State, Repeated<E::Prepared>>>,
    /// Estimates on their way out, newest first.
    due: Vec<Output>,
}

/// How estimates are reported: strain within limits, its standard deviation times a calibrated factor.
#[derive(Clone, Copy)]
pub(crate) struct Interval {
    pub limits: StrainRange<f64>,
    pub filtered_scale: f64,
    pub smoothed_scale: f64,
    pub settling: Settling<f64>,
    /// What a reading must be for the filter to see it.
    pub sieve: Sieve<f64>,
}

/// A row whose estimate waits for later readings.
struct Pending<S, P> {
    time_s: f64,
    seen: Seen,
    /// The step that leads to the next row, once there is one.
    onward: Option<PastStep<S, P, f64>>,
}

impl<E, const B: usize, const N: usize, const L: usize> Running<E, B, N, L>
where
    E: Estimator<f64, N, L>,
{
    /// From a state, and that of an unknown start.
    pub(crate) fn new(
        estimator: E,
        [start, unknown]: [E::State; 2],
        model: SwitchedModel<f64, B, N>,
        interval: Interval,
    ) -> Self {
        let (pending, due) = (VecDeque::new(), Vec::new());
        let reading_variance = model.noise().reading_sd.powi(2);
        let stepper = Stepper::new(estimator, interval.sieve, reading_variance);
        Self { stepper, model, interval, now: Moment::start(start), unknown, pending, due }
    }

    fn output(&self, state: &E::State, seen: Seen, sd_scale: f64) -> Output {
        let estimate = Estimate::new(&self.model, state, &self.interval.limits, sd_scale, &self.interval.settling);
        Output {
            estimate,
            nis: seen.innovation.map(|innovation| innovation.nis),
            verdict: seen.verdict,
            phases: state.phases(),
            startled: seen.startled,
        }
    }

    /// Follows what was known before any reading, too, where readings have jumped. A smoother, which sees them from both sides,
    /// does without.
    fn look_again(&mut self) {
        if self.now.seen.startled.is_some() {
            *self.now.state = self.now.state.beside(&self.unknown, BESIDE_SHARE);
        }
    }

    /// What a smoother says at a row.
    pub(crate) fn smoothed_output(&self, state: &E::State, seen: Seen) -> Output {
        self.output(state, seen, self.interval.smoothed_scale)
    }

    /// Hands out the first `count` of the rows that wait, given everything up to now.
    fn emit(&mut self, count: usize, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        if count == 0 {
            return Ok(());
        }
        let scale = self.interval.filtered_scale.max(self.interval.smoothed_scale);
        let mut due = mem::take(&mut self.due);
        let waiting = self.pending.len();
        let mut row = waiting - 1;
        let steps = self.pending.iter().rev().filter_map(|pending| pending.onward.as_ref());
        let smoothed = smooth_back_through(&self.stepper.estimator, &self.now.state, steps, |state| {
            row -= 1;
            if row < count {
                due.push(self.output(state, self.pending[row].seen, scale));
            }
            row > 0
        });
        if smoothed == Ok(true) {
            due.iter().rev().for_each(|output| out(*output));
        }
        due.clear();
        self.due = due;
        if !smoothed? {
            return Err(StepError::NoSmoother);
        }
        if count == waiting {
            out(self.output(&self.now.state, self.now.seen, scale));
        }
        self.pending.drain(..count);
        Ok(())
    }
}

impl<E, const B: usize, const N: usize, const L: usize> Filter for Running<E, B, N, L>
where
    E: Estimator<f64, N, L, State: Send, Prepared: Send> + Send,
{
    fn guard(&mut self, guard: Guard<f64>) {
        self.stepper.guard = guard;
    }

    fn sieve(&mut self, sieve: Sieve<f64>) {
        self.stepper.sieve = sieve.with_error_time(self.stepper.sieve.error_time_s);
    }

    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        self.stepper.advance_only(&mut self.now, time_s, reading)?;
        self.look_again();
        Ok(())
    }

    fn strain(&self) -> Gaussian<f64> {
        let Gaussian { mean, variance } = self.now.state.marginal(0);
        let variance = variance * self.interval.filtered_scale.powi(2);
        Gaussian { mean, variance }.clamped(&self.interval.limits)
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
        let (now, step) = self.stepper.advance(&self.now, time_s, reading)?;
        self.now = now;
        if let Some(before) = self.pending.back_mut() {
            before.onward = Some(step);
        }
        self.pending.push_back(Pending { time_s, seen: self.now.seen, onward: None });
        // Nothing leads back over a hypothesis that comes from nowhere: no row waits for what is after it.
        let startled = self.now.seen.startled.is_some();
        let due = self.pending.partition_point(|row| startled || row.time_s + lag_s <= time_s);
        self.emit(due, out)?;
        self.look_again();
        Ok(())
    }

    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        self.emit(self.pending.len(), out)
    }

    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)> {
        Ok(Box::new(Segments::new(self, rows)?))
    }
}
