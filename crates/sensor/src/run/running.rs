use std::collections::VecDeque;
use std::mem;
use std::sync::Arc;

use ohmstrain_ekf::correction::{FILTER_INPUTS, mixture};
use ohmstrain_ekf::live::{
    Correct, Doubts, Flags, LiveFilter, LiveParts, LiveRow, Measured, SensorEstimator, StaticCurve,
};
use ohmstrain_ekf::{Estimate, Estimator, Gaussian, PastStep, PlainState, Reading, Settling, State, StepError};
use ohmstrain_model::{StrainRange, SwitchedModel};

use crate::run::backward::{Backward, KeptStep};
use crate::run::clock::{Clock, floored};
use crate::run::learned::{Learned, OfFilter};
use crate::run::options::Options;
use crate::run::pending::{LiveStep, Pending, Reported};
use crate::run::remembering::Remembering;
use crate::run::stored::{Numbers, Stored, Waiting};
use crate::run::turns::Turns;
use crate::run::{Filter, Output};

/// The live filter on a computer.
pub(crate) type Live<E, const N: usize, const L: usize> =
    LiveFilter<f64, Remembering<E, <E as Estimator<f64, N, L>>::Prepared>, SharedCorrection, N, L>;

/// A row, and the data of its step that a smoother needs.
pub(crate) type KeptRow<E, const N: usize, const L: usize> =
    (LiveRow<f64, <E as Estimator<f64, N, L>>::State>, LiveStep<E, N, L>);

/// The learned correction of a sensor, shared by its filters.
#[derive(Clone)]
pub(crate) struct SharedCorrection(pub Arc<OfFilter>);

impl Correct<f64> for SharedCorrection {
    fn correct(&self, inputs: &[f64; FILTER_INPUTS], filtered: Gaussian<f64>, birge: f64) -> Gaussian<f64> {
        self.0.correction().correct(inputs, filtered, birge).strain
    }
}

/// A live filter with rows waiting for later readings.
pub(crate) struct Running<E: SensorEstimator<f64, N, L>, const B: usize, const N: usize, const L: usize> {
    pub live: Live<E, N, L>,
    pub clock: Clock,
    reports: Reports<B, N>,
    /// The smoother's correction.
    pub learned: Option<Arc<Learned>>,
    /// The last row.
    last: Option<LiveRow<f64, E::State>>,
    pending: VecDeque<Pending<E, N, L>>,
    /// Estimates to be emitted, newest first.
    due: Vec<Output>,
}

/// Conversion from states to reported estimates.
#[derive(Clone, Copy)]
pub(crate) struct Reports<const B: usize, const N: usize> {
    pub model: SwitchedModel<f64, B, N>,
    pub limits: StrainRange<f64>,
    /// Curve that gives the strain in place of the estimator.
    pub curve: Option<StaticCurve<f64>>,
    pub settling: Settling<f64>,
    /// Factors on the strain's standard deviation.
    pub filtered_scale: f64,
    pub smoothed_scale: f64,
    /// True if doubts widen intervals.
    pub doubts: bool,
}

impl<const B: usize, const N: usize> Reports<B, N> {
    /// Returns the output for a state, before any correction.
    pub(crate) fn row<S: State<f64, N, L>, const L: usize>(
        &self,
        state: &S,
        measured: &Measured<f64>,
        sd_scale: f64,
    ) -> Output {
        let mut estimate = Estimate::new(&self.model, state, &self.limits, sd_scale, &self.settling);
        if let Some(strain) = self.curve.and_then(|curve| measured.on_curve(&curve)) {
            estimate.strain = strain;
        }
        Output {
            estimate,
            nis: measured.nis,
            verdict: measured.verdict,
            phases: state.phases(),
            reading: measured.reading,
            doubts: Flags::NONE,
            doubted: 0.0,
            rest_off: 0.0,
        }
    }
}

