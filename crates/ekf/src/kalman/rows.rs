//! Gaussian variables as rows over independent sources, and their elimination.
//!
//! Prediction, update and smoother are one operation: the joint distribution of two vectors is factored as L D Lᵀ with
//! the given vector first, which leaves the conditional distribution of the second. The factor comes from modified
//! Gram-Schmidt with the sources' variances as weights. Covariances are never subtracted, so variances of very
//! different magnitude keep their digits.
//!
//! Source: Thornton & Bierman, *Proc. IEEE CDC* (1976) 1205; Bierman, *Factorization Methods* (1977), chapter VI.

use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

use super::factor::Factor;

/// A variable `Σ aᵢ sᵢ + Σ bⱼ nⱼ` of independent sources: N of the state and K of noise.
#[derive(Clone, Copy)]
pub(super) struct Combination<T, const N: usize, const K: usize> {
    state: Part<T, N>,
    noise: Part<T, K>,
}

/// Coefficients, and for each the largest term of its sum, to which its rounding error is proportional.
#[derive(Clone, Copy)]
struct Part<T, const N: usize> {
    value: SVector<T, N>,
    terms: SVector<T, N>,
}

/// Variances of the sources.
#[derive(Clone, Copy)]
pub(super) struct Sources<'a, T, const N: usize, const K: usize> {
    pub(super) state: &'a SVector<T, N>,
    pub(super) noise: &'a SVector<T, K>,
}

/// Digits of a row left after rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Digits {
    /// All digits.
    Kept,
    /// Rounding errors are significant in its variance.
    Few,
    /// Only rounding errors: the variable is determined by those before it.
    None,
}

/// Size of a coefficient, in ε of its terms, beyond which its row counts as nonzero.
const ZERO_ERRORS: f64 = 8.0;
/// Smallest standard deviation of a row, in ε of that of its terms. Half an ε is then 1/32 of it, a thousandth of the
/// variance.
const FEW_ERRORS: f64 = 16.0;

impl<T: Scalar, const N: usize> Part<T, N> {
    fn new(value: SVector<T, N>) -> Self {
        Self { value, terms: value.abs() }
    }

    fn covariance(&self, other: &Self, variances: &SVector<T, N>) -> T {
        (0..N).fold(T::zero(), |sum, i| sum + self.value[i] * variances[i] * other.value[i])
    }

    fn subtract(&mut self, factor: T, other: &Self) {
        for i in 0..N {
            let term = factor * other.value[i];
            self.value[i] -= term;
            self.terms[i] = self.terms[i].max(term.abs());
        }
    }

    fn is_zero(&self, variances: &SVector<T, N>, errors: T) -> bool {
        (0..N).all(|i| variances[i].is_zero() || self.value[i].abs() <= errors * self.terms[i])
    }

    fn variance_of_terms(&self, variances: &SVector<T, N>) -> T {
        (0..N).fold(T::zero(), |sum, i| sum + self.terms[i] * self.terms[i] * variances[i])
    }
}

impl<T: Scalar, const N: usize, const K: usize> Combination<T, N, K> {
    /// Returns source `i` of the state itself.
    pub(super) fn source(i: usize) -> Self {
        let value = SVector::from_fn(|j, _| if i == j { T::one() } else { T::zero() });
        Self { state: Part::new(value), noise: Part::new(SVector::zeros()) }
    }

    /// Returns row `i` of `[A L | B]` for a slope A, the factor L of the state's covariance and the factor B of the
    /// noise.
    pub(super) fn of<const R: usize>(
        slope: &SMatrix<T, R, N>,
        lower: &SMatrix<T, N, N>,
        noise: &SMatrix<T, R, K>,
        i: usize,
    ) -> Self {
        let (mut state, mut terms) = (SVector::zeros(), SVector::zeros());
        for j in 0..N {
            for k in 0..N {
                let term = slope[(i, k)] * lower[(k, j)];
                state[j] += term;
                terms[j] += term.abs();
            }
        }
        Self { state: Part { value: state, terms }, noise: Part::new(SVector::from_fn(|j, _| noise[(i, j)])) }
    }

    pub(super) fn covariance(&self, other: &Self, sources: Sources<T, N, K>) -> T {
        self.state.covariance(&other.state, sources.state) + self.noise.covariance(&other.noise, sources.noise)
    }

    fn subtract(&mut self, factor: T, other: &Self) {
        self.state.subtract(factor, &other.state);
        self.noise.subtract(factor, &other.noise);
    }

    fn digits(&self, variance: T, sources: Sources<T, N, K>) -> Digits {
        let epsilon = T::default_epsilon();
        let errors = T::of(ZERO_ERRORS * (N + K) as f64) * epsilon;
        let terms = self.state.variance_of_terms(sources.state) + self.noise.variance_of_terms(sources.noise);
        let few = T::of(FEW_ERRORS) * epsilon;
        if self.state.is_zero(sources.state, errors) && self.noise.is_zero(sources.noise, errors) {
            Digits::None
        } else if variance <= few * few * terms {
            Digits::Few
        } else {
            Digits::Kept
        }
    }
}

/// Orthogonalises each row against those before it. Returns their covariance L D Lᵀ, and the digits left of each.
///
/// A row that is not `wanted` is left out, with a pivot of zero, as if it did not exist.
pub(super) fn orthogonalise<T: Scalar, const R: usize, const N: usize, const K: usize>(
    rows: &mut [Combination<T, N, K>; R],
    sources: Sources<T, N, K>,
    wanted: [bool; R],
) -> (Factor<T, R>, [Digits; R]) {
    let mut factor = Factor::zero();
    let mut digits = [Digits::None; R];
    for j in (0..R).filter(|j| wanted[*j]) {
        let pivot_row = rows[j];
        let pivot = pivot_row.covariance(&pivot_row, sources);
        digits[j] = pivot_row.digits(pivot, sources);
        if digits[j] == Digits::None {
            continue;
        }
        factor.variances[j] = pivot;
        for i in (j + 1..R).filter(|i| wanted[*i]) {
            factor.columns[(i, j)] = rows[i].covariance(&pivot_row, sources) / pivot;
            rows[i].subtract(factor.columns[(i, j)], &pivot_row);
        }
    }
    (factor, digits)
}

/// Returns `A V Aᵀ + B W Bᵀ`, for sources of variances V and W, as L D Lᵀ.
pub(super) fn sum<T: Scalar, const R: usize, const K: usize>(
    first: &Factor<T, R>,
    more: &SMatrix<T, R, K>,
    variances: &SVector<T, K>,
) -> Factor<T, R> {
    let own = SMatrix::identity();
    let mut rows: [Combination<T, R, K>; R] = core::array::from_fn(|i| Combination::of(&own, &first.columns, more, i));
    orthogonalise(&mut rows, Sources { state: &first.variances, noise: variances }, [true; R]).0
}

/// Orthogonalises rows against `given` orthogonal rows. Returns the coefficients of the regression on these; a row with
/// zero pivot has no effect.
pub(super) fn regress<T: Scalar, const R: usize, const G: usize, const N: usize, const K: usize>(
    rows: &mut [Combination<T, N, K>; R],
    given: &[Combination<T, N, K>; G],
    pivots: &SVector<T, G>,
    sources: Sources<T, N, K>,
) -> SMatrix<T, R, G> {
    let mut coefficients = SMatrix::zeros();
    for j in 0..G {
        if pivots[j] > T::zero() {
            for i in 0..R {
                coefficients[(i, j)] = rows[i].covariance(&given[j], sources) / pivots[j];
                rows[i].subtract(coefficients[(i, j)], &given[j]);
            }
        }
    }
    coefficients
}
