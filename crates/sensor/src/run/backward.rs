use std::mem;

use ohmstrain_ekf::{Estimator, PastStep, Reading, Repeated, StepError, Substeps};

/// Data of a step that a smoother needs.
pub(crate) type Taken<E, const N: usize, const L: usize> =
    PastStep<<E as Estimator<f64, N, L>>::State, Repeated<<E as Estimator<f64, N, L>>::Prepared, f64>, f64>;

/// Data of a row in the forward pass that a smoother needs.
pub(crate) enum KeptStep<E: Estimator<f64, N, L>, const N: usize, const L: usize> {
    /// The step to a reading that was used.
    Read(Taken<E, N, L>),
    /// A row without a reading that was used: the predicted state, and the whole steps of the pause that the filter has taken
    /// there.
    Unread { predicted: Box<E::State>, whole: Option<Box<Taken<E, N, L>>> },
}

/// The backward pass over rows, newest first. It steps from reading to reading; a row without a reading is smoothed from the
/// reading after it.
pub(crate) struct Backward<S> {
    /// Smoothed state at the last reading before the rows already passed, or whole steps after that reading.
    smoothed: S,
    /// The reading after that: its time, s, the reading as used, and the smoothed state.
    ahead: Option<(f64, Option<Reading<f64>>, S)>,
}

impl<S: Clone> Backward<S> {
    /// Starts from the filter's state after the last row.
    pub(crate) fn new(last: S) -> Self {
        Self { smoothed: last, ahead: None }
    }

    /// Passes a row, calls `show` with its smoothed state, and moves on to the row before it only if `is_to_go_on`.
    pub(crate) fn over<E, const N: usize, const L: usize>(
        &mut self,
        estimator: &Substeps<E>,
        time_s: f64,
        row: &KeptStep<E, N, L>,
        is_to_go_on: bool,
        show: impl FnOnce(&S),
    ) -> Result<(), StepError>
    where
        E: Estimator<f64, N, L, State = S>,
    {
        let earlier =
            |step: &Taken<E, N, L>, later: &S| estimator.smooth_back(&step.from, &step.prepared, step.reading, later);
        match row {
            KeptStep::Read(step) => {
                show(&self.smoothed);
                if is_to_go_on {
                    let earlier = earlier(step, &self.smoothed)?;
                    let smoothed = mem::replace(&mut self.smoothed, earlier);
                    self.ahead = Some((time_s, step.reading, smoothed));
                }
            }
            KeptStep::Unread { predicted, whole } => {
                match &self.ahead {
                    None => show(predicted),
                    Some((ahead_s, reading, smoothed)) => {
                        let prepared = estimator.prepare(ahead_s - time_s);
                        show(&estimator.smooth_back(predicted, &prepared, *reading, smoothed)?);
                    }
                }
                if let Some(step) = whole.as_ref().filter(|_| is_to_go_on) {
                    // Without a later reading, the state before these steps needs no smoothing.
                    self.smoothed =
                        if self.ahead.is_some() { earlier(step, &self.smoothed)? } else { step.from.clone() };
                }
            }
        }
        Ok(())
    }
}
