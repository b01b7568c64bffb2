//! A running filter as plain data.

use ohmstrain_ekf::live::{Doubts, LiveRow, Measured, Memory, SensorEstimator};
use ohmstrain_ekf::{Gaussian, PastStep, Pause, PlainState, Reading, Repeated, Substeps};
use serde::de::Error as _;
use serde::{Deserialize, Serialize};
use toml::de;

use crate::run::backward::KeptStep;
use crate::run::clock::Clock;
use crate::run::pending::{LiveStep, Pending, Reported};
use crate::run::remembering::Remembering;

/// State on which the next row depends. Prepared steps are not stored, because they follow from their lengths. States of estimators
/// are numbers here; otherwise a program would contain this code once for each state type.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    pub clock: Clock,
    pub memory: Memory<f64, Numbers>,
    pub last: Option<LiveRow<f64, Numbers>>,
    pub waiting: Vec<Waiting>,
}

/// State of an estimator.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Numbers(Vec<f64>);

impl Numbers {
    pub(crate) fn of(state: &impl PlainState<f64>) -> Self {
        let mut numbers = Vec::new();
        state.each_number(&mut |number| numbers.push(number));
        Self(numbers)
    }

    pub(crate) fn state<S: PlainState<f64>>(self) -> Result<S, de::Error> {
        let mut numbers = self.0.into_iter();
        let state = S::from_numbers(&mut numbers).filter(|_| numbers.next().is_none());
        state.ok_or_else(|| de::Error::custom("expected the numbers of an estimator's state"))
    }
}

/// A row whose estimate waits for later readings.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Waiting {
    time_s: f64,
    measured: Measured<f64>,
    corrected: Option<Corrected>,
    doubts: Doubts<f64>,
    rest_off: f64,
    /// The step to a reading that was used.
    read: Option<StoredStep>,
    /// The predicted state at a row without a reading, and the whole steps of the pause.
    predicted: Option<Numbers>,
    whole: Option<StoredStep>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Corrected {
    strain: Gaussian<f64>,
    birge: f64,
}

/// A step: the state at its start, its length, and the reading at its end.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredStep {
    from: Numbers,
    pause: Pause<f64>,
    reading: Option<Reading<f64>>,
}

impl StoredStep {
    fn of<S: PlainState<f64>, P>(step: &PastStep<S, Repeated<P, f64>, f64>) -> Self {
        Self { from: Numbers::of(&step.from), pause: step.prepared.pause(), reading: step.reading }
    }

    fn taken<S: PlainState<f64>, P>(
        self,
        prepared: Repeated<P, f64>,
    ) -> Result<PastStep<S, Repeated<P, f64>, f64>, de::Error> {
        Ok(PastStep { from: self.from.state()?, prepared, reading: self.reading })
    }
}

impl Waiting {
    pub(crate) fn of<E, const N: usize, const L: usize>(pending: &Pending<E, N, L>) -> Self
    where
        E: SensorEstimator<f64, N, L, State: PlainState<f64>>,
    {
        let Reported { measured, corrected, doubts, rest_off } = pending.reported;
        let corrected = corrected.map(|(strain, birge)| Corrected { strain, birge });
        let (read, predicted, whole) = match &pending.row {
            KeptStep::Read(step) => (Some(StoredStep::of(step)), None, None),
            KeptStep::Unread { predicted, whole } => {
                (None, Some(Numbers::of(predicted.as_ref())), whole.as_ref().map(|step| StoredStep::of(step)))
            }
        };
        Self { time_s: pending.time_s, measured, corrected, doubts, rest_off, read, predicted, whole }
    }

    /// Restores the row, with steps prepared by this estimator.
    pub(crate) fn pending<E, const N: usize, const L: usize>(
        self,
        estimator: &Substeps<Remembering<E, E::Prepared>>,
    ) -> Result<Pending<E, N, L>, de::Error>
    where
        E: SensorEstimator<f64, N, L, State: PlainState<f64>>,
    {
        let neither = || de::Error::custom("`waiting`: expected rows with `read` or `predicted`");
        let Self { time_s, measured, corrected, doubts, rest_off, read, predicted, whole } = self;
        let corrected = corrected.map(|Corrected { strain, birge }| (strain, birge));
        let row: LiveStep<E, N, L> = match (read, predicted) {
            (Some(step), None) if whole.is_none() => {
                let prepared = estimator.prepare_over::<f64, N, L>(step.pause);
                KeptStep::Read(step.taken(prepared)?)
            }
            (None, Some(predicted)) => {
                let whole = whole.map(|step| {
                    let prepared = estimator.prepare_whole::<f64, N, L>(step.pause).ok_or_else(neither)?;
                    step.taken(prepared).map(Box::new)
                });
                KeptStep::Unread { predicted: Box::new(predicted.state()?), whole: whole.transpose()? }
            }
            _ => return Err(neither()),
        };
        Ok(Pending { time_s, reported: Reported { measured, corrected, doubts, rest_off }, row })
    }
}
