use std::mem;

use ohmstrain_ekf::{Estimator, Reading, StepError, Substeps};

use crate::filter::stepper::Row;

/// The way back over rows, newest first. It leads from reading to reading; a row without one branches off from the reading after it.
pub(crate) struct Backward<S> {
    /// At the last reading before the rows that have been gone over, given all readings.
    smoothed: S,
    /// The reading after that: its time, s, as it was used, and the state there.
    ahead: Option<(f64, Option<Reading<f64>>, S)>,
}

impl<S: Clone> Backward<S> {
    /// From the state at the last reading.
    pub(crate) fn new(last: S) -> Self {
        Self { smoothed: last, ahead: None }
    }

    /// Goes over a row and shows its state, given all readings; to the reading before it only if `is_to_go_on`. Returns whether the
    /// estimator has a smoother.
    pub(crate) fn over<E, const N: usize, const L: usize>(
        &mut self,
        estimator: &Substeps<E>,
        time_s: f64,
        row: &Row<E, N, L>,
        is_to_go_on: bool,
        show: impl FnOnce(&S),
    ) -> Result<bool, StepError>
    where
        E: Estimator<f64, N, L, State = S>,
    {
        match row {
            Row::Read(step) => {
                show(&self.smoothed);
                if is_to_go_on {
                    let earlier = estimator.smooth_back(&step.from, &step.prepared, step.reading, &self.smoothed)?;
                    let Some(earlier) = earlier else { return Ok(false) };
                    let smoothed = mem::replace(&mut self.smoothed, earlier);
                    self.ahead = Some((time_s, step.reading, smoothed));
                }
            }
            Row::Unread(predicted) => match &self.ahead {
                None => show(predicted),
                Some((ahead_s, reading, smoothed)) => {
                    let prepared = estimator.prepare(ahead_s - time_s);
                    let Some(between) = estimator.smooth_back(predicted, &prepared, *reading, smoothed)? else {
                        return Ok(false);
                    };
                    show(&between);
                }
            },
        }
        Ok(true)
    }
}
