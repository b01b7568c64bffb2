//! A running filter as plain data.

use std::collections::VecDeque;

use ohmstrain_ekf::live::{Doubts, Heard, LiveRow, Memory, SensorEstimator};
use ohmstrain_ekf::{Gaussian, PastStep, Pause, Reading, Repeated, Substeps};
use serde::{Deserialize, Serialize};

use crate::run::backward::Row;
use crate::run::clock::Clock;
use crate::run::remembering::Remembering;
use crate::run::running::{LiveStep, Pending, Said};

/// State that the next row depends on, `S` the estimator's state. Prepared steps are not in it: they follow from
/// their lengths.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored<S> {
    pub clock: Clock,
    pub memory: Memory<f64, S>,
    pub last: Option<LiveRow<f64, S>>,
    pub waiting: Vec<Waiting<S>>,
}

/// A row whose estimate waits for later readings.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Waiting<S> {
    time_s: f64,
    heard: Heard<f64>,
    corrected: Option<Corrected>,
    doubts: Doubts<f64>,
    rest_off: f64,
    /// The step to a reading that was used.
    read: Option<Step<S>>,
    /// The state that is predicted at a row without one, and the whole steps of the pause.
    predicted: Option<S>,
    whole: Option<Step<S>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Corrected {
    strain: Gaussian<f64>,
    birge: f64,
}

/// A step: where it started, how long it was and what was read at its end.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Step<S> {
    from: S,
    pause: Pause<f64>,
    reading: Option<Reading<f64>>,
}

impl<S: Clone> Step<S> {
    fn of<P>(step: &PastStep<S, Repeated<P, f64>, f64>) -> Self {
        Self { from: step.from.clone(), pause: step.prepared.pause(), reading: step.reading }
    }

    fn taken<P>(self, prepared: Repeated<P, f64>) -> PastStep<S, Repeated<P, f64>, f64> {
        PastStep { from: self.from, prepared, reading: self.reading }
    }
}

impl<S: Clone> Waiting<S> {
    pub(crate) fn of<E, const N: usize, const L: usize>(pending: &Pending<E, N, L>) -> Self
    where
        E: SensorEstimator<f64, N, L, State = S>,
    {
        let Said { heard, corrected, doubts, rest_off } = pending.said;
        let corrected = corrected.map(|(strain, birge)| Corrected { strain, birge });
        let (read, predicted, whole) = match &pending.row {
            Row::Read(step) => (Some(Step::of(step)), None, None),
            Row::Unread { predicted, whole } => {
                (None, Some(predicted.as_ref().clone()), whole.as_ref().map(|step| Step::of(step)))
            }
        };
        Self { time_s: pending.time_s, heard, corrected, doubts, rest_off, read, predicted, whole }
    }

    /// `None` for a row that is neither read nor predicted.
    pub(crate) fn pending<E, const N: usize, const L: usize>(
        self,
        estimator: &Substeps<Remembering<E, E::Prepared>>,
    ) -> Option<Pending<E, N, L>>
    where
        E: SensorEstimator<f64, N, L, State = S>,
    {
        let Self { time_s, heard, corrected, doubts, rest_off, read, predicted, whole } = self;
        let corrected = corrected.map(|Corrected { strain, birge }| (strain, birge));
        let row: LiveStep<E, N, L> = match (read, predicted, whole) {
            (Some(step), None, None) => {
                let prepared = estimator.prepare_over::<f64, N, L>(step.pause);
                Row::Read(step.taken(prepared))
            }
            (None, Some(predicted), None) => Row::Unread { predicted: Box::new(predicted), whole: None },
            (None, Some(predicted), Some(step)) => {
                let prepared = estimator.prepare_whole::<f64, N, L>(step.pause)?;
                Row::Unread { predicted: Box::new(predicted), whole: Some(Box::new(step.taken(prepared))) }
            }
            _ => return None,
        };
        Some(Pending { time_s, said: Said { heard, corrected, doubts, rest_off }, row })
    }
}

/// All rows that wait, in order.
pub(crate) fn all_pending<E, const N: usize, const L: usize>(
    waiting: Vec<Waiting<E::State>>,
    estimator: &Substeps<Remembering<E, E::Prepared>>,
) -> Option<VecDeque<Pending<E, N, L>>>
where
    E: SensorEstimator<f64, N, L>,
{
    waiting.into_iter().map(|row| row.pending(estimator)).collect()
}
