use ohmstrain_model::Scalar;

use crate::{Estimator, Reading, StepError};

/// Data of a step for a smoother: the state at its start, its prepared length, and the reading at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PastStep<S, P, T> {
    /// The state from which the step was taken.
    pub from: S,
    /// The prepared step.
    pub prepared: P,
    /// The reading at its end; `None` if it was missing or rejected.
    pub reading: Option<Reading<T>>,
}

/// Smooths back through past steps, newest first, from the state after the newest. `visit` receives the smoothed state at
/// the start of each step, and returns true to continue.
///
/// Only the states of the forward pass are stored; each step is recomputed, with the same result.
///
/// # Errors
/// As [`Estimator::smooth_back`].
pub fn smooth_back_through<'a, T, E, const N: usize, const L: usize>(
    estimator: &E,
    newest: &E::State,
    steps: impl Iterator<Item = &'a PastStep<E::State, E::Prepared, T>>,
    mut visit: impl FnMut(&E::State) -> bool,
) -> Result<(), StepError>
where
    T: Scalar,
    E: Estimator<T, N, L>,
    E::State: 'a,
    E::Prepared: 'a,
{
    let mut smoothed = newest.clone();
    for step in steps {
        smoothed = estimator.smooth_back(&step.from, &step.prepared, step.reading, &smoothed)?;
        if !visit(&smoothed) {
            break;
        }
    }
    Ok(())
}
