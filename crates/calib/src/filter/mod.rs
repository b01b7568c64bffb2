//! Any filter behind one trait: what the kernels of `ohmstrain-ekf` become once a sensor says which of them it needs.

pub(crate) mod backward;
pub(crate) mod build;
pub(crate) mod corrected;
pub(crate) mod known;
pub(crate) mod learned;
pub(crate) mod portable;
pub(crate) mod running;
pub(crate) mod stepper;
pub(crate) mod way_back;

use std::ops::Range;

use ohmstrain_ekf::live::Sieve;
use ohmstrain_ekf::{Estimate, Gaussian, Guard, Reading, ReadingVerdict, StepError};

/// A filter for a sensor whose number of branches and kind of motion are known at run time only. Threads and tasks can own it.
pub trait Filter: Send {
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

    /// What a reading must be from now on; for how long errors are alike stays as it was calibrated.
    fn sieve(&mut self, sieve: Sieve<f64>);

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

    /// Filters a recording, from the state the filter is in, and goes back through it segment by segment: the way to smooth
    /// recordings that are too long to hold their states, or their estimates, in memory.
    ///
    /// # Errors
    /// The row at which a step failed, and why; the filter stays as it was.
    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)>;

    /// Smooths a whole recording, from the state the filter is in; `None` if the estimator has no smoother.
    ///
    /// # Errors
    /// The row at which a step failed, and why.
    fn smooth(
        &mut self,
        time_s: &[f64],
        readings: &[Option<Reading<f64>>],
    ) -> Result<Option<Vec<Output>>, (usize, StepError)> {
        let len = time_s.len().min(readings.len());
        let row = |row: usize| (time_s[row], readings[row]);
        let mut back = self.way_back(Rows::new(len, &row))?;
        let (mut segment, mut outputs, mut first) = (Vec::new(), Vec::with_capacity(len), len);
        while let Some(rows) = back.next_segment(&mut segment)? {
            outputs.extend(segment.iter().rev());
            first = rows.start;
        }
        outputs.reverse();
        Ok((first == 0).then_some(outputs))
    }
}

/// Rows of a recording, wherever they are kept.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    len: usize,
    row: &'a dyn Fn(usize) -> (f64, Option<Reading<f64>>),
}

impl<'a> Rows<'a> {
    /// `len` rows; `row` gives time, s, and the reading `R/R₀ - 1` of each, `None` where it is missing.
    #[must_use]
    pub fn new(len: usize, row: &'a dyn Fn(usize) -> (f64, Option<Reading<f64>>)) -> Self {
        Self { len, row }
    }

    /// How many.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// One of them.
    #[must_use]
    pub fn get(&self, row: usize) -> (f64, Option<Reading<f64>>) {
        (self.row)(row)
    }
}

/// Goes back through a recording. What it holds in memory are the states of one segment, and a state for each of those
/// before it.
pub trait WayBack {
    /// Smooths the last segment that has not been smoothed yet. `out` then holds its estimates in order of time; what is
    /// returned are its rows, or `None` once the first row has been smoothed, or if the estimator has no smoother.
    ///
    /// # Errors
    /// The row at which a step failed, and why.
    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)>;
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
    /// How far readings have jumped, where a filter looks again: at the second in a row that startles
    /// ([`STARTLING_NIS`](ohmstrain_ekf::live::STARTLING_NIS)), 8 % of calibration's range away from the last that did not surprise.
    pub startled: Option<f64>,
}

/// Where a filter starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// The long-run distribution of the calibration.
    Unknown,
    /// A strain that is known to the limits' resolution, at rest.
    Strain(f64),
}
