use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{Scalar, Symmetric};

use crate::Belief;

/// What is known of a state of which some directions are unknown altogether.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseBelief<T, const N: usize, const L: usize> {
    /// Mean, and the covariance P* of what is known. In unknown directions the mean is where the model is linearised.
    pub finite: Belief<T, N, L>,
    /// The first `unknown` columns span the unknown directions. The others were unknown once; they are carried along
    /// because the rows of all columns together say how large a number must be to be more than rounding.
    directions: SMatrix<T, N, N>,
    unknown: usize,
}

/// Below this many roundings of what a number was computed from, it is zero. Every step adds a few roundings, which
/// grow with the square root of the number of steps: enough for thousands of steps without a reading.
const ROUNDINGS: f64 = 100.0;

/// The share of its terms below which a sum of `N` of them counts as zero.
pub(crate) fn negligible<T: Scalar, const N: usize>() -> T {
    T::default_epsilon() * T::of(ROUNDINGS * N as f64)
}

impl<T: Scalar, const N: usize, const L: usize> DiffuseBelief<T, N, L> {
    /// `P∞ = diag(scale²)` beside what is known: a scale of zero is an ordinary component, any other an unknown one.
    ///
    /// Scales are in the units of the state. They move the log-likelihood by a constant and nothing else; one is usual.
    /// The covariance of unknown components is usually zero.
    #[must_use]
    pub fn new(finite: Belief<T, N, L>, scale: &[T; N]) -> Self {
        let mut out = Self::from(finite);
        for (i, scale) in scale.iter().enumerate().filter(|(_, scale)| !scale.is_zero()) {
            out.directions[(i, out.unknown)] = *scale;
            out.unknown += 1;
        }
        out
    }

    /// How many directions are unknown, the rank of P∞.
    #[must_use]
    pub const fn unknown(&self) -> usize {
        self.unknown
    }

    /// P∞.
    #[must_use]
    pub fn diffuse_covariance(&self) -> Symmetric<T, N, L> {
        let mut out = Symmetric::zeros();
        for column in self.directions.column_iter().take(self.unknown) {
            out.add_outer(&column.into_owned(), T::one());
        }
        out
    }

    /// The ordinary belief, once nothing is unknown.
    #[must_use]
    pub fn settled(&self) -> Option<Belief<T, N, L>> {
        (self.unknown == 0).then_some(self.finite)
    }

    /// `F∞ = H P∞ Hᵀ` and the gain `P∞ Hᵀ / F∞` of a reading with gradient H, and the reading's direction struck off;
    /// `None` where the reading sees no unknown direction: F∞ is zero relative to the size of its terms.
    #[allow(non_snake_case, reason = "H, K are the letters of every textbook; NOTATION.md has the table")]
    pub(crate) fn fix_direction(&mut self, H: &SVector<T, N>) -> Option<(T, SVector<T, N>)> {
        let A = &self.directions;
        let mut seen = SVector::<T, N>::zeros();
        let mut size = T::zero();
        for i in 0..N {
            size += H[i].abs() * A.row(i).norm();
        }
        for j in 0..self.unknown {
            seen[j] = A.column(j).dot(H);
        }
        let length = seen.norm();
        if !(length > size * negligible::<T, N>()) {
            return None;
        }
        let diffuse_variance = length * length;
        let K = A * seen / diffuse_variance;
        // The reflection that turns `seen` into its last component.
        let last = self.unknown - 1;
        let mut mirror = seen;
        mirror[last] += if seen[last] < T::zero() { -length } else { length };
        let projected = A * mirror * (T::of(2.0) / mirror.norm_squared());
        self.directions -= projected * mirror.transpose();
        self.unknown = last;
        self.forget_rounding();
        Some((diffuse_variance, K))
    }

    /// Strikes off all directions if nothing but rounding is left of them, as where the dynamics forget a component.
    fn forget_rounding(&mut self) {
        let rounding = negligible::<T, N>();
        let gone = self.directions.row_iter().all(|row| {
            let left = row.iter().take(self.unknown).fold(T::zero(), |sum, x| sum + *x * *x);
            left.sqrt() <= row.norm() * rounding
        });
        if gone {
            self.unknown = 0;
        }
    }

    /// The belief after a linear step: what is known of it, and where F leads the unknown directions.
    pub(crate) fn led(&self, finite: Belief<T, N, L>, jacobian: &SMatrix<T, N, N>) -> Self {
        let mut out = Self { finite, directions: jacobian * self.directions, unknown: self.unknown };
        out.forget_rounding();
        out
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.finite.is_finite() && self.directions.iter().all(|x| x.is_finite())
    }
}

/// Nothing is unknown.
impl<T: Scalar, const N: usize, const L: usize> From<Belief<T, N, L>> for DiffuseBelief<T, N, L> {
    fn from(finite: Belief<T, N, L>) -> Self {
        Self { finite, directions: SMatrix::zeros(), unknown: 0 }
    }
}
