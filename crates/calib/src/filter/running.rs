use std::collections::VecDeque;
use std::mem;

use ohmstrain_ekf::live::{BESIDE_SHARE, Sieve};
use ohmstrain_ekf::{Estimate, Estimator, Gaussian, Guard, Reading, Settling, State, StepError};
use ohmstrain_model::{StrainRange, SwitchedModel};

use crate::filter::backward::Backward;
use crate::filter::stepper::{Moment, Row, Seen, Stepper};
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
    pending: VecDeque<Pending<E, N, L>>,
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
    /// Whether the strain is known at the first row.
    pub starts_known: bool,
}

/// A row whose estimate waits for later readings.
struct Pending<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    time_s: f64,
    seen: Seen,
    row: Row<E, N, L>,
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
        Self { stepper, model, interval, now: Moment::start(start, interval.starts_known), unknown, pending, due }
    }

    fn output_of(&self, state: &E::State, seen: Seen, sd_scale: f64) -> Output {
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
        self.output_of(state, seen, self.interval.smoothed_scale)
    }

    /// Hands out the first `count` of the rows that wait, given everything up to now.
    fn emit(&mut self, count: usize, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        let scale = self.interval.filtered_scale.max(self.interval.smoothed_scale);
        let mut due = mem::take(&mut self.due);
        let mut back = Backward::new((*self.now.state).clone());
        let mut smoothed = Ok(true);
        for (place, Pending { time_s, seen, row }) in self.pending.iter().enumerate().rev().take_while(|_| count > 0) {
            let show = |state: &E::State| {
                if place < count {
                    due.push(self.output_of(state, *seen, scale));
                }
            };
            smoothed = back.over(&self.stepper.estimator, *time_s, row, place > 0, show);
            if smoothed != Ok(true) {
                break;
            }
        }
        if smoothed == Ok(true) {
            due.iter().rev().for_each(|output| out(*output));
            self.pending.drain(..count);
        }
        due.clear();
        self.due = due;
        if smoothed? { Ok(()) } else { Err(StepError::NoSmoother) }
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
        let Gaussian { mean, variance } = self.now.shown().marginal(0);
        let variance = variance * self.interval.filtered_scale.powi(2);
        Gaussian { mean, variance }.clamped(&self.interval.limits)
    }

    fn output(&self) -> Output {
        self.output_of(self.now.shown(), self.now.seen, self.interval.filtered_scale)
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
        let (now, row) = self.stepper.advance(&self.now, time_s, reading)?;
        self.now = now;
        self.pending.push_back(Pending { time_s, seen: self.now.seen, row });
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
