use std::collections::HashMap;

use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, Reading, StepError};
use ohmstrain_model::Scalar;

use super::ModelFamily;
use crate::CalibrationError;

/// Readings without a reference. If times and readings differ in number, the surplus is ignored.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadingSeries<'a> {
    /// Times, s, not decreasing.
    pub time_s: &'a [f64],
    /// Readings in the channel's unit; NaN where missing.
    pub value: &'a [f64],
    /// Standard deviation that the electronics add to each reading; NaN, or beyond the slice's end, if it is unknown.
    pub extra_sd: &'a [f64],
}

impl ReadingSeries<'_> {
    /// Returns the reading of a row; `None` if it is missing.
    fn reading<T: Scalar>(&self, row: usize) -> Option<Reading<T>> {
        let value = self.value.get(row).filter(|value| !value.is_nan())?;
        let extra_sd = self.extra_sd.get(row).filter(|sd| !sd.is_nan()).copied().unwrap_or(0.0);
        Some(Reading { value: T::of(*value), extra_variance: T::of(extra_sd * extra_sd) })
    }
}

/// Log density of readings under a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingsLikelihood<T> {
    /// Log-likelihood with all constants.
    pub value: T,
    /// Number of readings that were not missing.
    pub readings: usize,
}

/// Returns the log-likelihood of recordings; the filter restarts for each. Parameters are on their natural scale.
pub(super) fn log_likelihood<T, F, const N: usize, const L: usize>(
    family: &F,
    parameters: &[T],
    recordings: &[ReadingSeries],
) -> Result<ReadingsLikelihood<T>, CalibrationError>
where
    T: Scalar,
    F: ModelFamily<N, L>,
{
    let model = family.model(parameters)?;
    let start = family.start(&model);
    let mut run = Run {
        filter: Ekf::new(model),
        prepared: HashMap::new(),
        sum: ReadingsLikelihood { value: T::zero(), readings: 0 },
    };
    for recording in recordings {
        let mut belief = start;
        let mut previous_s = None;
        for (row, &time_s) in recording.time_s.iter().enumerate().take(recording.value.len()) {
            let dt_s = previous_s.map_or(0.0, |previous_s| time_s - previous_s);
            belief = run
                .step(&belief, dt_s, recording.reading(row))
                .map_err(|source| CalibrationError::Filter { time_s, source })?;
            previous_s = Some(time_s);
        }
    }
    Ok(run.sum)
}

/// A filter running through recordings.
struct Run<M, P, T> {
    filter: Ekf<M>,
    /// Prepared steps by their length in nanoseconds, because differences of decimal times are equal only up to
    /// rounding.
    prepared: HashMap<u64, P>,
    sum: ReadingsLikelihood<T>,
}

/// Largest number of prepared steps, which bounds the memory for a recording whose steps never repeat.
const MOST_PREPARED: usize = 4096;

impl<M, T: Scalar, P: Copy> Run<M, P, T> {
    fn step<const N: usize, const L: usize>(
        &mut self,
        belief: &Belief<T, N, L>,
        dt_s: f64,
        reading: Option<Reading<T>>,
    ) -> Result<Belief<T, N, L>, StepError>
    where
        M: Dynamics<T, N, L, Prepared = P> + Channel<T, N, L>,
    {
        let step = if dt_s > 0.0 && dt_s.is_finite() {
            let prepared = self.prepare(dt_s);
            self.filter.step_prepared(belief, &prepared, reading)?
        } else {
            self.filter.step(belief, T::of(dt_s), reading)?
        };
        if let Some(update) = step.update {
            self.sum.value += update.log_likelihood;
            self.sum.readings += 1;
        }
        Ok(step.posterior)
    }

    fn prepare<const N: usize, const L: usize>(&mut self, dt_s: f64) -> P
    where
        M: Dynamics<T, N, L, Prepared = P>,
    {
        let nanoseconds = (dt_s * 1e9).round();
        if self.prepared.len() >= MOST_PREPARED {
            self.prepared.clear();
        }
        let model = self.filter.model();
        *self.prepared.entry(nanoseconds as u64).or_insert_with(|| model.prepare(T::of(nanoseconds * 1e-9)))
    }
}
