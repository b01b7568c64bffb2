use std::mem;
use std::ops::Range;

use ohmstrain_ekf::live::{LiveRow, Measured, Memory, SensorEstimator};
use ohmstrain_ekf::{Gaussian, StepError};

use crate::run::backward::Backward;
use crate::run::clock::Clock;
use crate::run::corrected::CorrectedWayBack;
use crate::run::last_rows::LastRows;
use crate::run::pending::LiveStep;
use crate::run::running::Running;
use crate::run::turns::Turns;
use crate::run::{Output, Rows, SEGMENT, Smoother, WayBack};

/// The backward pass through a recording: all segments but the last are filtered again, from the state before their first
/// row.
pub(crate) struct Segments<'a, E: SensorEstimator<f64, N, L>, const B: usize, const N: usize, const L: usize> {
    running: &'a mut Running<E, B, N, L>,
    rows: Rows<'a>,
    /// Filter's state before the first row of each segment not yet smoothed.
    starts: Vec<(Clock, Memory<f64, E::State>)>,
    /// Backward pass over the segments already smoothed.
    back: Backward<E::State>,
    /// Steps of the current segment.
    steps: Vec<(Measured<f64>, LiveStep<E, N, L>)>,
    /// True if it is the last segment, whose steps are already available.
    is_last: bool,
    /// Turns of all readings.
    turns: Turns,
}

impl<'a, E, const B: usize, const N: usize, const L: usize> Segments<'a, E, B, N, L>
where
    E: SensorEstimator<f64, N, L>,
{
    /// Filters the recording; `watch` receives each row's index and the filter's strain.
    pub(crate) fn new(
        running: &'a mut Running<E, B, N, L>,
        rows: Rows<'a>,
        mut watch: impl FnMut(usize, Gaussian<f64>),
    ) -> Result<Self, (usize, StepError)> {
        let mut starts = Vec::with_capacity(rows.len() / SEGMENT + 1);
        let last = rows.len().saturating_sub(1) / SEGMENT * SEGMENT;
        let mut turns = Turns::default();
        let mut watch = |running: &Running<E, B, N, L>, row, taken: &LiveRow<f64, E::State>| {
            running.watch(&mut turns, rows.get(row).0, &taken.measured);
            watch(row, taken.stated);
        };
        for row in 0..last {
            if row % SEGMENT == 0 {
                starts.push((running.clock, running.live.memory()));
            }
            let (time_s, reading) = rows.get(row);
            let taken = running.row(time_s, reading).map_err(|error| (row, error))?;
            watch(running, row, &taken);
        }
        if last < rows.len() {
            starts.push((running.clock, running.live.memory()));
        }
        let mut steps = Vec::new();
        steps_of(running, rows, last..rows.len(), &mut steps, watch)?;
        let back = Backward::new(running.live.state().clone());
        Ok(Self { running, rows, starts, back, steps, is_last: true, turns })
    }
}

/// Filters a segment from the current state, and keeps its steps; `after` is called with the index and the result of
/// each.
fn steps_of<E: SensorEstimator<f64, N, L>, const B: usize, const N: usize, const L: usize>(
    running: &mut Running<E, B, N, L>,
    rows: Rows<'_>,
    segment: Range<usize>,
    steps: &mut Vec<(Measured<f64>, LiveStep<E, N, L>)>,
    mut after: impl FnMut(&Running<E, B, N, L>, usize, &LiveRow<f64, E::State>),
) -> Result<(), (usize, StepError)> {
    steps.clear();
    steps.reserve_exact(segment.len());
    for row in segment {
        let (time_s, reading) = rows.get(row);
        let (taken, step) = running.kept_row(time_s, reading).map_err(|error| (row, error))?;
        after(running, row, &taken);
        steps.push((taken.measured, step));
    }
    Ok(())
}

impl<E, const B: usize, const N: usize, const L: usize> WayBack for Segments<'_, E, B, N, L>
where
    E: SensorEstimator<f64, N, L>,
{
    fn turns(&self) -> &Turns {
        &self.turns
    }

    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        out.clear();
        let Some((clock, memory)) = self.starts.pop() else { return Ok(None) };
        let first = self.starts.len() * SEGMENT;
        let rows = first..self.rows.len().min(first + SEGMENT);
        out.reserve_exact(rows.len());
        if !mem::take(&mut self.is_last) {
            self.running.clock = clock;
            self.running.live.return_to(&memory);
            steps_of(self.running, self.rows, rows.clone(), &mut self.steps, |_, _, _| {})?;
        }
        for (row, (measured, step)) in rows.clone().zip(&self.steps).rev() {
            let (running, time_s) = (&*self.running, self.rows.get(row).0);
            let show = |state: &E::State| out.push(running.smoothed_row(state, measured));
            self.back.over(running.live.substeps(), time_s, step, true, show).map_err(|error| (row, error))?;
        }
        out.reverse();
        Ok(Some(rows))
    }
}

impl<E, const B: usize, const N: usize, const L: usize> Smoother for Running<E, B, N, L>
where
    E: SensorEstimator<f64, N, L, State: Send, Prepared: Send> + Send,
{
    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)> {
        let Some(learned) = self.learned.clone() else { return Ok(Box::new(Segments::new(self, rows, |_, _| {})?)) };
        let mut filtered = LastRows::of(rows);
        let back = Segments::new(self, rows, |row, strain| filtered.watch(row, strain))?;
        Ok(Box::new(CorrectedWayBack::new(Box::new(back), &learned, rows, filtered)))
    }
}
