//! Filters behind one trait: the kernels of `ohmstrain-ekf` in the instances that a sensor needs.

mod backward;
pub(crate) mod build;
mod clock;
pub(crate) mod corrected;
pub(crate) mod known;
pub(crate) mod learned;
pub(crate) mod options;
pub(crate) mod portable;
mod remembering;
mod running;
mod stored;
pub(crate) mod turns;
mod way_back;

use std::ops::Range;

use ohmstrain_ekf::live::{Doubts, Flags};
use ohmstrain_ekf::{Estimate, Gaussian, Reading, ReadingVerdict, StepError};
use serde::{Deserialize, Serialize};

use crate::run::turns::Turns;

/// The live filter of a sensor whose number of branches and estimator are known at run time only. Threads and tasks can own it.
pub trait Filter: Send {
    /// Sets the resistance at rest, unstretched, from now on.
    ///
    /// # Errors
    /// As [`LiveFilter::rest`](ohmstrain_ekf::live::LiveFilter::rest).
    fn rest(&mut self, measured: f64) -> Result<(), StepError>;

    /// The strain is known now: what was doubted of it is gone.
    fn settle(&mut self);

    /// Takes the reading `R/R₀ - 1` at `time_s`; `None` if it is missing. The first row takes no time.
    ///
    /// # Errors
    /// See [`StepError`]. The filter stays as it was: the next good row goes on from the last good one.
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError>;

    /// Strain at the last row, within the limits.
    fn strain(&self) -> Gaussian<f64>;

    /// Returns all that is reported about the last row.
    fn output(&self) -> Output;

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

    /// Stores all that the next row depends on, except the parameters and options that the filter was made of.
    ///
    /// # Errors
    /// If TOML cannot hold it.
    fn store(&self) -> Result<toml::Table, toml::ser::Error>;

    /// Resumes, to the bit, from the result of [`Self::store`], of a filter made of the same parameters and options.
    ///
    /// # Errors
    /// If it is the state of a filter of another kind. The filter stays as it was.
    fn resume(&mut self, stored: toml::Table) -> Result<(), toml::de::Error>;
}

/// Smooths whole recordings with the steps of the live filter.
pub trait Smoother: Send {
    /// Filters a recording and goes back through it segment by segment: the way to smooth recordings that are too long to hold
    /// their states, or their estimates, in memory.
    ///
    /// # Errors
    /// The row at which a step failed, and why.
    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)>;

    /// Smooths a whole recording; `None` if the estimator has no smoother.
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

/// Rows whose states are in memory at once while a recording is smoothed; the others are computed again. Of a recording of
/// ten million rows that leaves 2441 states to begin again from, fewer than the rows of one segment.
const SEGMENT: usize = 4096;

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

    /// Returns the number of rows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// True if there is none.
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

/// Way back through a recording. It holds in memory the states of one segment, and a state for each of those
/// before it.
pub trait WayBack {
    /// Smooths the last segment that has not been smoothed yet. `out` then holds its estimates in order of time; what is
    /// returned are its rows, or `None` once the first row has been smoothed, or if the estimator has no smoother.
    ///
    /// # Errors
    /// The row at which a step failed, and why.
    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)>;

    /// Returns the times at which the readings turn.
    fn turns(&self) -> &Turns;
}

/// Output of a filter or smoother at one row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// The estimate.
    pub estimate: Estimate<f64>,
    /// Normalised innovation squared of the row's reading; `None` if it was missing.
    pub nis: Option<f64>,
    /// Verdict on the reading.
    pub verdict: ReadingVerdict,
    /// Probabilities of extend, hold and retract; `None` if the estimator has no phases.
    pub phases: Option<[f64; 3]>,
    /// The reading, R/R₀ - 1 of R₀ as it is followed; `None` if it was missing.
    pub reading: Option<Reading<f64>>,
    /// Flags that doubts raise.
    pub doubts: Flags,
    /// Relative deviation of R₀, as the filter follows it, from calibration's.
    pub rest_off: f64,
}

impl Output {
    /// Widens the estimate of the strain, `stated` before doubts, to a variance, and by as much, on the mean slope, the prediction of
    /// the reading after a hold.
    pub fn widen(&mut self, doubts: &Doubts<f64>, stated: Gaussian<f64>, variance: f64) {
        self.estimate.still_relaxes.variance += doubts.of_reading(variance - stated.variance).max(0.0);
        self.estimate.strain = Gaussian { variance, ..stated };
    }
}

/// Starting strain of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// The long-run distribution of the calibration.
    Unknown,
    /// A strain that is known to the limits' resolution, at rest.
    Strain(f64),
}

impl Start {
    /// The strain, if it is known.
    #[must_use]
    pub const fn strain(self) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::Strain(strain) => Some(strain),
        }
    }
}
