use std::ops::Range;

use ohmstrain_ekf::{Estimator, Reading, StepError};

use crate::filter::running::Running;
use crate::filter::stepper::{Moment, Seen, Taken};
use crate::filter::{Output, Rows, WayBack};

/// Rows whose states are in memory at once while a recording is smoothed; the others are computed again. Of a recording of
/// ten million rows that leaves 2441 states to begin again from, fewer than the rows of one segment.
pub(crate) const SEGMENT: usize = 4096;

/// The way back through a recording: every segment is filtered once more, from the state kept before its first row.
pub(crate) struct Segments<'a, E: Estimator<f64, N, L>, const B: usize, const N: usize, const L: usize> {
    running: &'a mut Running<E, B, N, L>,
    rows: Rows<'a>,
    /// Where the filter was before the first row of each segment that is not smoothed yet.
    starts: Vec<Moment<E::State>>,
    /// The state after the last of their rows, from all readings.
    smoothed: E::State,
    /// The present segment.
    steps: Vec<(Seen, Taken<E, N, L>)>,
}

impl<'a, E, const B: usize, const N: usize, const L: usize> Segments<'a, E, B, N, L>
where
    E: Estimator<f64, N, L>,
{
    /// Filters the recording; the filter then stands at its end.
    pub(crate) fn new(running: &'a mut Running<E, B, N, L>, rows: Rows<'a>) -> Result<Self, (usize, StepError)> {
        let mut now = running.now.clone();
        let mut starts = Vec::with_capacity(rows.len() / SEGMENT + 1);
        for row in 0..rows.len() {
            if row % SEGMENT == 0 {
                starts.push(now.clone());
            }
            let (time_s, reading): (f64, Option<Reading<f64>>) = rows.get(row);
            running.stepper.advance_only(&mut now, time_s, reading).map_err(|error| (row, error))?;
        }
        let smoothed = now.state.clone();
        running.now = now;
        Ok(Self { running, rows, starts, smoothed, steps: Vec::new() })
    }

    fn replay(&mut self, start: Moment<E::State>, rows: Range<usize>) -> Result<(), (usize, StepError)> {
        self.steps.clear();
        let mut now = start;
        for row in rows {
            let (time_s, reading) = self.rows.get(row);
            let (next, step) = self.running.stepper.advance(&now, time_s, reading).map_err(|error| (row, error))?;
            self.steps.push((next.seen, step));
            now = next;
        }
        Ok(())
    }
}

impl<E, const B: usize, const N: usize, const L: usize> WayBack for Segments<'_, E, B, N, L>
where
    E: Estimator<f64, N, L>,
{
    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        out.clear();
        let Some(start) = self.starts.pop() else { return Ok(None) };
        let first = self.starts.len() * SEGMENT;
        let rows = first..self.rows.len().min(first + SEGMENT);
        self.replay(start, rows.clone())?;
        for (row, (seen, step)) in rows.clone().zip(&self.steps).rev() {
            out.push(self.running.smoothed_output(&self.smoothed, *seen));
            let estimator = &self.running.stepper.estimator;
            let back = estimator.smooth_back(&step.from, &step.prepared, step.reading, &self.smoothed);
            match back.map_err(|error| (row, error))? {
                Some(earlier) => self.smoothed = earlier,
                None => {
                    out.clear();
                    self.starts.clear();
                    return Ok(None);
                }
            }
        }
        out.reverse();
        Ok(Some(rows))
    }
}