impl<E, const B: usize, const N: usize, const L: usize> Running<E, B, N, L>
where
    E: SensorEstimator<f64, N, L>,
{
    /// Starts before any row.
    pub(crate) fn new(
        estimator: Remembering<E, E::Prepared>,
        parts: LiveParts<f64, SharedCorrection>,
        reports: Reports<B, N>,
        learned: Option<Arc<Learned>>,
        options: &Options,
    ) -> Self {
        let longest_step_s = floored(estimator.longest_step_s().min(parts.longest_step_s));
        let live = LiveFilter::new(estimator, LiveParts { longest_step_s, ..parts }).on_curve(reports.curve);
        let mut live = live.protected_by(options.protections).guarded_by(options.guard);
        if let Some(strain) = options.start.strain() {
            live.start_at(Some(strain));
        }
        let (pending, due) = (VecDeque::new(), Vec::new());
        Self { live, clock: Clock::default(), reports, learned, last: None, pending, due }
    }

    /// Takes the next row. Never inlined, so that a program contains it once for each estimator and size.
    #[inline(never)]
    pub(crate) fn row(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<LiveRow<f64, E::State>, StepError> {
        if reading.is_some_and(|reading| !reading.value.is_finite()) {
            return Err(StepError::NonFiniteReading);
        }
        let (clock, dt_s) = self.clock.at(time_s)?;
        let row = self.live.row_after(dt_s, reading)?;
        self.clock = clock;
        Ok(row)
    }

    /// Takes the next row, and returns the data that a smoother needs as well.
    pub(crate) fn kept_row(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
    ) -> Result<KeptRow<E, N, L>, StepError> {
        let ends_fault = self.ends_fault(time_s, reading);
        let before = if ends_fault { self.live.kept().0 } else { self.live.state() }.clone();
        let row = self.row(time_s, reading)?;
        let step = match &row.look {
            None => KeptStep::Read(self.live.past_step(&before, &row.measured)),
            Some(look) => {
                let whole = self.live.substeps().prepare_whole(row.pause);
                let whole = whole.map(|prepared| Box::new(PastStep { from: before, prepared, reading: None }));
                KeptStep::Unread { predicted: Box::new(look.clone()), whole }
            }
        };
        Ok((row, step))
    }

    /// True if a fault ends with this reading.
    fn ends_fault(&self, time_s: f64, reading: Option<Reading<f64>>) -> bool {
        let reading = reading.filter(|reading| reading.value.is_finite());
        self.clock.at(time_s).is_ok_and(|(_, dt_s)| self.live.ends_fault(dt_s, reading))
    }

    /// Notes a turn of the readings at the last row.
    pub(crate) fn watch(&self, turns: &mut Turns, time_s: f64, measured: &Measured<f64>) {
        if let Some(watch) = self.live.doubts().turns().filter(|_| measured.used.is_some()) {
            turns.see(time_s, watch);
        }
    }

    /// Output of a smoother at a row.
    pub(crate) fn smoothed_row(&self, state: &E::State, measured: &Measured<f64>) -> Output {
        self.reports.row(state, measured, self.reports.smoothed_scale)
    }

    /// Widens the strain's interval by the doubts, if there are any.
    fn widen(&self, output: &mut Output, doubts: &Doubts<f64>, stated: Gaussian<f64>, (variance, flags): (f64, Flags)) {
        if self.reports.doubts {
            output.widen(doubts, stated, variance);
            output.doubts = flags;
        } else {
            output.estimate.strain = stated;
        }
    }

    /// Returns the output of a row given later readings. If there is a correction, it is mixed with the row's first estimate.
    /// The doubts are those of the row's time.
    fn lagged_row(&self, state: &E::State, reported: &Reported) -> Output {
        let scale = self.reports.filtered_scale.max(self.reports.smoothed_scale);
        let mut output = self.reports.row(state, &reported.measured, scale);
        output.rest_off = reported.rest_off;
        let lagged = output.estimate.strain;
        let stated = reported.corrected.map_or(lagged, |(corrected, birge)| {
            mixture([corrected, Gaussian { variance: lagged.variance * birge, ..lagged }])
        });
        let open = if reported.measured.used.is_some() { stated.variance } else { reported.doubts.open(stated) };
        let widened = reported.doubts.widened(Gaussian { variance: open, ..stated }, output.estimate.rate.mean);
        self.widen(&mut output, &reported.doubts, stated, widened);
        output
    }

    /// Emits the first `count` waiting rows, smoothed from the state `last`.
    fn emit(&mut self, count: usize, last: E::State, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        let mut due = mem::take(&mut self.due);
        let mut back = Backward::new(last);
        let mut waiting = self.pending.iter().enumerate().rev().take_while(|_| count > 0);
        let smoothed = waiting.try_for_each(|(place, Pending { time_s, reported, row })| {
            let show = |state: &E::State| {
                if place < count {
                    due.push(self.lagged_row(state, reported));
                }
            };
            back.over(self.live.substeps(), *time_s, row, place > 0, show)
        });
        if smoothed.is_ok() {
            due.iter().rev().for_each(|output| out(*output));
            self.pending.drain(..count);
        }
        due.clear();
        self.due = due;
        smoothed
    }

    /// Returns the state after a row, before a second look of the filter: no backward step exists over its newly created
    /// hypothesis.
    fn state_after(&self, measured: &Measured<f64>, row: &LiveStep<E, N, L>) -> Result<E::State, StepError> {
        match row {
            KeptStep::Read(step) if measured.jumped.is_some() => {
                let taken = self.live.substeps().advance(&step.from, &step.prepared, step.reading)?;
                Ok(taken.state)
            }
            _ => Ok(self.live.state().clone()),
        }
    }
}

impl<E, const B: usize, const N: usize, const L: usize> Filter for Running<E, B, N, L>
where
    E: SensorEstimator<f64, N, L, State: Send + PlainState<f64>, Prepared: Send> + Send,
{
    fn rest(&mut self, measured: f64) -> Result<(), StepError> {
        self.live.rest(measured)
    }

    fn settle(&mut self) {
        self.live.settle();
        self.pending.iter_mut().for_each(|row| row.reported.doubts.settle());
    }

    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        self.last = Some(self.row(time_s, reading)?);
        Ok(())
    }

    fn strain(&self) -> Gaussian<f64> {
        self.last.as_ref().map_or_else(|| self.output().estimate.strain, |row| row.estimate.strain)
    }

    fn output(&self) -> Output {
        let scale = self.reports.filtered_scale;
        let Some(row) = &self.last else { return self.reports.row(self.live.state(), &Measured::nothing(), scale) };
        let state = row.look.as_ref().unwrap_or_else(|| self.live.state());
        let mut output = self.reports.row(state, &row.measured, scale);
        output.rest_off = self.live.rest_off();
        self.widen(&mut output, self.live.doubts(), row.stated, (row.estimate.strain.variance, row.doubts));
        output
    }

    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        lag_s: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError> {
        // Rows due before the time of this reading are estimated without it, and all those of a fault that it ends.
        let ends_fault = self.ends_fault(time_s, reading);
        let overdue = self.pending.partition_point(|row| ends_fault || row.time_s + lag_s < time_s);
        let now = self.live.state().clone();
        self.emit(overdue, now, out)?;
        let doubts = if ends_fault { self.live.kept().1 } else { self.live.doubts() };
        let birge = doubts.birge();
        let (row, step) = self.kept_row(time_s, reading)?;
        let state = self.state_after(&row.measured, &step)?;
        let corrected = self.live.is_corrected().then_some((row.stated, birge));
        let reported =
            Reported { measured: row.measured, corrected, doubts: *self.live.doubts(), rest_off: self.live.rest_off() };
        self.pending.push_back(Pending { time_s, reported, row: step });
        // No row waits for readings after a jump.
        let jumped = row.measured.jumped.is_some();
        let due = self.pending.partition_point(|row| jumped || row.time_s + lag_s <= time_s);
        self.last = Some(row);
        self.emit(due, state, out)
    }

    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        let now = self.live.state().clone();
        self.emit(self.pending.len(), now, out)
    }

    fn store(&self) -> Result<toml::Table, toml::ser::Error> {
        let numbers = |state| Ok::<_, toml::ser::Error>(Numbers::of(&state));
        let last = self.last.as_ref().map(|row| row.clone().try_map(numbers));
        toml::Table::try_from(Stored {
            clock: self.clock,
            memory: self.live.memory().try_map(numbers)?,
            last: last.transpose()?,
            waiting: self.pending.iter().map(Waiting::of).collect(),
        })
    }

    fn resume(&mut self, stored: toml::Table) -> Result<(), toml::de::Error> {
        let Stored { clock, memory, last, waiting } = stored.try_into()?;
        let memory = memory.try_map(Numbers::state)?;
        let last = last.map(|row| row.try_map(Numbers::state)).transpose()?;
        let waiting = waiting.into_iter().map(|row| row.pending(self.live.substeps()));
        self.pending = waiting.collect::<Result<_, _>>()?;
        self.live.return_to(&memory);
        (self.clock, self.last) = (clock, last);
        Ok(())
    }
}
