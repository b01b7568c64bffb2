use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

use super::filter::solve_lower;
use super::rows::{Combination, Digits, Sources, orthogonalise, regress};
use super::{Affine, KalmanError, Normal, Step};

/// Smooths a recording by the Rauch-Tung-Striebel recursion: it estimates the state at every step given all readings.
///
/// `steps` are the results of a filter, in order; `smoothed` has the same length. No covariance is subtracted or
/// inverted. A direction in which the prediction is certain to 16 ε of its terms is skipped.
///
/// # Errors
/// [`KalmanError::Length`], [`KalmanError::NonFiniteState`].
///
/// Source: Rauch, Tung & Striebel, *AIAA J.* 3 (1965) 1445; Särkkä, *Bayesian Filtering and Smoothing* (2013), §8.2.
pub fn smooth<T: Scalar, const N: usize, const M: usize>(
    steps: &[Step<T, N, M>],
    smoothed: &mut [Normal<T, N>],
) -> Result<(), KalmanError> {
    if steps.len() != smoothed.len() {
        return Err(KalmanError::Length);
    }
    let mut next: Option<(&Step<T, N, M>, Normal<T, N>)> = None;
    for (step, out) in steps.iter().zip(smoothed).rev() {
        *out = match &next {
            None => step.posterior,
            Some((later, state)) => smooth_step(&step.posterior, &later.transition, &later.prior, state)?,
        };
        next = Some((step, *out));
    }
    Ok(())
}

/// Returns the state at the first step of a window given all readings of the window (fixed-lag smoother). A recording
/// is `steps.windows(lag + 1).map(smooth_first)`, and the last `lag` states are those of [`smooth`] over the last window; a
/// live filter keeps its last `lag + 1` steps.
///
/// # Errors
/// [`KalmanError::Length`] for an empty window, [`KalmanError::NonFiniteState`].
pub fn smooth_first<T: Scalar, const N: usize, const M: usize>(
    window: &[Step<T, N, M>],
) -> Result<Normal<T, N>, KalmanError> {
    let last = window.last().ok_or(KalmanError::Length)?.posterior;
    window.windows(2).rev().try_fold(last, |next, pair| match pair {
        [step, later] => smooth_step(&step.posterior, &later.transition, &later.prior, &next),
        _ => Ok(next),
    })
}

/// Smooths one step backwards, from N(x, P) given the readings so far, and the next state's distribution given all
/// readings, which was predicted as `prior`.
///
/// `x = x̂ + G (x′ − x⁻) + e`, where e is the part of this state that the next one does not determine.
#[allow(non_snake_case, reason = "G is the letter of every textbook")]
fn smooth_step<T: Scalar, const N: usize>(
    filtered: &Normal<T, N>,
    transition: &Affine<T, N, N>,
    prior: &Normal<T, N>,
    next: &Normal<T, N>,
) -> Result<Normal<T, N>, KalmanError> {
    let sources = transition.sources(filtered);
    let mut next_rows = transition.rows(filtered);
    let (mut predicted, digits) = orthogonalise(&mut next_rows, sources, [true; N]);
    for i in 0..N {
        if digits[i] == Digits::Few {
            predicted.variances[i] = T::zero();
        }
    }
    let mut s_rows: [Combination<T, N, N>; N] = core::array::from_fn(Combination::source);
    let on_next = regress(&mut s_rows, &next_rows, &predicted.variances, sources);
    let (left, _) = orthogonalise(&mut s_rows, sources, [true; N]);

    let lower = &filtered.factor.columns;
    let mut G = SMatrix::<T, N, N>::zeros();
    for j in 0..N {
        let unit = SVector::from_fn(|i, _| if i == j { T::one() } else { T::zero() });
        G.set_column(j, &(lower * (on_next * solve_lower(&predicted.columns, &unit))));
    }
    let left_lower = lower * left.columns;
    let mut rows: [Combination<T, N, N>; N] =
        core::array::from_fn(|i| Combination::of(&G, &next.factor.columns, &left_lower, i));
    let (factor, _) =
        orthogonalise(&mut rows, Sources { state: &next.factor.variances, noise: &left.variances }, [true; N]);
    Normal { mean: filtered.mean + G * (next.mean - prior.mean), factor }.checked()
}
