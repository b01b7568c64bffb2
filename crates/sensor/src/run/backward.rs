use std::mem;

use ohmstrain_ekf::{Estimator, PastStep, Reading, Repeated, StepError, Substeps};

/// A step, as a smoother needs it.
pub(crate) type Taken<E, const N: usize, const L: usize> =
    PastStep<<E as Estimator<f64, N, L>>::State, Repeated<<E as Estimator<f64, N, L>>::Prepared, f64>, f64>;

/// A row on the way forward, as a smoother needs it.
pub(crate) enum KeptStep<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    /// The step to a reading that was used.
    Read(Taken<E, N, L>),
    /// A row without one: the state that the readings before it predict, and the whole steps of the pause that the filter has
    /// taken there.
    Unread { predicted: Box<E::State>, whole: Option<Box<Taken<E, N, L>>> },
}

/// The way back over rows, newest first. It leads from reading to reading; a row without one branches off from the reading after it.
pub(crate) struct Backward<S> {
    /// State at the last reading before the rows that have been passed, or whole steps after it, given all readings.
    smoothed: S,
    /// The reading after that: its time, s, as it was used, and the state there.
    ahead: Option<(f64, Option<Reading<f64>>, S)>,
}

impl<S: Clone> Backward<S> {
    /// Starts from the filter's state after the last row.
    pub(crate) fn new(last: S) -> Self {
        Self { smoothed: last, ahead: None }
    }

    /// Passes a row and shows its state, given all readings; goes on to the row before it only if `is_to_go_on`. Returns true if the
    /// estimator has a smoother.
    pub(crate) fn over<E, const N: usize, const L: usize>(
        &mut self,
        estimator: &Substeps<E>,
        time_s: f64,
        row: &KeptStep<E, N, L>,
        is_to_go_on: bool,
        show: impl FnOnce(&S),
    ) -> Result<bool, StepError>
    where
        E: Estimator<f64, N, L, State = S>,
    {
        let earlier =
            |step: &Taken<E, N, L>, later: &S| estimator.smooth_back(&step.from, &step.prepared, step.reading, later);
        match row {
            KeptStep::Read(step) => {
                show(&self.smoothed);
                if is_to_go_on {
                    let Some(earlier) = earlier(step, &self.smoothed)? else { return Ok(false) };
                    let smoothed = mem::replace(&mut self.smoothed, earlier);
                    self.ahead = Some((time_s, step.reading, smoothed));
                }
            }
            KeptStep::Unread { predicted, whole } => {
                match &self.ahead {
                    None => show(predicted),
                    Some((ahead_s, reading, smoothed)) => {
                        let prepared = estimator.prepare(ahead_s - time_s);
                        let Some(between) = estimator.smooth_back(predicted, &prepared, *reading, smoothed)? else {
                            return Ok(false);
                        };
                        show(&between);
                    }
                }
                if let Some(step) = whole.as_ref().filter(|_| is_to_go_on) {
                    // No reading after them tells more of the state before them.
                    let before =
                        if self.ahead.is_some() { earlier(step, &self.smoothed)? } else { Some(step.from.clone()) };
                    let Some(before) = before else { return Ok(false) };
                    self.smoothed = before;
                }
            }
        }
        Ok(true)
    }
}
