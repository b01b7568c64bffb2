//! Filters behind one trait: the estimators of `ohmstrain-ekf`, instantiated for sensors.

mod backward;
pub(crate) mod build;
mod clock;
pub(crate) mod corrected;
pub(crate) mod known;
mod last_rows;
pub(crate) mod learned;
pub(crate) mod options;
mod pending;
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

use crate::run::known::Stated;
use crate::run::turns::Turns;

/// Live filter of a sensor whose number of branches and estimator are known only at run time. It can be moved between threads
/// and tasks.
pub trait Filter: Send {
    /// Sets the resistance at rest, unstretched, from now on.
    ///
    /// # Errors
    /// As [`LiveFilter::rest`](ohmstrain_ekf::live::LiveFilter::rest).
    fn rest(&mut self, measured: f64) -> Result<(), StepError>;

    /// Clears the doubts about the strain, which is now known.
    fn settle(&mut self);

    /// Takes the reading `R/R₀ - 1` at `time_s`; `None` if it is missing. No time passes before the first row.
    ///
    /// # Errors
    /// See [`StepError`]. The filter is unchanged: the next good row continues from the last good one.
    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError>;

    /// Returns the strain at the last row, within the limits.
    fn strain(&self) -> Gaussian<f64>;

    /// Returns the full output for the last row.
    fn output(&self) -> Output;

    /// Like [`Self::step`], but every row is estimated from the readings up to `lag_s` seconds after it. `out` receives
    /// the rows that have become due, in order. The cost of a step grows with the number of rows within the lag, not
    /// with time.
    ///
    /// # Errors
    /// See [`StepError`]. The filter is unchanged.
    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        lag_s: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError>;

    /// Passes the rows still waiting to `out`, estimated from all readings so far.
    ///
    /// # Errors
    /// See [`StepError`].
    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError>;

    /// Stores everything on which the next row depends, except the filter's parameters and options.
    ///
    /// # Errors
    /// If TOML cannot represent it.
    fn store(&self) -> Result<toml::Table, toml::ser::Error>;

    /// Resumes, to the bit, from the result of [`Self::store`] of a filter with the same parameters and options.
    ///
    /// # Errors
    /// If it is the state of a filter of another kind. The filter is then unchanged.
    fn resume(&mut self, stored: toml::Table) -> Result<(), toml::de::Error>;
}

/// Smooths whole recordings with the steps of the live filter.
pub trait Smoother: Send {
    /// Filters a recording, and returns the backward pass, segment by segment. Use it for recordings whose states or estimates
    /// do not fit in memory.
    ///
    /// # Errors
    /// The row at which a step failed, and the reason.
    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)>;

    /// Smooths a whole recording.
    ///
    /// # Errors
    /// The row at which a step failed, and the reason.
    fn smooth(&mut self, time_s: &[f64], readings: &[Option<Reading<f64>>]) -> Result<Vec<Output>, (usize, StepError)> {
        let len = time_s.len().min(readings.len());
        let row = |row: usize| (time_s[row], readings[row]);
        let mut back = self.way_back(Rows::new(len, &row))?;
        let (mut segment, mut outputs) = (Vec::new(), Vec::with_capacity(len));
        while back.next_segment(&mut segment)?.is_some() {
            outputs.extend(segment.iter().rev());
        }
        outputs.reverse();
        Ok(outputs)
    }
}

/// Number of rows whose states are in memory at once while a recording is smoothed; the others are recomputed. A recording
/// of ten million rows has 2441 states to restart from, fewer than the rows of one segment.
const SEGMENT: usize = 4096;

/// Rows of a recording, whatever their storage.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    len: usize,
    row: &'a dyn Fn(usize) -> (f64, Option<Reading<f64>>),
}

impl<'a> Rows<'a> {
    /// Describes `len` rows; `row` returns the time, s, and the reading `R/R₀ - 1` of each, `None` where it is missing.
    #[must_use]
    pub fn new(len: usize, row: &'a dyn Fn(usize) -> (f64, Option<Reading<f64>>)) -> Self {
        Self { len, row }
    }

    /// Returns the number of rows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// True if there are no rows.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns time, s, and reading of a row.
    #[must_use]
    pub fn get(&self, row: usize) -> (f64, Option<Reading<f64>>) {
        (self.row)(row)
    }
}

/// Backward pass through a recording. It holds in memory the states of one segment, and one state for each earlier
/// segment.
pub trait WayBack {
    /// Smooths the last segment that has not been smoothed yet. `out` then holds its estimates in order of time. Returns
    /// the range of its rows; `None` once the first row has been smoothed.
    ///
    /// # Errors
    /// The row at which a step failed, and the reason.
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
    /// Reading, R/R₀ - 1 with R₀ as tracked; `None` if it was missing.
    pub reading: Option<Reading<f64>>,
    /// Flags raised by doubts.
    pub doubts: Flags,
    /// Variance of the strain that doubts have added.
    #[serde(default)]
    pub doubted: f64,
    /// Relative deviation of R₀, as tracked by the filter, from that of the calibration.
    pub rest_off: f64,
}

impl Output {
    /// Widens the estimate of the strain, `stated` before doubts, to `variance`. The prediction of the reading after a hold is
    /// widened by the equivalent on the mean slope.
    pub fn widen(&mut self, doubts: &Doubts<f64>, stated: Gaussian<f64>, variance: f64) {
        let added = variance - stated.variance;
        self.estimate.still_relaxes.variance += doubts.of_reading(added).max(0.0);
        self.estimate.strain = Gaussian { variance, ..stated };
        self.doubted += added.max(0.0);
    }

    /// Returns the strain, and the part of its variance that doubts have added.
    #[must_use]
    pub const fn stated(&self) -> Stated {
        let Gaussian { mean, variance } = self.estimate.strain;
        Stated { strain: Gaussian { mean, variance: (variance - self.doubted).max(0.0) }, doubted: self.doubted }
    }
}

/// Starting strain of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// The long-run distribution of the calibration.
    Unknown,
    /// A known strain at rest, exact to a small fraction of the limits' span.
    Strain(f64),
}

impl Start {
    /// Returns the strain if it is known.
    #[must_use]
    pub const fn strain(self) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::Strain(strain) => Some(strain),
        }
    }
}
