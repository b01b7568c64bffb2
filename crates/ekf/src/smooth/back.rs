use ohmstrain_model::Scalar;

use crate::{Estimator, Reading, StepError};

/// A step as a smoother needs it: where it started, how long it was and what was read at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PastStep<S, P, T> {
    /// The state from which the step was taken.
    pub from: S,
    /// The prepared step.
    pub prepared: P,
    /// The reading at its end; `None` if it was missing or turned down.
    pub reading: Option<Reading<T>>,
}

/// Goes back through past steps, newest first, from the state after the newest. `visit` sees the state at the beginning
/// of each step given all readings, and says whether to go on.
///
/// Nothing of the forward pass but the states is stored: each step is taken again, which gives the same. Returns whether
/// the estimator has a smoother.
///
/// # Errors
/// See [`StepError`]; steps that went forward go backward.
pub fn smooth_back_through<'a, T, E, const N: usize, const L: usize>(
    estimator: &E,
    newest: &E::State,
    steps: impl Iterator<Item = &'a PastStep<E::State, E::Prepared, T>>,
    mut visit: impl FnMut(&E::State) -> bool,
) -> Result<bool, StepError>
where
    T: Scalar,
    E: Estimator<T, N, L>,
    E::State: 'a,
    E::Prepared: 'a,
{
    let mut smoothed = newest.clone();
    for step in steps {
        let Some(earlier) = estimator.smooth_back(&step.from, &step.prepared, step.reading, &smoothed)? else {
            return Ok(false);
        };
        smoothed = earlier;
        if !visit(&smoothed) {
            break;
        }
    }
    Ok(true)
}
